use super::{
    Acts, Brings, Build, Choice, Component, Instance, Kind, LINEAR_ABOVE, Piston, Port, SUBSONIC_INDEX,
    Terminals, axis, chamber, exhaust, table,
};
use crate::assembly::Quantity;
use crate::assembly::end_stop::{Driven, ends};
use crate::assembly::leak::leak;
use crate::circuit::{AxisId, GasId, PistonSide};
use crate::part::ChamberLaw;
use crate::run::Error;
use math::{Lane, Real};
use std::f64::consts::PI;

/// Cylinders with two chambers. The port of a chamber has no volume of its own: the dead volume includes it.
const PORTS: &[Port] = &[chamber("a"), chamber("b"), axis("rod", true)];

/// What every cylinder has, and what a kind has beside that.
macro_rules! parameters {
    ($($more:tt)*) => {
        table! {
            bore: "m", physics::above(0.0), "Bore D";
            rod_diameter: "m", physics::at_least(0.0), default 0.0, "Diameter of the rod d";
            stroke: "m", physics::above(0.0), "Stroke";
            dead_volume_a: "m3", physics::above(0.0), "Volume of chamber a at x = 0, port and line included";
            dead_volume_b: "m3", physics::above(0.0), "Volume of chamber b at the end of the stroke, port and line included";
            moving_mass: "kg", physics::above(0.0), "Mass of piston, rod and carriage";
            incline: "rad", physics::any(), default 0.0, "Incline of the axis; positive: x points up";
            heat_transfer: "W/(m2 K)", physics::at_least(0.0), default 30.0, assumed "of air in a cylinder of this size",
                "Heat-transfer coefficient to the wall";
            wall_temperature: "K", physics::above(0.0), follows "the ambient temperature", "Temperature of the wall";
            leakage: "m3/(s Pa)", physics::at_least(0.0), default 0.0, "Sonic conductance of the leak past the piston";
            end_stop_stiffness: "N/m", physics::above(0.0), follows "the circuit, so that a sensible run never reaches a cover",
                "Stiffness of the end stops";
            end_stop_damping: "N s/m", physics::at_least(0.0), follows "the stiffness of the end stop",
                "Damping of the end stops";
            end_stop_damping_depth: "m", physics::above(0.0), follows "the dead volumes",
                "Depth from which the damper acts fully";
            $($more)*
        }
    };
}

const KIND: Kind = Kind {
    key: "",
    title: "",
    text: "Two chambers of gas, each with its balance of mass and energy, a piston with friction between them, and end \
           stops. x grows from chamber a's end to chamber b's.",
    sources: &["bejan2016"],
    ports: PORTS,
    parameters: parameters! {},
    choices: &[Choice {
        name: "chamber_law",
        options: &["energy-balance", "as-printed"],
        meaning: "Balance of the chambers; as-printed breaks it and is for reproducing the source paper only",
    }],
    friction: true,
    inputs: &[("load_force_n", "N", "external force in +x")],
    outputs: &[
        ("position_m", "m", "position"),
        ("velocity_m_s", "m/s", "velocity"),
        ("acceleration_m_s2", "m/s2", "acceleration"),
        ("friction_force_n", "N", "friction force, positive where it opposes v > 0"),
        ("end_stop_force_n", "N", "force of the end stops, positive where it pushes towards -x"),
        ("a.pressure_pa", "Pa", "absolute pressure in chamber a"),
        ("a.temperature_k", "K", "temperature in chamber a"),
        ("a.mass_flow_kg_s", "kg/s", "mass flow into chamber a"),
        ("b.pressure_pa", "Pa", "absolute pressure in chamber b"),
        ("b.temperature_k", "K", "temperature in chamber b"),
        ("b.mass_flow_kg_s", "kg/s", "mass flow into chamber b"),
    ],
    ..Kind::PLAIN
};

/// Area and walls of a chamber with a rod of diameter `rod` (0: none). Heat passes the barrel, both
/// end faces and the rod's surface; the dead volume has no surface of its own.
fn side<P: Real>(bore: P, rod: P) -> PistonSide<P> {
    let area = P::c(0.25 * PI) * (bore * bore - rod * rod);
    PistonSide { area, perimeter: P::c(PI) * (bore + rod), end_wall: P::c(2.0) * area }
}

fn chamber_law<P: Lane>(own: &Instance<P>) -> ChamberLaw {
    if own.choices[0] == 0 { ChamberLaw::EnergyBalance } else { ChamberLaw::AsPrinted }
}

/// What a chamber is, its dead volume having this key.
fn bring_chamber<P: Lane>(own: &Instance<P>, dead_volume: &str, ambient_temperature: P) -> Brings<P> {
    Brings::Volume {
        law: chamber_law(own),
        dead_volume: own.number(dead_volume),
        wall: P::zero(),
        heat_transfer: own.number("heat_transfer"),
        wall_temperature: own.given("wall_temperature").unwrap_or(ambient_temperature),
    }
}

fn bring_rod<P: Lane>(own: &Instance<P>) -> Brings<P> {
    Brings::Mass {
        mass: own.number("moving_mass"),
        incline: Some(own.number("incline")),
        force: P::zero(),
        friction: own.friction.clone(),
    }
}

fn check(own: &Instance<f64>, has_rod: bool) -> Result<(), Error> {
    let (bore, rod) = (own.number("bore"), own.number("rod_diameter"));
    let refuse = |message: String| Err(Error::Specification(message));
    if own.friction.is_none() {
        return refuse(format!("{}: a cylinder needs a friction table", own.name));
    }
    match (has_rod, rod) {
        (false, rod) if rod != 0.0 => {
            refuse(format!("{}.rod_diameter = {rod} m: a rodless cylinder has no rod", own.name))
        }
        (true, 0.0) => {
            refuse(format!("{}.rod_diameter is missing: this kind of cylinder has a rod", own.name))
        }
        (true, rod) if rod >= bore => {
            refuse(format!("{}.rod_diameter = {rod} m must be less than the bore, {bore} m", own.name))
        }
        _ => Ok(()),
    }
}

fn compose<P: Lane>(
    own: &Instance<P>,
    rods: [bool; 2],
    (a, b, axis): (GasId, GasId, AxisId),
    build: &mut Build<P>,
) {
    let (bore, stroke) = (own.number("bore"), own.number("stroke"));
    let mut sides =
        rods.map(|has_rod| side(bore, if has_rod { own.number("rod_diameter") } else { P::zero() }));
    if chamber_law(own) == ChamberLaw::AsPrinted {
        // pi (D x + 0.25 D^3) as printed, in metres: the second term is no area at all.
        for side in &mut sides {
            (side.perimeter, side.end_wall) = (P::c(PI) * bore, P::c(0.25 * PI) * (bore * bore * bore));
        }
    }
    build.circuit.face(a, axis, true, stroke, sides[0]);
    build.circuit.face(b, axis, false, stroke, sides[1]);
    let spring = build
        .springs
        .iter()
        .filter(|(of, ..)| *of == axis)
        .fold(P::zero(), |sum, (_, k, rest)| sum + *k * rest.abs().max((stroke - *rest).abs()));
    let (mass, force) = build.masses[axis.index()];
    let ends = ends(&Driven {
        sides: &sides,
        dead_volumes: ["dead_volume_a", "dead_volume_b"].map(|key| own.number(key)),
        mass,
        stroke,
        incline: own.number("incline"),
        supply_pressure: build.highest.unwrap_or(build.ambient[0]),
        hottest: build.hottest,
        forces: [force, spring],
        gas_constant: build.gas.gas_constant,
        conductance: build.widest(a).max(build.widest(b)),
        given: ["end_stop_stiffness", "end_stop_damping", "end_stop_damping_depth"].map(|key| own.given(key)),
    });
    build.circuit.end_stops(axis, ends.stop.clone(), stroke);
    if let Some(covers) = &ends.covers {
        build.circuit.covers(axis, covers.clone());
    }
    build.pistons.push(Piston { axis, name: own.name.clone(), ends, areas: sides.map(|side| side.area) });
    let leakage = own.number("leakage");
    if leakage.get(0) != 0.0 || own.is_free("leakage") {
        let law = leak(leakage, &build.gas, build.is_air);
        build.passage(law, a, b);
    }
    build.input(own, 0, Acts::Force(axis));
    let quantities = [
        Quantity::Position(axis),
        Quantity::Velocity(axis),
        Quantity::Acceleration(axis),
        Quantity::Friction(axis),
        Quantity::EndStop(axis),
        Quantity::Pressure(a),
        Quantity::Temperature(a),
        Quantity::MassFlow(a),
        Quantity::Pressure(b),
        Quantity::Temperature(b),
        Quantity::MassFlow(b),
    ];
    for (output, quantity) in quantities.into_iter().enumerate() {
        build.column(own, output, quantity);
    }
    let inner = own.friction.iter().flat_map(|contact| contact.states());
    for (i, state) in inner.enumerate() {
        build.columns.push((format!("{}.{}", own.name, state.name), Quantity::Inner(axis, i)));
    }
}

macro_rules! cylinder {
    ($(#[$attribute:meta])* $name:ident = $key:literal, $title:literal, rods $rods:expr) => {
        $(#[$attribute])*
        pub struct $name;

        impl Component for $name {
            const KIND: Kind = Kind { key: $key, title: $title, ..KIND };

            fn bring<P: Lane>(own: &Instance<P>, port: usize, ambient_temperature: P) -> Brings<P> {
                match port {
                    0 => bring_chamber(own, "dead_volume_a", ambient_temperature),
                    1 => bring_chamber(own, "dead_volume_b", ambient_temperature),
                    _ => bring_rod(own),
                }
            }

            fn check(own: &Instance<f64>) -> Result<(), Error> {
                check(own, $rods != [false; 2])
            }

            fn compose<P: Lane>(own: &Instance<P>, at: &Terminals, build: &mut Build<P>) {
                let (Some(a), Some(b), Some(axis)) = (at.gas(0), at.gas(1), at.axis(2)) else { return };
                compose(own, $rods, (a, b, axis), build);
            }
        }
    };
}

cylinder! {
    /// No rod on either side.
    Rodless = "cylinder/rodless", "Rodless cylinder", rods [false, false]
}
cylinder! {
    /// A rod on both sides.
    ThroughRod = "cylinder/through-rod", "Cylinder with a through rod", rods [true, true]
}
cylinder! {
    /// A rod on the side of chamber b.
    SingleRod = "cylinder/single-rod", "Cylinder with a rod on the side of chamber b", rods [false, true]
}

/// Pressure in chamber a pushes the rod out, a spring in chamber b pushes it back.
pub struct SingleActing;

impl Component for SingleActing {
    const KIND: Kind = Kind {
        key: "cylinder/single-acting",
        title: "Single-acting cylinder with a spring",
        text: "A cylinder with a rod on the side of chamber b that pressure in chamber a drives out, and a spring in \
               chamber b, F = F_0 + k x towards chamber a, drives back. Chamber b breathes through a hole in its cover.",
        sources: &["bejan2016", "iso6358-2013"],
        ports: &[chamber("a"), exhaust("exhaust"), axis("rod", true)],
        parameters: parameters! {
            spring_stiffness: "N/m", physics::above(0.0), "Stiffness k of the spring";
            spring_preload: "N", physics::at_least(0.0), "Force F_0 of the spring at x = 0";
            breather_conductance: "m3/(s Pa)", physics::above(0.0), "Sonic conductance C of the breather, for air";
            critical_pressure_ratio: "1", physics::between(0.0, 1.0), default 0.3, assumed "of a hole with a filter",
                "Critical pressure ratio b of the breather";
            SUBSONIC_INDEX;
            LINEAR_ABOVE;
        },
        ..KIND
    };

    fn bring<P: Lane>(own: &Instance<P>, port: usize, ambient_temperature: P) -> Brings<P> {
        match port {
            0 => bring_chamber(own, "dead_volume_a", ambient_temperature),
            1 => Brings::Nothing,
            _ => bring_rod(own),
        }
    }

    fn check(own: &Instance<f64>) -> Result<(), Error> {
        check(own, true)
    }

    fn compose<P: Lane>(own: &Instance<P>, at: &Terminals, build: &mut Build<P>) {
        let (Some(a), Some(around), Some(axis)) = (at.gas(0), at.gas(1), at.axis(2)) else { return };
        let brings = bring_chamber(own, "dead_volume_b", build.ambient[1]);
        let Some(b) = build.inner_volume(&format!("{}.b", own.name), brings) else { return };
        build.passage(own.path("breather_conductance", build), b, around);
        let stiffness = own.number("spring_stiffness");
        build.spring(axis, stiffness, -own.number("spring_preload") / stiffness);
        compose(own, [false, true], (a, b, axis), build);
    }
}
