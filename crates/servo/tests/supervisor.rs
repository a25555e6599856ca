//! The supervisor on the reference axis: each row of what it answers, and random runs with faults.

mod study;

use circuit::specification::Circuit;
use control::{
    AnyLaw, Controller, EventKind, LAWS, MotionRules, Move, Own, Reaction, Reference, Rules, Seen,
};
use servo::specification::{Fault, FaultKind, SensorChannel, Setup};
use servo::{COLUMNS, Encoder};
use study::axis::{self, Loop, axis};
use study::{Class, healthy, is_lost_alone, outcome};

const STROKE: f64 = 0.5;

type Rows = Vec<[f64; COLUMNS.len()]>;

fn setup(faults: Vec<Fault>) -> Setup {
    Setup { computing_time_s: 0.3e-3, jitter_s: [10e-6; 4], faults, ..axis::setup(1) }
}

fn fault(kind: FaultKind, begin_s: f64, end_s: f64) -> Fault {
    Fault { kind, channel: None, begin_s, end_s: Some(end_s), value: None }
}

fn on(channel: SensorChannel, kind: FaultKind, value: f64) -> Fault {
    Fault { channel: Some(channel), value: Some(value), ..fault(kind, 0.6, 9.0) }
}

/// A channel without readings, in the midst of a move.
fn fault_of(channel: SensorChannel) -> Fault {
    on(channel, FaultKind::Nan, 0.0)
}

fn rules() -> Rules {
    let motion = MotionRules { tolerance: 1e-4, settled_for: 0.05, timeout: 0.5 };
    Rules { motion, on_supply: Reaction::Tell, ..Rules::default() }
}

/// 60 mm in 0.4 s, from 0.5 s on.
fn a_move() -> Reference {
    Reference::Moves { start: 0.22, moves: vec![Move { begin: 0.5, duration: 0.4, to: 0.28 }] }
}

fn begin(plant: &Circuit, law: &str, setup: &Setup, x: f64) -> (Loop, Controller) {
    axis::begin(axis(), plant, (law, Some(rules())), setup, x)
}

/// Runs a controller that may be changed before.
fn run_with(
    (law, setup): (&str, &Setup),
    (reference, duration): (&Reference, f64),
    change: impl FnOnce(&mut Controller),
) -> (Rows, Controller) {
    run_on(&axis(), (law, setup), (reference, duration), change)
}

fn run_on(
    plant: &Circuit,
    (law, setup): (&str, &Setup),
    (reference, duration): (&Reference, f64),
    change: impl FnOnce(&mut Controller),
) -> (Rows, Controller) {
    let (mut under, mut controller) = begin(plant, law, setup, reference.at(0.0).position);
    change(&mut controller);
    let mut never = |_| false;
    let look = &mut circuit::Look::new(&mut never);
    let rows = under.run(&mut controller, reference, duration, look).expect("it runs");
    (rows, controller)
}

fn run(faults: Vec<Fault>) -> (Rows, Controller) {
    run_with(("inversion", &setup(faults)), (&a_move(), 1.5), |_| ())
}

fn count(controller: &Controller, kind: EventKind) -> usize {
    controller
        .supervisor
        .as_ref()
        .expect("a supervisor")
        .log
        .events
        .iter()
        .filter(|own| own.kind == kind)
        .count()
}

fn told(controller: &Controller) -> Vec<(f64, EventKind)> {
    let log = &controller.supervisor.as_ref().expect("a supervisor").log;
    log.events.iter().map(|own| (own.time, own.kind)).collect()
}

fn fastest(rows: &[[f64; COLUMNS.len()]]) -> f64 {
    rows.iter().map(|row| row[2].abs()).fold(0.0, f64::max)
}

/// Largest step of the command between samples after a time, s.
fn steepest(rows: &Rows, after: f64) -> f64 {
    rows.windows(2)
        .filter(|two| two[1][0] > after)
        .map(|two| (two[1][6] - two[0][6]).abs())
        .fold(0.0, f64::max)
}

#[test]
fn without_faults_every_law_gives_the_same_bits_with_a_supervisor() {
    for law in LAWS {
        let setup = setup(vec![]);
        let commands = |supervised: bool| -> Vec<u64> {
            let change = |own: &mut Controller| {
                if !supervised {
                    own.supervisor = None;
                }
            };
            let (rows, _) = run_with((law, &setup), (&a_move(), 1.2), change);
            rows.iter().map(|row| row[6].to_bits()).collect()
        };
        assert_eq!(commands(true), commands(false), "{law}");
    }
}

/// What happens from 0.6 s on, in the midst of a move: what is told, and that the drive stands at the end.
#[test]
fn faults_of_sensors_reference_clock_and_user_are_told_and_bring_the_drive_to_a_stand() {
    let position = |kind, value| on(SensorChannel::Position, kind, value);
    let still = |kind| fault(kind, 0.6, 9.0);
    let rows: [(Fault, EventKind); 9] = [
        (position(FaultKind::Nan, 0.0), EventKind::PositionLost),
        (position(FaultKind::Stuck, 0.0), EventKind::PositionLost),
        (position(FaultKind::Offset, 0.02), EventKind::PositionLost),
        (still(FaultKind::Reference), EventKind::Reference),
        (Fault { value: Some(0.6), ..still(FaultKind::Reference) }, EventKind::Reference),
        (Fault { value: Some(0.01), ..still(FaultKind::Clock) }, EventKind::Clock),
        (still(FaultKind::EmergencyStop), EventKind::EmergencyStop),
        (still(FaultKind::EnableLost), EventKind::Disabled),
        (still(FaultKind::ValveDead), EventKind::Valve),
    ];
    for (fault, kind) in rows {
        let (rows, controller) = run(vec![fault]);
        let events = told(&controller);
        let first = events.iter().find(|own| own.1 == kind);
        assert!(first.is_some(), "{fault:?}: {events:?}");
        assert!(events.iter().all(|own| own.0 >= 0.6), "{fault:?}: {events:?}");
        let end = &rows[rows.len() - 100..];
        assert!(fastest(end) < 5e-3, "{fault:?}: {} m/s at the end", fastest(end));
        assert!(fastest(&rows) < 0.6, "{fault:?}: {} m/s", fastest(&rows));
    }
}

#[test]
fn a_single_wild_reading_is_replaced_and_the_move_goes_on() {
    let (rows, controller) = run(vec![on(SensorChannel::Position, FaultKind::Jump, 0.01)]);
    assert_eq!(told(&controller).len(), 1, "{:?}", told(&controller));
    assert_eq!(count(&controller, EventKind::PositionPredicted), 1);
    assert!((rows[rows.len() - 1][1] - 0.28).abs() < 1e-4, "it arrives");
    let error = rows.iter().map(|row| (row[5] - row[1]).abs()).fold(0.0, f64::max);
    assert!(error < 1e-3, "{error} m");
}

#[test]
fn a_lost_pressure_is_replaced_by_the_model_and_the_move_goes_on() {
    for (kind, value) in [(FaultKind::Nan, 0.0), (FaultKind::Offset, 1e5), (FaultKind::Saturated, 1e6)] {
        let (rows, controller) = run(vec![on(SensorChannel::PressureA, kind, value)]);
        assert_eq!(count(&controller, EventKind::PressureLost), 1, "{kind:?}: {:?}", told(&controller));
        let error = rows.iter().map(|row| (row[5] - row[1]).abs()).fold(0.0, f64::max);
        assert!(error < 3e-3, "{kind:?}: {error} m");
        assert!((rows[rows.len() - 1][1] - 0.28).abs() < 5e-4, "{kind:?}");
    }
    // A reading that rests is told once the pressure has to have moved.
    let (_, controller) = run_with(
        ("inversion", &setup(vec![on(SensorChannel::PressureA, FaultKind::Stuck, 0.0)])),
        (&Reference::Moves { start: 0.1, moves: vec![Move { begin: 0.62, duration: 0.3, to: 0.4 }] }, 1.2),
        |_| (),
    );
    assert_eq!(count(&controller, EventKind::PressureLost), 1, "{:?}", told(&controller));
}

#[test]
fn integrals_stand_while_the_command_is_at_its_limit() {
    // A step of 0.2 m saturates the valve; what a wound-up integral would add is many times this.
    let moves = vec![Move { begin: 0.5, duration: 0.12, to: 0.35 }];
    let reference = Reference::Moves { start: 0.15, moves };
    for (law, most) in [("pid", 0.04), ("super-twisting", 0.06), ("nmpc", 0.03)] {
        let (rows, _) = run_with((law, &setup(vec![])), (&reference, 1.5), |_| ());
        assert!(rows.iter().any(|row| row[6].abs() > 0.99), "{law}: it is at its limit");
        let overshoot = rows.iter().map(|row| row[1] - 0.35).fold(0.0, f64::max);
        assert!(overshoot < most, "{law}: {overshoot} m");
    }
}

#[test]
fn the_end_stop_is_not_hit_by_a_law_that_runs_towards_it() {
    for way in [1.0, -1.0] {
        let run_away = move |_: &Seen, _: &Reference| 0.35 * way;
        let change = |own: &mut Controller| own.law = AnyLaw::Own(Own::new(run_away));
        let (rows, controller) = run_with(("own", &setup(vec![])), (&a_move(), 1.5), change);
        assert!(count(&controller, EventKind::EndStop) > 0, "{way}");
        assert!(fastest(&rows) > 0.3, "{way}: it runs: {} m/s", fastest(&rows));
        let beyond = |row: &[f64; COLUMNS.len()]| if way > 0.0 { row[1] >= STROKE } else { row[1] <= 0.0 };
        let hits = rows.windows(2).filter(|two| beyond(&two[1])).map(|two| way * two[0][2]);
        let hit = hits.fold(0.0, f64::max);
        assert!(hit < 0.05, "{way}: {hit} m/s");
    }
}

/// A sensor that sticks early in a move or at its end: a model that goes on from the readings is held by them, and the drive
/// hits at 2.5 m/s without pressure sensors, and at 0.34 m/s with them, where the law holds what it takes for a stand.
#[test]
fn a_position_that_sticks_while_the_drive_begins_or_ends_a_move_is_lost() {
    let moves =
        |from, to, duration| Reference::Moves { start: from, moves: vec![Move { begin: 0.2, duration, to }] };
    let stuck =
        |at| vec![Fault { channel: Some(SensorChannel::Position), ..fault(FaultKind::Stuck, at, 9.0) }];
    let begins = Setup { pressures: None, ..setup(stuck(0.25)) };
    let ends = setup(stuck(1.282));
    for (law, reference, setup, until) in [
        ("inversion", moves(0.1, 0.4, 2.5), begins, 1.0),
        ("super-twisting", moves(0.457, 0.1482, 1.12), ends, 3.0),
    ] {
        let (rows, controller) = run_with((law, &setup), (&reference, until), |_| ());
        assert_eq!(count(&controller, EventKind::PositionLost), 1, "{law}: {:?}", told(&controller));
        let end = rows[rows.len() - 1];
        assert!((0.05..0.45).contains(&end[1]) && end[2].abs() < 5e-3, "{law}: {} m, {} m/s", end[1], end[2]);
    }
}

/// The alarm may be false: a valve that shuts at once lets the load bounce.
#[test]
fn a_lost_sensor_stops_a_moving_drive_before_its_valve_is_shut() {
    for channel in [SensorChannel::Position, SensorChannel::PressureA] {
        let lost = setup(vec![fault_of(channel)]);
        let blocks = |own: &mut Controller| {
            let rules = &mut own.supervisor.as_mut().expect("a supervisor").rules;
            (rules.on_position, rules.on_pressure) = (Reaction::Block, Reaction::Block);
        };
        let (rows, controller) = run_with(("inversion", &lost), (&a_move(), 2.0), blocks);
        let shut =
            rows.windows(30).position(|own| own[0][0] > 0.6 && own.iter().all(|row| row[6].abs() < 1e-3));
        let shut = &rows[shut.expect("it is shut")];
        assert!(shut[2].abs() < 0.03, "{channel:?} {} m/s: {:?}", shut[2], told(&controller));
        assert!(shut[0] < 1.0 && fastest(&rows[1900..]) < 1e-3, "{channel:?} at {} s", shut[0]);
    }
}

#[test]
fn limits_stop_the_drive_and_switches_let_it_go_away_alone() {
    let limited = |own: &mut Controller| {
        own.supervisor.as_mut().expect("a supervisor").rules.position = [0.1, 0.2805];
    };
    let load = Setup { forces: vec![[1.2, 150.0]], ..setup(vec![]) };
    let (_, controller) = run_with(("inversion", &load), (&a_move(), 1.5), limited);
    assert_eq!(count(&controller, EventKind::Limit), 1, "{:?}", told(&controller));
    let (mut under, mut controller) = begin(&axis(), "inversion", &load, 0.22);
    limited(&mut controller);
    let beyond = Reference::Moves { start: 0.22, moves: vec![Move { begin: 0.1, duration: 0.4, to: 0.3 }] };
    let mut never = |_| false;
    let refused = under.run(&mut controller, &beyond, 1.0, &mut circuit::Look::new(&mut never));
    let message = refused.expect_err("it leaves the limits").to_string();
    assert!(message.contains("limits.position"), "{message}");
    let switched = Setup { switches_m: Some([0.01, 0.26]), ..setup(vec![]) };
    let (rows, controller) = run_with(("inversion", &switched), (&a_move(), 1.0), |_| ());
    assert_eq!(count(&controller, EventKind::LimitSwitch), 1, "{:?}", told(&controller));
    assert!(rows.iter().filter(|row| row[1] >= 0.26).all(|row| row[6] < 1e-3), "away alone");
}

#[test]
fn after_enable_the_drive_returns_to_its_reference_without_a_bump() {
    let (rows, controller) = run(vec![fault(FaultKind::EnableLost, 0.65, 0.9)]);
    assert_eq!(count(&controller, EventKind::Enabled), 1);
    let shut = rows.iter().filter(|row| row[0] > 0.652 && row[0] < 0.899);
    assert!(shut.clone().count() > 200 && shut.clone().all(|row| row[6].abs() < 1e-3), "the valve is shut");
    assert!((rows[rows.len() - 1][1] - 0.28).abs() < 1e-3, "it arrives at {}", rows[rows.len() - 1][1]);
    assert!(steepest(&rows, 0.9) < 0.15, "{}", steepest(&rows, 0.9));
}

/// An encoder that has lost counts is off for good: to begin anew with it would lead into an end stop.
#[test]
fn a_drive_whose_position_is_off_still_is_not_enabled_again() {
    let offset = |end_s| Fault { end_s: Some(end_s), ..on(SensorChannel::Position, FaultKind::Offset, 0.09) };
    for (until, may_move) in [(9.0, false), (0.8, true)] {
        let (rows, controller) = run(vec![offset(until), fault(FaultKind::EnableLost, 0.85, 0.95)]);
        let lost = count(&controller, EventKind::PositionLost);
        assert_eq!(lost, if may_move { 1 } else { 2 }, "{:?}", told(&controller));
        let [after, end] = [1000, rows.len() - 1].map(|tick| rows[tick][1]);
        assert_eq!((end - 0.28).abs() < 1e-3, may_move, "it ends at {end} m");
        assert!(may_move || (end - after).abs() < 1e-3, "it moves from {after} m to {end} m");
    }
}

#[test]
fn a_drive_that_does_not_move_or_settle_is_told_with_its_cause() {
    let with = |change: &dyn Fn(&mut Circuit), law: &str, faults: Vec<Fault>| {
        let mut plant = axis();
        change(&mut plant);
        // An encoder that shows its noise: what rests does not look like a reading that is stuck.
        let fine = Encoder { resolution: 0.0, noise: 1e-6 };
        let modelled = if law == "pid" { None } else { setup(vec![]).pressures };
        let setup = Setup { position: fine, pressures: modelled, ..setup(faults) };
        let (_, controller) = run_on(&plant, (law, &setup), (&a_move(), 2.5), |_| ());
        controller
    };
    let jammed = |plant: &mut Circuit| {
        for friction in plant.components.iter_mut().filter_map(|own| own.friction.as_mut()) {
            for key in ["coulomb", "breakaway"] {
                *friction.parameters.get_mut(key).expect("a level") *= 20.0;
            }
        }
    };
    let blocked = with(&jammed, "pid", vec![]);
    assert!(count(&blocked, EventKind::Blocked) > 0, "{:?}", told(&blocked));
    let supply = Fault { value: Some(1.1e5), ..fault(FaultKind::SupplyFallen, 0.0, 9.0) };
    let no_air = with(&|_| (), "inversion", vec![supply]);
    assert!(count(&no_air, EventKind::NoAir) > 0, "{:?}", told(&no_air));
    let late = |plant: &mut Circuit| {
        for valve in plant.components.iter_mut().filter(|own| own.kind.starts_with("valve")) {
            *valve.numbers.get_mut("delay").expect("a dead time") *= 30.0;
        }
    };
    let swings = with(&late, "pid", vec![]);
    assert!(count(&swings, EventKind::LimitCycle) > 0, "{:?}", told(&swings));
    let settles = with(&|_| (), "nmpc", vec![]);
    assert_eq!(told(&settles), [], "it settles");
}

#[test]
fn a_valve_that_does_not_answer_and_a_supply_that_falls_are_told() {
    let sine = Reference::Sine { centre: 0.25, amplitude: 0.1, frequency: 1.0 };
    let told_of = |fault: Fault| {
        let (_, controller) = run_with(("inversion", &setup(vec![fault])), (&sine, 2.0), |_| ());
        controller
    };
    let stuck = told_of(fault(FaultKind::ValveStuck, 1.45, 9.0));
    assert_eq!(count(&stuck, EventKind::Valve), 1, "{:?}", told(&stuck));
    let fallen = told_of(Fault { value: Some(4e5), ..fault(FaultKind::SupplyFallen, 1.0, 9.0) });
    assert_eq!(count(&fallen, EventKind::Supply), 1, "{:?}", told(&fallen));
}

#[test]
fn a_late_or_failing_law_is_bridged_then_replaced_without_a_bump() {
    let (rows, controller) = run(vec![fault(FaultKind::Late, 0.6, 0.6005)]);
    assert_eq!(told(&controller).iter().map(|own| own.1).collect::<Vec<_>>(), [EventKind::Late]);
    let at = |t: f64| rows.iter().position(|row| row[0] >= t).expect("a sample");
    assert_eq!(rows[at(0.5995)][6], rows[at(0.5985)][6], "the last command stays");
    let (rows, controller) =
        run_with(("nmpc", &setup(vec![fault(FaultKind::Late, 0.6, 9.0)])), (&a_move(), 1.5), |_| ());
    assert_eq!(count(&controller, EventKind::StandBy), 1);
    assert!((rows[rows.len() - 1][1] - 0.28).abs() < 1e-4, "it arrives");
    let taken = rows.windows(2).find(|two| two[1][0] > 0.6015).expect("a sample");
    assert!((taken[1][6] - taken[0][6]).abs() < 0.05, "{} {}", taken[0][6], taken[1][6]);
    let fails = |seen: &Seen, _: &Reference| if seen.time < 0.6 { 0.0 } else { f64::NAN };
    let change = |own: &mut Controller| {
        own.law = AnyLaw::Own(Own::new(fails));
        own.supervisor.as_mut().expect("a supervisor").serves_own = true;
    };
    let (rows, controller) = run_with(("own", &setup(vec![])), (&a_move(), 1.5), change);
    assert_eq!(count(&controller, EventKind::LawFailed), 2);
    assert!(rows.iter().all(|row| row[6].is_finite()));
}

/// The command of the sample at which another law takes over.
#[test]
fn laws_are_switched_without_a_bump() {
    for law in ["pid", "super-twisting", "nmpc"] {
        let setup = setup(vec![]);
        let (mut under, mut controller) = begin(&axis(), "inversion", &setup, 0.22);
        let (reference, mut never) =
            (Reference::Sine { centre: 0.25, amplitude: 0.06, frequency: 1.0 }, |_| false);
        let look = &mut circuit::Look::new(&mut never);
        let mut rows = Rows::new();
        for tick in 0..1600 {
            if tick == 800 {
                let other = AnyLaw::tuned(law, &controller.model, &controller.plant).expect("a law");
                controller.switch(other);
            }
            let turn = under.observe(tick, &mut controller, &reference, look).expect("it runs");
            rows.push(under.give(&mut controller, &turn, turn.answer.command).expect("it runs"));
        }
        assert!((rows[800][6] - rows[799][6]).abs() < 1e-3, "{law}: {}", rows[800][6] - rows[799][6]);
        assert!(steepest(&rows, 0.7) < 0.2, "{law}: {}", steepest(&rows, 0.7));
        assert_eq!(controller.law.key(), law);
    }
}

/// Factors multiply the gains that the drive gives.
#[test]
fn factors_multiply_gains() {
    let keys = ["gain", "derivative_time", "filter_time"];
    let (_, mut controller) = begin(&axis(), "pid", &setup(vec![]), 0.22);
    let gains = |own: &mut Controller| {
        keys.map(|key| own.law.gains().into_iter().find(|one| one.0.key == key).map_or(0.0, |one| *one.1))
    };
    let before = gains(&mut controller);
    controller.scale([2.0, 0.5, 3.0]).expect("within bounds");
    assert_eq!(gains(&mut controller), [2.0 * before[0], 0.5 * before[1], 3.0 * before[2]]);
    let refused = |law: &str, factors| begin(&axis(), law, &setup(vec![]), 0.22).1.scale(factors);
    let words = refused("inversion", [1.0, 2.0, 1.0]).expect_err("inversion has no damping");
    assert!(words.contains("factors.damping = 2") && words.contains("inversion"), "{words}");
    assert!(refused("pid", [0.05, 1.0, 1.0]).expect_err("too small").contains("factors.gain = 0.05"));
    assert!(refused("nmpc", [2.0, 0.5, 1.0]).is_ok());
}

/// Runs of the example `faults` whose supply falls, with pressure sensors and without. A brake that counts on the
/// described supply hits at 0.24 to 0.96 m/s.
#[test]
fn braking_does_not_count_on_a_supply_that_has_fallen() {
    let members = [251, 690, 709, 1011, 4456, 5757, 8388, 8932].map(|member| (1, member));
    let hits: Vec<_> = (members.into_iter())
        .filter_map(|(seed, member)| {
            let own = outcome(seed, member);
            (own.class != Class::Safe).then(|| format!("{member}: {} m/s: {}", own.speed, own.told))
        })
        .collect();
    assert!(hits.is_empty(), "{hits:?}");
}

/// A supply below the chamber that it is to fill: told within 21 ms by that chamber, which the law would have emptied on the
/// way to 0.08 to 0.45 m/s at an end. A load that comes and goes is not taken for that.
#[test]
fn a_supply_that_does_not_fill_a_chamber_shuts_the_valve() {
    for (seed, member, fallen) in [(31, 2304, 0.311), (103, 2428, 0.269), (1005, 3890, 0.852)] {
        let own = outcome(seed, member);
        assert_eq!(own.class, Class::Safe, "{member}: {} m/s: {}", own.speed, own.told);
        let at = own.told.split(", ").find(|event| event.contains(" supply ")).expect("it is told");
        let at: f64 = at.split(' ').next().and_then(|own| own.parse().ok()).expect("a time");
        assert!((fallen..fallen + 0.021).contains(&at), "{member}: {}", own.told);
    }
    let pushed = |from: f64, to: f64, force: f64| [[from, 0.0], [from, force], [to, force], [to, 0.0]];
    for pressures in [axis::setup(1).pressures, None] {
        for force in [-80.0, 80.0] {
            let forces = [[0.0, 0.0]].into_iter().chain(pushed(0.6, 0.8, force)).collect();
            let healthy = Setup { pressures, forces, ..setup(vec![]) };
            let (_, controller) = run_with(("inversion", &healthy), (&a_move(), 1.2), |_| ());
            assert_eq!(count(&controller, EventKind::Supply), 0, "{force}: {:?}", told(&controller));
        }
    }
}

/// The supply sags while a fast move ends near an end stop, and is back for the next move: the brake is no reason to
/// leave the reference for good.
#[test]
fn a_drive_returns_to_its_reference_after_braking_on_a_sagging_supply() {
    let sags = || setup(vec![Fault { value: Some(5e5), ..fault(FaultKind::SupplyFallen, 0.4, 1.0) }]);
    for (start, near) in [(0.1, 0.492), (0.4, 0.008)] {
        let moves = [(0.5, 0.3, near), (1.2, 0.5, 0.25)];
        let moves: Vec<_> = moves.map(|(begin, duration, to)| Move { begin, duration, to }).into();
        for law in ["inversion", "super-twisting", "nmpc"] {
            let (rows, controller) =
                run_with((law, &sags()), (&Reference::Moves { start, moves: moves.clone() }, 3.0), |_| ());
            for kind in [EventKind::Supply, EventKind::EndStop] {
                assert!(count(&controller, kind) > 0, "{law}: {:?}", told(&controller));
            }
            let error = (rows[rows.len() - 1][1] - 0.25).abs();
            assert!(error < 1e-3, "{law}: {error} m: {:?}", told(&controller));
        }
    }
}

/// A supply that has fallen may be back when the drive is enabled anew: it is led to its reference and stands there.
#[test]
fn a_supply_that_is_back_serves_again_once_the_drive_is_enabled() {
    let fallen = Fault { value: Some(1.5e5), ..fault(FaultKind::SupplyFallen, 0.6, 1.0) };
    {
        let lost = setup(vec![fallen, fault(FaultKind::EnableLost, 1.2, 1.3)]);
        let shut = |own: &mut Controller| {
            own.supervisor.as_mut().expect("a supervisor").rules.on_supply = Reaction::Block;
        };
        let (rows, controller) = run_with(("inversion", &lost), (&a_move(), 2.5), shut);
        assert_eq!(count(&controller, EventKind::Supply), 1, "{:?}", told(&controller));
        let away = |t: f64| (rows[(t / 1e-3) as usize][1] - 0.28).abs();
        assert!(away(1.15) > 0.01 && away(2.45) < 5e-4, "{} and {} m", away(1.15), away(2.45));
    }
}

/// The drive moves away from an end, and a command turns it back on a supply that has fallen: a brake that looks along the
/// motion alone is too late, and it hits at 0.49 m/s.
#[test]
fn a_command_that_turns_the_drive_is_braked_before_it_turned() {
    let own = outcome(7, 3646);
    assert_eq!(own.class, Class::Safe, "{} m/s: {}", own.speed, own.told);
}

/// A reading that rested for 0.1 s, whose sensor was given up when it was right again and from what the valve had been
/// learned, hits at 0.41 m/s; braking with the valve shut, where that is too weak and only a sensor is lost, at 0.29 m/s;
/// a pressure by the model that follows the missing force in 0.1 s, at 0.82 m/s. An offset that is accepted some samples
/// after it was noticed misleads the speed of the model: four runs hit at 1.2 to 3.1 m/s. A ramp by the model alone that
/// lasts 0.2 s hits at 1.3 m/s, one of 0.08 s at 0.71 m/s.
#[test]
fn a_lost_sensor_spoils_neither_the_model_nor_the_brake() {
    for (seed, member) in
        [(1, 3758), (1, 6336), (23, 1217), (1, 376), (2, 287), (2, 1069), (11, 3207), (11, 3397), (11, 5964)]
    {
        let own = outcome(seed, member);
        assert_eq!(own.class, Class::Safe, "{member}: {} m/s: {}", own.speed, own.told);
    }
}

/// As the example `faults` does with ten thousand.
#[test]
fn random_runs_with_faults_do_not_hit_the_end_stops() {
    let outcomes: Vec<_> = (0..40).map(|member| outcome(1, member)).collect();
    let hits: Vec<_> =
        outcomes.iter().filter(|own| matches!(own.class, Class::Hit | Class::Failed)).collect();
    let words = |own: &&study::Outcome| format!("{} {} {} m/s: {}", own.fault, own.law, own.speed, own.told);
    assert!(hits.is_empty(), "{:?}", hits.iter().map(words).collect::<Vec<_>>());
    assert!(outcomes.iter().filter(|own| own.class == Class::Safe).count() >= 36);
    assert!(outcomes.iter().all(|own| own.early == 0), "an alarm before the fault");
    let told = (0..20).map(|member| healthy(1, member)).find(|own| own.early > 0 || own.class != Class::Safe);
    assert!(told.is_none(), "without a fault: {told:?}");
    let alone = (0..20).filter(|&member| is_lost_alone(1, member)).count();
    assert!(alone > 0, "without a supervisor they do");
}
