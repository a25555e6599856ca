//! Integration method of short calls.

/// Integration method of the next call. A low-order method makes its first attempts if calls of this length needed few
/// attempts. A low-order step needs less work, and the end of the call limits the length of a step anyway.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct ShortCalls {
    /// Calls of few attempts until low order is tried again.
    pub left: u32,
    /// Duration of the last call, s.
    pub lasted: f64,
}

impl ShortCalls {
    /// Largest number of attempts in a call for which low order is efficient: one high-order attempt costs as much as
    /// two.
    const FEW: u64 = 2;
    /// Attempts of low order in one call. A call that needs more is continued by the high-order method.
    const MOST: u64 = 2 * Self::FEW;
    /// Calls of few attempts after which low order is tried again: tries then cost a few percent (assumed).
    const PAUSE: u32 = 16;
    /// Largest ratio of a duration to the last one that counts as equal (assumed).
    const LONGER: f64 = 1.5;

    /// Returns the number of attempts by low order in a call that lasts this long, s.
    pub fn low_order(&self, lasts: f64) -> u64 {
        if self.left == 0 && lasts <= Self::LONGER * self.lasted { Self::MOST } else { 0 }
    }

    /// Registers a call: how long it lasted, s, and its number of attempts.
    pub fn register(&mut self, lasted: f64, attempts: u64) {
        let left = if attempts > Self::FEW { Self::PAUSE } else { self.left.saturating_sub(1) };
        *self = ShortCalls { left, lasted };
    }
}
