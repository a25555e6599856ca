//! A run that is taken up from the state of another goes on as that one does: also with a law whose mode is no state.

use crate::support::*;
use circuit::Circuit;
use ode::{NoOutput, Stepper};

/// 2 kg pulled at 20 mm/s through 2 kN/m: it sticks and slips.
fn pulled() -> (Circuit<f64>, circuit::AxisId, Vec<f64>) {
    let values = [
        ("coulomb", 30.0),
        ("breakaway", 45.0),
        ("stribeck_velocity", 0.02),
        ("viscous", 10.0),
        ("bristle_stiffness", 1e5),
        ("memory_time", 0.01),
        ("recovery_time", 0.5),
    ];
    let mut circuit = empty();
    let axis = circuit.axis(2.0, 0.0, 0.0, Some(law("armstrong", &values).into()));
    let (node, _) = circuit.servo(circuit::Carriage::rigid());
    circuit.link(node, axis, 2e3, 0.0);
    let mut circuit = circuit.build(false);
    let y = circuit.initial(&[], &[(axis, 0.0, 0.0), (node, 0.0, 0.02)]);
    (circuit, axis, y)
}

#[test]
fn armstrong_goes_on_in_the_mode_that_its_state_shows() {
    let (circuit, axis, y) = pulled();
    let mut whole = Stepper::new(circuit.clone(), 0.0, &y, options(1e-9));
    let (mut slipping, mut other, mut worst) = (0, 0, 0.0_f64);
    for k in 1..=300 {
        advance(&mut whole, 0.01 * f64::from(k), &mut NoOutput);
        let mut y = whole.state().to_vec();
        let mut again = circuit.clone();
        again.find_modes(&mut y);
        assert_eq!(bits(&y), bits(whole.state()), "its state stays as it is");
        let (mode, found) = (whole.system().mode(axis), again.mode(axis));
        slipping += u32::from(mode != 0.0);
        other += u32::from(mode != found);
        let mut going_on = Stepper::new(again, whole.time(0), &y, options(1e-9));
        let mut undisturbed = whole.clone();
        for run in [&mut going_on, &mut undisturbed] {
            advance(run, 0.01 * f64::from(k) + 0.1, &mut NoOutput);
        }
        worst = worst.max((now(&going_on)[axis].x - now(&undisturbed)[axis].x).abs());
    }
    println!("{slipping} of 300 slip, {other} are taken otherwise, {worst:e} m apart after 0.1 s");
    assert!(slipping > 50 && slipping < 250, "{slipping}");
    assert!(other == 0, "{other} of 300 modes are taken otherwise");
    assert!(worst < 1e-7, "{worst:e} m");
}
