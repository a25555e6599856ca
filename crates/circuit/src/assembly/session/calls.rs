//! Integration method of calls that are as short as a step.

use ode::Method;

/// Integration method of the next call: a low-order method if the call is hardly longer than a step. A low-order step
/// needs less work, and the end of the call limits the length of a step anyway.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct ShortCalls {
    /// Remaining calls for the high-order method.
    pub left: u32,
    /// Duration of the last call, s.
    pub lasted: f64,
}

impl ShortCalls {
    /// Largest number of attempts in a call for which low order is efficient: one high-order attempt costs as much as
    /// two.
    const FEW: u64 = 2;
    /// Calls after which low order is tried again.
    const PAUSE: u32 = 16;
    /// Largest ratio of a duration to the last one that counts as equal.
    const LONGER: f64 = 1.5;

    /// Returns the method of a call that lasts this long, s.
    pub fn method(&self, lasts: f64) -> Method {
        if self.left == 0 && lasts <= Self::LONGER * self.lasted { Method::Rodas3 } else { Method::Rodas5P }
    }

    /// Registers a call: how long it lasted, s, and its number of attempts.
    pub fn register(&mut self, lasted: f64, attempts: u64) {
        let left = if attempts > Self::FEW { Self::PAUSE } else { self.left.saturating_sub(1) };
        *self = ShortCalls { left, lasted };
    }
}
