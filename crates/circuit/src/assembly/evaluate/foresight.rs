//! Prediction of an assembly under held inputs, each time from a new state: as values, and with derivatives by each
//! held value.

use crate::assembly::variables::{Assembly, Variables};
use crate::circuit::Circuit;
use crate::ground::Sensitive;
use math::Lane;
use ode::{Accepted, NoOutput, Options, Output, Paused, Stepper, same_time};
use std::sync::Arc;

/// An assembly that is used for prediction.
#[derive(Clone)]
pub struct Foresight {
    values: Runner<f64>,
    derivatives: Runner<Sensitive>,
    /// State index of the position of the predicted mass. Its velocity follows.
    position: usize,
    /// Inputs that follow the held value, each with a factor.
    follow: Vec<(usize, f64)>,
    start: Start,
}

/// Start of a prediction: modes, state, a further input with its value, and the limit on attempts.
#[derive(Clone, Default)]
struct Start {
    modes: Vec<f64>,
    y: Vec<f64>,
    other: (usize, f64),
    attempts: u64,
}

/// Prediction for one kind of number.
#[derive(Clone)]
struct Runner<R: Lane> {
    assembly: Assembly<R>,
    stepper: Stepper<R, Circuit<R>>,
}

/// Positions of the mass at the requested times, collected during the run.
struct Motion<'t, R> {
    position: usize,
    times: &'t [f64],
    rows: Vec<[R; 3]>,
}

impl<R: Lane> Output<R, Circuit<R>> for Motion<'_, R> {
    fn due(&self, _lane: usize) -> f64 {
        f64::INFINITY
    }

    fn sample(&mut self, _lane: usize, _t: f64, _y: &[R], _system: &Circuit<R>) {}

    /// The acceleration is the slope of the velocity within a step, so that the equations need not be evaluated again.
    fn step(&mut self, _lane: usize, t: f64, h: f64, states: &mut Accepted<'_, R>, _system: &Circuit<R>) {
        let due = self.times[self.rows.len()..].iter();
        let due = due.take_while(|&&time| time <= t + h || same_time(time, t + h));
        let [position, velocity] = [self.position, self.position + 1].map(|state| states.course(state));
        self.rows.extend(due.map(|time| {
            let theta = ((time - t) / h).clamp(0.0, 1.0);
            let [v, rate] = velocity.value_and_slope(theta);
            [position.value(theta), v, rate * R::c(1.0 / h)]
        }));
    }
}

impl<R: Lane> Runner<R> {
    fn new(assembly: &Assembly, options: Options) -> Self {
        let circuit = Circuit::<R>::gather(&[&assembly.circuit]);
        let y = vec![R::zero(); circuit.n_states()];
        let variables =
            Arc::new(Variables { inputs: assembly.variables.inputs.clone(), ..Variables::default() });
        let stepper = Stepper::new(circuit.clone(), 0.0, &y, options);
        let timings = assembly.timings.clone();
        Runner { assembly: Assembly { circuit: circuit.into(), variables, timings }, stepper }
    }

    fn renew(&mut self, assembly: &Assembly) {
        let circuit = Circuit::gather(&[&assembly.circuit]);
        self.stepper.system_mut().clone_from(&circuit);
        self.assembly.circuit = circuit.into();
        self.assembly.timings.clone_from(&assembly.timings);
    }

    fn load(&mut self, start: &Start) {
        let (circuit, mut modes) = (self.stepper.system_mut(), start.modes.iter());
        circuit.change_modes(|mode| *mode = R::c(modes.next().copied().unwrap_or_default()));
        let (input, value) = start.other;
        self.assembly.set(circuit, input, 0, R::c(value));
        self.stepper.load(0, 0.0, &start.y);
        self.stepper.allow_in(0, start.attempts);
    }

    /// Sets the held value at the inputs that follow it.
    fn hold(&mut self, follow: &[(usize, f64)], held: R) {
        let circuit = self.stepper.system_mut();
        for &(input, factor) in follow {
            self.assembly.set(circuit, input, 0, held * R::c(factor));
        }
    }

    /// Returns whether the time was reached.
    fn went(&self, paused: Paused) -> bool {
        paused == Paused::Arrived && self.stepper.failure(0).is_none()
    }

    /// Returns the motion at times, or `None` if a run under one of the held values fails.
    fn ahead(
        &mut self,
        (position, plan, times): (usize, &[(f64, R)], &[f64]),
        mut go: impl FnMut(&mut Self, f64, R, &mut Motion<'_, R>) -> bool,
    ) -> Option<Vec<[R; 3]>> {
        let mut motion = Motion { position, times, rows: Vec::with_capacity(times.len()) };
        plan.iter().all(|&(until, held)| go(self, until, held, &mut motion)).then_some(motion.rows)
    }
}

impl Runner<f64> {
    /// Continues to a time under a held value. Returns whether this succeeded.
    fn go(
        &mut self,
        follow: &[(usize, f64)],
        until: f64,
        held: f64,
        output: &mut impl Output<f64, Circuit<f64>>,
    ) -> bool {
        self.hold(follow, held);
        let paused = self.stepper.advance(until, u64::MAX, output);
        self.went(paused)
    }
}

impl Foresight {
    /// Creates the prediction for an assembly and the mass whose position is this state. The given inputs follow the
    /// held value, each with a factor. The prediction stops after this many attempts of steps.
    pub fn new(assembly: &Assembly, position: usize, follow: Vec<(usize, f64)>, options: Options) -> Self {
        Foresight {
            values: Runner::new(assembly, options),
            derivatives: Runner::new(assembly, options),
            position,
            follow,
            start: Start { attempts: options.max_attempts, ..Start::default() },
        }
    }

    /// Replaces the assembly by another one whose circuit differs only in numbers.
    pub fn renew(&mut self, assembly: &Assembly) {
        self.values.renew(assembly);
        self.derivatives.renew(assembly);
    }

    /// Starts at time zero from a state, with the modes of a circuit, and one more input at a value.
    pub fn begin(&mut self, (circuit, y): &mut (Circuit<f64>, Vec<f64>), other: (usize, f64)) {
        self.start.modes.clear();
        circuit.change_modes(|mode| self.start.modes.push(*mode));
        self.start.y.clone_from(y);
        self.start.other = other;
    }

    /// Returns position, m, velocity, m/s, and acceleration, m/s2, at times, s, under a plan that gives the end time of
    /// each held value. `None`: the run failed.
    pub fn values(&mut self, plan: &[(f64, f64)], times: &[f64]) -> Option<Vec<[f64; 3]>> {
        self.values.load(&self.start);
        let asked = (self.position, plan, times);
        self.values.ahead(asked, |own, until, held, motion| own.go(&self.follow, until, held, motion))
    }

    /// Returns the same with derivatives.
    pub fn derivatives(&mut self, plan: &[(f64, Sensitive)], times: &[f64]) -> Option<Vec<[Sensitive; 3]>> {
        self.values.load(&self.start);
        self.derivatives.load(&self.start);
        let (follow, twin) = (&self.follow, &mut self.values);
        self.derivatives.ahead((self.position, plan, times), |own, until, held, motion| {
            own.hold(follow, held);
            twin.hold(follow, held.re);
            loop {
                own.stepper.refresh_by(&mut twin.stepper, Circuit::share_modes);
                let paused = own.stepper.advance(until, 1, motion);
                if paused == Paused::Arrived {
                    return own.went(paused);
                }
            }
        })
    }

    /// Returns circuit and state after a time, s, under one held value.
    pub fn after(&mut self, held: f64, time: f64) -> Option<(Circuit<f64>, Vec<f64>)> {
        self.values.load(&self.start);
        let went = self.values.go(&self.follow, time, held, &mut NoOutput);
        went.then(|| (self.values.stepper.system().clone(), self.values.stepper.state().to_vec()))
    }
}
