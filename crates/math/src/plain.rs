//! Plain numbers.

use crate::elementary;
use crate::real::{Lane, Real, functions};

impl Real for f64 {
    type Mask = bool;

    #[inline(always)]
    fn c(x: f64) -> f64 {
        x
    }
    #[inline(always)]
    fn fma(self, a: f64, b: f64) -> f64 {
        self.mul_add(a, b)
    }
    functions!(call f64: sqrt);
    functions!(call elementary: exp ln sin cos tanh);
    #[inline(always)]
    fn pow(self, exponent: f64) -> f64 {
        elementary::pow(self, exponent)
    }
    #[inline(always)]
    fn lt(self, other: f64) -> bool {
        self < other
    }
    #[inline(always)]
    fn is_zero(&self) -> bool {
        *self == 0.0
    }
    #[inline(always)]
    fn select(mask: bool, a: f64, b: f64) -> f64 {
        if mask { a } else { b }
    }
}

impl Lane for f64 {
    type Plain = f64;
    const L: usize = 1;
    #[inline(always)]
    fn plain(&self) -> f64 {
        *self
    }
    #[inline(always)]
    fn get(&self, _lane: usize) -> f64 {
        *self
    }
    #[inline(always)]
    fn put(&mut self, _lane: usize, value: f64) {
        *self = value;
    }
    #[inline(always)]
    fn mask_bits(mask: bool) -> u64 {
        u64::from(mask)
    }
    #[inline(always)]
    fn mask_of(bits: u64) -> bool {
        bits != 0
    }
}
