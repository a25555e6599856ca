//! Interface between an integrator and a system of equations.

use crate::linear::Dense;
use crate::stepper::Accepted;
use crate::structure::Structure;
use math::{Lane, Over, Real};
use std::sync::Arc;

/// `y' = f(t, y)` with parameters, inputs and modes of type `R` held in `self`.
pub trait System<R: Lane> {
    /// Room for intermediate results, made once for each scalar type and reused at every call.
    type Work<S: Over<R>>: Clone;

    /// Makes that room.
    fn work<S: Over<R>>(&self) -> Self::Work<S>;

    /// Brings what `work` holds of the inputs up to date; asked for after every step and change of the system.
    fn renew<S: Over<R>>(&self, _work: &mut Self::Work<S>) {}

    /// Writes `f(t, y)` into `dy`; both have one entry for each state.
    fn rhs<S: Over<R>>(&self, t: S, y: &[S], dy: &mut [S], work: &mut Self::Work<S>);

    /// Writes `f(t, y)` at numbers of its own plus `known` into `out`.
    fn add_rates(&self, t: R, y: &[R], known: &[R], out: &mut [R], work: &mut Self::Work<R>) {
        self.rhs(t, y, out, work);
        for (out, known) in out.iter_mut().zip(known) {
            *out += *known;
        }
    }

    /// Writes `f` and its Jacobian, where the system knows it and it has the shape of an arrow (see [`Dense`]); zeros
    /// of the shape are not written. A system says yes always, or never.
    fn linearise(&self, _y: &[R], _f: &mut [R], _jacobian: &mut Dense<R>) -> bool {
        false
    }

    /// Sparsity, colouring and elimination order; see [`Structure::of`].
    fn structure(&self) -> &Arc<Structure>;

    /// Absolute error scale of each state: its absolute tolerance is `rtol * scale`.
    /// An infinite scale marks a quadrature: integrated alongside, never steering the step.
    fn scale(&self) -> &[R];

    /// The velocities of masses that may swing, and for each the speed with which its energy is as much as its swings
    /// may be measured by.
    fn swings(&self) -> Vec<(usize, R)> {
        Vec::new()
    }

    /// Whether quadratures hold more than the integrals of `rhs`.
    fn completes(&self) -> bool {
        false
    }

    /// Writes what an accepted step adds to the quadratures beside the integrals of `rhs`, into what comes as zeros.
    fn complete(&self, _step: &mut Accepted<'_, R>, _out: &mut [R]) {}

    /// Number of event functions.
    fn n_events(&self) -> usize {
        0
    }

    /// Event functions at `y`: positive while the present mode holds, an event where one turns negative.
    fn events(&self, _t: R, _y: &[R], _out: &mut [R], _work: &mut Self::Work<R>) {}

    /// Depth below zero at which an event may be taken, in the function's unit.
    fn event_tolerance(&self, _event: usize) -> f64 {
        0.0
    }

    /// Number of obstacles (discontinuity surfaces): behind one the right-hand side is of another kind.
    fn n_obstacles(&self) -> usize {
        0
    }

    /// Functions that are positive before an obstacle and negative behind it. A step that fails because
    /// it runs into one is followed by one that ends before it: a matter of work, not of accuracy.
    fn obstacles(&self, _y: &[R], _out: &mut [R], _work: &mut Self::Work<R>) {}

    /// One in each lane whose state the equations hold for, minus one where they do not. Every accepted step and
    /// every sample is asked; one that lies outside is tried again with a shorter step, and no caller ever sees it.
    fn inside(&self, _y: &[R], _work: &mut Self::Work<R>) -> R::Plain {
        R::Plain::one()
    }

    /// The same for every state within `spread` of `y`, without doubt; minus one says nothing. A step that passes is
    /// not asked sample by sample.
    fn surely_inside(&self, _y: &[R], _spread: &[R::Plain]) -> R::Plain {
        -R::Plain::one()
    }

    /// A step of this lane would end outside: brings in what the equations leave out as long as nothing comes near it;
    /// true where there was something.
    fn meet(&mut self, _lane: usize) -> bool {
        false
    }

    /// Puts a sample onto the side of the present mode, from which the error of a step may have moved it.
    fn settle(&self, _y: &mut [R]) {}

    /// Changes the mode of one lane, and its state where the mode demands it (a stop sets v = 0).
    fn switch(&mut self, _lane: usize, _event: usize, _y: &mut [R], _work: &mut Self::Work<R>) {}
}
