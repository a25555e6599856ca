//! Numbers with derivatives give those of the solution, whatever attempts were refused on the way.

mod support;

use math::{Dual, Over, Real};
use ode::{NoOutput, Options, Paused, Stepper, Structure, System};
use std::sync::Arc;

type Number = Dual<f64, 8>;

/// y' = -sqrt(y): sqrt(y) = sqrt(y0) - t/2, which is not to be had below zero.
struct Emptying {
    structure: Arc<Structure>,
    scale: [Number; 1],
}

impl System<Number> for Emptying {
    type Work<S: Over<Number>> = ();

    fn work<S: Over<Number>>(&self) {}
    fn rhs<S: Over<Number>>(&self, _t: S, y: &[S], dy: &mut [S], _work: &mut ()) {
        dy[0] = -y[0].sqrt();
    }
    fn structure(&self) -> &Arc<Structure> {
        &self.structure
    }
    fn scale(&self) -> &[Number] {
        &self.scale
    }
}

#[test]
fn an_attempt_that_is_no_number_leaves_nothing_behind() {
    let scale = [1.0];
    let structure = Arc::new(Structure::of(|y, dy| dy[0] = -y[0].sqrt(), &scale, false));
    let system = Emptying { structure, scale: scale.map(Number::from) };
    let options = Options { rtol: 1e-9, least_first_step: 1.9, ..Options::default() };
    let mut stepper = Stepper::new(system, 0.0, &[Number::variable(1.0, 0)], options);
    assert_eq!(stepper.advance(1.9, 10_000, &mut NoOutput), Paused::Arrived);
    assert_eq!(stepper.failure(0), None);
    assert!(stepper.statistics(0).rejected > 0);
    let y = stepper.state()[0];
    // y = (sqrt(y0) - t/2)^2, so dy/dy0 = (sqrt(y0) - t/2) / sqrt(y0).
    assert!((y.re - 0.0025).abs() < 1e-8, "{y:?}");
    assert!((y.eps[0] - 0.05).abs() < 1e-6, "{y:?}");
}
