use crate::component::prelude::*;
use crate::part::{InputId, Regulator, SecondOrder};
use physics::constants::P_0;
use std::f64::consts::PI;

/// Parameters of every regulator.
const OF_A_REGULATOR: &[Row] = table! {
    set_pressure: "Pa abs", physics::above(0.0), "Set pressure p_set";
    conductance: "m3/(s Pa)", physics::above(0.0), "Sonic conductance C of the open seat, for air";
    critical_pressure_ratio: "1", physics::between(0.0, 1.0), default 0.3, assumed "usual for a seat of this kind",
        "Critical pressure ratio b of both paths";
    full_opening_drop: "Pa", physics::above(0.0), default 6e4, assumed "usual for a small regulator",
        "Drop dp_full below p_set at which the seat is fully open, a difference";
    time_constant: "s", physics::above(0.0), default 0.03, assumed "usual for a small regulator",
        "Time constant tau of the seat";
    relief_conductance: "m3/(s Pa)", physics::above(0.0), default 1e-9, assumed "usual for a small regulator", only "relieving = yes",
        "Sonic conductance of the open relief, for air";
    relief_offset: "Pa", physics::at_least(0.0), default 2e4, assumed "usual for a small regulator", only "relieving = yes",
        "Rise dp_on above p_set at which relief begins, a difference";
    relief_rise: "Pa", physics::above(0.0), default 2e4, assumed "usual for a small regulator", only "relieving = yes",
        "Further rise dp_relief at which the relief is fully open, a difference";
    SUBSONIC_INDEX;
    LINEAR_ABOVE;
};

/// Table of every regulator.
const KIND: Kind = Kind {
    sources: &["iso6358-2013"],
    ports: &[gas("1"), Port { holds: Holds::Set, ..gas("2") }, exhaust("3")],
    parameters: OF_A_REGULATOR,
    choices: &[Choice {
        name: "relieving",
        options: &["yes", "no"],
        meaning: "Whether the regulator vents excess pressure at its outlet",
    }],
    outputs: &[
        ("mass_flow_kg_s", "kg/s", "mass flow from port 1 to port 2"),
        ("relief_flow_kg_s", "kg/s", "mass flow from port 2 to port 3"),
    ],
    ..Kind::PLAIN
};

/// Adds the seat and the relief. The set pressure may be a signal. Returns the input of the set pressure if it is a
/// number.
fn regulate<P: Lane>(
    own: &Instance<P>,
    at: &Terminals,
    build: &mut Build<P>,
    set: impl FnOnce(&mut Build<P>) -> Option<usize>,
) -> Option<InputId> {
    let [one, two, out] = [at.gas(0)?, at.gas(1)?, at.gas(2)?];
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
        set: set(build),
        paths: [build.circuit.between(one, two), build.circuit.between(two, out)],
    };
    // Gas leaves the protected volume through the relief. The relief therefore does not affect the design of end stops.
    let conductance = part.seat.conductance;
    let part = build.flow_part(part, &[conductance]);
    build.columns(own, 0, [0, 1].map(|path| Quantity::along(Path::along(part, path))));
    Some(part.input(0))
}

/// A pressure regulator.
pub struct PressureRegulator;

impl Component for PressureRegulator {
    const KIND: Kind = Kind {
        key: "regulator",
        title: "Pressure regulator",
        text: "A seat from port 1 to port 2 that opens by the share y of its conductance, tau y' = clip((p_set - p2)/dp_full) - y, \
               and, if relieving, a path from port 2 to port 3 that opens by clip((p2 - p_set - dp_on)/dp_relief).",
        inputs: &[("set_pressure_pa", "Pa", "set pressure, absolute")],
        ..KIND
    };

    fn compose<P: Lane>(own: &Instance<P>, at: &Terminals, build: &mut Build<P>) {
        if let Some(input) = regulate(own, at, build, |_| None) {
            build.input(own, 0, Acts::On(input));
        }
    }
}

/// A regulator whose set pressure follows a command.
pub struct ElectroPneumatic;

impl Component for ElectroPneumatic {
    const KIND: Kind = Kind {
        key: "regulator/electro-pneumatic",
        title: "Electro-pneumatic pressure regulator",
        text: "A regulator whose set pressure p_set follows the commanded one, p_c: \
               p_set'' + 2 zeta w p_set' + w^2 p_set = w^2 p_c with w = 2 pi f. Seat and relief are those of a regulator.",
        parameters: table! {
            ..OF_A_REGULATOR;
            natural_frequency: "Hz", physics::above(0.0), default 10.0, assumed "usual for a valve of this kind",
                "Natural frequency f of the set pressure";
            damping_ratio: "1", physics::above(0.0), default 1.0, assumed "no overshoot",
                "Damping ratio zeta of the set pressure";
        },
        inputs: &[("set_pressure_pa", "Pa", "commanded pressure, absolute")],
        ..KIND
    };

    fn compose<P: Lane>(own: &Instance<P>, at: &Terminals, build: &mut Build<P>) {
        let mut command = None;
        let follow = |build: &mut Build<P>| {
            let signal = build.circuit.signal();
            let angular_frequency = P::c(2.0 * PI) * own.number("natural_frequency");
            let part = SecondOrder {
                command: own.number("set_pressure"),
                angular_frequency,
                damping_ratio: own.number("damping_ratio"),
                rate_scale: P_0 * angular_frequency.get(0),
                signal,
            };
            command = Some(build.circuit.add(part).input(0));
            Some(signal)
        };
        let regulated = regulate(own, at, build, follow);
        if let (Some(_), Some(command)) = (regulated, command) {
            build.input(own, 0, Acts::On(command));
        }
    }
}
