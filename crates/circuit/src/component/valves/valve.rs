use crate::component::prelude::*;
use crate::ground::GasId;
use crate::part::{Edge, Held, Spool, SpoolLeak, TableEdge};
use physics::curve::Curve;
use physics::flow::Iso6358;
use physics::{Bounds, Parameter};
use std::f64::consts::PI;

/// A 5/3 proportional valve.
pub struct Proportional53;

/// Motion of a spool, and shape of its edges.
const DYNAMICS: [Row; 8] = *table! {
    frequency: "Hz", physics::at_least(0.0), default 0.0,
        "Natural frequency of the spool; 0: it follows the command at once";
    damping_ratio: "1", physics::above(0.0), default 0.7, assumed "usual for a directly driven spool", only "frequency",
        "Damping ratio of the spool";
    stroke_time: "s", physics::above(0.0), follows "none: the speed of the spool is unbounded", only "frequency",
        "Time of the spool at its top speed from the centre to its end";
    delay: "s", physics::at_least(0.0), default 0.0, "Dead time from the command to the spool";
    hysteresis: "1", physics::within(0.0, 1.0), default 0.0, "Width of the play between command and spool";
    overlap: "1", Bounds { open: true, ..physics::between(-1.0, 1.0) }, default 0.0,
        "Position up to which an edge stays shut; negative: opening in the centre";
    leakage: "1", physics::within(0.0, 1.0), default 0.0, "Fraction of the conductance that leaks past each edge in the centre";
    leakage_width: "1", physics::above(0.0), default 0.05, assumed "usual for a sliding spool", only "leakage",
        "Position over which the leak falls to 1/e";
};

const DYNAMIC: [&str; 5] = ["frequency", "delay", "hysteresis", "overlap", "leakage"];

/// Returns whether the valve is more than edges that open with the command.
fn is_dynamic<P: Lane>(own: &Instance<P>) -> bool {
    DYNAMIC.iter().any(|key| own.number(key).get(0) != 0.0 || own.is_free(key))
}

/// Adds the spool of a valve, and returns the index of its position among the signals.
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
    build.columns(own, 0, [Quantity::Input(timing.commanded()), Quantity::Signal(signal)]);
    build.input(own, 0, Acts::Timed(timing, physics::within(-1.0, 1.0)));
    signal
}

/// Adds leakage past the edges of a spool, if any, and returns its index among the signals.
fn leak<P: Lane>(own: &Instance<P>, position: usize, build: &mut Build<P>) -> Option<usize> {
    let leaks = own.number("leakage").get(0) != 0.0 || own.is_free("leakage");
    leaks.then(|| {
        let signal = build.circuit.signal();
        let [leak, width] = ["leakage", "leakage_width"].map(|key| own.number(key));
        build.circuit.add(SpoolLeak { leak, width, position, signal });
        signal
    })
}

/// Adds an edge that opens as the spool moves in a direction.
fn edge<P: Lane>(
    own: &Instance<P>,
    (law, (signal, leak), direction): (&Iso6358<P>, (usize, Option<usize>), f64),
    (from, to): (GasId, GasId),
    build: &mut Build<P>,
) -> Path {
    let overlap = own.number("overlap");
    let whole = P::one() - overlap;
    let (offset, slope, path) = (-overlap / whole, P::c(direction) / whole, build.circuit.between(from, to));
    build.path_part(Edge { offset, slope, law: law.clone(), signal, leak, path }, law.conductance)
}

/// Conductance of an edge at an opening. Zero if a point omits it.
const fn flow(key: &'static str, meaning: &'static str) -> Parameter {
    Parameter { key, unit: "m3/(s Pa)", bounds: physics::at_least(0.0), default: Some(0.0), meaning }
}

/// Critical pressure ratio at this opening.
const fn ratio(key: &'static str, meaning: &'static str) -> Parameter {
    let bounds = Bounds { open_above: true, ..physics::within(0.0, 1.0) };
    Parameter { key, unit: "1", bounds, default: Some(0.0), meaning }
}

const OPENING: Parameter = Parameter {
    key: "opening",
    unit: "1",
    bounds: physics::within(-1.0, 1.0),
    default: None,
    meaning: "Position of the spool",
};

const FLOW_TABLE: &str = "flow_table";

const fn flow_table(columns: &'static [Parameter]) -> Option<Points> {
    Some(Points { key: FLOW_TABLE, columns, optional: true, most: 50 })
}

/// Returns an edge by its columns of the flow table, or `None` if it never opens.
fn table_edge<P: Lane>(
    own: &Instance<P>,
    (column, usual_ratio): (usize, P),
    signal: usize,
    (from, to): (GasId, GasId),
    build: &mut Build<P>,
) -> Option<Path> {
    let points = own.points();
    let largest = points.iter().fold(P::zero(), |most, point| most.max(point[column]));
    if largest.get(0) == 0.0 {
        return None;
    }
    let curve = |value: &dyn Fn(&[P]) -> P| {
        let points: Vec<_> = points.iter().map(|point| [point[0], value(point)]).collect();
        if own.chosen("flow_shape") == Some("smooth") {
            Curve::smooth(&points)
        } else {
            Curve::straight(&points)
        }
    };
    let ratio = |point: &[P]| {
        let ratio = point[column + 1];
        if ratio.get(0) == 0.0 { usual_ratio } else { ratio }
    };
    let part = TableEdge {
        law: own.path_of(largest, build),
        share: curve(&|point| point[column] / largest),
        ratio: curve(&ratio),
        signal,
        path: build.circuit.between(from, to),
    };
    Some(build.path_part(part, largest))
}

/// Checks a flow table for keys that it replaces and keys that it needs.
fn check_table(own: &Instance<f64>) -> Result<(), Error> {
    let (points, name) = (own.points(), &own.name);
    if points.is_empty() {
        return Ok(());
    }
    let sized = ["conductance", "exhaust_conductance"]
        .into_iter()
        .filter(|key| own.table.parameters.iter().any(|row| row.key == *key));
    let shaped = ["overlap", "leakage"].into_iter().filter(|key| own.number(key) != 0.0);
    if let Some(key) = sized.filter(|key| own.given(key).is_some()).chain(shaped).next() {
        return refuse!("{name}.{key} and {name}.{FLOW_TABLE} both set this value: keep one of them");
    }
    if points.iter().all(|point| point[1..].iter().step_by(2).all(|size| *size == 0.0)) {
        return refuse!("{name}.{FLOW_TABLE} opens no edge: give a conductance at an opening");
    }
    Ok(())
}

/// Table of every proportional valve.
const KIND: Kind = Kind {
    sources: &["iso6358-2013", "fritsch1984"],
    choices: &[Choice {
        name: "flow_shape",
        options: &["smooth", "straight"],
        meaning: "A smooth curve without overshoot through the points of the flow table, or straight lines between them",
    }],
    discrete: &["hysteresis", "delay"],
    inputs: &[("command", "1", "valve command")],
    ..Kind::PLAIN
};

impl Component for Proportional53 {
    const KIND: Kind = Kind {
        key: "valve/proportional-5/3",
        title: "5/3 proportional valve, closed centre",
        text: "Four edges that the spool opens by the share |x| of their conductance: x > 0 opens 1 to 4 and 2 to 3, x < 0 \
               opens 1 to 2 and 4 to 5. Or a flow table gives the conductance of each edge over the opening. The spool follows \
               the command at once, or as a system of second order with bounded speed behind a dead time and a play.",
        points: flow_table(&[
            OPENING,
            flow("supply_4", "Conductance from port 1 to port 4"),
            ratio("supply_4_critical_pressure_ratio", "Its critical pressure ratio; 0: that of the valve"),
            flow("exhaust_4", "Conductance from port 4 to port 5"),
            ratio("exhaust_4_critical_pressure_ratio", "Its critical pressure ratio; 0: that of the valve"),
            flow("supply_2", "Conductance from port 1 to port 2"),
            ratio("supply_2_critical_pressure_ratio", "Its critical pressure ratio; 0: that of the valve"),
            flow("exhaust_2", "Conductance from port 2 to port 3"),
            ratio("exhaust_2_critical_pressure_ratio", "Its critical pressure ratio; 0: that of the valve"),
        ]),
        ports: &[gas("1"), gas("4"), gas("2"), exhaust("5"), exhaust("3")],
        parameters: table! {
            conductance: "m3/(s Pa)", physics::above(0.0), unless "flow_table",
                "Sonic conductance C of each edge at full opening, for air";
            critical_pressure_ratio: "1", physics::between(0.0, 1.0), "Critical pressure ratio b";
            SUBSONIC_INDEX;
            LINEAR_ABOVE;
            ..DYNAMICS;
        },
        outputs: &[
            ("command", "1", "valve command"),
            ("position", "1", "position of the spool"),
            ("mass_flow_4_kg_s", "kg/s", "mass flow out of port 4"),
            ("mass_flow_2_kg_s", "kg/s", "mass flow out of port 2"),
        ],
        ..KIND
    };

    fn check(own: &Instance<f64>) -> Result<(), Error> {
        check_table(own)
    }

    fn compose<P: Lane>(own: &Instance<P>, at: &Terminals, build: &mut Build<P>) {
        let each = [0, 1, 2, 3, 4].map(|port| at.gas(port));
        let [Some(supply), Some(a), Some(b), Some(out_a), Some(out_b)] = each else { return };
        let ends = [(supply, a), (a, out_a), (supply, b), (b, out_b)];
        let paths = if !own.points().is_empty() {
            let (signal, ratio) = (spool(own, build), own.number("critical_pressure_ratio"));
            [0, 1, 2, 3].map(|i| table_edge(own, (1 + 2 * i, ratio), signal, ends[i], build))
        } else if is_dynamic(own) {
            let law = own.path("conductance", build);
            let position = spool(own, build);
            let signals = (position, leak(own, position, build));
            let directions = [1.0, -1.0, -1.0, 1.0];
            [0, 1, 2, 3].map(|i| Some(edge(own, (&law, signals, directions[i]), ends[i], build)))
        } else {
            let law = own.path("conductance", build);
            let edges = ends.map(|(from, to)| build.edge(law.clone(), from, to));
            build.input(own, 0, Acts::Command(edges));
            build.columns(own, 0, [Quantity::Command(edges); 2]);
            edges.map(|edge| Some(Path::of(edge)))
        };
        let [to_a, from_a, to_b, from_b] = paths;
        build.column(own, 2, Quantity::Flow([to_a, from_a.map(Path::backward)]));
        build.column(own, 3, Quantity::Flow([to_b, from_b.map(Path::backward)]));
    }
}

/// A 3/2 proportional valve.
pub struct Proportional32;

impl Component for Proportional32 {
    const KIND: Kind = Kind {
        key: "valve/proportional-3/2",
        title: "3/2 proportional valve, closed centre",
        text: "Two edges that the spool opens by the share |x| of their conductance: x > 0 opens 1 to 2, x < 0 opens 2 to 3. \
               Or a flow table gives the conductance of both over the opening. The spool follows the command at once, or as a \
               system of second order with bounded speed behind a dead time and a play.",
        points: flow_table(&[
            OPENING,
            flow("supply", "Conductance from port 1 to port 2"),
            ratio("supply_critical_pressure_ratio", "Its critical pressure ratio; 0: that of the valve"),
            flow("exhaust", "Conductance from port 2 to port 3"),
            ratio("exhaust_critical_pressure_ratio", "Its critical pressure ratio; 0: that of the valve"),
        ]),
        ports: &[gas("1"), gas("2"), exhaust("3")],
        parameters: table! {
            conductance: "m3/(s Pa)", physics::above(0.0), unless "flow_table",
                "Sonic conductance C from port 1 to port 2 at full opening, for air";
            critical_pressure_ratio: "1", physics::between(0.0, 1.0), default 0.3, assumed "usual for a spool valve",
                "Critical pressure ratio b from port 1 to port 2";
            exhaust_conductance: "m3/(s Pa)", physics::above(0.0), follows "the conductance from port 1 to port 2",
                "Sonic conductance C from port 2 to port 3 at full opening, for air";
            exhaust_critical_pressure_ratio: "1", physics::between(0.0, 1.0), follows "the ratio from port 1 to port 2",
                "Critical pressure ratio b from port 2 to port 3";
            SUBSONIC_INDEX;
            LINEAR_ABOVE;
            ..DYNAMICS;
        },
        outputs: &[
            ("command", "1", "valve command"),
            ("position", "1", "position of the spool"),
            ("mass_flow_2_kg_s", "kg/s", "mass flow out of port 2"),
        ],
        ..KIND
    };

    fn check(own: &Instance<f64>) -> Result<(), Error> {
        check_table(own)
    }

    fn compose<P: Lane>(own: &Instance<P>, at: &Terminals, build: &mut Build<P>) {
        let (Some(supply), Some(work), Some(out)) = (at.gas(0), at.gas(1), at.gas(2)) else { return };
        let signal = spool(own, build);
        let [to, from] = if own.points().is_empty() {
            let (law, vent) = (own.path("conductance", build), own.exhaust_path(build));
            let signals = (signal, leak(own, signal, build));
            let to = edge(own, (&law, signals, 1.0), (supply, work), build);
            [to, edge(own, (&vent, signals, -1.0), (work, out), build)].map(Some)
        } else {
            let usual = own.number("critical_pressure_ratio");
            let vent = own.given("exhaust_critical_pressure_ratio").unwrap_or(usual);
            let to = table_edge(own, (1, usual), signal, (supply, work), build);
            [to, table_edge(own, (3, vent), signal, (work, out), build)]
        };
        build.column(own, 2, Quantity::Flow([to, from.map(Path::backward)]));
    }
}
