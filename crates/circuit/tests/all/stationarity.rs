//! What is at rest stays at rest: with the valve closed, no leak and a piston that sticks, no state
//! moves within 1000 s, whatever the law that holds it; a piston that sticks exactly not by one bit.

use crate::support::drive::{self, Drive};
use crate::support::*;
use ode::{NoOutput, Stepper, System};

/// From `settle` s to 1000 s later: the largest change of any state, relative to its size and scale, and
/// whether position and velocity kept their bits.
fn drift(spec: &drive::Spec, pressures: (f64, f64), settle: f64) -> (f64, bool) {
    let drive = Drive::assemble(spec, false).expect("assembles");
    let mut initial = at_rest(0.2, pressures.0);
    initial.pressure_b_pa = pressures.1;
    let (circuit, y) = drive.start(&initial, 0.0);
    let mut stepper = Stepper::new(circuit, 0.0, &y, options(1e-6));
    advance(&mut stepper, settle, &mut NoOutput);
    let before = stepper.state().to_vec();
    advance(&mut stepper, settle + 1000.0, &mut NoOutput);
    let steps = stepper.statistics(0).steps;
    assert!(steps < 2000, "rest costs nothing: {steps} steps");
    let after = stepper.state();
    let size = |i: usize| before[i].abs() + stepper.system().scale()[i];
    let change = |i: usize| (after[i] - before[i]).abs() / size(i);
    let largest = (0..before.len()).map(change).fold(0.0, f64::max);
    (largest, bits(&before[..2]) == bits(&after[..2]))
}

#[test]
fn nothing_moves_where_nothing_pushes() {
    let (exact, still) = drift(&reference_stribeck(), (3e5, 3e5), 0.0);
    assert!(exact < 1e-12 && still, "{exact:e}");
    let (bristles, _) = drift(&reference(), (3e5, 3e5), 0.0);
    assert!(bristles < 1e-12, "{bristles:e}");
}

#[test]
fn nothing_moves_below_breakaway() {
    // 0.8 bar on 4.9 cm2: 39 N of 45 N.
    let (exact, still) = drift(&reference_stribeck(), (3.8e5, 3e5), 0.0);
    assert!(exact < 1e-12 && still, "{exact:e}");
    // Bristles first bend, then hold, once the air has taken the temperature of the wall.
    let (bent, _) = drift(&reference(), (3.8e5, 3e5), 500.0);
    assert!(bent < 1e-12, "{bent:e}");
}
