//! Interface between an integrator and a system of equations.

use crate::linear::Dense;
use crate::output::Accepted;
use crate::structure::Structure;
use math::{Lane, Over, Real};
use std::sync::Arc;

/// `y' = f(t, y)` with parameters, inputs and modes of type `R` held in `self`.
pub trait System<R: Lane> {
    /// Workspace for intermediate results, made once for each scalar type and reused in every call.
    type Work<S: Over<R>>: Clone;

    /// Makes the workspace.
    fn work<S: Over<R>>(&self) -> Self::Work<S>;

    /// Updates the parts of `work` that depend on the inputs. It is called after every step and change of the
    /// system.
    fn renew<S: Over<R>>(&self, _work: &mut Self::Work<S>) {}

    /// Writes `f(t, y)` into `dy`; both have one entry for each state.
    fn rhs<S: Over<R>>(&self, t: S, y: &[S], dy: &mut [S], work: &mut Self::Work<S>);

    /// Writes `f(t, y)` at separate numbers plus `known` into `out`.
    fn add_rates(&self, t: R, y: &[R], known: &[R], out: &mut [R], work: &mut Self::Work<R>) {
        self.rhs(t, y, out, work);
        for (out, known) in out.iter_mut().zip(known) {
            *out += *known;
        }
    }

    /// Writes `f` and its Jacobian, if the system knows the Jacobian and it has the shape of an arrow (see
    /// [`Dense`]). Zeros of the shape are not written. The result must be the same for every call.
    fn linearise(&self, _y: &[R], _f: &mut [R], _jacobian: &mut Dense<R>) -> bool {
        false
    }

    /// Sparsity, colouring and elimination order; see [`Structure::of`].
    fn structure(&self) -> &Arc<Structure>;

    /// Absolute error scale of each state: its absolute tolerance is `rtol * scale`. An infinite scale marks
    /// a quadrature: it is integrated with the states but never influences the step.
    fn scale(&self) -> &[R];

    /// Velocities of masses that may oscillate, each with the speed at which its energy equals the reference
    /// of its swings.
    fn swings(&self) -> Vec<(usize, R)> {
        Vec::new()
    }

    /// Whether quadratures contain more than the integrals of `rhs`.
    fn completes(&self) -> bool {
        false
    }

    /// Writes the part of the quadratures of an accepted step that `rhs` does not cover. The array is zero at
    /// entry.
    fn complete(&self, _step: &mut Accepted<'_, R>, _out: &mut [R]) {}

    /// Number of event functions.
    fn n_events(&self) -> usize {
        0
    }

    /// Event functions at `y`. They are positive while the present mode holds, and an event is a change to
    /// negative.
    fn events(&self, _t: R, _y: &[R], _out: &mut [R], _work: &mut Self::Work<R>) {}

    /// Depth below zero at which an event may be located, in the function's unit.
    fn event_tolerance(&self, _event: usize) -> f64 {
        0.0
    }

    /// Number of obstacles (discontinuity surfaces). The right-hand side changes its form behind an obstacle.
    fn n_obstacles(&self) -> usize {
        0
    }

    /// Functions that are positive before an obstacle and negative behind it. If a step fails because it
    /// crosses an obstacle, the next step ends before the obstacle. This saves work and does not change
    /// accuracy.
    fn obstacles(&self, _y: &[R], _out: &mut [R], _work: &mut Self::Work<R>) {}

    /// One for each lane in the valid range of the equations, minus one otherwise. Every accepted step and
    /// every sample is checked. A step that ends outside is repeated with a shorter length, and no caller
    /// sees it.
    fn inside(&self, _y: &[R], _work: &mut Self::Work<R>) -> R::Plain {
        R::Plain::one()
    }

    /// The same for every state within `spread` of `y`. 1 means certainly valid, and -1 unknown. If the result is 1,
    /// the samples of the step are not checked one by one.
    fn surely_inside(&self, _y: &[R], _spread: &[R::Plain]) -> R::Plain {
        -R::Plain::one()
    }

    /// Handles a step of this lane that would end outside. It adds the effects that the equations omit far
    /// from the boundary. Returns true if there were any.
    fn meet(&mut self, _lane: usize) -> bool {
        false
    }

    /// Moves a sample onto the side of the present mode, if the error of a step has moved it away.
    fn settle(&self, _y: &mut [R]) {}

    /// Changes the mode of one lane, and its state if the mode requires it (a stop sets v = 0).
    fn switch(&mut self, _lane: usize, _event: usize, _y: &mut [R], _work: &mut Self::Work<R>) {}
}
