use crate::component::prelude::*;
use crate::ground::GasId;
use crate::part::{Armature, Edge, Held};
use physics::flow::Iso6358;

/// Times of an armature.
const TIMES: [Row; 3] = *table! {
    time_on: "s", physics::above(0.0), "Time from the command on to the middle of the travel";
    time_off: "s", physics::above(0.0), "Time from the command off to the middle of the travel back";
    travel_share: "1", physics::between(0.0, 1.0), default 0.2, assumed "usual for a small solenoid valve",
        "Fraction of these times for the whole travel";
};

const PULSES: [Row; 1] = *table! {
    pwm_frequency: "Hz", physics::at_least(0.0), default 0.0,
        "Frequency of pulses with the command as width; 0: the command switches";
};

pub(in crate::component) const EXHAUST: [Row; 2] = *table! {
    exhaust_conductance: "m3/(s Pa)", physics::above(0.0), follows "the conductance of the supply's paths",
        "Sonic conductance C of the paths to the exhaust, for air";
    exhaust_critical_pressure_ratio: "1", physics::between(0.0, 1.0), follows "the ratio of the supply's paths",
        "Critical pressure ratio b of the paths to the exhaust";
};

const PWM_MODEL: Choice = Choice {
    name: "pwm_model",
    options: &["exact", "averaged"],
    meaning: "Simulate each pulse, or the mean opening; the mean suffices for design if the period is much shorter than the filling time of a chamber",
};

const NORMALLY: Choice =
    Choice { name: "normally", options: &["closed", "open"], meaning: "State without a command" };

/// Offset and slope of an edge's opening over the position. The edge is shut up to the middle of the travel, so that
/// two edges of a port
/// are never open together.
pub(in crate::component) const OPENS: [f64; 2] = [-1.0, 2.0];
pub(in crate::component) const SHUTS: [f64; 2] = [1.0, -2.0];
/// Offset and slope of a single edge. The edge is shut or open only within the rounding of a travel.
const ALONE: [f64; 2] = [-SLACK, 1.0 + 2.0 * SLACK];
const ALONE_SHUTS: [f64; 2] = [1.0 + SLACK, -1.0 - 2.0 * SLACK];
const SLACK: f64 = 1e-8;

/// Drive of an armature.
#[derive(Clone, Copy)]
pub(in crate::component) struct Drives {
    pub has_pulses: bool,
    /// Least command.
    pub least: f64,
    /// It starts at the position of its first command, otherwise at rest.
    pub stands: bool,
}

const PULSED: Drives = Drives { has_pulses: true, least: 0.0, stands: false };

/// Adds an armature with the times of its component, and returns the index of its position among the signals.
pub(in crate::component) fn armature<P: Lane>(
    own: &Instance<P>,
    drives: Drives,
    build: &mut Build<P>,
) -> usize {
    let Drives { has_pulses, least, stands } = drives;
    let signal = build.circuit.signal();
    let (acts, remembered, commanded) = (P::zero(), P::zero(), P::zero());
    let times = ["time_on", "time_off"].map(|key| own.number(key).get(0));
    let frequency = if has_pulses { own.number("pwm_frequency").get(0) } else { 0.0 };
    let pulses = (frequency > 0.0).then(|| 1.0 / frequency);
    let share = own.number("travel_share").get(0);
    let dead = times.map(|time| time * (1.0 - 0.5 * share));
    let averaged = own.table.choices.iter().position(|choice| choice.name == PWM_MODEL.name);
    let timing = match (pulses, averaged.map(|choice| own.choices[choice])) {
        (Some(pulses), Some(1)) => Timing::Average {
            part: build.circuit.add(Held { acts, remembered, commanded, signal }),
            times,
            dead,
            pulses,
        },
        _ => Timing::Travel {
            part: build.circuit.add(Armature { acts, remembered, commanded, signal }),
            dead,
            travel: times.map(|time| time * share),
            pulses,
            stands,
        },
    };
    build.columns(own, 0, [Quantity::Input(timing.commanded()), Quantity::Signal(signal)]);
    build.input(own, 0, Acts::Timed(timing, physics::within(least, 1.0)));
    signal
}

fn edge<P: Lane>(
    (law, signal): (&Iso6358<P>, usize),
    [offset, slope]: [f64; 2],
    (from, to): (GasId, GasId),
    build: &mut Build<P>,
) -> Path {
    let (offset, slope, path) = (P::c(offset), P::c(slope), build.circuit.between(from, to));
    build.path_part(Edge { offset, slope, law: law.clone(), signal, leak: None, path }, law.conductance)
}

/// Pulses with a period shorter than the dead time on never move the armature.
fn check_pulses(own: &Instance<f64>) -> Result<(), Error> {
    let [frequency, on, share] = ["pwm_frequency", "time_on", "travel_share"].map(|key| own.number(key));
    let dead = on * (1.0 - 0.5 * share);
    if frequency * dead < 1.0 {
        return Ok(());
    }
    refuse!(
        "{}.pwm_frequency = {frequency} Hz: a period of {:.3} ms is no longer than the dead time on, {:.3} ms, so the valve never \
         opens. Take a lower frequency",
        own.name,
        1e3 / frequency,
        1e3 * dead
    )
}

const KIND: Kind = Kind {
    sources: &["iso6358-2013"],
    discrete: &["time_on", "time_off", "travel_share", "pwm_frequency"],
    inputs: &[("command", "1", "1: on, 0: off; with pulses, the fraction of a period in which it is on")],
    ..Kind::PLAIN
};

macro_rules! text {
    ($of:literal) => {
        concat!(
            $of,
            " After a command the armature stands for the dead time, then it travels at a steady rate; edges of one port \
             are never open at once. If a command returns within the dead time, the armature does not move."
        )
    };
}

/// A 2/2 switching valve.
pub struct Switching22;

impl Component for Switching22 {
    const KIND: Kind = Kind {
        key: "valve/switching-2/2",
        title: "2/2 switching valve",
        text: text!("One path between ports 1 and 2 that the command opens, or shuts."),
        ports: &[gas("1"), gas("2")],
        parameters: table! {
            conductance: "m3/(s Pa)", physics::above(0.0), "Sonic conductance C of the open valve, for air";
            critical_pressure_ratio: "1", physics::between(0.0, 1.0), "Critical pressure ratio b";
            ..TIMES;
            ..PULSES;
            SUBSONIC_INDEX;
            LINEAR_ABOVE;
        },
        choices: &[NORMALLY, PWM_MODEL],
        outputs: &[
            ("command", "1", "command"),
            ("position", "1", "position of the armature"),
            ("mass_flow_kg_s", "kg/s", "mass flow from port 1 to port 2"),
        ],
        ..KIND
    };

    fn check(own: &Instance<f64>) -> Result<(), Error> {
        check_pulses(own)
    }

    fn compose<P: Lane>(own: &Instance<P>, at: &Terminals, build: &mut Build<P>) {
        let (Some(one), Some(two)) = (at.gas(0), at.gas(1)) else { return };
        let law = own.path("conductance", build);
        let signal = armature(own, PULSED, build);
        let opens = if own.choices[0] == 0 { ALONE } else { ALONE_SHUTS };
        let path = edge((&law, signal), opens, (one, two), build);
        build.column(own, 2, Quantity::along(path));
    }
}

/// A 3/2 switching valve.
pub struct Switching32;

impl Component for Switching32 {
    const KIND: Kind = Kind {
        key: "valve/switching-3/2",
        title: "3/2 switching valve",
        text: text!(
            "Port 2 is open to the exhaust 3, and to the supply 1 under a command; normally open: reversed."
        ),
        ports: &[gas("1"), gas("2"), exhaust("3")],
        parameters: table! {
            conductance: "m3/(s Pa)", physics::above(0.0), "Sonic conductance C from port 1 to port 2, for air";
            critical_pressure_ratio: "1", physics::between(0.0, 1.0), "Critical pressure ratio b from port 1 to port 2";
            ..EXHAUST;
            ..TIMES;
            ..PULSES;
            SUBSONIC_INDEX;
            LINEAR_ABOVE;
        },
        choices: &[NORMALLY, PWM_MODEL],
        outputs: &[
            ("command", "1", "command"),
            ("position", "1", "position of the armature"),
            ("mass_flow_2_kg_s", "kg/s", "mass flow out of port 2"),
        ],
        ..KIND
    };

    fn check(own: &Instance<f64>) -> Result<(), Error> {
        if own.choices[1] == 1 && own.number("pwm_frequency") > 0.0 {
            return refuse!(
                "{}.pwm_model = \"averaged\": between supply and exhaust the mean of pulses is no opening. Take two 2/2 valves, \
                 or pwm_model = \"exact\"",
                own.name
            );
        }
        check_pulses(own)
    }

    fn compose<P: Lane>(own: &Instance<P>, at: &Terminals, build: &mut Build<P>) {
        let (Some(one), Some(two), Some(out)) = (at.gas(0), at.gas(1), at.gas(2)) else { return };
        let (law, vent) = (own.path("conductance", build), own.exhaust_path(build));
        let signal = armature(own, PULSED, build);
        let (supply, exhaust) = if own.choices[0] == 0 { (OPENS, SHUTS) } else { (SHUTS, OPENS) };
        let to = edge((&law, signal), supply, (one, two), build);
        let from = edge((&vent, signal), exhaust, (two, out), build);
        build.column(own, 2, Quantity::Flow([Some(to), Some(from.backward())]));
    }
}

/// Adds the four edges of a valve with five ports, from the signal of its position.
pub(in crate::component) fn five<P: Lane>(
    own: &Instance<P>,
    at: &Terminals,
    (signal, opens): (usize, [[f64; 2]; 4]),
    build: &mut Build<P>,
) {
    let each = [0, 1, 2, 3, 4].map(|port| at.gas(port));
    let [Some(supply), Some(a), Some(b), Some(out_a), Some(out_b)] = each else { return };
    let (law, vent) = (own.path("conductance", build), own.exhaust_path(build));
    let ends = [(supply, a), (a, out_a), (supply, b), (b, out_b)];
    let laws = [&law, &vent, &law, &vent];
    let [to_a, from_a, to_b, from_b] =
        [0, 1, 2, 3].map(|i| edge((laws[i], signal), opens[i], ends[i], build));
    build.column(own, 2, Quantity::Flow([Some(to_a), Some(from_a.backward())]));
    build.column(own, 3, Quantity::Flow([Some(to_b), Some(from_b.backward())]));
}

pub(in crate::component) const FIVE: Kind = Kind {
    ports: &[gas("1"), gas("4"), gas("2"), exhaust("5"), exhaust("3")],
    outputs: &[
        ("command", "1", "command"),
        ("position", "1", "position of the armature"),
        ("mass_flow_4_kg_s", "kg/s", "mass flow out of port 4"),
        ("mass_flow_2_kg_s", "kg/s", "mass flow out of port 2"),
    ],
    parameters: table! {
        conductance: "m3/(s Pa)", physics::above(0.0), "Sonic conductance C of the paths from port 1, for air";
        critical_pressure_ratio: "1", physics::between(0.0, 1.0), "Critical pressure ratio b of the paths from port 1";
        ..EXHAUST;
        ..TIMES;
        SUBSONIC_INDEX;
        LINEAR_ABOVE;
    },
    ..KIND
};

/// A 5/2 switching valve with a spring.
pub struct Switching52;

impl Component for Switching52 {
    const KIND: Kind = Kind {
        key: "valve/switching-5/2",
        title: "5/2 switching valve",
        text: text!("1 to 2 and 4 to 5 are open; under a command 1 to 4 and 2 to 3."),
        ..FIVE
    };

    fn compose<P: Lane>(own: &Instance<P>, at: &Terminals, build: &mut Build<P>) {
        let signal = armature(own, Drives { has_pulses: false, least: 0.0, stands: false }, build);
        five(own, at, (signal, [OPENS, SHUTS, SHUTS, OPENS]), build);
    }
}

/// A 5/3 switching valve.
pub struct Switching53;

impl Component for Switching53 {
    const KIND: Kind = Kind {
        key: "valve/switching-5/3",
        title: "5/3 switching valve",
        text: text!(
            "Under command 1, 1 to 4 and 2 to 3 are open; under -1, 1 to 2 and 4 to 5; under 0 the paths of the centre."
        ),
        choices: &[Choice {
            name: "centre",
            options: &["closed", "exhaust", "pressure"],
            meaning: "Paths open in the centre: none, 4 to 5 and 2 to 3, or 1 to 4 and 1 to 2",
        }],
        inputs: &[("command", "1", "1, 0 or -1")],
        ..FIVE
    };

    fn compose<P: Lane>(own: &Instance<P>, at: &Terminals, build: &mut Build<P>) {
        // Positions from which each edge opens, towards 1 and towards -1.
        let edges = match own.choices[0] {
            0 => [OPENS, [-1.0, -2.0], [-1.0, -2.0], OPENS],
            1 => [OPENS, SHUTS, [-1.0, -2.0], [1.0, 2.0]],
            _ => [[1.0, 2.0], [-1.0, -2.0], SHUTS, OPENS],
        };
        let signal = armature(own, Drives { has_pulses: false, least: -1.0, stands: false }, build);
        five(own, at, (signal, edges), build);
    }
}
