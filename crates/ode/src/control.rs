//! Step size, acceptance and failure of one lane, in plain `f64` and plain `if`.

use crate::approach::{Approach, FAR_OFF};
use crate::stages::Method;
use crate::swing::Swing;
use math::Lane;

/// Tolerance, step limits and method.
#[derive(Clone, Copy, Debug)]
pub struct Options {
    /// Relative tolerance. The absolute tolerance is `rtol` times the scale that the system declares.
    pub rtol: f64,
    /// Limit on the step attempts of an integration.
    pub max_attempts: u64,
    /// Longest step allowed.
    pub max_step: f64,
    /// Least first trial step, s. Error control still shortens it if necessary.
    pub least_first_step: f64,
    /// Integration method.
    pub method: Method,
}

impl Default for Options {
    fn default() -> Self {
        Options {
            rtol: 1e-6,
            max_attempts: 50_000_000,
            max_step: f64::INFINITY,
            least_first_step: 0.0,
            method: Method::Rodas5P,
        }
    }
}

/// Work counts so far.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize)]
pub struct Statistics {
    /// Accepted steps.
    pub steps: u64,
    /// Rejected attempts.
    pub rejected: u64,
    /// Evaluations of the right-hand side.
    pub right_hand_sides: u64,
    /// Evaluations of the Jacobian.
    pub jacobians: u64,
    /// Factorisations of W.
    pub factorisations: u64,
    /// Located events.
    pub events: u64,
}

/// Reason why an integration failed at a time `t`, s, with a step `h`, s. `state` is the index of the
/// component that caused the failure, and `event` that of the event function. The name of each variant is its
/// message.
#[allow(missing_docs)] // of variants and fields: named above
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum Failure {
    #[error("the step size fell to {h:e} at t = {t}: state {state} cannot be resolved")]
    StepTooSmall { t: f64, h: f64, state: usize },
    #[error("the right-hand side is not finite at t = {t}, state {state}")]
    NotFinite { t: f64, state: usize },
    #[error("the state is no longer valid at t = {t}")]
    Outside { t: f64 },
    #[error("event {event} fires again and again at t = {t}")]
    Chatter { t: f64, event: usize },
    #[error("the budget of {attempts} attempts at a step is used up at t = {t}")]
    TooManyAttempts { t: f64, attempts: u64 },
}

/// Safety factor on the predicted step. With 0.8 instead of 0.9, a fifth fewer steps are rejected on problems
/// with many kinks.
const SAFETY: f64 = 0.8;
/// Bounds on the change of the step size from one attempt to the next.
const MIN_FACTOR: f64 = 0.1;
const MAX_FACTOR: f64 = 6.0;
/// Smaller errors are raised to this value, because zero has no root. They already give the largest growth.
pub(crate) const LEAST_ERROR: f64 = 1e-12;
/// Step factor after an attempt without a finite error.
const NOT_FINITE_FACTOR: f64 = 0.1;
/// Step factor after a step that error control accepts but that leaves the valid range of the equations.
const OUTSIDE_FACTOR: f64 = 0.25;
/// A step within this factor of the target is stretched or cut onto it.
const STRETCH: f64 = 1.01;
/// Number of cuts onto one event before its tolerance is widened, and the factor for each further cut.
/// Rounding may keep the event function (a force on a stiff end stop) from coming nearer to zero.
const FREE_CUTS: u32 = 20;
const CUT_FACTOR: f64 = 10.0;
/// Number of switches without progress in time after which the lane fails.
const MAX_IDLE_SWITCHES: u32 = 16;

/// Returns x^(-1/5) for a normal x > 0, with a relative error below 1e-6. A step size needs no more. The
/// error of the method is of order h^5. First guess from the exponent bits, then Newton's iteration.
#[inline(always)]
fn inverse_fifth_root<R: Lane>(x: R) -> R {
    // 6/5 of the exponent bias, minus a constant that centres the error of the guess.
    const GUESS: u64 = 0x4CB8_A999_9999_9800;
    let mut y = R::from_lanes(|lane| f64::from_bits(GUESS - x.get(lane).to_bits() / 5));
    for _ in 0..3 {
        let (y2, xy) = (y * y, x * y);
        y *= (R::c(-0.2) * xy * y2).fma(y2, R::c(1.2));
    }
    y
}

/// Returns the step factor of each lane for its error, if the error is finite.
#[inline(always)]
pub(crate) fn factor<R: Lane>(error: R) -> R {
    let factor = R::c(SAFETY) * inverse_fifth_root(error.max(R::c(LEAST_ERROR)));
    factor.max(R::c(MIN_FACTOR)).min(R::c(MAX_FACTOR))
}

/// Returns x^(-1/3) in the same way.
pub(crate) fn inverse_cube_root(x: f64) -> f64 {
    // 4/3 of the exponent bias, minus such a constant.
    const GUESS: u64 = 0x553E_F000_0000_0000;
    let mut y = f64::from_bits(GUESS - x.to_bits() / 3);
    for _ in 0..3 {
        y *= (x * y * y).mul_add(y * (-1.0 / 3.0), 4.0 / 3.0);
    }
    y
}

#[cfg(test)]
#[path = "../tests/unit/control.rs"]
mod tests;

/// Step control of one lane.
#[derive(Clone, Debug)]
pub(crate) struct Control {
    /// Next step proposed by error control.
    pub wish: f64,
    /// Whether the last attempt was rejected, so that the next step may not grow.
    pub after_rejection: bool,
    /// Approach to a kink.
    pub approach: Approach,
    /// Whether the present attempt ends on the target exactly.
    pub last: bool,
    /// Length of the next attempt if it must end on an event.
    pub cut: Option<f64>,
    /// Whether the present attempt was cut to end on an event.
    pub cutting: bool,
    /// Number of cuts since the last event or the last uncut step.
    pub cuts: u32,
    pub idle_switches: u32,
    pub failure: Option<Failure>,
    pub statistics: Statistics,
    /// Masses that may oscillate.
    pub swings: Vec<Swing>,
    /// Fraction of the tolerance that one step may use.
    pub share: f64,
}

/// Fraction of the tolerance that one step may use. Step errors add up, and stick-slip motion amplifies them.
/// With one half, the golden trajectories meet the requested tolerance.
const LOCAL_SHARE: f64 = 0.5;

impl Control {
    pub fn new(swings: Vec<Swing>) -> Self {
        Control {
            wish: 0.0,
            after_rejection: false,
            approach: Approach::NEW,
            last: false,
            cut: None,
            cutting: false,
            cuts: 0,
            idle_switches: 0,
            failure: None,
            statistics: Statistics::default(),
            swings,
            share: LOCAL_SHARE,
        }
    }

    /// Updates the swings of the masses after a step of length `h`. `velocities` gives the velocities before
    /// and after the step.
    #[inline(always)]
    pub fn follow(&mut self, h: f64, velocities: impl Fn(usize) -> [f64; 2]) {
        let mut turned = false;
        for swing in &mut self.swings {
            let [before, after] = velocities(swing.state);
            turned |= swing.step(h, before, after);
        }
        if turned {
            self.renew_share();
        }
    }

    /// Updates the fraction of the tolerance from the swings.
    pub fn renew_share(&mut self) {
        self.share = LOCAL_SHARE * self.swings.iter().map(Swing::share).fold(1.0, f64::min);
    }

    /// Returns the step to attempt from `t` towards `until`.
    pub fn propose(&mut self, t: f64, until: f64, max_step: f64) -> f64 {
        let left = until - t;
        self.cutting = self.cut.is_some();
        if let Some(h) = self.cut.take() {
            self.last = h >= left;
            return h.min(left);
        }
        let h = self.wish.min(max_step);
        self.last = h * STRETCH >= left;
        if self.last { left } else { h }
    }

    /// Sets the next step from the [`factor`] of an attempt with step `h`. Returns true if the attempt is
    /// accepted.
    pub fn judge(&mut self, h: f64, error: f64, factor: f64) -> bool {
        if !error.is_finite() {
            self.wish = h * self.approach.failed(h).unwrap_or(NOT_FINITE_FACTOR);
            self.after_rejection = true;
            self.statistics.rejected += 1;
            return false;
        }
        if error > 1.0 {
            let halving = if error > FAR_OFF { self.approach.failed(h) } else { None };
            self.wish = h * halving.unwrap_or(factor.min(SAFETY));
            self.after_rejection = true;
            self.statistics.rejected += 1;
            return false;
        }
        let smooth = if self.after_rejection { factor.min(1.0) } else { factor };
        let before_obstacle = self.cutting && self.after_rejection;
        self.after_rejection = false;
        // A step cut by the target or an event does not shorten the planned step. A step that ends before an obstacle
        // does.
        self.wish = if self.last || self.cutting {
            self.approach.end();
            if before_obstacle { self.wish } else { (h * smooth).max(self.wish) }
        } else {
            self.approach.kept(h, error).map_or(h * smooth, |most| most.min(h * factor))
        };
        self.statistics.steps += 1;
        true
    }

    /// Makes the next attempt end on an event, after `h`.
    pub fn cut_onto_event(&mut self, h: f64) {
        self.cut = Some(h);
        self.cuts += 1;
    }

    /// Factor by which the tolerance of an event is widened: one during the normal search.
    pub fn patience(&self) -> f64 {
        CUT_FACTOR.powi(self.cuts.saturating_sub(FREE_CUTS) as i32)
    }

    /// Revokes the acceptance of an attempt with step `h` that ended outside the valid range of the
    /// equations.
    pub fn take_back(&mut self, h: f64) {
        self.wish = h * OUTSIDE_FACTOR;
        self.after_rejection = true;
        self.statistics.steps -= 1;
        self.statistics.rejected += 1;
    }

    /// Records a switch at time `t`. Fails if time does not advance between switches.
    pub fn note_switch(&mut self, t: f64, event: usize, moved: bool) {
        self.statistics.events += 1;
        self.cuts = 0;
        self.approach.end();
        self.idle_switches = if moved { 0 } else { self.idle_switches + 1 };
        if self.idle_switches > MAX_IDLE_SWITCHES {
            self.failure = Some(Failure::Chatter { t, event });
        }
    }
}
