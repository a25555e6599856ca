//! Laws on two 3/2 valves, on four 2/2 and on one 5/3 switching valve: what they are told, how they follow, what they do to the
//! valves. Values assumed.

mod axis;

use axis::{Loop, PERIOD, axis, session, setup};
use circuit::Look;
use circuit::specification::{Circuit, Component};
use control::{Arrangement, Controller, Move, Reference};
use servo::{COLUMNS, belief, controller, specification};
use std::collections::BTreeMap;

/// The axis on other valves: kind, names, numbers; and what is joined.
fn on(kind: &str, names: &[&str], numbers: &[(&str, f64)], joints: &[&[&str]]) -> Circuit {
    let mut circuit = axis();
    circuit.components.retain(|own| own.name != "valve");
    circuit.components.extend(names.iter().map(|name| Component {
        name: (*name).into(),
        kind: kind.into(),
        numbers: numbers.iter().map(|(key, value)| ((*key).into(), *value)).collect(),
        choices: BTreeMap::new(),
        friction: None,
        formula: None,
        points: None,
    }));
    circuit.joints = joints.iter().map(|own| own.iter().map(|port| (*port).into()).collect()).collect();
    circuit
}

fn pair() -> Circuit {
    let spool = [("frequency", 100.0), ("damping_ratio", 0.7), ("delay", 1e-3), ("overlap", 0.02)];
    let numbers = [&[("conductance", 2e-8), ("critical_pressure_ratio", 0.3)][..], &spool].concat();
    let joints: [&[&str]; 5] = [
        &["supply.1", "valve_a.1", "valve_b.1"],
        &["valve_a.2", "cylinder.a"],
        &["valve_b.2", "cylinder.b"],
        &["valve_a.3", "ambient"],
        &["valve_b.3", "ambient"],
    ];
    // Not in the order of the chambers.
    on("valve/proportional-3/2", &["valve_b", "valve_a"], &numbers, &joints)
}

const SWITCHING: [(&str, f64); 4] =
    [("conductance", 5e-9), ("critical_pressure_ratio", 0.3), ("time_on", 2e-3), ("time_off", 2e-3)];

fn four(pwm: f64) -> Circuit {
    let joints: [&[&str]; 4] = [
        &["supply.1", "in_a.1", "in_b.1"],
        &["in_a.2", "cylinder.a", "out_a.1"],
        &["in_b.2", "cylinder.b", "out_b.1"],
        &["out_a.2", "out_b.2", "ambient"],
    ];
    let numbers = [&SWITCHING[..], &[("pwm_frequency", pwm)]].concat();
    on("valve/switching-2/2", &["in_a", "out_a", "in_b", "out_b"], &numbers, &joints)
}

fn five() -> Circuit {
    let joints: [&[&str]; 5] = [
        &["supply.1", "valve.1"],
        &["valve.4", "cylinder.a"],
        &["valve.2", "cylinder.b"],
        &["valve.5", "ambient"],
        &["valve.3", "ambient"],
    ];
    on("valve/switching-5/3", &["valve"], &SWITCHING, &joints)
}

fn told(law: &str, plant: &Circuit) -> specification::Controller {
    specification::Controller {
        law: law.into(),
        period_s: PERIOD,
        gains: BTreeMap::new(),
        factors: [1.0; 3],
        valves: BTreeMap::new(),
        adaptation: true,
        hold: Some([3e-5, 0.02]),
        supervision: Default::default(),
        standby: None,
        belief: plant.clone(),
    }
}

struct Ran {
    rows: Vec<[f64; COLUMNS.len()]>,
    /// Commands of the valves at each sample.
    commands: Vec<Vec<f64>>,
    air: f64,
    controller: Controller,
}

impl Ran {
    /// Largest error from a time on, mm.
    fn error(&self, from: f64) -> f64 {
        let late = self.rows.iter().filter(|row| row[0] >= from);
        late.map(|row| (row[5] - row[1]).abs()).fold(0.0, f64::max) * 1e3
    }

    fn velocity_error(&self) -> f64 {
        let sum: f64 = self.rows.iter().map(|row| (row[7] - row[2]).powi(2)).sum();
        (sum / self.rows.len() as f64).sqrt()
    }

    /// Stiffness of the shut-in gas from a time on, N/m: least and largest.
    fn stiffness(&self, from: f64) -> [f64; 2] {
        let area = std::f64::consts::PI * 0.025 * 0.025 / 4.0;
        let of = |p: f64, length: f64| 1.4 * p * area * area / (1e-5 + area * length);
        let late = self.rows.iter().filter(|row| row[0] >= from);
        late.map(|row| of(row[3], row[1]) + of(row[4], 0.5 - row[1]))
            .fold([f64::INFINITY, 0.0], |[low, high], own| [low.min(own), high.max(own)])
    }
}

fn run(spec: &specification::Controller, reference: &Reference, duration: f64) -> Ran {
    let setup = setup(1);
    let (mut controller, names) = controller(spec, 1.76e-6).expect("a controller");
    let mut session = session(&spec.belief, reference.at(0.0).position);
    session.follow_drawn();
    let mut under = Loop::new(session, &names, &setup).expect("an axis");
    let rows = under.run(&mut controller, reference, duration, &mut Look::new(&mut |_| false));
    let (valves, each) = under.servo().commanded();
    let commands = each.chunks(valves.len()).map(<[f64]>::to_vec).collect();
    Ran { rows: rows.expect("it runs"), commands, air: under.air_drawn().expect("followed"), controller }
}

fn sine() -> Reference {
    Reference::Sine { centre: 0.25, amplitude: 0.06, frequency: 1.0 }
}

fn there_and_back() -> Reference {
    let moves =
        vec![Move { begin: 0.2, duration: 0.3, to: 0.28 }, Move { begin: 1.0, duration: 0.3, to: 0.22 }];
    Reference::Moves { start: 0.22, moves }
}

/// Two 3/2 valves follow as one 5/3 valve does, and keep the stiffness that they are told; a softer drive takes less air.
#[test]
fn two_valves_give_the_force_and_the_stiffness() {
    let mut spec = told("inversion", &pair());
    let mut air = Vec::new();
    for stiffness in [1600.0, 2400.0] {
        spec.valves.insert("stiffness".into(), stiffness);
        let ran = run(&spec, &sine(), 2.5);
        assert!(ran.error(1.0) < 0.3, "{} mm at {stiffness} N/m", ran.error(1.0));
        let [low, high] = ran.stiffness(1.0);
        assert!(low > 0.98 * stiffness && high < 1.02 * stiffness, "{low} .. {high} N/m");
        assert!(ran.commands.iter().all(|own| own.len() == 2));
        air.push(ran.air);
    }
    assert!(air[0] < 0.9 * air[1], "{air:?} kg");
}

/// Four valves without pulses: both edges of a chamber are never open, nor both chambers filled or vented; no valve switches
/// before its armature has arrived; at rest nothing switches.
#[test]
fn four_valves_take_one_of_seven_modes() {
    let ran = run(&told("nmpc", &four(0.0)), &there_and_back(), 2.0);
    assert!(ran.error(0.0) < 0.7, "{} mm", ran.error(0.0));
    let modes: Vec<[f64; 2]> = ran.commands.iter().map(|own| [own[0] - own[1], own[2] - own[3]]).collect();
    for (own, mode) in ran.commands.iter().zip(&modes) {
        assert!(own.iter().all(|command| *command == 0.0 || *command == 1.0));
        assert!(own[0] * own[1] + own[2] * own[3] + mode[0] * mode[1].max(0.0) * mode[0].max(0.0) == 0.0);
        assert!(mode[0] == 0.0 || mode[0] != mode[1], "{mode:?}");
    }
    let switches: Vec<usize> = (1..modes.len()).filter(|&k| modes[k] != modes[k - 1]).collect();
    assert!(switches.windows(2).all(|pair| pair[1] - pair[0] >= 3), "a mode of less than 2.2 ms");
    let at_rest = switches.iter().filter(|&&k| k > 1400).count();
    assert!(switches.len() > 20 && at_rest <= 8, "valves switch seldom at rest: {switches:?}");
}

/// Pulses of 10 ms: none is too short for the armature, and the drive follows.
#[test]
fn pulses_are_never_shorter_than_the_valve_takes() {
    let ran = run(&told("nmpc", &four(100.0)), &there_and_back(), 1.6);
    assert!(ran.error(0.0) < 0.7, "{} mm", ran.error(0.0));
    let widths = ran.commands.iter().flatten().filter(|own| **own > 0.0 && **own < 1.0);
    let [low, high] = widths.fold([1.0_f64, 0.0_f64], |[low, high], own| [low.min(*own), high.max(*own)]);
    assert!(low >= 0.22 - 1e-12 && high <= 0.78 + 1e-12 && low < high, "{low} .. {high}");
}

#[test]
fn a_switching_valve_follows_in_three_positions() {
    let ran = run(&told("inversion", &five()), &sine(), 2.0);
    assert!(ran.error(1.0) < 0.6, "{} mm", ran.error(1.0));
    let each: Vec<f64> = ran.commands.iter().map(|own| own[0]).collect();
    assert!([-1.0, 0.0, 1.0].iter().all(|way| each.contains(way)));
    assert!(each.iter().all(|own| own.abs() == 1.0 || *own == 0.0));
    let Arrangement::Three(armature) = ran.controller.model.valve.arrangement else {
        panic!("three positions")
    };
    assert!((armature.dead[0] + armature.travel[0] - 2.2e-3).abs() < 1e-12);
}

#[test]
fn what_no_law_commands_is_refused() {
    let wrong = |change: &dyn Fn(&mut Circuit), mut circuit: Circuit, says: &str| {
        change(&mut circuit);
        let message = belief(&circuit).expect_err(says).to_string();
        assert!(message.contains(says), "{message}");
    };
    let number = |key: &'static str, value: f64| {
        move |own: &mut Circuit| {
            own.components
                .iter_mut()
                .find(|own| own.name == "in_b")
                .expect("in_b")
                .numbers
                .insert(key.into(), value);
        }
    };
    wrong(&number("conductance", 6e-9), four(0.0), "assumes that the valves are equal");
    let choice = |key: &'static str, option: &'static str| {
        move |own: &mut Circuit| {
            let valves = own.components.iter_mut().filter(|own| own.kind.starts_with("valve"));
            valves.for_each(|own| _ = own.choices.insert(key.into(), option.into()));
        }
    };
    wrong(&choice("normally", "open"), four(0.0), "normally open");
    wrong(&choice("pwm_model", "averaged"), four(100.0), "a controller commands pulses");
    wrong(&choice("centre", "exhaust"), five(), "no position of the valve shuts the chambers");
    wrong(
        &|own| own.joints[1] = vec!["valve_a.2".into(), "supply.1".into()],
        pair(),
        "connect the cylinder with supply",
    );
    let kind = |own: &mut Circuit| {
        own.components.iter_mut().for_each(|own| {
            if own.kind.starts_with("valve") {
                own.kind = "valve/switching-3/2".into();
            }
        })
    };
    wrong(&kind, pair(), "cannot hold the drive at rest");
    let mut fast = told("pid", &four(400.0));
    fast.period_s = 5e-3;
    assert!(controller(&fast, 2e-6).expect_err("pulses").to_string().contains("take a lower pwm_frequency"));
    let mut one = told("pid", &axis());
    one.valves.insert("stiffness".into(), 2e3);
    assert!(controller(&one, 2e-6).expect_err("no numbers").to_string().contains("Leave the table out"));
}

/// The observer in the loop, with the noise of sensors, beside the true velocity.
#[test]
fn the_observer_comes_near_to_the_velocity() {
    let error = run(&told("inversion", &axis()), &sine(), 3.0).velocity_error();
    assert!(error < 1.2e-3, "{error} m/s");
}
