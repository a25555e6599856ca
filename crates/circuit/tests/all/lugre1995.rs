//! LuGre gives what its authors published in 1995 for sigma0 = 1e5 N/m, sigma1 = sqrt(1e5) N s/m,
//! sigma2 = 0.4 N s/m, Fc = 1 N, Fs = 1.5 N, vs = 1 mm/s: presliding, a breakaway force that falls
//! with the rate at which the force grows, and stick-slip of a mass pulled through a spring.
//! Source: [canudas1995].

use crate::support::*;
use circuit::{AxisId, Circuit};
use ode::Stepper;

const FS: f64 = 1.5;
const SIGMA_0: f64 = 1e5;

/// Unit mass pulled through a spring by a carriage of constant speed, from rest.
fn pull(stiffness: f64, speed: f64, trace: &mut Trace) -> (Stepper<f64, Circuit<f64>>, AxisId) {
    let mut circuit = empty();
    let values = [
        ("coulomb", 1.0),
        ("breakaway", FS),
        ("stribeck_velocity", 0.001),
        ("viscous", 0.4),
        ("bristle_stiffness", SIGMA_0),
        ("bristle_damping", SIGMA_0.sqrt()),
    ];
    let mass = circuit.axis(1.0, 0.0, 0.0, Some(law("lugre", &values).into()));
    let (carriage, _) = circuit.servo(circuit::Carriage::rigid());
    circuit.link(carriage, mass, stiffness, 0.0);
    let mut circuit = circuit.build(false);
    let y = circuit.initial(&[], &[(mass, 0.0, 0.0), (carriage, 0.0, speed)]);
    let mut stepper = Stepper::new(circuit, 0.0, &y, options(1e-8));
    let end = trace.times[trace.times.len() - 1];
    advance(&mut stepper, end, trace);
    trace.finish(&stepper);
    (stepper, mass)
}

/// A force that grows by `rate` N/s: the spring is so soft that the mass does not feel it.
fn ramp(rate: f64, step: f64, end: f64) -> Vec<(f64, f64, f64)> {
    let mut trace = Trace::every(step, end);
    let (stepper, mass) = pull(1e-4, rate / 1e-4, &mut trace);
    let row = |y: &Vec<f64>| {
        let node = nodes(stepper.system(), y)[mass];
        (node.force, node.x, node.friction)
    };
    trace.states.iter().map(row).collect()
}

#[test]
fn stick_slip_repeats_after_6_363_s() {
    let mut trace = Trace::every(1e-3, 60.0);
    let (stepper, mass) = pull(2.0, 0.1, &mut trace);
    let speed: Vec<f64> = trace.states.iter().map(|y| nodes(stepper.system(), y)[mass].v).collect();
    let starts: Vec<f64> = (1..speed.len())
        .filter(|&i| speed[i - 1] < 0.05 && speed[i] >= 0.05)
        .map(|i| trace.times[i])
        .collect();
    assert!(starts.len() >= 8, "{starts:?}");
    let period = (starts[starts.len() - 1] - starts[1]) / (starts.len() - 2) as f64;
    println!("period {period}");
    assert_close("period", period, 6.363, 0.005);
    let stuck = speed.iter().filter(|v| v.abs() < 1e-3).count() as f64 / speed.len() as f64;
    assert!(stuck > 0.4, "it sticks for {stuck} of the time");
}

#[test]
fn presliding_bends_towards_breakaway() {
    let rows = ramp(0.02, 0.5, 71.25);
    let mut worst = 0.0_f64;
    for (force, x, _) in rows.into_iter().filter(|row| row.0 > 0.02) {
        let by_hand = FS / SIGMA_0 * (1.0 / (1.0 - force / FS)).ln();
        worst = worst.max((x / by_hand - 1.0).abs());
        assert_close(&format!("deflection at {force} N"), x, by_hand, 0.01);
    }
    println!("presliding within {worst:e}");
}

#[test]
fn breakaway_falls_as_the_force_grows_faster() {
    let mut last = FS;
    for rate in [0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0] {
        let rows = ramp(rate, 0.002 / rate, 2.5 / rate + 0.1);
        // The peak of friction before it slides away, where viscous friction does not count yet.
        let before = rows.iter().take_while(|row| row.1 < 3e-4);
        let breakaway = before.map(|row| row.2).fold(0.0, f64::max);
        assert!(rows[rows.len() - 1].1 > 3e-4, "it slides away");
        println!("{rate} N/s: {breakaway} N");
        assert!(breakaway < last && breakaway > 1.0, "{rate} N/s: {breakaway} N after {last} N");
        last = breakaway;
    }
    assert!(last < 0.9 * FS);
}
