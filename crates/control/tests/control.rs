//! References, the spool's twin, the observer, and what every law must do.

use approx::assert_abs_diff_eq;
use control::spool::Spool;
use control::{
    Arrangement, COEFFICIENTS, ConstantGas, Controller, Coupled, Course, Efforts, LAWS, Law, Model, Move,
    Noise, Observer, Piece, Plant, Reference, Sample, Side, Slip, State, Tick, Valve, Wanted, blend, demand,
    export, least_factor, sugeno,
};
use physics::flow::{Iso6358, LINEAR_ABOVE};
use physics::friction::{AnyLaw, Choices, Contact};
use physics::{Gas, IdealGas};
use std::f64::consts::{PI, TAU};

const STROKE: f64 = 0.5;
const MIDDLE: f64 = 0.5 * STROKE;
const PERIOD: f64 = 1e-3;
const PRESSURE: f64 = 4e5;

/// A rodless drive, the same in both directions.
fn drive() -> Model {
    let gas = IdealGas::air();
    let area = 0.25 * PI * 0.025 * 0.025;
    let side = |length: f64, sign: f64| Side {
        area,
        perimeter: PI * 0.025,
        end_wall: 2.0 * area,
        dead_volume: 1e-5,
        length,
        sign,
    };
    let values = [
        ("coulomb", 30.0),
        ("breakaway", 45.0),
        ("stribeck_velocity", 0.02),
        ("stribeck_exponent", 2.0),
        ("viscous", 40.0),
        ("bristle_stiffness", 1e5),
        ("bristle_damping", 300.0),
    ];
    let value = |key: &str| values.iter().find(|own| own.0 == key).map_or(f64::INFINITY, |own| own.1);
    let law = AnyLaw::build("lugre", &mut |parameter| value(parameter.key), &Choices::default());
    Model {
        ambient: ConstantGas { pressure: 101_325.0, temperature: 293.15 },
        supply: ConstantGas { pressure: 7e5, temperature: 293.15 },
        sides: [side(0.0, 1.0), side(STROKE, -1.0)],
        stroke: STROKE,
        mass: 2.0,
        load: 0.0,
        heat_transfer: 30.0,
        wall_temperature: 293.15,
        valve: Valve {
            arrangement: Arrangement::One,
            flow: Iso6358::for_gas(2e-8, 0.3, 0.5, LINEAR_ABOVE, true, &gas, true),
            angular_frequency: TAU * 100.0,
            damping_ratio: 0.7,
            delay: 1e-3,
            overlap: 0.02,
            leakage: 0.003,
            leakage_width: 0.05,
        },
        friction: Contact::from(law.expect("a law of that name")),
        stick_stiffness: 1e5,
        slip: Slip::Always,
        friction_shares: [1.0; 2],
        stick_damping_time: 3e-3,
        gas: Gas::from(&gas),
    }
}

#[test]
fn a_blend_has_its_published_extremes_and_each_derivative_is_the_slope_of_the_one_before() {
    let step = 1e-6;
    let mut most = [0.0_f64; 4];
    for i in 1..1000 {
        let t = f64::from(i) * 1e-3;
        let (at, above, below) = (blend(t), blend(t + step), blend(t - step));
        for k in 0..3 {
            assert_abs_diff_eq!((above[k] - below[k]) / (2.0 * step), at[k + 1], epsilon = 1e-4);
        }
        most = [0, 1, 2, 3].map(|k| most[k].max(at[k].abs()));
    }
    for (own, published) in most.iter().zip([1.0, 2.1875, 7.5132, 52.5]) {
        assert_abs_diff_eq!(*own, published, epsilon = 1e-4 * published);
    }
}

#[test]
fn derivatives_of_references_are_their_slopes() {
    let moves =
        vec![Move { begin: 0.1, duration: 0.3, to: 0.3 }, Move { begin: 0.5, duration: 0.2, to: 0.2 }];
    let sine = Reference::Sine { centre: 0.25, amplitude: 0.06, frequency: 1.0 };
    // A blend of order 9, and constant velocity behind it.
    let mut piece = Piece { begin: 0.1, duration: 0.4, coefficients: [0.0; COEFFICIENTS] };
    for (own, number) in
        piece.coefficients.iter_mut().zip([0.2, 0.0, 0.0, 0.0, 0.0, 12.6, -42.0, 54.0, -31.5, 7.0])
    {
        *own = number;
    }
    let mut straight = Piece { begin: 0.8, duration: 0.7, coefficients: [0.0; COEFFICIENTS] };
    straight.coefficients[..2].copy_from_slice(&[0.3, 0.1]);
    let pieces = Reference::Pieces { start: 0.2, pieces: vec![piece, straight], efforts: None };
    assert!(pieces.stands(0.6, 0.1) && !pieces.stands(0.3, 0.01) && !pieces.stands(0.6, 0.3));
    assert_abs_diff_eq!(pieces.at(9.0).position, 0.4, epsilon = 1e-12);
    for reference in [Reference::Moves { start: 0.22, moves }, sine, pieces] {
        let row = |w: Wanted| [w.position, w.velocity, w.acceleration, w.jerk];
        for i in 1..200 {
            let t = f64::from(i) * 0.0101;
            let step = 1e-6;
            let (at, above, below) =
                (row(reference.at(t)), row(reference.at(t + step)), row(reference.at(t - step)));
            for k in 0..3 {
                let slope = (above[k] - below[k]) / (2.0 * step);
                assert!(
                    (slope - at[k + 1]).abs() <= 1e-3 * (1.0 + at[k + 1].abs()),
                    "{reference:?} at {t} s"
                );
            }
        }
    }
}

/// A reference without rows of efforts has none, at any time.
#[test]
fn efforts_without_rows_are_those_of_the_model() {
    let efforts = Some(Efforts { period: 0.1, rows: vec![], others: vec![] });
    let reference = Reference::Pieces { start: 0.2, pieces: vec![], efforts };
    assert!(reference.effort(0.3).is_none() && reference.others(0.3).is_empty());
}

/// What a reference takes: opening and speed grow with the speed, and slowed by the factor that is found it takes the
/// share that was asked for.
/// Pressures of rest bear the load, and differ from the mean of supply and ambient by equal forces on both pistons.
#[test]
fn rest_pressures_bear_the_load_about_the_mean_of_supply_and_ambient() {
    for (load, rod) in [(0.0, 1.0), (-120.0, 1.0), (60.0, 0.8)] {
        let mut model = drive();
        model.load = load;
        model.sides[1].area *= rod;
        let pressures = model.rest_pressures();
        assert_abs_diff_eq!(model.gas_force(pressures) + load, 0.0, epsilon = 1e-9);
        let mean = 0.5 * (7e5 + 101_325.0);
        let [a, b] = [0, 1].map(|i| (pressures[i] - mean) * model.sides[i].area);
        assert_abs_diff_eq!(a, -b, epsilon = 1e-9);
    }
}

#[test]
fn a_reference_is_slowed_until_its_drive_can_follow() {
    let model = drive();
    let plant = control::Plant::of(&model, MIDDLE, [PRESSURE; 2], PERIOD);
    let mut on = |_| false;
    let slow = Reference::Sine { centre: MIDDLE, amplitude: 0.06, frequency: 0.5 };
    let took = demand(&model, &slow, 6.0, 1.0, &mut on);
    assert!(took.opening > PI * 0.06 / plant.speed && took.opening < 0.2, "{took:?}");
    // Of 293 N friction takes up to 45 N, less while it slides.
    assert!((0.12..0.2).contains(&took.force), "{took:?}");
    let fast = vec![Move { begin: 0.1, duration: 0.1, to: 0.4 }];
    let reference = Reference::Moves { start: 0.1, moves: fast };
    assert!(demand(&model, &reference, 0.4, 1.0, &mut on).most() > 1.0);
    let factor = least_factor(&model, &reference, 0.4, 0.85, &mut on).expect("slow enough");
    assert!(factor > 2.0 && demand(&model, &reference, 0.4, factor, &mut on).most() <= 0.85, "{factor}");
    assert!(demand(&model, &reference, 0.4, 0.99 * factor, &mut on).most() > 0.85);
    // A move that is over within a step of the others is not overlooked.
    let sudden =
        Reference::Moves { start: 0.1, moves: vec![Move { begin: 0.1, duration: 0.8e-3, to: 0.101 }] };
    assert!(demand(&model, &sudden, 0.4, 1.0, &mut on).most() > 1.0);
    // However slow, friction is to be overcome.
    let mut force = |frequency: f64| {
        let sine = Reference::Sine { centre: MIDDLE, amplitude: 0.06, frequency };
        demand(&model, &sine, 1.0 / frequency, 1.0, &mut on).force
    };
    assert_abs_diff_eq!(force(0.0001), force(0.001), epsilon = 0.01);
    assert_abs_diff_eq!(
        reference.slowed(0.5, 2.0).velocity,
        0.5 * reference.at(0.25).velocity,
        epsilon = 1e-12
    );
}

/// The spool against x'' = w^2 (u - x) - 2 d w x', followed in steps of a microsecond.
#[test]
fn the_twin_of_a_spool_solves_its_equation_behind_the_dead_time() {
    for damping_ratio in [0.3, 1.0, 2.5] {
        let valve = Valve { damping_ratio, ..drive().valve };
        let mut twin = Spool::new(&valve);
        let (mut x, mut v, mut acts) = (0.0_f64, 0.0_f64, 0.0);
        twin.command(0.0013, 0.4);
        twin.command(0.0047, -0.2);
        let h = 1e-7;
        for i in 0..100_000_u32 {
            let t = f64::from(i) * h;
            for (from, value) in [(0.0013, 0.4), (0.0047, -0.2)] {
                if t >= from - 0.5 * h {
                    acts = value;
                }
            }
            let w = valve.angular_frequency;
            v += h * (w * w * (acts - x) - 2.0 * damping_ratio * w * v);
            x += h * v;
        }
        (0..10).for_each(|ms| twin.advance(f64::from(ms) * 1e-3, f64::from(ms + 1) * 1e-3));
        assert_abs_diff_eq!(twin.position(), x, epsilon = 1e-4);
    }
}

/// A drive of the model itself, sliding, under a force that the observer is not told.
#[test]
fn an_observer_finds_a_force_that_it_is_not_told() {
    let model = drive();
    let sample = |t: f64, position: f64| Sample { time: t, position, pressures: Some([PRESSURE; 2]) };
    let noise = Noise { disturbance: 15.0, position: 2e-6 };
    let mut observer = Observer::new(&model, &sample(0.0, 0.1), PERIOD, noise);
    // 40 N drive it against 30 N of Coulomb and 40 N s/m of viscous friction: it comes to 0.25 m/s.
    let (mut x, mut v, force) = (0.1, 0.2, 40.0);
    for i in 1..=300 {
        for _ in 0..100 {
            v += 1e-5 * (force - 30.0 - 40.0 * v) / model.mass;
            x += 1e-5 * v;
        }
        observer.update(&model, &sample(f64::from(i) * PERIOD, x));
    }
    assert_abs_diff_eq!(observer.state.disturbance, force, epsilon = 0.5);
    assert_abs_diff_eq!(observer.state.velocity, v, epsilon = 1e-3);
}

/// Commands of a law for samples, each seen by the same law from the other end of the drive, too.
fn both_ways(
    key: &str,
    samples: &[(f64, [f64; 2])],
    reference: &Reference,
    mirrored: &Reference,
) -> Vec<[f64; 2]> {
    let model = drive();
    let tuned = || Controller::tuned(key, &model, PERIOD, 2e-6).expect("a law of that name");
    let (mut one, mut other) = (tuned(), tuned());
    let each = samples.iter().enumerate().map(|(tick, &(position, [a, b]))| {
        let time = tick as f64 * PERIOD;
        let seen = Sample { time, position, pressures: Some([a, b]) };
        let turned = Sample { time, position: STROKE - position, pressures: Some([b, a]) };
        [one.step(&seen, reference).command, other.step(&turned, mirrored).command]
    });
    each.collect()
}

fn sine(sign: f64) -> Reference {
    Reference::Sine { centre: MIDDLE, amplitude: sign * 0.06, frequency: 2.0 }
}

/// In every cell whose four rules lie within the seven sets the rules are a sum; elsewhere they saturate.
#[test]
fn fuzzy_rules_are_linear_where_they_must_be() {
    for i in -60..=60 {
        for j in -60..=60 {
            let [e, de] = [i, j].map(|own| f64::from(own) / 60.0);
            let corners = |x: f64| [(3.0 * x).floor().min(2.0), (3.0 * x).floor().min(2.0) + 1.0];
            let is_linear = corners(e).iter().all(|i| corners(de).iter().all(|j| (i + j).abs() <= 3.0));
            let phi = sugeno(e, de);
            if is_linear {
                assert_abs_diff_eq!(phi, e + de, epsilon = 1e-12);
            }
            assert!(phi.abs() <= 1.0 && (phi - (e + de)).abs() <= 1.0 + 1e-12, "{e} {de}: {phi}");
            assert_abs_diff_eq!(phi, -sugeno(-e, -de), epsilon = 1e-12);
        }
    }
    assert_eq!([sugeno(1.0, 1.0), sugeno(-5.0, -5.0), sugeno(1.0, -1.0)], [1.0, -1.0, 0.0]);
}

#[test]
fn every_law_does_nothing_where_nothing_is_wanted() {
    let stands = Reference::Moves { start: MIDDLE, moves: vec![] };
    for key in LAWS {
        let commands = both_ways(key, &[(MIDDLE, [PRESSURE; 2]); 200], &stands, &stands);
        let most = commands.iter().flatten().fold(0.0_f64, |most, u| most.max(u.abs()));
        assert!(most < 1e-9, "{key} commands {most} at rest where it is to be");
    }
}

#[test]
fn every_law_is_odd() {
    // A drive that follows poorly, with pressures that differ.
    let samples: Vec<_> = (0..500)
        .map(|i| {
            let t = f64::from(i) * PERIOD;
            let lean = 2e4 * (7.0 * t).sin();
            (
                MIDDLE + 0.055 * (TAU * 2.0 * (t - 0.005)).sin() * (2.0 * t).min(1.0),
                [PRESSURE + lean, PRESSURE - lean],
            )
        })
        .collect();
    for key in LAWS {
        let commands = both_ways(key, &samples, &sine(1.0), &sine(-1.0));
        let most = commands.iter().fold(0.0_f64, |most, [one, other]| most.max((one + other).abs()));
        let moves = commands.iter().any(|[one, _]| one.abs() > 0.05);
        assert!(moves && most < 1e-6, "{key}: the mirrored drive gets another command, by {most}");
    }
}

/// Axes that do not touch each other need m a. A load of other axes is part of the state, not of the force that is asked for.
#[test]
fn inversion_is_that_of_a_single_axis_where_axes_do_not_touch() {
    let (alone, load) = (drive(), 15.0);
    let loaded = Model { load, ..alone.clone() };
    let plant = Plant::of(&alone, MIDDLE, [PRESSURE; 2], PERIOD);
    let (reference, spool) = (sine(1.0), Spool::new(&alone.valve));
    let state = State {
        position: MIDDLE - 5e-4,
        velocity: -5e-3,
        disturbance: -0.5,
        pressures: [PRESSURE, 0.99 * PRESSURE],
        temperatures: [293.15; 2],
        ..State::default()
    };
    let asked = |model: &Model, coupled: Option<Coupled>| {
        let mut law = control::AnyLaw::tuned("inversion", model, &plant).expect("a law");
        let wanted = Wanted { position: MIDDLE, ..Wanted::default() };
        let tick = Tick {
            model,
            plant: &plant,
            period: PERIOD,
            state,
            acceleration: model.acceleration(&state),
            wanted,
            friction: [0.0; 2],
            now: (state.position, wanted),
            acts: 0.0,
            spool: &spool,
            preview: &Course::from(&reference),
            coupled,
        };
        (law.step(&tick), law.feedback(&tick).map(|own| own * model.mass))
    };
    let (opening, feedback) = asked(&alone, None);
    let coupled = |share: f64| Coupled { loads: [load; 2], feedback: feedback.map(|own| share * own) };
    assert!(opening.abs() < 0.5 && feedback.iter().all(|own| *own > 1.0), "{opening} {feedback:?}");
    assert_abs_diff_eq!(asked(&loaded, Some(coupled(1.0))).0, opening, epsilon = 1e-12);
    assert!(asked(&loaded, Some(coupled(2.0))).0 > opening + 0.01, "a heavier body needs more force");
}

/// The exported work of a law, its observer and its checks, on the samples of a drive that follows poorly and then rests: the
/// bits of its controller.
#[test]
fn an_exported_law_gives_the_bits_of_its_controller() {
    // Times that have no rounding: a step of the controller lasts the difference of two times.
    let period = 1.0 / 1024.0;
    let (mut model, moves) = (drive(), vec![Move { begin: 0.02, duration: 0.1, to: MIDDLE + 0.01 }]);
    model.valve.delay = period;
    let reference = Reference::Moves { start: MIDDLE, moves };
    for &key in LAWS {
        let mut law = Controller::tuned(key, &model, period, 2e-6).expect("a law of that name");
        law.adaptation = None;
        law.supervisor = None; // Exported code has its own checks.
        law.plant.lag = 3.75 * period;
        let Ok(program) = export::program(&law, true) else {
            assert_eq!(key, "nmpc");
            continue;
        };
        let mut own = program.remembered();
        const STRONG: u32 = 280;
        let (mut holds, mut moves) = (false, false);
        for tick in 0..300_u32 {
            let time = f64::from(tick) * period;
            let (now, then) = (reference.at(time), reference.at(time + program.ahead));
            let late = reference.at(time - 2e-3);
            // A force that no held drive can have: three times the breakaway friction.
            let force = if tick < STRONG { 0.0 } else { 2e5 };
            let (position, lean) =
                (late.position + 1e-6 * f64::from(tick % 3), 2e3 * late.acceleration + force);
            let sample = Sample { time, position, pressures: Some([PRESSURE + lean, PRESSURE - lean]) };
            let answer = law.step(&sample, &reference);
            let stands = f64::from(u8::from(reference.stands(time, law.plant.lag)));
            let wanted = |own: Wanted| [own.position, own.velocity, own.acceleration, own.jerk];
            let given = [
                &[position, PRESSURE + lean, PRESSURE - lean][..],
                &wanted(now),
                &wanted(then),
                &[stands, 1.0],
            ];
            let results = program.step(&mut own, &given.concat());
            let holding = f64::from(u8::from(answer.holds));
            let expected = [answer.command, answer.velocity, answer.disturbance, holding, 0.0];
            assert_eq!(results, expected, "{key}, sample {tick}");
            (holds, moves) = (holds || answer.holds, moves || answer.command.abs() > 0.05);
            assert!(tick != STRONG - 1 || answer.holds, "{key} holds before the force");
            assert!(tick < STRONG + 2 || !answer.holds, "{key} holds against the force, sample {tick}");
        }
        assert!(holds && moves, "{key}");
    }
    let wanted = export::along_a_move().run(&[MIDDLE, MIDDLE + 0.01, 0.02, 0.1, 0.05]);
    let exact = reference.at(0.05);
    assert_eq!(wanted, [exact.position, exact.velocity, exact.acceleration, exact.jerk]);
}

/// A drive with twice the friction along a sine: a controller that was disabled for a sample, at standstill, commands
/// what one commands that never was, and not what a new one does.
#[test]
fn an_exported_law_keeps_learned_values_while_it_is_disabled() {
    let (model, reference) = (drive(), sine(1.0));
    let law = Controller::tuned("inversion", &model, PERIOD, 2e-6).expect("a law of that name");
    let program = export::program(&law, true).expect("code");
    let mut own = [(); 3].map(|()| program.remembered());
    // Sums of deviations from the commands of the one that never was.
    let [mut kept, mut fresh] = [0.0; 2];
    // A sine stands still at quarters of its period.
    const OFF: u32 = 4125;
    for tick in 0..OFF + 1000 {
        let time = f64::from(tick) * PERIOD;
        let (now, then) = (reference.at(time), reference.at(time + program.ahead));
        let force = model.mass * now.acceleration + 60.0 * (now.velocity / 1e-3).tanh() + 40.0 * now.velocity;
        let lean = 0.5 * force / model.sides[0].area;
        let wanted = |own: Wanted| [own.position, own.velocity, own.acceleration, own.jerk];
        let measured = [now.position, PRESSURE + lean, PRESSURE - lean];
        let mut command = |number: usize, enabled: bool| {
            let flags = [0.0, f64::from(u8::from(enabled))];
            let given = [&measured[..], &wanted(now), &wanted(then), &flags].concat();
            program.step(&mut own[number], &given)[0]
        };
        let [steady, again, new] = [command(0, true), command(1, tick != OFF), command(2, tick > OFF)];
        // Both observers need a while to find the velocity.
        if tick > OFF + 100 {
            kept += (again - steady).abs();
            fresh += (new - steady).abs();
        }
    }
    assert!(fresh > 10.0 && kept < 0.2 * fresh, "kept {kept}, fresh {fresh}");
}

/// Checks of exported code: two lost readings are predicted, a reference that jumps ends in a stop ramp, a lost sensor shuts the
/// valve until the drive is disabled and enabled again.
#[test]
fn exported_code_checks_its_sensors_and_its_reference() {
    let law = Controller::tuned("inversion", &drive(), PERIOD, 2e-6).expect("a law of that name");
    let program = export::program(&law, true).expect("code");
    let mut own = program.remembered();
    let mut at = |position: f64, pressure: f64, [x, v]: [f64; 2], enabled: f64| {
        let wanted = [x, v, 0.0, 0.0];
        let then = [x + v * program.ahead, v, 0.0, 0.0];
        let given =
            [&[position, pressure, PRESSURE][..], &wanted, &then, &[f64::from(u8::from(v == 0.0)), enabled]];
        let results = program.step(&mut own, &given.concat());
        assert!(results.iter().all(|own| own.is_finite()) && results[0].abs() <= 1.0, "{results:?}");
        (results[0], results[4])
    };
    assert_eq!(at(f64::NAN, f64::NAN, [f64::NAN; 2], 0.0), (0.0, 1.0));
    let place = |k: i32| MIDDLE + 0.2 * PERIOD * f64::from(k);
    for k in 0..100 {
        let position = if (50..52).contains(&k) { f64::INFINITY } else { place(k) };
        let pressure = if (60..62).contains(&k) { -1.0 } else { PRESSURE };
        assert_eq!(at(position, pressure, [place(k), 0.2], 1.0).1, 0.0, "sample {k}");
    }
    // A reference that jumps: the drive comes to rest ahead, and the reference is not followed any more.
    assert_eq!(at(place(100), PRESSURE, [place(100) + 0.01, 0.2], 1.0).1, 4.0);
    assert_eq!(at(place(101), PRESSURE, [place(101), 0.2], 1.0).1, 4.0);
    // Three readings that the drive cannot have reached.
    let found: Vec<_> = (0..3).map(|_| at(place(102) + 0.02, PRESSURE, [MIDDLE, 0.0], 1.0)).collect();
    assert_eq!([found[1].1, found[2].1], [4.0, 2.0]);
    assert_eq!(found[2].0, 0.0);
    assert_eq!(at(MIDDLE, PRESSURE, [MIDDLE, 0.0], 1.0), (0.0, 2.0));
    assert_eq!(at(MIDDLE, PRESSURE, [MIDDLE, 0.0], 0.0), (0.0, 1.0));
    assert_eq!(at(MIDDLE, PRESSURE, [MIDDLE, 0.0], 1.0).1, 0.0);
    let found: Vec<_> = (0..3).map(|_| at(MIDDLE, f64::NAN, [MIDDLE, 0.0], 1.0).1).collect();
    assert_eq!(found, [0.0, 0.0, 3.0]);
    // A drive far from its reference stays where it is.
    at(MIDDLE, PRESSURE, [MIDDLE, 0.0], 0.0);
    assert_eq!(at(MIDDLE, PRESSURE, [MIDDLE + 0.01, 0.0], 1.0).1, 4.0);
}

#[test]
fn every_law_gives_a_command_for_any_sample() {
    let mut state = 1_u64;
    let mut random = || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 11) as f64 / (1_u64 << 53) as f64
    };
    let samples: Vec<_> =
        (0..2000).map(|_| (STROKE * random(), [0, 1].map(|_| 2e4 + 9e5 * random()))).collect();
    for key in LAWS {
        let commands = both_ways(key, &samples, &sine(1.0), &sine(-1.0));
        assert!(commands.iter().flatten().all(|u| u.is_finite() && u.abs() <= 1.0), "{key}");
    }
}

/// A command that acts halfway between two samples, by times that are rounded: halfway the spool is where it was.
#[test]
fn a_spool_without_a_lag_does_not_go_by_the_rounding_of_times() {
    let model = drive();
    let mut spool = Spool::new(&Valve { angular_frequency: f64::INFINITY, ..model.valve });
    let delay = 2.5 * PERIOD;
    for k in 0..2000_u32 {
        let t = f64::from(k) * PERIOD;
        let mut halfway = spool.clone();
        halfway.advance(t - PERIOD, 0.5 * (t - PERIOD + t));
        assert_eq!(halfway.position(), f64::from(k.saturating_sub(4)) / 2048.0, "sample {k}");
        spool.advance(t - PERIOD, t);
        spool.command(t + delay, f64::from(k) / 2048.0);
    }
}

/// Holding survives an error of 2 bands and ends at 3 bands, whereas it begins only within one band.
#[test]
fn holding_has_a_hysteresis_of_the_error() {
    let model = drive();
    let reference = Reference::Moves { start: MIDDLE, moves: vec![] };
    for (key, pressed) in LAWS.iter().flat_map(|key| [(key, 1.0), (key, -1.0)]) {
        let mut law = Controller::tuned(key, &model, PERIOD, 2e-6).expect("a law of that name");
        (law.adaptation, law.supervisor) = (None, None);
        let band = law.hold.as_ref().expect("it holds by default").band;
        let mut tick = 0;
        let mut holds = |error: f64| {
            let last = (0..100).map(|_| {
                tick += 1;
                let time = f64::from(tick) * PERIOD;
                let position = MIDDLE + pressed * error * band;
                law.step(&Sample { time, position, pressures: Some([PRESSURE; 2]) }, &reference).holds
            });
            last.last().expect("samples")
        };
        let course = [2.0, 0.5, 2.0, 3.0, 2.0, 0.5].map(&mut holds);
        assert_eq!(course, [false, true, true, false, false, true], "{key} {pressed}");
    }
}
