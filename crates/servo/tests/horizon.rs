//! The horizon of predictive control by the circuit that is believed in, with derivatives by all moves: beside the fixed
//! steps of the model, beside differences of a session under commands, and in the loop.

mod axis;

use axis::{MEAN, PERIOD, STICKY, axis, begin_choosing, behind_tubes, rubbing, session, setup};
use circuit::Look;
use circuit::specification::Circuit;
use control::nmpc::{ByMoves, MOVES, by_the_model, steps};
use control::spool::Spool;
use control::{Course, Model, Move, Plant, Predictor, Reference, State, Tick};
use servo::{ByCircuit, belief};

/// What a drive does when a horizon begins.
struct Moment {
    name: &'static str,
    velocity: f64,
    pressures: [f64; 2],
    /// Share of the friction's level that the contact carries.
    friction: f64,
    opening: f64,
}

const REST: Moment =
    Moment { name: "at rest", velocity: 0.0, pressures: [MEAN; 2], friction: 0.0, opening: 0.0 };
const MOMENTS: [Moment; 4] = [
    REST,
    Moment { name: "slow", velocity: 0.05, pressures: [4.3e5, 3.5e5], friction: 1.0, opening: 0.05 },
    Moment { name: "moving", velocity: 0.5, pressures: [4.5e5, 3.5e5], friction: 1.0, opening: 0.15 },
    Moment { name: "back", velocity: -0.3, pressures: [3.5e5, 4.2e5], friction: -1.0, opening: -0.1 },
];

const PLANS: [[f64; MOVES]; 3] = [
    [0.3; MOVES],
    [-0.4, -0.4, -0.3, -0.3, -0.2, -0.2, -0.1, -0.05],
    [0.5, 0.5, 0.4, 0.3, 0.2, 0.1, -0.2, -0.4],
];
const START: f64 = 0.2;
/// Speed, m/s, below which it may turn around.
const SLOW: f64 = 0.02;

fn upright() -> Circuit {
    let mut plant = axis();
    for own in plant.components.iter_mut().filter(|own| own.name == "cylinder") {
        own.numbers.insert("incline".into(), std::f64::consts::FRAC_PI_2);
    }
    plant
}

fn seeded(plan: [f64; MOVES]) -> [ByMoves; MOVES] {
    std::array::from_fn(|i| ByMoves::variable(plan[i], i))
}

/// A tick at a moment.
fn at<T>(model: &Model, moment: &Moment, then: impl FnOnce(&Tick) -> T) -> T {
    let reference = Reference::Moves { start: START, moves: vec![] };
    let mut spool = Spool::new(&model.valve);
    spool.command(-0.1, model.command_for(moment.opening));
    spool.advance(-0.1, 0.0);
    let level = model.friction_levels([START, moment.velocity], moment.pressures)[0];
    let state = State {
        position: START,
        velocity: moment.velocity,
        disturbance: 0.0,
        friction: moment.friction * level,
        pressures: moment.pressures,
        temperatures: [293.15; 2],
    };
    let standing = reference.at(0.0);
    then(&Tick {
        model,
        plant: &Plant::of(model, 0.25, [MEAN; 2], PERIOD),
        period: PERIOD,
        state,
        acceleration: state.acceleration(model),
        wanted: standing,
        friction: [0.0; 2],
        now: (START, standing),
        acts: 0.0,
        spool: &spool,
        preview: &Course::from(&reference),
    })
}

/// Neither is made of the other. Positions over the horizon within 1 % of the way, and within 0.2 % where the drive goes
/// on; slopes of its end by each move within 1 % of the largest one there, and 15 % where it breaks away or turns around.
#[test]
fn circuit_and_model_foresee_the_same() {
    let drives = [
        ("lugre", axis()),
        ("upright", upright()),
        ("light and sticky", rubbing(0.7, "elasto-plastic", &STICKY)),
        ("heavy and sticky", rubbing(4.7, "elasto-plastic", &STICKY)),
    ];
    let mut went_on = 0;
    for (drive, plant) in drives {
        let (model, names) = belief(&plant).expect("a belief");
        let mut circuit = ByCircuit::new(&plant, &names, &model).expect("a predictor");
        for moment in &MOMENTS {
            for plan in PLANS {
                let (fixed, own, plain) = at(&model, moment, |tick| {
                    let (mut own, mut plain) = (Vec::new(), Vec::new());
                    circuit.begin(tick, 0.0);
                    assert!(circuit.derivatives(&seeded(plan), &mut |seen| own.push(seen)));
                    assert!(circuit.values(&plan, &mut |seen| plain.push(seen)));
                    (by_the_model(tick, &seeded(plan)), own, plain)
                });
                assert_eq!(own.len(), steps().count());
                // The Jacobian without derivatives is that of the very state, inputs and modes.
                let bits = |row: [f64; 3]| row.map(f64::to_bits);
                assert!(own.iter().zip(plain).all(|(own, plain)| bits(own.map(|own| own.re)) == bits(plain)));
                let places = || [START].into_iter().chain(own.iter().map(|own| own[0].re));
                let way: f64 = places().zip(places().skip(1)).map(|(one, other)| (one - other).abs()).sum();
                let far = own.iter().zip(&fixed).map(|(own, other)| (own[0].re - other[0].re).abs());
                let far = far.fold(0.0, f64::max) / way;
                let [end, other] = [&own, &fixed].map(|each| each[each.len() - 1][0].eps);
                let most =
                    |of: &mut dyn Iterator<Item = f64>| of.fold(0.0, |most: f64, own| most.max(own.abs()));
                let off = most(&mut end.iter().zip(other).map(|(own, other)| own - other));
                let off = off / most(&mut end.into_iter());
                let goes_on =
                    own.iter().all(|own| own[1].re * moment.velocity > SLOW * moment.velocity.abs());
                let what = format!("{drive}, {}, {}: {far} of {way} m, slopes {off}", moment.name, plan[0]);
                assert!(!goes_on || far < 0.002 && off < 0.01, "{what}");
                assert!(far < 0.01 && off < 0.15, "{what}");
                went_on += u32::from(goes_on);
            }
        }
    }
    assert!(went_on >= 16, "{went_on} of 48 go on");
}

/// Through rest the sign of a motion is steeper than a step can follow: slopes doubled at each, up to 1e12 m, where a
/// contact slips slowly at its level.
#[test]
fn slopes_of_a_contact_that_slips_slowly_are_bounded() {
    const NEAR: f64 = 0.95;
    for mass in [0.7, 4.7, 40.0] {
        let (model, _) = belief(&rubbing(mass, "stribeck", &STICKY[..4])).expect("a belief");
        for (speed, way) in [1e-5, 5e-5, 2e-4, 5e-4, 1e-3].into_iter().flat_map(|v| [(v, 1.0), (v, -1.0)]) {
            let level = model.friction_levels([START, speed], [MEAN; 2])[0];
            let half = way * 0.5 * NEAR * level / model.sides[0].area;
            let pressures = [MEAN + half, MEAN - half];
            let moment = Moment {
                name: "slips",
                velocity: way * speed,
                pressures,
                friction: way * NEAR,
                opening: 0.0,
            };
            let seen = at(&model, &moment, |tick| by_the_model(tick, &seeded([way * 1e-3; MOVES])));
            let slope =
                seen.iter().flat_map(|own| own[0].eps).fold(0.0, |most: f64, own| most.max(own.abs()));
            assert!(slope < 1.0, "{mass} kg at {} m/s: {slope} m", way * speed);
        }
    }
}

/// The end of the horizon by a session of the circuit, its valve without overlap and dead time, from rest under the plan.
fn end_of(plant: &Circuit, plan: [f64; MOVES]) -> f64 {
    let mut session = session(plant, START);
    let place = |name: &str, all: Vec<&str>| all.iter().position(|own| *own == name).expect("a name");
    let command = place("valve.command", session.inputs().iter().map(|own| &*own.name).collect());
    let column = place("cylinder.position_m", session.columns().iter().map(|own| &**own).collect());
    let (mut t, mut never) = (0.0, |_| false);
    for (block, h) in steps() {
        session.set(command, plan[block]).expect("within bounds");
        t += h;
        session.go_on(t, &mut Look::new(&mut never)).expect("it runs");
    }
    session.now(column)
}

/// Also of a drive behind tubes, of which the model knows nothing.
#[test]
fn slopes_by_moves_are_differences_of_a_session() {
    for (drive, believed) in [("lugre", axis()), ("tubes", behind_tubes())] {
        let mut plant = believed.clone();
        for own in &mut plant.components {
            own.numbers.retain(|key, _| !["delay", "hysteresis", "overlap"].contains(&key.as_str()));
        }
        let (model, names) = belief(&believed).expect("a belief");
        let mut circuit = ByCircuit::new(&believed, &names, &model).expect("a predictor");
        let plan = [0.5, 0.5, 0.4, 0.4, 0.3, 0.3, 0.2, 0.15];
        let mut end = START.into();
        at(&model, &REST, |tick| {
            circuit.begin(tick, 0.0);
            assert!(circuit.derivatives(&seeded(plan), &mut |[x, ..]| end = x));
        });
        let exact = end_of(&plant, plan);
        assert!((exact - end.re).abs() < 1e-3 * (exact - START), "{drive}: {exact} m, {} m", end.re);
        for i in 0..MOVES {
            let moved = |by: f64| {
                let mut plan = plan;
                plan[i] += by;
                end_of(&plant, plan)
            };
            let slope = (moved(0.02) - moved(-0.02)) / 0.04;
            assert!((slope - end.eps[i]).abs() < 2e-3 * slope, "{drive}, move {i}: {slope}, {}", end.eps[i]);
        }
    }
}

/// Largest error, mm, from a time on, s.
fn largest(plant: &Circuit, predictor: &str, reference: &Reference, (from, to): (f64, f64)) -> f64 {
    let (mut under, mut controller) =
        begin_choosing(plant.clone(), plant, ("nmpc", None), &[("predictor", predictor)], &setup(1), 0.25);
    let mut never = |_| false;
    let rows = under.run(&mut controller, reference, to, &mut Look::new(&mut never)).expect("it runs");
    let late = rows.iter().filter(|row| row[0] >= from);
    late.map(|row| (row[5] - row[1]).abs()).fold(0.0, f64::max) * 1e3
}

/// It knows the flow through tubes of 2 m, which fast moves need; of them the model has the volume alone.
#[test]
fn a_plan_by_the_circuit_leads_a_drive() {
    let sine = Reference::Sine { centre: 0.25, amplitude: 0.06, frequency: 1.0 };
    let known = largest(&axis(), "circuit", &sine, (1.0, 2.0));
    assert!(known < 0.12, "{known} mm");
    let moves = [(0.2, 0.4), (1.2, 0.1)].map(|(begin, to)| Move { begin, duration: 0.5, to });
    let fast = Reference::Moves { start: 0.25, moves: moves.into() };
    let [model, circuit] = ["model", "circuit"].map(|own| largest(&behind_tubes(), own, &fast, (0.2, 1.9)));
    assert!(circuit < 0.7 * model, "{circuit} mm; by the model {model} mm");
}

/// Damping of the contact that would stop the mass within a fraction of a step of the model.
#[test]
fn a_stiff_damper_leads_no_law_astray() {
    let mut plant = axis();
    for friction in plant.components.iter_mut().filter_map(|own| own.friction.as_mut()) {
        friction.parameters.insert("bristle_damping".into(), 8000.0);
    }
    let moves = [(0.2, 0.4), (1.2, 0.1)].map(|(begin, to)| Move { begin, duration: 0.5, to });
    let fast = Reference::Moves { start: 0.25, moves: moves.into() };
    let error = largest(&plant, "model", &fast, (0.2, 1.9));
    assert!(error < 10.0, "{error} mm");
}
