//! Laws that stick by a mode, in whole circuits: Karnopp's band becomes exact sticking as it narrows, and what its stops
//! take is booked; Armstrong's static friction rises with the stop as its authors' formula says, and its spring holds.
//! Sources: [karnopp1985], [armstrong1994].

use crate::support::*;
use circuit::{AxisId, Circuit, balance};
use ode::Stepper;
use physics::friction::AnyLaw;

/// A mass, kg, pulled from rest through a spring by a carriage of constant speed.
fn pulled(law: AnyLaw<f64>, mass: f64, stiffness: f64, speed: f64) -> (Circuit<f64>, AxisId, Vec<f64>) {
    let mut circuit = empty();
    let axis = circuit.axis(mass, 0.0, 0.0, Some(law.into()));
    let (node, _) = circuit.servo(circuit::Carriage::rigid());
    circuit.link(node, axis, stiffness, 0.0);
    let mut circuit = circuit.build(true);
    let y = circuit.initial(&[], &[(axis, 0.0, 0.0), (node, 0.0, speed)]);
    (circuit, axis, y)
}

const STRIBECK: [(&str, f64); 4] =
    [("coulomb", 30.0), ("breakaway", 45.0), ("stribeck_velocity", 0.02), ("viscous", 40.0)];

fn karnopp(dead_zone: f64) -> AnyLaw<f64> {
    let values: Vec<_> = STRIBECK.into_iter().chain([("dead_zone", dead_zone)]).collect();
    law("karnopp", &values)
}

/// Stick-slip of 2 kg on 5 kN/m at 5 mm/s for 6 s: the places at each ms, and the run.
fn stick_slip(law: AnyLaw<f64>) -> (Vec<f64>, Trace, Stepper<f64, Circuit<f64>>) {
    let (circuit, axis, y) = pulled(law, 2.0, 5e3, 5e-3);
    let mut trace = Trace::every(1e-3, 6.0);
    let mut stepper = Stepper::new(circuit, 0.0, &y, options(1e-9));
    advance(&mut stepper, 6.0, &mut trace);
    trace.finish(&stepper);
    let places = trace.states.iter().map(|y| nodes(stepper.system(), y)[axis].x).collect();
    (places, trace, stepper)
}

#[test]
fn karnopp_becomes_exact_sticking_as_its_band_narrows() {
    let (exact, _, stepper) = stick_slip(stribeck());
    let stops = stepper.statistics(0).events / 2;
    assert!(stops >= 3, "{stops} stops");
    let apart = |dead_zone: f64| {
        let (places, ..) = stick_slip(karnopp(dead_zone));
        places.iter().zip(&exact).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
    };
    let [wide, middle, narrow] = [1e-3, 1e-4, 1e-5].map(apart);
    println!("{wide:e} {middle:e} {narrow:e} m off");
    assert!(middle < 0.2 * wide && narrow < 0.2 * middle && narrow < 1e-6, "{wide:e} {middle:e} {narrow:e}");
}

#[test]
fn what_a_stop_of_karnopp_takes_is_booked_as_heat() {
    let dead_zone = 5e-3;
    let (_, trace, stepper) = stick_slip(karnopp(dead_zone));
    let books = balance(stepper.system(), &trace.states);
    // Three events a stop: it breaks away, leaves the band, comes back into it.
    let taken = 0.5 * 2.0 * dead_zone * dead_zone * (stepper.statistics(0).events / 3) as f64;
    println!("{taken} J of {} J, closed to {:e}", books.turnover, books.energy_error);
    assert!(
        taken > 1e-5 * books.turnover,
        "a stop takes what would be seen: {taken} J of {} J",
        books.turnover
    );
    assert!(books.energy_error.abs() < 1e-8, "{:e}", books.energy_error);
    assert!(books.least_production >= -1e-12);
}

const VS: f64 = 5e-3;
const STIFFNESS: f64 = 1e5;
const GAMMA: f64 = 10.0;

/// Slides at 50 mm/s, stops within 10 ms, stands for `stop` s and is pulled away at 0.1 mm/s: the peak of friction
/// without its viscous part, the share that was lost at the arrival, and the time from the arrival to the peak.
fn breakaway(stop: f64) -> (f64, f64, f64) {
    let mut circuit = empty();
    let values = [
        ("coulomb", 30.0),
        ("breakaway", 45.0),
        ("stribeck_velocity", VS),
        ("viscous", 60.0),
        ("bristle_stiffness", STIFFNESS),
        ("memory_time", 0.02),
        ("recovery_time", GAMMA),
    ];
    let axis = circuit.axis(0.2, 0.0, 0.0, Some(law("armstrong", &values).into()));
    let (node, carriage) = circuit.servo(circuit::Carriage::rigid());
    circuit.link(node, axis, 1e5, 100.0);
    let mut circuit = circuit.build(false);
    let y = circuit.initial(&[], &[(axis, 0.0, 0.05), (node, 30.0 / 1e5, 0.05)]);
    let mut stepper = Stepper::new(circuit, 0.0, &y, options(1e-9));
    let mut trace = Trace::every(1.0, 0.0);
    let mut run = |stepper: &mut Stepper<f64, Circuit<f64>>, jerk: f64, until: f64| {
        stepper.system_mut().set_input(carriage.input(0), 0, jerk);
        advance(stepper, until, &mut trace);
    };
    run(&mut stepper, 0.0, 0.2);
    run(&mut stepper, -0.05 / 25e-6, 0.205);
    run(&mut stepper, 0.05 / 25e-6, 0.21);
    let mut arrived = 0.0;
    for k in 0..200 {
        run(&mut stepper, 0.0, 0.21 + 1e-4 * f64::from(k));
        if stepper.system().mode(axis) == 0.0 && arrived == 0.0 {
            arrived = stepper.time(0);
        }
    }
    assert!(arrived > 0.0, "it has come to rest");
    run(&mut stepper, 0.0, 0.23 + stop);
    let [.., lost] = *stepper.system().inner_states(axis, stepper.state()) else { unreachable!() };
    // 0.1 mm/s by two pieces of jerk, then on until it slips.
    let start = 0.23 + stop;
    run(&mut stepper, 1.0, start + 0.01);
    run(&mut stepper, -1.0, start + 0.02);
    let (mut peak, mut at) = (0.0, 0.0);
    for k in 1..40_000 {
        run(&mut stepper, 0.0, start + 0.02 + 1e-3 * f64::from(k));
        let axis_now = now(&stepper)[axis];
        let dry = axis_now.friction - 60.0 * axis_now.v;
        if dry > peak {
            (peak, at) = (dry, stepper.time(0));
        }
        if stepper.system().mode(axis) != 0.0 {
            break;
        }
    }
    assert_eq!(stepper.system().mode(axis), 1.0, "it breaks away");
    (peak, lost, at - arrived)
}

#[test]
fn breakaway_of_armstrong_rises_with_the_stop_by_its_formula() {
    let mut last = 0.0;
    for stop in [1.0, 10.0, 100.0, 1000.0] {
        let (peak, lost, stood) = breakaway(stop);
        // Fc + Ea + (Fs - Fc - Ea) t/(t + gamma), with Ea = (1 - lost)(Fs - Fc) that of the arrival.
        let arrival = 15.0 * (1.0 - lost);
        let increment = arrival + (15.0 - arrival) * stood / (stood + GAMMA);
        println!("{stop} s: {peak} N, by hand {} N, arrived with {arrival} N", 30.0 + increment);
        assert!(arrival < 3.0, "the stop is abrupt against the memory: {arrival} N");
        assert!(((peak - 30.0) / increment - 1.0).abs() < 5e-4, "{stop} s: {peak} N, {increment} N over Fc");
        assert!(peak > last);
        last = peak;
    }
}

#[test]
fn below_breakaway_armstrong_is_a_spring_that_comes_back() {
    // 40 N of 45 N on and off, slowly: out by F/kt and back to where it was.
    let values = [
        ("coulomb", 30.0),
        ("breakaway", 45.0),
        ("stribeck_velocity", VS),
        ("viscous", 60.0),
        ("bristle_stiffness", STIFFNESS),
        ("memory_time", 0.02),
        ("recovery_time", GAMMA),
    ];
    let mut circuit = empty();
    let axis = circuit.axis(0.2, 0.0, 0.0, Some(law("armstrong", &values).into()));
    let (node, carriage) = circuit.servo(circuit::Carriage::rigid());
    circuit.link(node, axis, 10.0, 0.0);
    let mut circuit = circuit.build(false);
    let y = circuit.initial(&[], &[(axis, 0.0, 0.0), (node, 0.0, 0.0)]);
    let mut stepper = Stepper::new(circuit, 0.0, &y, options(1e-9));
    let mut at = |jerk: f64, until: f64| {
        stepper.system_mut().set_input(carriage.input(0), 0, jerk);
        advance(&mut stepper, until, &mut ode::NoOutput);
        (now(&stepper)[axis].x, now(&stepper)[axis].force, stepper.system().mode(axis))
    };
    // The carriage goes 4 m in 4 pieces of 1 s, then back.
    let jerk = 2.0;
    for (k, sign) in [1.0, -1.0, -1.0, 1.0].into_iter().enumerate() {
        at(sign * jerk, (k + 1) as f64);
    }
    let (x, force, mode) = at(0.0, 6.0);
    assert_eq!(mode, 0.0);
    assert_close("40 N", force, 40.0, 1e-3);
    assert_close("deflection", x, force / STIFFNESS, 1e-6);
    for (k, sign) in [-1.0, 1.0, 1.0, -1.0].into_iter().enumerate() {
        at(sign * jerk, 7.0 + k as f64);
    }
    let (x, _, mode) = at(0.0, 12.0);
    assert_eq!(mode, 0.0);
    assert!(x.abs() < 1e-10, "it comes back: {x} m");
}
