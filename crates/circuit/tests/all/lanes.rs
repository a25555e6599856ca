//! Several drives side by side give the bits that each gives alone: states at every sample, events,
//! numbers of steps. Four different drives under four different commands.

use crate::support::drive::{self, Drive};
use crate::support::{at_rest, everything, pinned, reference, reference_stribeck};
use circuit::{Circuit, Error, Look, advance};
use math::{Lane, Lanes};
use ode::{NoOutput, Options, Output, Paused, Statistics, Stepper};

type L = Lanes<4>;

/// Samples of each lane.
struct LaneTrace {
    times: Vec<f64>,
    states: Vec<Vec<Vec<u64>>>,
}

impl<R: Lane> Output<R, Circuit<R>> for LaneTrace {
    fn due(&self, lane: usize) -> f64 {
        self.times.get(self.states[lane].len()).copied().unwrap_or(f64::INFINITY)
    }
    fn sample(&mut self, lane: usize, _t: f64, y: &[R], _system: &Circuit<R>) {
        self.states[lane].push(y.iter().map(|y| y.get(lane).to_bits()).collect());
    }
}

/// Two seconds in segments of 0.25 s: lane `l` takes the commands `commands[l]`.
fn run<R: Lane>(drives: &[Drive], x0: &[f64], commands: &[[f64; 8]]) -> (LaneTrace, Vec<Statistics>) {
    let each: Vec<(Circuit<f64>, Vec<f64>)> = drives
        .iter()
        .zip(x0)
        .zip(commands)
        .map(|((drive, &x), plan)| drive.start(&at_rest(x, 3e5), plan[0]))
        .collect();
    let circuit = Circuit::<R>::gather(&each.iter().map(|(circuit, _)| circuit).collect::<Vec<_>>());
    let y: Vec<R> = (0..each[0].1.len()).map(|i| R::from_lanes(|l| each[l].1[i])).collect();
    let options = Options { rtol: 1e-6, ..Options::default() };
    let mut stepper = Stepper::new(circuit, 0.0, &y, options);
    let mut trace =
        LaneTrace { times: (0..2000).map(|k| f64::from(k) * 1e-3).collect(), states: vec![Vec::new(); R::L] };
    for segment in 0..8 {
        if segment > 0 {
            let system = stepper.system_mut();
            for (lane, plan) in commands.iter().enumerate() {
                drives[lane].set_command(system, lane, R::c(plan[segment]));
            }
        }
        let paused = stepper.advance(0.25 * (segment + 1) as f64, 100_000, &mut trace);
        assert_eq!(paused, Paused::Arrived);
        assert!((0..R::L).all(|lane| stepper.failure(lane).is_none()));
    }
    (trace, (0..R::L).map(|lane| stepper.statistics(lane)).collect())
}

/// Four drives of one kind that differ in every number.
fn four(spec: &drive::Spec) -> Vec<Drive> {
    let vary = |(i, factor): (usize, f64)| {
        let mut spec = spec.clone();
        spec.cylinder.bore_m *= factor;
        spec.cylinder.moving_mass_kg *= factor * factor;
        spec.cylinder.incline_rad = 0.2 * i as f64;
        spec.cylinder.dead_volume_a_m3 *= 2.0 - factor;
        spec.cylinder.heat_transfer_w_m2_k *= factor;
        spec.supply.pressure_pa *= 2.0 - factor;
        spec.supply.temperature_k += 10.0 * i as f64;
        spec.gas.gas_constant_j_kg_k += i as f64;
        spec.load.force_n = 3.0 * i as f64;
        for (name, value) in &mut spec.friction.parameters {
            *value *= if name == "stribeck_exponent" { 1.0 } else { factor };
        }
        if let Some(dwell) = &mut spec.friction.dwell {
            *dwell.numbers.get_mut("increment_n").expect("an increment") *= factor;
            *dwell.numbers.get_mut("time_s").expect("a time") *= 2.0 - factor;
        }
        if let Some(relaxation) = &mut spec.friction.relaxation {
            *relaxation.get_mut("share").expect("a fraction") *= factor;
        }
        spec.friction.pressure = Some(
            [
                ("coulomb_a", 1e-6 * i as f64),
                ("coulomb_b", 2e-6),
                ("breakaway_a", 3e-6),
                ("breakaway_b", 1e-6),
            ]
            .map(|(key, value)| (key.into(), value))
            .into(),
        );
        Drive::assemble(&spec, false).expect("assembles")
    };
    [1.0, 1.1, 0.9, 1.3].into_iter().enumerate().map(vary).collect()
}

fn lanes_equal_scalars(spec: &drive::Spec, least_events: u64) {
    let drives = four(spec);
    let x0 = [0.05, 0.1, 0.25, 0.4];
    let commands = [
        [0.6, 0.6, 0.6, 0.6, -0.6, -0.6, -0.6, -0.6], // case A: slams into both stops
        [0.02, 0.0, -0.02, 0.05, 0.0, 0.01, 0.0, 0.0],
        [0.0, -1.0, 1.0, 0.0, 0.3, -0.3, 0.1, 0.0],
        [-0.01, 0.004, 0.008, 0.004, -0.004, -0.05, 1.0, 0.002],
    ];
    let (together, statistics) = run::<L>(&drives, &x0, &commands);
    let bits = together.states.concat().concat();
    let what = if spec.friction.dwell.is_some() { "-and-everything" } else { "" };
    pinned(&format!("lanes/{}{what}", spec.friction.law), bits.into_iter().map(f64::from_bits));
    let mut events = 0;
    for lane in 0..4 {
        let (alone, own) = run::<f64>(&drives[lane..=lane], &x0[lane..=lane], &commands[lane..=lane]);
        assert_eq!(alone.states[0].len(), 2000);
        let differs = (0..2000).find(|&k| alone.states[0][k] != together.states[lane][k]);
        let show = |k: usize| (&alone.states[0][k], &together.states[lane][k]);
        assert!(differs.is_none(), "lane {lane} differs from sample {differs:?}: {:?}", differs.map(show));
        let count = |s: &Statistics| (s.steps, s.rejected, s.events);
        assert_eq!(count(&own[0]), count(&statistics[lane]));
        events += own[0].events;
    }
    assert!(events >= least_events, "{events} events");
}

#[test]
fn the_reference_drive() {
    lanes_equal_scalars(&reference(), 0);
}

#[test]
fn a_drive_with_exact_sticking() {
    lanes_equal_scalars(&reference_stribeck(), 15);
}

#[test]
fn drives_with_friction_that_remembers() {
    let laws = [("elasto-plastic", 0), ("stribeck", 15), ("karnopp", 15), ("armstrong", 10), ("bouc-wen", 0)];
    for (law, least_events) in laws.into_iter().chain([("gms", 0), ("rate-and-state", 0), ("film-lugre", 0)])
    {
        lanes_equal_scalars(&drive::Spec { friction: everything(law), ..reference() }, least_events);
    }
}

/// The start of four drives side by side, with what each is alone.
fn side_by_side(drives: &[Drive], starts: &[drive::Initial]) -> (Circuit<L>, Vec<L>, Vec<Circuit<f64>>) {
    let each: Vec<_> = drives.iter().zip(starts).map(|(drive, start)| drive.start(start, 0.0)).collect();
    let circuit = Circuit::gather(&each.iter().map(|(circuit, _)| circuit).collect::<Vec<_>>());
    let y = (0..each[0].1.len()).map(|i| L::from_lanes(|lane| each[lane].1[i])).collect();
    (circuit, y, each.into_iter().map(|(circuit, _)| circuit).collect())
}

#[test]
fn each_lane_finds_the_mode_of_its_own_state() {
    let drives = four(&reference_stribeck());
    // At rest under little and under much pressure, and moving either way.
    let mut starts = [at_rest(0.25, 3e5); 4];
    starts[1].pressure_a_pa = 6e5;
    (starts[2].velocity_m_s, starts[3].velocity_m_s) = (0.2, -0.2);
    let (mut circuit, mut y, each) = side_by_side(&drives, &starts);
    let before: Vec<L> = y.clone();
    // All lanes one further: none has the mode that it begins with.
    circuit
        .find_modes(&mut y.iter().map(|y| L::from_lanes(|lane| y.get((lane + 1) % 4))).collect::<Vec<_>>());
    circuit.find_modes(&mut y);
    assert_eq!(y, before);
    let modes: Vec<f64> = (0..4).map(|lane| circuit.mode(drives[0].axis()).get(lane)).collect();
    let alone: Vec<f64> = each.iter().map(|circuit| circuit.mode(drives[0].axis())).collect();
    assert_eq!(modes, alone);
    assert_eq!(alone, [0.0, 1.0, 1.0, -1.0]);
}

#[test]
fn a_failure_of_any_lane_ends_the_run_with_its_reason() {
    let drives = four(&reference());
    let mut starts = [at_rest(0.25, 3e5); 4];
    starts[2].position_m = -0.3;
    let (circuit, y, _) = side_by_side(&drives, &starts);
    let mut stepper = Stepper::new(circuit, 0.0, &y, Options::default());
    let outcome = advance(&mut stepper, 0.1, &mut NoOutput, &mut Look::new(&mut |_| false));
    let Err(Error::Stopped(message)) = outcome else { panic!("{outcome:?}") };
    assert!(message.contains("t = 0.0") && message.contains("chamber a"), "{message}");
    assert!(message.contains("position_m = -3.000000e-1"), "{message}");
}

#[test]
fn each_lane_has_a_budget_of_its_own() {
    let (circuit, y, _) = side_by_side(&four(&reference()), &[at_rest(0.25, 3e5); 4]);
    let mut stepper = Stepper::new(circuit, 0.0, &y, Options::default());
    stepper.allow_in(1, 5);
    stepper.advance(0.1, 10_000, &mut NoOutput);
    for lane in 0..4 {
        let attempts = stepper.statistics(lane).factorisations;
        let failed = matches!(stepper.failure(lane), Some(ode::Failure::TooManyAttempts { attempts: 5, .. }));
        assert_eq!((failed, attempts == 5), (lane == 1, lane == 1), "lane {lane} took {attempts}");
        assert_eq!(stepper.time(lane) == 0.1, lane != 1);
    }
}
