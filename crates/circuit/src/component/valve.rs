use super::boxes::{
    ABOVE, ARROW, BELOW, CLOSED, ENDLESS, FEEDS, FIVE_THREE, FIVE_THREE_PORTS, SHUT, SHUT_ABOVE, SOLENOID,
    THREE_BOXES, VENTS,
};
use super::{
    Acts, Build, Component, Instance, Kind, LINEAR_ABOVE, Row, SUBSONIC_INDEX, Stroke, Symbol, Terminals,
    exhaust, gas, table,
};
use crate::assembly::{Quantity, Timing};
use crate::circuit::{GasId, Path};
use crate::part::{Edge, Held, Spool};
use math::Lane;
use physics::Bounds;
use physics::flow::Iso6358;
use std::f64::consts::PI;

/// A 5/3 proportional valve.
pub struct Proportional53;

/// How a spool moves and what its edges are like.
const DYNAMICS: [Row; 8] = *table! {
    frequency: "Hz", physics::at_least(0.0), default 0.0,
        "Natural frequency of the spool; 0: it follows the command at once";
    damping_ratio: "1", physics::above(0.0), default 0.7, assumed "of a directly driven spool", only "frequency",
        "Damping ratio of the spool";
    stroke_time: "s", physics::above(0.0), follows "nothing that is given: the speed of the spool has no bound", only "frequency",
        "Time in which the spool at its top speed goes from the centre to its end";
    delay: "s", physics::at_least(0.0), default 0.0, "Dead time from the command to the spool";
    hysteresis: "1", physics::within(0.0, 1.0), default 0.0, "Width of the play between command and spool";
    overlap: "1", Bounds { open: true, ..physics::between(-1.0, 1.0) }, default 0.0,
        "Position up to which an edge stays shut; negative: how far it is open in the centre";
    leakage: "1", physics::within(0.0, 1.0), default 0.0, "Share of the conductance that leaks past each edge in the centre";
    leakage_width: "1", physics::above(0.0), default 0.05, assumed "of a sliding spool", only "leakage",
        "Position over which the leak falls to 1/e";
};

const DYNAMIC: [&str; 5] = ["frequency", "delay", "hysteresis", "overlap", "leakage"];

/// Whether the valve is more than edges that open with the command.
fn is_dynamic<P: Lane>(own: &Instance<P>) -> bool {
    DYNAMIC.iter().any(|key| own.number(key).get(0) != 0.0 || own.is_free(key))
}

/// The spool of a valve: its position among the signals.
fn spool<P: Lane>(own: &Instance<P>, build: &mut Build<P>) -> usize {
    let signal = build.circuit.signal();
    let (acts, remembered, commanded) = (P::zero(), P::zero(), P::zero());
    let part = if own.number("frequency").get(0) == 0.0 {
        build.circuit.add(Held { acts, remembered, commanded, signal })
    } else {
        let angular_frequency = P::c(2.0 * PI) * own.number("frequency");
        let (damping_ratio, top_speed) = (
            own.number("damping_ratio"),
            own.given("stroke_time").map_or(P::c(f64::INFINITY), |time| P::one() / time),
        );
        build.circuit.add(Spool {
            acts,
            remembered,
            commanded,
            angular_frequency,
            damping_ratio,
            top_speed,
            signal,
        })
    };
    let [play, delay] = ["hysteresis", "delay"].map(|key| own.number(key).get(0));
    let timing = Timing::Follow { part, play: 0.5 * play, delay };
    build.column(own, 0, Quantity::Input(timing.commanded()));
    build.column(own, 1, Quantity::Signal(signal));
    build.input(own, 0, Acts::Timed(timing, physics::within(-1.0, 1.0)));
    signal
}

/// An edge that opens as the spool moves in a direction.
fn edge<P: Lane>(
    own: &Instance<P>,
    (law, signal, direction): (&Iso6358<P>, usize, f64),
    (from, to): (GasId, GasId),
    build: &mut Build<P>,
) -> Path {
    let overlap = own.number("overlap");
    let whole = P::one() - overlap;
    build.signal_edge(Edge {
        offset: -overlap / whole,
        slope: P::c(direction) / whole,
        leak: own.number("leakage"),
        leak_width: own.number("leakage_width"),
        law: law.clone(),
        signal,
        path: build.circuit.between(from, to),
        leaks: own.number("leakage").get(0) != 0.0 || own.is_free("leakage"),
    })
}

const INPUTS: &[super::Variable] = &[("command", "1", "valve command")];

impl Component for Proportional53 {
    const KIND: Kind = Kind {
        key: "valve/proportional-5/3",
        title: "5/3 proportional valve, closed centre",
        text: "Four edges that the spool opens by the share |x| of their conductance: x > 0 opens 1 to 4 and 2 to 3, x < 0 \
               opens 1 to 2 and 4 to 5. The spool follows the command at once, or as a system of second order with bounded \
               speed behind a dead time and a play.",
        sources: &["iso6358-2013"],
        ports: &[gas("1"), gas("4"), gas("2"), exhaust("5"), exhaust("3")],
        parameters: table! {
            conductance: "m3/(s Pa)", physics::above(0.0), "Sonic conductance C of each edge at full opening, for air";
            critical_pressure_ratio: "1", physics::between(0.0, 1.0), "Critical pressure ratio b";
            SUBSONIC_INDEX;
            LINEAR_ABOVE;
            ..DYNAMICS;
        },
        discrete: &["hysteresis", "delay"],
        inputs: INPUTS,
        outputs: &[
            ("command", "1", "valve command"),
            ("position", "1", "position of the spool"),
            ("mass_flow_4_kg_s", "kg/s", "mass flow out of port 4"),
            ("mass_flow_2_kg_s", "kg/s", "mass flow out of port 2"),
        ],
        symbol: SYMBOL,
        ..Kind::PLAIN
    };

    fn compose<P: Lane>(own: &Instance<P>, at: &Terminals, build: &mut Build<P>) {
        let law = own.path("conductance", build);
        let each = [0, 1, 2, 3, 4].map(|port| at.gas(port));
        let [Some(supply), Some(a), Some(b), Some(out_a), Some(out_b)] = each else { return };
        let ends = [(supply, a), (a, out_a), (supply, b), (b, out_b)];
        let paths = if is_dynamic(own) {
            let signal = spool(own, build);
            let directions = [1.0, -1.0, -1.0, 1.0];
            [0, 1, 2, 3].map(|i| edge(own, (&law, signal, directions[i]), ends[i], build))
        } else {
            let edges = ends.map(|(from, to)| build.edge(law.clone(), from, to));
            build.input(own, 0, Acts::Command(edges));
            build.column(own, 0, Quantity::Command(edges));
            build.column(own, 1, Quantity::Command(edges));
            edges.map(Path::of)
        };
        let [to_a, from_a, to_b, from_b] = paths;
        build.column(own, 2, Quantity::Flow([Some(to_a), Some(from_a.backward())]));
        build.column(own, 3, Quantity::Flow([Some(to_b), Some(from_b.backward())]));
    }
}

/// A 3/2 proportional valve.
pub struct Proportional32;

impl Component for Proportional32 {
    const KIND: Kind = Kind {
        key: "valve/proportional-3/2",
        title: "3/2 proportional valve, closed centre",
        text: "Two edges that the spool opens by the share |x| of their conductance: x > 0 opens 1 to 2, x < 0 opens 2 to 3. \
               The spool follows the command at once, or as a system of second order with bounded speed behind a dead time \
               and a play.",
        sources: &["iso6358-2013"],
        ports: &[gas("1"), gas("2"), exhaust("3")],
        parameters: table! {
            conductance: "m3/(s Pa)", physics::above(0.0), "Sonic conductance C from port 1 to port 2 at full opening, for air";
            critical_pressure_ratio: "1", physics::between(0.0, 1.0), "Critical pressure ratio b from port 1 to port 2";
            exhaust_conductance: "m3/(s Pa)", physics::above(0.0), follows "the conductance from port 1 to port 2",
                "Sonic conductance C from port 2 to port 3 at full opening, for air";
            exhaust_critical_pressure_ratio: "1", physics::between(0.0, 1.0), follows "the ratio from port 1 to port 2",
                "Critical pressure ratio b from port 2 to port 3";
            SUBSONIC_INDEX;
            LINEAR_ABOVE;
            ..DYNAMICS;
        },
        discrete: &["hysteresis", "delay"],
        inputs: INPUTS,
        outputs: &[
            ("command", "1", "valve command"),
            ("position", "1", "position of the spool"),
            ("mass_flow_2_kg_s", "kg/s", "mass flow out of port 2"),
        ],
        symbol: THREE_TWO,
        ..Kind::PLAIN
    };

    fn compose<P: Lane>(own: &Instance<P>, at: &Terminals, build: &mut Build<P>) {
        let (Some(supply), Some(work), Some(out)) = (at.gas(0), at.gas(1), at.gas(2)) else { return };
        let (law, vent) = (own.path("conductance", build), own.exhaust_path(build));
        let signal = spool(own, build);
        let to = edge(own, (&law, signal, 1.0), (supply, work), build);
        let from = edge(own, (&vent, signal, -1.0), (work, out), build);
        build.column(own, 2, Quantity::Flow([Some(to), Some(from.backward())]));
    }
}

const SYMBOL: Symbol = Symbol {
    strokes: &[FIVE_THREE, ENDLESS, Stroke::at(CLOSED, 0.0), Stroke::at(ARROW, -8.0), Stroke::at(ARROW, 6.3)],
    when: &[],
    ports: FIVE_THREE_PORTS,
};

const THREE_TWO: Symbol = Symbol {
    strokes: &[
        THREE_BOXES,
        ENDLESS,
        Stroke::at(BELOW, -1.0),
        Stroke::at(SHUT, -1.0),
        Stroke::at(BELOW, 1.0),
        Stroke::at(SHUT, 1.0),
        Stroke::at(ABOVE, -1.0),
        Stroke::at(SHUT_ABOVE, -1.0),
        Stroke::at(FEEDS, -4.0),
        Stroke::at(VENTS, 4.0),
        Stroke::mirrored(SOLENOID, -6.0),
        Stroke::at(ARROW, -8.0),
        Stroke::at(SOLENOID, 6.0),
        Stroke::at(ARROW, 6.3),
    ],
    when: &[],
    ports: &[[-1.0, -1.0], [-1.0, 5.0], [1.0, -1.0]],
};
