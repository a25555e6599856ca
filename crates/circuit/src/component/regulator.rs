use super::{
    Acts, Build, Choice, Component, Holds, Instance, Kind, LINEAR_ABOVE, Port, SUBSONIC_INDEX, Stroke,
    Symbol, Terminals, exhaust, gas, table,
};
use crate::assembly::Quantity;
use crate::circuit::Path;
use crate::part::Regulator;
use math::Lane;

/// A pressure regulator.
pub struct PressureRegulator;

impl Component for PressureRegulator {
    const KIND: Kind = Kind {
        key: "regulator",
        title: "Pressure regulator",
        text: "A seat from port 1 to port 2 that opens by the share y of its conductance, tau y' = clip((p_set - p2)/dp_full) - y, \
               and, where it relieves, a path from port 2 to port 3 that opens by clip((p2 - p_set - dp_on)/dp_relief).",
        sources: &["iso6358-2013"],
        ports: &[gas("1"), Port { holds: Holds::Set, ..gas("2") }, exhaust("3")],
        parameters: table! {
            set_pressure: "Pa abs", physics::above(0.0), "Set pressure p_set";
            conductance: "m3/(s Pa)", physics::above(0.0), "Sonic conductance C of the open seat, for air";
            critical_pressure_ratio: "1", physics::between(0.0, 1.0), default 0.3, assumed "of a seat of this kind",
                "Critical pressure ratio b of both paths";
            full_opening_drop: "Pa", physics::above(0.0), default 6e4, assumed "of a small regulator",
                "Drop dp_full below p_set at which the seat is fully open, a difference";
            time_constant: "s", physics::above(0.0), default 0.03, assumed "of a small regulator",
                "Time constant tau of the seat";
            relief_conductance: "m3/(s Pa)", physics::above(0.0), default 1e-9, assumed "of a small regulator",
                "Sonic conductance of the open relief, for air";
            relief_offset: "Pa", physics::at_least(0.0), default 2e4, assumed "of a small regulator",
                "Rise dp_on above p_set from which on it relieves, a difference";
            relief_rise: "Pa", physics::above(0.0), default 2e4, assumed "of a small regulator",
                "Further rise dp_relief at which the relief is fully open, a difference";
            SUBSONIC_INDEX;
            LINEAR_ABOVE;
        },
        choices: &[Choice {
            name: "relieving",
            options: &["yes", "no"],
            meaning: "Whether it vents a pressure behind it that is too high",
        }],
        inputs: &[("set_pressure_pa", "Pa", "set pressure, absolute")],
        outputs: &[
            ("mass_flow_kg_s", "kg/s", "mass flow from port 1 to port 2"),
            ("relief_flow_kg_s", "kg/s", "mass flow from port 2 to port 3"),
        ],
        symbol: SYMBOL,
        ..Kind::PLAIN
    };

    fn compose<P: Lane>(own: &Instance<P>, at: &Terminals, build: &mut Build<P>) {
        let (Some(one), Some(two), Some(out)) = (at.gas(0), at.gas(1), at.gas(2)) else { return };
        let relieves = own.choices[0] == 0;
        let part = Regulator {
            set_pressure: own.number("set_pressure"),
            full_opening_drop: own.number("full_opening_drop"),
            time_constant: own.number("time_constant"),
            relief_offset: if relieves { own.number("relief_offset") } else { P::c(f64::INFINITY) },
            relief_rise: own.number("relief_rise"),
            seat: own.path("conductance", build),
            relief: own.path("relief_conductance", build),
            signal: build.circuit.signal(),
            paths: [build.circuit.between(one, two), build.circuit.between(two, out)],
        };
        // Through the relief gas leaves what it protects: no cylinder's end stops follow from it.
        let conductance = part.seat.conductance;
        let part = build.flow_part(part, &[conductance]);
        let (input, paths) = (part.input(0), [0, 1].map(|path| Path::along(part, path)));
        build.input(own, 0, Acts::On(input));
        for (output, path) in paths.into_iter().enumerate() {
            build.column(own, output, Quantity::Flow([Some(path), None]));
        }
    }
}

const SYMBOL: Symbol = Symbol {
    strokes: &[
        Stroke::Line(&[[-2.0, 1.0], [-2.0, 5.0], [2.0, 5.0], [2.0, 1.0], [-2.0, 1.0]]),
        Stroke::Line(&[[0.0, 0.0], [0.0, 6.0]]),
        Stroke::Head([[0.0, 5.0], [-0.35, 4.2], [0.35, 4.2]]),
        Stroke::Line(&[
            [-2.0, 3.0],
            [-2.15, 3.5],
            [-2.4, 2.5],
            [-2.65, 3.5],
            [-2.9, 2.5],
            [-3.15, 3.5],
            [-3.3, 3.0],
        ]),
        Stroke::Line(&[[-3.2, 1.9], [-2.3, 3.9]]),
        Stroke::Head([[-2.1, 4.3], [-2.6, 3.9], [-2.1, 3.7]]),
        Stroke::Dashed(&[[0.0, 5.5], [2.6, 5.5], [2.6, 4.0], [2.0, 4.0]]),
        Stroke::Line(&[[2.0, 2.0], [3.0, 2.0]]),
    ],
    when: &[],
    ports: &[[0.0, 0.0], [0.0, 6.0], [3.0, 2.0]],
};
