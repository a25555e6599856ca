//! Two numbers side by side. Computations that both sides of a piston share are done once.

use crate::real::{Real, functions};

/// Two numbers. Every operation acts on each number, so the bits agree. Over `f64`, the compiler makes one vector
/// instruction of both.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(align(16))]
pub struct Both<R>(pub [R; 2]);

impl<R: Copy> Both<R> {
    /// The same number twice.
    #[inline(always)]
    pub fn same(number: R) -> Self {
        Both([number; 2])
    }
}

crate::operators! {
    [R: Real] Both<R>, |a, b|
    +: Both([a.0[0] + b.0[0], a.0[1] + b.0[1]]),
    -: Both([a.0[0] - b.0[0], a.0[1] - b.0[1]]),
    *: Both([a.0[0] * b.0[0], a.0[1] * b.0[1]]),
    /: Both([a.0[0] / b.0[0], a.0[1] / b.0[1]]),
    neg: a.map(R::neg),
}

impl<R: Real> Both<R> {
    #[inline(always)]
    fn map(self, f: impl Fn(R) -> R) -> Self {
        Both([f(self.0[0]), f(self.0[1])])
    }
}

impl<R: Real> Real for Both<R> {
    type Mask = [R::Mask; 2];
    const LARGE: bool = R::LARGE;

    #[inline(always)]
    fn once<T>(operation: impl FnOnce() -> T) -> T {
        R::once(operation)
    }
    #[inline(always)]
    fn c(x: f64) -> Self {
        Self::same(R::c(x))
    }
    #[inline(always)]
    fn fma(self, a: Self, b: Self) -> Self {
        Both([self.0[0].fma(a.0[0], b.0[0]), self.0[1].fma(a.0[1], b.0[1])])
    }
    functions!(map R: sqrt exp ln sin cos tanh);
    #[inline(always)]
    fn pow(self, exponent: Self) -> Self {
        Both([self.0[0].pow(exponent.0[0]), self.0[1].pow(exponent.0[1])])
    }
    #[inline(always)]
    fn lt(self, o: Self) -> Self::Mask {
        [self.0[0].lt(o.0[0]), self.0[1].lt(o.0[1])]
    }
    #[inline(always)]
    fn select(mask: Self::Mask, a: Self, b: Self) -> Self {
        Both([R::select(mask[0], a.0[0], b.0[0]), R::select(mask[1], a.0[1], b.0[1])])
    }
}
