//! Several `f64` side by side in a plain array, which the compiler turns into vector instructions.

use crate::elementary;
use crate::real::{Lane, Real, functions};
use std::array::from_fn;

/// `N` independent numbers. Every operation is that of `f64`, lane by lane, so the bits agree.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(align(32))]
pub struct Lanes<const N: usize>(pub [f64; N]);

crate::operators! {
    [const N: usize] Lanes<N>, |a, b|
    +: Lanes(from_fn(|i| a.0[i] + b.0[i])),
    -: Lanes(from_fn(|i| a.0[i] - b.0[i])),
    *: Lanes(from_fn(|i| a.0[i] * b.0[i])),
    /: Lanes(from_fn(|i| a.0[i] / b.0[i])),
    neg: Lanes(from_fn(|i| -a.0[i])),
}

impl<const N: usize> Lanes<N> {
    #[inline(always)]
    fn map(self, f: impl Fn(f64) -> f64) -> Self {
        Lanes(from_fn(|i| f(self.0[i])))
    }
}

impl<const N: usize> Real for Lanes<N> {
    type Mask = [bool; N];

    #[inline(always)]
    fn c(x: f64) -> Self {
        Lanes([x; N])
    }
    #[inline(always)]
    fn fma(self, a: Self, b: Self) -> Self {
        Lanes(from_fn(|i| self.0[i].mul_add(a.0[i], b.0[i])))
    }
    #[inline(always)]
    fn sqrt(self) -> Self {
        self.map(f64::sqrt)
    }
    functions!(map elementary: exp ln sin cos tanh);
    #[inline(always)]
    fn pow(self, exponent: Self) -> Self {
        Lanes(from_fn(|i| elementary::pow(self.0[i], exponent.0[i])))
    }
    #[inline(always)]
    fn lt(self, other: Self) -> [bool; N] {
        from_fn(|i| self.0[i] < other.0[i])
    }
    #[inline(always)]
    fn select(mask: [bool; N], a: Self, b: Self) -> Self {
        Lanes(from_fn(|i| if mask[i] { a.0[i] } else { b.0[i] }))
    }
}

impl<const N: usize> Lane for Lanes<N> {
    type Plain = Self;
    const L: usize = N;
    #[inline(always)]
    fn plain(&self) -> Self {
        *self
    }
    #[inline(always)]
    fn mask_bits(mask: [bool; N]) -> u64 {
        mask.iter().enumerate().fold(0, |bits, (lane, holds)| bits | u64::from(*holds) << lane)
    }
    #[inline(always)]
    fn mask_of(bits: u64) -> [bool; N] {
        from_fn(|lane| bits >> lane & 1 == 1)
    }
    #[inline(always)]
    fn get(&self, lane: usize) -> f64 {
        self.0[lane]
    }
    #[inline(always)]
    fn put(&mut self, lane: usize, value: f64) {
        self.0[lane] = value;
    }
}
