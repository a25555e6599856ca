//! Approach of steps to a kink that step control cannot pass easily.

/// An attempt whose error exceeds this many tolerances may have crossed a kink.
pub(crate) const FAR_OFF: f64 = 10.0;
/// If the error of a shorter attempt is below this, the longer attempt did cross a kink. On a smooth
/// solution, step control leaves a third of the tolerance.
const COLLAPSED: f64 = 0.01;
/// Length of the next attempt as a fraction of the way to the end of the failed attempt.
const HALF: f64 = 0.5;
/// Number of consecutive accepted steps after which the kink counts as passed.
const MOST_KEPT: u32 = 4;
/// Number of very large errors in a run before kinks are approached in this way. Typical drives have fewer
/// (assumed).
const FREE_FAILURES: u32 = 2000;

/// A kink may be between the present time and the end of an attempt with a very large error. The usual step
/// prediction holds for smooth solutions. It approaches a kink in ever shorter steps, with three attempts for
/// each third of the way. Halving takes one attempt for each half.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Approach {
    /// Time to the end of the failed attempt, s. Infinite if unknown.
    pub left: f64,
    /// Whether a kink is known before that end.
    pub halving: bool,
    /// Steps accepted since the last failure.
    pub kept: u32,
    /// Number of attempts with a very large error.
    pub failures: u32,
}

impl Approach {
    pub const NEW: Approach = Approach { left: f64::INFINITY, halving: false, kept: 0, failures: 0 };

    /// Records a very large error of an attempt of length `h`. Returns the factor on the step if halving
    /// applies.
    pub fn failed(&mut self, h: f64) -> Option<f64> {
        (self.left, self.kept) = (h, 0);
        self.failures = self.failures.saturating_add(1);
        self.halving.then_some(HALF)
    }

    /// Records an accepted step of length `h`. Returns the longest next step if halving applies.
    pub fn kept(&mut self, h: f64, error: f64) -> Option<f64> {
        self.left -= h;
        self.kept += 1;
        self.halving = self.failures > FREE_FAILURES
            && self.left > 0.0
            && self.left < f64::INFINITY
            && error < COLLAPSED
            && self.kept <= MOST_KEPT;
        if !self.halving {
            self.end();
        }
        self.halving.then_some(HALF * self.left)
    }

    /// Ends the approach: the step ends elsewhere, or the equations have changed.
    pub fn end(&mut self) {
        *self = Approach { failures: self.failures, ..Self::NEW };
    }
}

#[cfg(test)]
#[path = "../tests/unit/approach.rs"]
mod tests;
