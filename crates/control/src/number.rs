//! Number types of laws: values, or records of each operation for code generation.

use math::Over;

/// A number of a law.
pub trait Number: Over<f64> {
    /// Runs `a` or `b` on a memory and returns its number: `a` if the mask is true, else `b`.
    fn either<M: Memory<Self>>(
        mask: Self::Mask,
        memory: &mut M,
        a: impl FnOnce(&mut M) -> Self,
        b: impl FnOnce(&mut M) -> Self,
    ) -> Self;

    /// Clips a number to -1 .. 1. NaN stays NaN.
    fn limited(self) -> Self {
        self.within(-1.0, 1.0)
    }

    /// Within two bounds.
    fn within(self, low: f64, high: f64) -> Self {
        self.max(Self::c(low)).min(Self::c(high))
    }
}

/// State of a law or an observer, as numbers.
pub trait Memory<S>: Clone {
    /// Visits each number, always in the same order.
    fn each(&mut self, see: &mut dyn FnMut(&mut S));
}

impl<S: Number> Memory<S> for S {
    fn each(&mut self, see: &mut dyn FnMut(&mut S)) {
        see(self);
    }
}

impl<S: Number, const N: usize> Memory<S> for [S; N] {
    fn each(&mut self, see: &mut dyn FnMut(&mut S)) {
        self.iter_mut().for_each(see);
    }
}

impl Number for f64 {
    fn either<M: Memory<f64>>(
        mask: bool,
        memory: &mut M,
        a: impl FnOnce(&mut M) -> f64,
        b: impl FnOnce(&mut M) -> f64,
    ) -> f64 {
        if mask { a(memory) } else { b(memory) }
    }
}
