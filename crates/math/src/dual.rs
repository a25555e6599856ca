//! Forward-mode automatic differentiation.

use crate::real::{Lane, Real};
use std::array::from_fn;
use std::ops::{Add, AddAssign, Div, Mul, MulAssign, Neg, Sub, SubAssign};

/// `re + sum_i eps[i] e_i` with `e_i e_j = 0`: a value with `N` directional derivatives, over any
/// `Real`, so that lanes have derivatives and derivatives have lanes.
#[derive(Clone, Copy, Debug)]
pub struct Dual<R, const N: usize> {
    pub re: R,
    pub eps: [R; N],
}

impl<R: Real, const N: usize> Dual<R, N> {
    /// The independent variable of direction `i`.
    #[inline(always)]
    pub fn variable(re: R, i: usize) -> Self {
        let mut eps = [R::zero(); N];
        eps[i] = R::one();
        Dual { re, eps }
    }

    /// `f` with value `re` and derivative `slope` with respect to `self`.
    #[inline(always)]
    fn chain(self, re: R, slope: R) -> Self {
        Dual { re, eps: from_fn(|i| self.eps[i] * slope) }
    }
}

impl<R: Real, const N: usize> From<R> for Dual<R, N> {
    #[inline(always)]
    fn from(re: R) -> Self {
        Dual { re, eps: [R::zero(); N] }
    }
}

impl<R: Real, const N: usize> Add for Dual<R, N> {
    type Output = Self;
    #[inline(always)]
    fn add(self, o: Self) -> Self {
        Dual { re: self.re + o.re, eps: from_fn(|i| self.eps[i] + o.eps[i]) }
    }
}

impl<R: Real, const N: usize> Sub for Dual<R, N> {
    type Output = Self;
    #[inline(always)]
    fn sub(self, o: Self) -> Self {
        Dual { re: self.re - o.re, eps: from_fn(|i| self.eps[i] - o.eps[i]) }
    }
}

impl<R: Real, const N: usize> Mul for Dual<R, N> {
    type Output = Self;
    #[inline(always)]
    fn mul(self, o: Self) -> Self {
        Dual { re: self.re * o.re, eps: from_fn(|i| self.eps[i].fma(o.re, self.re * o.eps[i])) }
    }
}

impl<R: Real, const N: usize> Div for Dual<R, N> {
    type Output = Self;
    #[inline(always)]
    fn div(self, o: Self) -> Self {
        let re = self.re / o.re;
        let inverse = R::one() / o.re;
        Dual { re, eps: from_fn(|i| (self.eps[i] - re * o.eps[i]) * inverse) }
    }
}

impl<R: Real, const N: usize> Neg for Dual<R, N> {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        Dual { re: -self.re, eps: from_fn(|i| -self.eps[i]) }
    }
}

impl<R: Real, const N: usize> AddAssign for Dual<R, N> {
    #[inline(always)]
    fn add_assign(&mut self, o: Self) {
        *self = *self + o;
    }
}

impl<R: Real, const N: usize> SubAssign for Dual<R, N> {
    #[inline(always)]
    fn sub_assign(&mut self, o: Self) {
        *self = *self - o;
    }
}

impl<R: Real, const N: usize> MulAssign for Dual<R, N> {
    #[inline(always)]
    fn mul_assign(&mut self, o: Self) {
        *self = *self * o;
    }
}

impl<R: Real, const N: usize> Real for Dual<R, N> {
    type Mask = R::Mask;

    #[inline(always)]
    fn c(x: f64) -> Self {
        Self::from(R::c(x))
    }
    #[inline(always)]
    fn fma(self, a: Self, b: Self) -> Self {
        Dual {
            re: self.re.fma(a.re, b.re),
            eps: from_fn(|i| self.eps[i].fma(a.re, self.re.fma(a.eps[i], b.eps[i]))),
        }
    }
    #[inline(always)]
    fn sqrt(self) -> Self {
        let re = self.re.sqrt();
        self.chain(re, R::c(0.5) / re)
    }
    #[inline(always)]
    fn exp(self) -> Self {
        let re = self.re.exp();
        self.chain(re, re)
    }
    #[inline(always)]
    fn ln(self) -> Self {
        self.chain(self.re.ln(), R::one() / self.re)
    }
    #[inline(always)]
    fn pow(self, exponent: Self) -> Self {
        let re = self.re.pow(exponent.re);
        let (by_base, by_exponent) = (exponent.re / self.re, self.re.ln());
        Dual { re, eps: from_fn(|i| re * self.eps[i].fma(by_base, exponent.eps[i] * by_exponent)) }
    }
    #[inline(always)]
    fn sin(self) -> Self {
        self.chain(self.re.sin(), self.re.cos())
    }
    #[inline(always)]
    fn cos(self) -> Self {
        self.chain(self.re.cos(), -self.re.sin())
    }
    #[inline(always)]
    fn tanh(self) -> Self {
        let re = self.re.tanh();
        self.chain(re, R::one() - re * re)
    }
    #[inline(always)]
    fn lt(self, other: Self) -> R::Mask {
        self.re.lt(other.re)
    }
    #[inline(always)]
    fn select(mask: R::Mask, a: Self, b: Self) -> Self {
        Dual { re: R::select(mask, a.re, b.re), eps: from_fn(|i| R::select(mask, a.eps[i], b.eps[i])) }
    }
}

/// Step control and events look at the value alone.
impl<const N: usize> Lane for Dual<f64, N> {
    const L: usize = 1;
    const DIRECTIONS: usize = N;
    #[inline(always)]
    fn get(&self, _lane: usize) -> f64 {
        self.re
    }
    #[inline(always)]
    fn put(&mut self, _lane: usize, value: f64) {
        *self = Self::from(value);
    }
    #[inline(always)]
    fn take(&mut self, _lane: usize, from: &Self) {
        *self = *from;
    }
    #[inline(always)]
    fn part(&self, part: usize) -> f64 {
        if part == 0 { self.re } else { self.eps[part - 1] }
    }
    #[inline(always)]
    fn from_parts(part: impl Fn(usize) -> f64) -> Self {
        Dual { re: part(0), eps: from_fn(|i| part(i + 1)) }
    }
}
