//! Equations as a test writes them, made into a [`System`]: the pattern comes from the equations.

#![allow(dead_code)] // every contract uses its own part

use math::{Deps, Over, Real};
use ode::{NoOutput, Options, Output, Paused, Stepper, Structure, System};
use std::sync::Arc;

/// `y' = f(t, y)`, with events where there are any.
pub trait Equations: Clone {
    const TIME: bool = false;
    const EVENTS: usize = 0;
    const EVENT_TOLERANCE: f64 = 0.0;

    fn n(&self) -> usize;
    fn f<S: Real + From<f64>>(&self, t: S, y: &[S], dy: &mut [S]);
    /// Error scale of each state; infinite for a quadrature.
    fn scale(&self) -> Vec<f64> {
        vec![1.0; self.n()]
    }
    fn events(&self, _t: f64, _y: &[f64], _out: &mut [f64]) {}
    fn switch(&mut self, _event: usize, _y: &mut [f64]) {}
}

#[derive(Clone)]
pub struct Problem<E> {
    pub equations: E,
    structure: Arc<Structure>,
    scale: Vec<f64>,
}

impl<E: Equations> Problem<E> {
    pub fn new(equations: E) -> Self {
        let scale = equations.scale();
        let f = |y: &[Deps], dy: &mut [Deps]| equations.f(Deps::c(0.0), y, dy);
        Problem { structure: Arc::new(Structure::of(f, &scale, E::TIME)), equations, scale }
    }
}

impl<E: Equations> System<f64> for Problem<E> {
    type Work<S: Over<f64>> = ();

    fn work<S: Over<f64>>(&self) {}
    fn rhs<S: Over<f64>>(&self, t: S, y: &[S], dy: &mut [S], _work: &mut ()) {
        self.equations.f(t, y, dy);
    }
    fn structure(&self) -> &Arc<Structure> {
        &self.structure
    }
    fn scale(&self) -> &[f64] {
        &self.scale
    }
    fn n_events(&self) -> usize {
        E::EVENTS
    }
    fn events(&self, t: f64, y: &[f64], out: &mut [f64], _work: &mut ()) {
        self.equations.events(t, y, out);
    }
    fn event_tolerance(&self, _event: usize) -> f64 {
        E::EVENT_TOLERANCE
    }
    fn switch(&mut self, _lane: usize, event: usize, y: &mut [f64], _work: &mut ()) {
        self.equations.switch(event, y);
    }
}

/// Steps of length `h` and nothing else: no error is large enough to be refused.
pub fn fixed_step(h: f64) -> Options {
    Options { rtol: 1e100, max_step: h, ..Options::default() }
}

pub fn tolerance(rtol: f64) -> Options {
    Options { rtol, ..Options::default() }
}

/// Runs to `until` without a budget.
pub fn run<E: Equations>(
    equations: E,
    (t0, until): (f64, f64),
    y0: &[f64],
    options: Options,
) -> Stepper<f64, Problem<E>> {
    let mut stepper = Stepper::new(Problem::new(equations), t0, y0, options);
    finish(&mut stepper, until, &mut NoOutput);
    stepper
}

pub fn finish<E: Equations>(
    stepper: &mut Stepper<f64, Problem<E>>,
    until: f64,
    output: &mut impl Output<f64, Problem<E>>,
) {
    let paused = stepper.advance(until, u64::MAX, output);
    assert_eq!(stepper.failure(0), None);
    assert_eq!(paused, Paused::Arrived);
}

/// States at given times, from dense output.
pub struct Samples {
    pub times: Vec<f64>,
    pub states: Vec<Vec<f64>>,
}

impl Samples {
    pub fn at(times: Vec<f64>) -> Self {
        Samples { times, states: Vec::new() }
    }
}

impl<Sys> Output<f64, Sys> for Samples {
    fn due(&self, _lane: usize) -> f64 {
        let next = self.times.get(self.states.len());
        next.copied().unwrap_or(f64::INFINITY)
    }
    fn sample(&mut self, _lane: usize, _t: f64, y: &[f64], _system: &Sys) {
        self.states.push(y.to_vec());
    }
}

pub fn bits(y: &[f64]) -> Vec<u64> {
    y.iter().map(|x| x.to_bits()).collect()
}

/// Uniform numbers in [-1, 1) from a seed (a linear congruential generator: the same everywhere).
pub struct Uniform(pub u64);

impl Uniform {
    pub fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
    }
}
