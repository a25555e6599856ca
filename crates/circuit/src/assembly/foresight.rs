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

    fn load(&mut self, modes: &[f64], y: &[f64], (input, value): (usize, f64), attempts: u64) {
        let (circuit, mut modes) = (self.stepper.system_mut(), modes.iter());
        circuit.change_modes(|mode| *mode = R::c(modes.next().copied().unwrap_or_default()));
        self.assembly.set(circuit, input, 0, R::c(value));
        self.stepper.load(0, 0.0, y);
        self.stepper.allow_in(0, attempts);
    }

    /// Goes on to a time under what is held; whether it could.
    fn go(
        &mut self,
        follow: &[(usize, f64)],
        held: R,
        until: f64,
        output: &mut impl Output<R, Circuit<R>>,
    ) -> bool {
        let circuit = self.stepper.system_mut();
        for &(input, factor) in follow {
            self.assembly.set(circuit, input, 0, held * R::c(factor));
        }
        let paused = self.stepper.advance(until, u64::MAX, output);
        paused == Paused::Arrived && self.stepper.failure(0).is_none()
    }

    fn ahead(&mut self, follow: &[(usize, f64)], plan: &[(f64, R)], times: &[f64]) -> Option<Vec<R>> {
        let (assembly, columns) = (self.assembly.clone(), [0, 1, 2]);
        let columns = &columns[..assembly.columns().len()];
        let mut tracker = Tracker::new(&assembly, columns, times, self.stepper.system().work());
        let whole = plan.iter().all(|&(until, held)| self.go(follow, held, until, &mut tracker));
        if !whole {
            return None;
        }
        tracker.finish_at(self.stepper.state(), self.stepper.system());
        Some(tracker.into_rows())
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
            attempts: options.max_attempts,
        }
    }

    /// Begins at time zero from a state, with the modes of a circuit, and one more input at a value.
    pub fn begin(&mut self, (circuit, y): &mut (Circuit<f64>, Vec<f64>), other: (usize, f64)) {
        let mut modes = Vec::new();
        circuit.change_modes(|mode| modes.push(*mode));
        self.values.load(&modes, y, other, self.attempts);
        self.derivatives.load(&modes, y, other, self.attempts);
    }

    /// Columns at times, s, row by row, under a plan: until when each value is held. None: it could not go on.
    pub fn values(&mut self, plan: &[(f64, f64)], times: &[f64]) -> Option<Vec<f64>> {
        self.values.ahead(&self.follow, plan, times)
    }

    /// The same with derivatives.
    pub fn derivatives(&mut self, plan: &[(f64, Sensitive)], times: &[f64]) -> Option<Vec<Sensitive>> {
        self.derivatives.ahead(&self.follow, plan, times)
    }

    /// Circuit and state after a time, s, under one value that is held.
    pub fn after(&mut self, held: f64, time: f64) -> Option<(Circuit<f64>, Vec<f64>)> {
        let went = self.values.go(&self.follow, held, time, &mut NoOutput);
        went.then(|| (self.values.stepper.system().clone(), self.values.stepper.state().to_vec()))
    }
}
