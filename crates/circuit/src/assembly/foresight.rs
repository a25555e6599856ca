//! What an assembly will do under inputs that are held one after the other, from a state that begins anew each time: as
//! values, and with derivatives by each of the values that are held.

use super::shoot::{Sensitive, Tracker};
use super::variables::{Assembly, Variables};
use crate::circuit::Circuit;
use math::Lane;
use ode::{NoOutput, Options, Output, Paused, Stepper, System};
use std::sync::Arc;

/// An assembly that is looked ahead with.
#[derive(Clone)]
pub struct Foresight {
    values: Runner<f64>,
    derivatives: Runner<Sensitive>,
    /// Inputs that follow what is held, each with a factor.
    follow: Vec<(usize, f64)>,
    start: Start,
}

/// Where it begins: modes, state, one more input at a value; and how many attempts it may take.
#[derive(Clone, Default)]
struct Start {
    modes: Vec<f64>,
    y: Vec<f64>,
    other: (usize, f64),
    attempts: u64,
}

/// One kind of number.
#[derive(Clone)]
struct Runner<R: Lane> {
    /// With the columns alone that are shown.
    assembly: Assembly<R>,
    stepper: Stepper<R, Circuit<R>>,
}

impl<R: Lane> Runner<R> {
    fn new(assembly: &Assembly, columns: &[usize], options: Options) -> Self {
        let circuit = Circuit::<R>::gather(&[&assembly.circuit]);
        let (all, y) = (&assembly.variables, vec![R::zero(); circuit.n_states()]);
        let shown = Variables {
            inputs: all.inputs.clone(),
            columns: columns.iter().map(|&column| all.columns[column].clone()).collect(),
            quantities: columns.iter().map(|&column| all.quantities[column]).collect(),
            ..Variables::default()
        };
        let stepper = Stepper::new(circuit.clone(), 0.0, &y, options);
        let timings = assembly.timings.clone();
        Runner {
            assembly: Assembly { circuit: circuit.into(), variables: Arc::new(shown), timings },
            stepper,
        }
    }

    fn load(&mut self, start: &Start) {
        let (circuit, mut modes) = (self.stepper.system_mut(), start.modes.iter());
        circuit.change_modes(|mode| *mode = R::c(modes.next().copied().unwrap_or_default()));
        let (input, value) = start.other;
        self.assembly.set(circuit, input, 0, R::c(value));
        self.stepper.load(0, 0.0, &start.y);
        self.stepper.allow_in(0, start.attempts);
    }

    /// The inputs that follow take what is held.
    fn hold(&mut self, follow: &[(usize, f64)], held: R) {
        let circuit = self.stepper.system_mut();
        for &(input, factor) in follow {
            self.assembly.set(circuit, input, 0, held * R::c(factor));
        }
    }

    /// Whether it arrived.
    fn went(&self, paused: Paused) -> bool {
        paused == Paused::Arrived && self.stepper.failure(0).is_none()
    }

    /// Columns at times, row by row, if `go` can go on under each of what is held until a time.
    fn ahead(
        &mut self,
        plan: &[(f64, R)],
        times: &[f64],
        mut go: impl FnMut(&mut Self, f64, R, &mut Tracker<'_, R>) -> bool,
    ) -> Option<Vec<R>> {
        let (assembly, columns) = (self.assembly.clone(), [0, 1, 2]);
        let columns = &columns[..assembly.columns().len()];
        let mut tracker = Tracker::new(&assembly, columns, times, self.stepper.system().work());
        if !plan.iter().all(|&(until, held)| go(self, until, held, &mut tracker)) {
            return None;
        }
        tracker.finish_at(self.stepper.state(), self.stepper.system());
        Some(tracker.into_rows())
    }
}

impl Runner<f64> {
    /// Goes on to a time under what is held; whether it could.
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
    /// Of an assembly, of which up to three columns are shown; these inputs follow what is held, each with a factor. Further
    /// than so many attempts at a step it does not look.
    pub fn new(assembly: &Assembly, columns: &[usize], follow: Vec<(usize, f64)>, options: Options) -> Self {
        Foresight {
            values: Runner::new(assembly, columns, options),
            derivatives: Runner::new(assembly, columns, options),
            follow,
            start: Start { attempts: options.max_attempts, ..Start::default() },
        }
    }

    /// Begins at time zero from a state, with the modes of a circuit, and one more input at a value.
    pub fn begin(&mut self, (circuit, y): &mut (Circuit<f64>, Vec<f64>), other: (usize, f64)) {
        self.start.modes.clear();
        circuit.change_modes(|mode| self.start.modes.push(*mode));
        self.start.y.clone_from(y);
        self.start.other = other;
    }

    /// Columns at times, s, row by row, under a plan: until when each value is held. None: it could not go on.
    pub fn values(&mut self, plan: &[(f64, f64)], times: &[f64]) -> Option<Vec<f64>> {
        self.values.load(&self.start);
        self.values.ahead(plan, times, |own, until, held, tracker| own.go(&self.follow, until, held, tracker))
    }

    /// The same with derivatives.
    pub fn derivatives(&mut self, plan: &[(f64, Sensitive)], times: &[f64]) -> Option<Vec<Sensitive>> {
        self.values.load(&self.start);
        self.derivatives.load(&self.start);
        let (follow, twin) = (&self.follow, &mut self.values);
        self.derivatives.ahead(plan, times, |own, until, held, tracker| {
            own.hold(follow, held);
            twin.hold(follow, held.re);
            loop {
                own.stepper.refresh_by(&mut twin.stepper, Circuit::share_modes);
                let paused = own.stepper.advance(until, 1, tracker);
                if paused == Paused::Arrived {
                    return own.went(paused);
                }
            }
        })
    }

    /// Circuit and state after a time, s, under one value that is held.
    pub fn after(&mut self, held: f64, time: f64) -> Option<(Circuit<f64>, Vec<f64>)> {
        self.values.load(&self.start);
        let went = self.values.go(&self.follow, time, held, &mut NoOutput);
        went.then(|| (self.values.stepper.system().clone(), self.values.stepper.state().to_vec()))
    }
}
