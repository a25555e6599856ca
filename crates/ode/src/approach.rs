//! Approach of steps to a kink that no step passes easily.

/// An attempt whose error is this many tolerances may have run into something.
pub(crate) const FAR_OFF: f64 = 10.0;
/// A shorter attempt whose error is below this says that the longer one did run into something: where the solution is
/// smooth, step control leaves a third of the tolerance.
const COLLAPSED: f64 = 0.01;
/// Share of the way to the end of the failed attempt that the next one goes.
const HALF: f64 = 0.5;
/// Steps accepted one after the other after which the kink counts as passed unnoticed.
const MOST_KEPT: u32 = 4;
/// Attempts of a run that fail by far before kinks are approached so: sensible drives have fewer (assumed).
const FREE_FAILURES: u32 = 2000;

/// Between the present time and the end of an attempt that failed by far there may be a kink. What the error of a step
/// says of the next one's length holds for smooth solutions, and led up to a kink in ever shorter steps: three attempts
/// for each third of the way. Halving takes one attempt for each half.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Approach {
    /// How far the end of the failed attempt still is, s; infinite where none is known.
    pub left: f64,
    /// There is a kink before that end.
    pub halving: bool,
    /// Steps accepted since the last failure.
    pub kept: u32,
    /// Attempts that have failed by far.
    pub failures: u32,
}

impl Approach {
    pub const NEW: Approach = Approach { left: f64::INFINITY, halving: false, kept: 0, failures: 0 };

    /// An attempt of length `h` has failed by far; the factor on it, where that is for the approach to say.
    pub fn failed(&mut self, h: f64) -> Option<f64> {
        (self.left, self.kept) = (h, 0);
        self.failures = self.failures.saturating_add(1);
        self.halving.then_some(HALF)
    }

    /// A step of length `h` was accepted; the longest that the next may be, where that is for the approach to say.
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

    /// The step ends elsewhere, or the equations are others now.
    pub fn end(&mut self) {
        *self = Approach { failures: self.failures, ..Self::NEW };
    }
}

#[cfg(test)]
mod tests {
    use super::{Approach, FREE_FAILURES};

    #[test]
    fn a_kink_is_found_by_halving_once_many_attempts_have_failed() {
        let mut approach = Approach::NEW;
        assert_eq!((approach.failed(1.0), approach.kept(0.1, 1e-6)), (None, None));
        approach.failures = FREE_FAILURES;
        assert_eq!((approach.failed(1.0), approach.kept(0.25, 1e-6)), (None, Some(0.375)));
        assert_eq!((approach.failed(0.375), approach.kept(0.1875, 0.2)), (Some(0.5), None));
        assert_eq!(approach.failed(0.5), None);
    }

    #[test]
    fn a_kink_passed_unnoticed_is_not_sought_for_long() {
        let mut approach = Approach { failures: FREE_FAILURES, ..Approach::NEW };
        approach.failed(1.0);
        let steps = std::iter::successors(Some(0.5), |h| approach.kept(*h, 1e-6)).count();
        assert_eq!(steps, 5);
    }
}
