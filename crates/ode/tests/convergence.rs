//! Error falls with the step size as the method's order says, on smooth nonlinear problems that
//! contain time, at the end of steps and between them, and without order reduction where the
//! problem becomes stiff.

mod support;

use math::Real;
use ode::{Method, Options, Stepper};
use support::*;

/// y1' = 2 t y1 ln y2, y2' = -2 t y2 ln y1: y1 = exp(sin t^2), y2 = exp(cos t^2).
#[derive(Clone)]
struct Exponentials;

impl Equations for Exponentials {
    const TIME: bool = true;
    fn n(&self) -> usize {
        2
    }
    fn f<S: Real + From<f64>>(&self, t: S, y: &[S], dy: &mut [S]) {
        let twice = S::from(2.0) * t;
        dy[0] = twice * y[0] * y[1].ln();
        dy[1] = -(twice * y[1] * y[0].ln());
    }
}

fn exponentials(t: f64) -> [f64; 2] {
    [(t * t).sin().exp(), (t * t).cos().exp()]
}

/// Kaps: y1' = -(1/e + 2) y1 + y2^2/e, y2' = y1 - y2 - y2^2: y1 = exp(-2t), y2 = exp(-t).
#[derive(Clone)]
struct Kaps(f64);

impl Equations for Kaps {
    fn n(&self) -> usize {
        2
    }
    fn f<S: Real + From<f64>>(&self, _t: S, y: &[S], dy: &mut [S]) {
        let stiffness = S::from(self.0);
        dy[0] = stiffness * (y[1] * y[1] - y[0]) - S::from(2.0) * y[0];
        dy[1] = y[0] - y[1] - y[1] * y[1];
    }
}

fn kaps(t: f64) -> [f64; 2] {
    [(-2.0 * t).exp(), (-t).exp()]
}

/// Prothero-Robinson: y' = -l (y - sin t) + cos t, y = sin t.
#[derive(Clone)]
struct ProtheroRobinson(f64);

impl Equations for ProtheroRobinson {
    const TIME: bool = true;
    fn n(&self) -> usize {
        1
    }
    fn f<S: Real + From<f64>>(&self, t: S, y: &[S], dy: &mut [S]) {
        dy[0] = S::from(-self.0) * (y[0] - t.sin()) + t.cos();
    }
}

/// Largest error at the end and over `per_step` points of every step, with `n` equal steps.
fn errors<E: Equations>(
    equations: &E,
    (t0, t1): (f64, f64),
    exact: &dyn Fn(f64) -> Vec<f64>,
    n: usize,
    method: Method,
) -> (f64, f64) {
    let h = (t1 - t0) / n as f64;
    let per_step = 7;
    let times = (0..n * per_step).map(|k| t0 + h * k as f64 / per_step as f64);
    let mut samples = Samples::at(times.collect());
    let problem = Problem::new(equations.clone());
    let mut stepper = Stepper::new(problem, t0, &exact(t0), Options { method, ..fixed_step(h) });
    finish(&mut stepper, t1, &mut samples);
    assert_eq!(stepper.statistics(0).steps, n as u64, "equal steps");
    let distance = |t: f64, y: &[f64]| -> f64 {
        let exact = exact(t);
        let differences = y.iter().zip(&exact).map(|(a, b)| (a - b).abs());
        differences.fold(0.0, f64::max)
    };
    let between = samples.times.iter().zip(&samples.states);
    (distance(t1, stepper.state()), between.map(|(&t, y)| distance(t, y)).fold(0.0, f64::max))
}

/// Slope of log error over log step between two numbers of steps.
fn orders<E: Equations>(
    equations: E,
    span: (f64, f64),
    exact: &dyn Fn(f64) -> Vec<f64>,
    (coarse, fine): (usize, usize),
    method: Method,
) -> (f64, f64) {
    let [one, two] = [coarse, fine].map(|n| errors(&equations, span, exact, n, method));
    let ratio = (fine as f64 / coarse as f64).ln();
    ((one.0 / two.0).ln() / ratio, (one.1 / two.1).ln() / ratio)
}

#[test]
fn order_5_on_a_nonlinear_problem_that_contains_time() {
    let exact = |t: f64| exponentials(t).to_vec();
    let (end, dense) = orders(Exponentials, (0.0, 2.0), &exact, (80, 320), Method::Rodas5P);
    assert!((end - 5.0).abs() < 0.2, "at the end {end}");
    // Dense output of order 4 leaves the fifth power of h in every step.
    assert!((dense - 5.0).abs() < 0.2, "between {dense}");
}

#[test]
fn order_5_on_a_nonlinear_autonomous_problem() {
    let exact = |t: f64| kaps(t).to_vec();
    let (end, dense) = orders(Kaps(1.0), (0.0, 2.0), &exact, (20, 80), Method::Rodas5P);
    assert!((end - 5.0).abs() < 0.2, "at the end {end}");
    assert!((dense - 5.0).abs() < 0.2, "between {dense}");
}

#[test]
fn order_3_of_the_short_steps() {
    let by = Method::Rodas3;
    let exact = |t: f64| exponentials(t).to_vec();
    let with_time = orders(Exponentials, (0.0, 2.0), &exact, (160, 640), by);
    let exact = |t: f64| kaps(t).to_vec();
    let autonomous = orders(Kaps(1.0), (0.0, 2.0), &exact, (40, 160), by);
    let (stiff, _) = orders(Kaps(1e8), (0.0, 2.0), &exact, (20, 80), by);
    // Dense output of order 2 leaves the third power of h in every step.
    for order in [with_time.0, with_time.1, autonomous.0, autonomous.1] {
        assert!((order - 3.0).abs() < 0.2, "{with_time:?} {autonomous:?}");
    }
    assert!(stiff > 2.8, "{stiff}");
}

#[test]
fn order_5_in_the_limit_of_infinite_stiffness() {
    let exact = |t: f64| kaps(t).to_vec();
    let (end, _) = orders(Kaps(1e8), (0.0, 2.0), &exact, (10, 40), Method::Rodas5P);
    assert!(end > 4.8, "{end}");
}

/// Stiff problems with a moving equilibrium cost many methods most of their order: for each step
/// there is a stiffness that is worst. Over all of them the error still falls with the fourth power.
#[test]
fn no_stiffness_spoils_the_order() {
    let sine = |t: f64| vec![t.sin()];
    let worst = |n: usize| -> f64 {
        let each = (0..=32).map(|k| 10.0_f64.powf(0.25 * f64::from(k)));
        let errors = each
            .map(|stiffness| errors(&ProtheroRobinson(stiffness), (0.0, 3.0), &sine, n, Method::Rodas5P).0);
        errors.fold(0.0, f64::max)
    };
    let (coarse, fine) = (worst(20), worst(80));
    let order = (coarse / fine).ln() / 4.0_f64.ln();
    assert!(order > 3.8, "{coarse:e} {fine:e}: {order}");
}

#[test]
fn the_error_follows_the_tolerance() {
    let exact = exponentials(2.0);
    let mut last = f64::INFINITY;
    for k in 3..=11 {
        let rtol = 10.0_f64.powi(-k);
        let run = run(Exponentials, (0.0, 2.0), &exponentials(0.0), tolerance(rtol));
        let error = (run.state()[0] - exact[0]).abs();
        assert!(error < 30.0 * rtol && error < last, "rtol {rtol:e}: {error:e}");
        last = error;
    }
}
