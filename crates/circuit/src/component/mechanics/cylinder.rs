mod chamber;
mod cushion;

use crate::component::mechanics::end_stop::{EndStopDesign, ends};
use crate::component::prelude::*;
use crate::component::{count, join};
use crate::ground::{AxisId, GasId};
use crate::part::{ChamberLaw, EndStops, PistonSide};
use chamber::{chamber_law, dead_volume, vessel};
use cushion::{CUSHION_A, CUSHION_B, check_cushions, cushion, cushioned, room};
use physics::flow::{self, LEAK_RATIO};
use std::f64::consts::{FRAC_PI_2, PI};

/// Cylinders with two chambers. The port of a chamber has no separate volume, because the dead volume includes it.
const PORTS: &[Port] = &[chamber("a"), chamber("b"), axis("rod", true)];

/// Parameters of every cylinder.
const PARAMETERS: &[Row] = table! {
    bore: "m", physics::above(0.0), "Bore D";
    rod_diameter: "m", physics::at_least(0.0), default 0.0, "Diameter of the rod d";
    stroke: "m", physics::above(0.0), "Stroke";
    dead_volume_a: "m3", physics::above(0.0), "Volume of chamber a at x = 0, port and line included";
    dead_volume_b: "m3", physics::above(0.0), "Volume of chamber b at the end of the stroke, port and line included";
    moving_mass: "kg", physics::above(0.0), "Mass of piston, rod and carriage";
    incline: "rad", physics::within(-FRAC_PI_2, FRAC_PI_2), default 0.0, "Incline of the axis; positive: x points up";
    heat_transfer: "W/(m2 K)", physics::at_least(0.0), follows "the law of heat transfer in a vessel",
        "Heat-transfer coefficient to the wall, if it is constant; the dead volume then has no wall";
    HEAT_SCALE;
    port_diameter: "m", physics::above(0.0), follows "the tube at the port, or the conductance there", only "no heat_transfer",
        "Diameter of the ports, for the jet in the law of heat transfer";
    wall_temperature: "K", physics::above(0.0), follows "the ambient temperature",
        "Temperature of the wall; start temperature if the wall stores heat";
    ..WALL;
    leakage: "m3/(s Pa)", physics::at_least(0.0), default 0.0, "Sonic conductance of the leak past the piston";
    end_stop_stiffness: "N/m", physics::above(0.0), follows "from the circuit, so that a usual run never reaches a cover",
        "Stiffness of the end stops";
    end_stop_damping: "N s/m", physics::at_least(0.0), follows "the stiffness of the end stop",
        "Damping of the end stops";
    end_stop_damping_depth: "m", physics::above(0.0), follows "the dead volumes",
        "Depth from which the damper acts fully";
};

pub(in crate::component) const OUTPUTS: &[Variable] = &[
    ("position_m", "m", "position"),
    ("velocity_m_s", "m/s", "velocity"),
    ("acceleration_m_s2", "m/s2", "acceleration"),
    ("friction_force_n", "N", "friction force, positive if it opposes v > 0"),
    ("end_stop_force_n", "N", "force of the end stops, positive if it pushes towards -x"),
    ("a.pressure_pa", "Pa", "absolute pressure in chamber a"),
    ("a.temperature_k", "K", "temperature in chamber a"),
    ("a.mass_flow_kg_s", "kg/s", "mass flow into chamber a"),
    ("b.pressure_pa", "Pa", "absolute pressure in chamber b"),
    ("b.temperature_k", "K", "temperature in chamber b"),
    ("b.mass_flow_kg_s", "kg/s", "mass flow into chamber b"),
];

const KIND: Kind = Kind {
    key: "",
    title: "",
    text: "Two chambers of gas, each with its balance of mass and energy, a piston with friction between them, and end \
           stops. x grows from chamber a's end to chamber b's. Without a stated coefficient, the heat transfer follows from \
           conduction, natural convection, change of density and jets.",
    sources: &["bejan2016", "woodfield2007", "geankoplis1993"],
    ports: PORTS,
    parameters: table! {
        ..PARAMETERS;
        ..CUSHION_A;
        ..CUSHION_B;
    },
    choices: &[Choice {
        name: "chamber_law",
        options: &["energy-balance", "as-printed"],
        meaning: "Energy balance of the chambers; as-printed violates it and serves only to reproduce the source paper",
    }],
    friction: FrictionTable::Needed,
    inputs: &[("load_force_n", "N", "external force in +x")],
    outputs: OUTPUTS,
    ..Kind::PLAIN
};

/// Returns the volume at the port of a chamber: the chamber itself, or the volume behind its cushion.
fn bring_port<P: Lane>(own: &Instance<P>, end: &str, ambient_temperature: P) -> Brings<P> {
    let behind = |key: &str| own.number(&format!("cushion_{end}_{key}"));
    let size = if cushioned(own, end) {
        ["port_volume", "plunger_diameter"].map(behind)
    } else {
        [dead_volume(own, end), own.number("bore")]
    };
    Brings::Volume(vessel(own, size, ambient_temperature))
}

fn check(own: &Instance<f64>, has_rod: bool) -> Result<(), Error> {
    let (bore, rod) = (own.number("bore"), own.number("rod_diameter"));
    if chamber_law(own) == ChamberLaw::AsPrinted && own.given("wall_capacity").is_some() {
        return refuse!("{}: chamber law \"as-printed\" does not support a wall that stores heat", own.name);
    }
    if own.friction.is_none() {
        return refuse!("{}: a cylinder needs a friction table", own.name);
    }
    match (has_rod, rod) {
        (false, rod) if rod != 0.0 => {
            let rod = in_usual_unit(rod, "m");
            refuse!("{}.rod_diameter = {rod}: a rodless cylinder has no rod", own.name)
        }
        (true, 0.0) => {
            refuse!("{}.rod_diameter is missing: this kind of cylinder has a rod", own.name)
        }
        (true, rod) if rod >= bore => {
            let [rod, bore] = [rod, bore].map(|diameter| in_usual_unit(diameter, "m"));
            refuse!("{}.rod_diameter = {rod} must be less than the bore, {bore}", own.name)
        }
        _ => Ok(()),
    }
}

/// A chamber of a cylinder.
struct CylinderChamber {
    gas: GasId,
    /// Letter of the chamber, as in the key of its dead volume.
    name: &'static str,
    /// Whether it grows with x.
    grows: bool,
    has_rod: bool,
}

impl CylinderChamber {
    fn new(gas: GasId, name: &'static str, has_rod: bool) -> Self {
        CylinderChamber { gas, name, grows: name.starts_with('a'), has_rod }
    }
}

/// Returns the pressurised area in one direction, and the part of the volume that an end stop may use, m3.
fn one_side<P: Lane>(
    own: &Instance<P>,
    chambers: &[CylinderChamber],
    sides: &[PistonSide<P>],
    grows: bool,
) -> (PistonSide<P>, P) {
    let each = chambers.iter().zip(sides).filter(|(chamber, _)| chamber.grows == grows);
    let each = each.map(|(chamber, side)| (*side, room(own, chamber.name, side.area)));
    let both = each.reduce(|(sum, dead), (side, other)| {
        let area = sum.area + side.area;
        (PistonSide { area, ..sum }, (dead / sum.area).min(other / side.area) * area)
    });
    both.expect("a chamber on either side")
}

/// Adds faces, end stops, leaks and columns of a cylinder. Each pair of chambers has a piston in between. Gas leaves
/// each chamber through at most `widest` m3/(s Pa).
fn compose<P: Lane>(
    own: &Instance<P>,
    chambers: &[CylinderChamber],
    axis: AxisId,
    widest: P,
    build: &mut Build<P>,
) {
    let (bore, stroke, rod) = (own.number("bore"), own.number("stroke"), own.number("rod_diameter"));
    let mut sides: Vec<_> = chambers
        .iter()
        .map(|own| PistonSide::of_bore(bore, if own.has_rod { rod } else { P::zero() }))
        .collect();
    if chamber_law(own) == ChamberLaw::AsPrinted {
        // The source prints pi (D x + 0.25 D^3). The second term does not have the dimension of an area.
        for side in &mut sides {
            (side.perimeter, side.end_wall) = (P::c(PI) * bore, P::c(0.25 * PI) * (bore * bore * bore));
        }
    }
    for (chamber, side) in chambers.iter().zip(&sides) {
        build.circuit.face(chamber.gas, axis, chamber.grows, stroke, *side);
    }
    let both = [true, false].map(|grows| one_side(own, chambers, &sides, grows));
    let (sides, dead_volumes) = (both.map(|(side, _)| side), both.map(|(_, dead)| dead));
    let spring = build
        .springs
        .iter()
        .filter(|(of, ..)| *of == axis)
        .fold(P::zero(), |sum, (_, k, rest)| sum + *k * rest.abs().max((stroke - *rest).abs()));
    let (mass, force) = build.masses[axis.0];
    let ends = ends(&EndStopDesign {
        sides: &sides,
        dead_volumes,
        mass,
        stroke,
        incline: own.number("incline"),
        supply_pressure: build.highest.unwrap_or(build.ambient[0]),
        hottest: build.hottest,
        forces: [force, spring],
        gas_constant: build.gas.gas_constant,
        conductance: widest * P::c(0.5 * chambers.len() as f64),
        given: ["end_stop_stiffness", "end_stop_damping", "end_stop_damping_depth"].map(|key| own.given(key)),
    });
    let areas = sides.map(|side| side.area);
    let (law, covers, follows) = (ends.stop.clone(), ends.covers.clone(), ends.follows.clone().map(Box::new));
    build.circuit.add(EndStops { law, covers, stroke, axis: axis.0, follows });
    build.pistons.push(Piston { axis, name: own.name.clone(), stroke, ends, areas, dead_volumes });
    let leakage = own.number("leakage");
    if leakage.get(0) != 0.0 || own.is_free("leakage") {
        for pair in chambers.chunks(2) {
            let law = build.usual_path([leakage, P::c(LEAK_RATIO)], P::c(flow::LINEAR_ABOVE));
            build.passage(law, pair[0].gas, pair[1].gas);
        }
    }
    let gas: Vec<GasId> = chambers.iter().map(|chamber| chamber.gas).collect();
    if own.given("wall_capacity").is_some() {
        build.wall(own, &gas);
    }
    show(own, &gas, axis, build);
}

/// Adds the input and the columns of a cylinder with these chambers.
fn show<P: Lane>(own: &Instance<P>, chambers: &[GasId], axis: AxisId, build: &mut Build<P>) {
    build.input(own, 0, Acts::Force(axis));
    build.motion(own, axis);
    build.column(own, 4, Quantity::EndStop(axis));
    let gas = [Quantity::Pressure, Quantity::Temperature, Quantity::MassFlow];
    build.columns(own, 5, chambers.iter().flat_map(|chamber| gas.map(|quantity| quantity(*chamber))));
    build.inner_states(own, axis);
}

macro_rules! cylinder {
    ($(#[$attribute:meta])* $name:ident = $key:literal, $title:literal, rods $rods:expr) => {
        $(#[$attribute])*
        pub struct $name;

        impl Component for $name {
            const KIND: Kind = Kind { key: $key, title: $title, ..KIND };

            fn bring<P: Lane>(own: &Instance<P>, port: usize, ambient_temperature: P) -> Brings<P> {
                match port {
                    0 => bring_port(own, "a", ambient_temperature),
                    1 => bring_port(own, "b", ambient_temperature),
                    _ => own.guided_mass("moving_mass"),
                }
            }

            fn check(own: &Instance<f64>) -> Result<(), Error> {
                check(own, $rods != [false; 2])?;
                check_cushions(own)
            }

            fn compose<P: Lane>(own: &Instance<P>, at: &Terminals, build: &mut Build<P>) {
                let (Some(a), Some(b), Some(axis)) = (at.gas(0), at.gas(1), at.axis(2)) else { return };
                let widest = build.widest(a).max(build.widest(b));
                let [a, b] = [(a, "a"), (b, "b")].map(|(port, end)| cushion(own, end, (port, axis), build));
                let [rod_a, rod_b] = $rods;
                let chambers = [CylinderChamber::new(a, "a", rod_a), CylinderChamber::new(b, "b", rod_b)];
                compose(own, &chambers, axis, widest, build);
            }
        }
    };
}

cylinder! {
    /// A cylinder without a rod on either side.
    Rodless = "cylinder/rodless", "Rodless cylinder", rods [false, false]
}
cylinder! {
    /// A cylinder with a rod on both sides.
    ThroughRod = "cylinder/through-rod", "Cylinder with a through rod", rods [true, true]
}
cylinder! {
    /// A cylinder with a rod on the side of chamber b.
    SingleRod = "cylinder/single-rod", "Cylinder with a rod on the side of chamber b", rods [false, true]
}

/// Pressure in chamber a pushes the rod out, and a spring in chamber b pushes it back.
pub struct SingleActing;

impl Component for SingleActing {
    const KIND: Kind = Kind {
        key: "cylinder/single-acting",
        title: "Single-acting cylinder with a spring",
        text: "A cylinder with a rod on the side of chamber b that pressure in chamber a drives out, and a spring in \
               chamber b, F = F_0 + k x towards chamber a, drives back. Chamber b breathes through a hole in its cover.",
        sources: &["bejan2016", "iso6358-2013"],
        ports: &[chamber("a"), exhaust("exhaust"), axis("rod", true)],
        parameters: table! {
        ..PARAMETERS;
            spring_stiffness: "N/m", physics::above(0.0), "Stiffness k of the spring";
            spring_preload: "N", physics::at_least(0.0), "Force F_0 of the spring at x = 0";
            breather_conductance: "m3/(s Pa)", physics::above(0.0), "Sonic conductance C of the breather, for air";
            critical_pressure_ratio: "1", physics::between(0.0, 1.0), default 0.3, assumed "usual for a hole with a filter",
                "Critical pressure ratio b of the breather";
            SUBSONIC_INDEX;
            LINEAR_ABOVE;
        },
        ..KIND
    };

    fn bring<P: Lane>(own: &Instance<P>, port: usize, ambient_temperature: P) -> Brings<P> {
        match port {
            0 => bring_port(own, "a", ambient_temperature),
            1 => Brings::Nothing,
            _ => own.guided_mass("moving_mass"),
        }
    }

    fn check(own: &Instance<f64>) -> Result<(), Error> {
        check(own, true)
    }

    fn compose<P: Lane>(own: &Instance<P>, at: &Terminals, build: &mut Build<P>) {
        let (Some(a), Some(around), Some(axis)) = (at.gas(0), at.gas(1), at.axis(2)) else { return };
        let size = [dead_volume(own, "b"), own.number("bore")];
        let b = build.volume(vessel(own, size, build.ambient[1]));
        build.gas_starts(b, format_args!("{}.b", own.name));
        build.passage(own.path("breather_conductance", build), b, around);
        let stiffness = own.number("spring_stiffness");
        build.spring(axis, stiffness, -own.number("spring_preload") / stiffness);
        let widest = build.widest(a).max(build.widest(b));
        let chambers = [CylinderChamber::new(a, "a", false), CylinderChamber::new(b, "b", true)];
        compose(own, &chambers, axis, widest, build);
    }
}

const SECOND_PAIR: &[Variable] = &[
    ("a2.pressure_pa", "Pa", "absolute pressure in chamber a2"),
    ("a2.temperature_k", "K", "temperature in chamber a2"),
    ("a2.mass_flow_kg_s", "kg/s", "mass flow into chamber a2"),
    ("b2.pressure_pa", "Pa", "absolute pressure in chamber b2"),
    ("b2.temperature_k", "K", "temperature in chamber b2"),
    ("b2.mass_flow_kg_s", "kg/s", "mass flow into chamber b2"),
];

/// Two pistons on one rod.
pub struct Tandem;

impl Component for Tandem {
    const KIND: Kind = Kind {
        key: "cylinder/tandem",
        title: "Tandem cylinder",
        text: "Two pistons on one rod, in two barrels in a row with a wall between them. Chambers a and a2 drive the rod \
               out, b and b2 drive it in; the rod goes through all of them but a. Friction that follows pressure takes \
               those of a2 and b2.",
        sources: &["bejan2016"],
        ports: &[chamber("a"), chamber("b"), chamber("a2"), chamber("b2"), axis("rod", true)],
        parameters: table! {
            ..PARAMETERS;
            dead_volume_a2: "m3", physics::above(0.0), "Volume of chamber a2 at x = 0, port and line included";
            dead_volume_b2: "m3", physics::above(0.0), "Volume of chamber b2 at the end of the stroke, port and line included";
        },
        outputs: {
            const ALL: [Variable; count(&[OUTPUTS, SECOND_PAIR])] = join(&[OUTPUTS, SECOND_PAIR]);
            &ALL
        },
        ..KIND
    };

    fn bring<P: Lane>(own: &Instance<P>, port: usize, ambient_temperature: P) -> Brings<P> {
        match port {
            0..4 => {
                let key = ["dead_volume_a", "dead_volume_b", "dead_volume_a2", "dead_volume_b2"][port];
                Brings::Volume(vessel(own, [own.number(key), own.number("bore")], ambient_temperature))
            }
            _ => own.guided_mass("moving_mass"),
        }
    }

    fn check(own: &Instance<f64>) -> Result<(), Error> {
        check(own, true)
    }

    fn compose<P: Lane>(own: &Instance<P>, at: &Terminals, build: &mut Build<P>) {
        let (Some(a), Some(b), Some(a2), Some(b2), Some(axis)) =
            (at.gas(0), at.gas(1), at.gas(2), at.gas(3), at.axis(4))
        else {
            return;
        };
        let widest = [a, b, a2, b2].into_iter().fold(P::zero(), |most, gas| build.widest(gas).max(most));
        let chambers = [
            CylinderChamber::new(a, "a", false),
            CylinderChamber::new(b, "b", true),
            CylinderChamber::new(a2, "a2", true),
            CylinderChamber::new(b2, "b2", true),
        ];
        compose(own, &chambers, axis, widest, build);
    }
}
