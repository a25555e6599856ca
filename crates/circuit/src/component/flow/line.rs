use crate::component::prelude::*;
use crate::part::{ChamberLaw, Column};
use physics::flow::{BORE_CONDUCTANCE, LINEAR_ABOVE, NOZZLE_RATIO};
use std::f64::consts::PI;

/// A tube with waves: cells of gas, and columns with inertia between them.
pub struct Line;

impl Component for Line {
    const KIND: Kind = Kind {
        key: "tube/distributed",
        title: "Tube with waves",
        text: "N lengths of gas with inertia and friction between N + 1 cells with a wall, Nu = 3.66 for laminar flow and Gnielinski's for turbulent flow, those at the ends half as long: \
               l/A m' = p1 - p2 - (f l/d + zeta) m |m|/(2 rho A^2), f Re = 64 for laminar and 0.3164 Re^0.75 for turbulent flow; no outflow of a cell \
               is supersonic. \
               N = ceil(12.8 f_max L/c) keeps the speed of sound to 1 % up to f_max. The bore at each end chokes the flow: \
               C = 0.2 dm3/(s bar) per mm2, b = 0.528.",
        sources: &["modelica-straight-pipe", "iso6358-2013", "gnielinski1976"],
        ports: &[Port { volume: 0.0, ..gas("1") }, Port { volume: 0.0, ..gas("2") }],
        parameters: table! {
            length: "m", physics::above(0.0), "Length L";
            diameter: "m", physics::above(0.0), "Inner diameter d";
            bandwidth: "Hz", physics::above(0.0), default 20.0, assumed "usual for a positioning drive",
                "Frequency f_max up to which the speed of sound is accurate to 1 %";
            cells: "1", physics::within(1.0, 150.0), follows "length and bandwidth", "Number N of lengths with inertia";
            friction_scale: "1", physics::at_least(0.0), default 1.0, "Factor on the friction of a smooth pipe";
            loss: "1", physics::at_least(0.0), default 0.0, "Coefficient zeta of local losses, bends included, over the whole tube";
            viscosity: "Pa s", physics::above(0.0), default 1.82e-5, assumed "usual for air at 20 degC", "Dynamic viscosity";
            ..TUBE_WALL;
        },
        open: true,
        discrete: &["cells", "bandwidth"],
        outputs: &[
            ("mass_flow_kg_s", "kg/s", "mass flow from port 1 into the tube"),
            ("outlet_flow_kg_s", "kg/s", "mass flow out of the tube at port 2"),
        ],
        ..Kind::PLAIN
    };

    fn check(own: &Instance<f64>) -> Result<(), Error> {
        match own.given("cells") {
            Some(cells) if cells.fract() != 0.0 => {
                refuse!("{}.cells = {cells} must be a whole number", own.name)
            }
            _ => Ok(()),
        }
    }

    fn compose<P: Lane>(own: &Instance<P>, at: &Terminals, build: &mut Build<P>) {
        let (Some(from), Some(to)) = (at.gas(0), at.gas(1)) else { return };
        let (whole, diameter) = (own.number("length"), own.number("diameter"));
        let area = P::c(0.25 * PI) * diameter * diameter;
        let sound = (build.gas.heat_capacity_ratio * build.gas.gas_constant * build.ambient[1]).sqrt();
        let n = own.given("cells").map_or_else(
            || (CELLS * own.number("bandwidth").get(0) * whole.get(0) / sound.get(0)).ceil().max(1.0),
            |cells| cells.get(0),
        );
        let length = whole / P::c(n);
        let heat = tube_heat(own);
        let wall_temperature = own.given("wall_temperature").unwrap_or(build.ambient[1]);
        let n = n as usize;
        let cells: Vec<_> = (0..=n)
            .map(|cell| {
                let own_length = if cell == 0 || cell == n { P::c(0.5) * length } else { length };
                let node = build.volume(Vessel {
                    law: ChamberLaw::EnergyBalance,
                    dead_volume: area * own_length,
                    wall: P::c(PI) * diameter * own_length,
                    heat,
                    wall_temperature,
                });
                build.gas_starts(node, format_args!("{}.cell_{cell}", own.name));
                node
            })
            .collect();
        for ends in cells.windows(2) {
            let viscosity = own.number("viscosity");
            let half = P::c(0.5) / area;
            let column = Column {
                inertance: length / area,
                reynolds: diameter / (area * viscosity),
                friction: own.number("friction_scale") * viscosity * length / (diameter * diameter) * half,
                loss: own.number("loss") / P::c(n as f64) * half / area,
                per_area: P::one() / area,
                scale: area.get(0) * SCALE,
                signal: build.circuit.signal(),
                path: build.circuit.between(ends[0], ends[1]),
            };
            build.flow_part(column, &[]);
        }
        let bore = P::c(BORE_CONDUCTANCE) * area;
        let mouth = build.usual_path([bore, P::c(NOZZLE_RATIO)], P::c(LINEAR_ABOVE));
        let edges = [build.passage(mouth.clone(), from, cells[0]), build.passage(mouth, cells[n], to)];
        build.columns(own, 0, edges.map(|edge| Quantity::along(Path::of(edge))));
    }
}

/// Number of lengths for which the speed of sound is right to 1 %, by frequency, length and speed of sound: (pi/6)^2/24
/// is 1 %.
const CELLS: f64 = 12.8;
/// Error scale of a mass flow for each cross-section, kg/(s m2): ambient air at the speed of sound.
const SCALE: f64 = 400.0;
