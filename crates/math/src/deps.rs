//! Sparsity from the type: a "number" that only remembers which states it depends on.

use crate::dual::Dual;
use crate::real::{Over, Real};
use std::ops::{Add, AddAssign, Div, Mul, MulAssign, Neg, Sub, SubAssign};

const WORDS: usize = 8;

/// A set of state indices. Run once through a right-hand side it gives the Jacobian's pattern; both
/// sides of a `select` count, so that the pattern holds for every value and mode.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Deps([u64; WORDS]);

impl Deps {
    /// The largest number of states that a set can hold.
    pub const CAPACITY: usize = 64 * WORDS;

    /// The set `{i}`. Panics if `i >= CAPACITY`.
    pub fn of(i: usize) -> Self {
        let mut bits = [0; WORDS];
        bits[i / 64] = 1 << (i % 64);
        Deps(bits)
    }

    /// Whether variable `i` is in the set.
    pub fn contains(&self, i: usize) -> bool {
        self.0[i / 64] >> (i % 64) & 1 == 1
    }

    fn union(self, other: Self) -> Self {
        Deps(std::array::from_fn(|i| self.0[i] | other.0[i]))
    }
}

impl From<f64> for Deps {
    fn from(_: f64) -> Self {
        Deps([0; WORDS])
    }
}

impl<const N: usize> From<Dual<f64, N>> for Deps {
    fn from(_: Dual<f64, N>) -> Self {
        Deps([0; WORDS])
    }
}

macro_rules! union_operator {
    ($($trait:ident $method:ident),*) => {$(
        impl $trait for Deps {
            type Output = Self;
            // The set of a product is the union: the operator of the trait does not matter here.
            #[allow(clippy::suspicious_arithmetic_impl)]
            fn $method(self, other: Self) -> Self {
                self.union(other)
            }
        }
    )*};
}
union_operator!(Add add, Sub sub, Mul mul, Div div);

macro_rules! union_assign {
    ($($trait:ident $method:ident),*) => {$(
        impl $trait for Deps {
            fn $method(&mut self, other: Self) {
                *self = self.union(other);
            }
        }
    )*};
}
union_assign!(AddAssign add_assign, SubAssign sub_assign, MulAssign mul_assign);

impl Neg for Deps {
    type Output = Self;
    fn neg(self) -> Self {
        self
    }
}

impl Over<f64> for Deps {}
impl<const N: usize> Over<Dual<f64, N>> for Deps {}

impl Real for Deps {
    type Mask = bool;

    fn c(_: f64) -> Self {
        Deps([0; WORDS])
    }
    fn fma(self, a: Self, b: Self) -> Self {
        self.union(a).union(b)
    }
    fn sqrt(self) -> Self {
        self
    }
    fn exp(self) -> Self {
        self
    }
    fn ln(self) -> Self {
        self
    }
    fn pow(self, exponent: Self) -> Self {
        self.union(exponent)
    }
    fn sin(self) -> Self {
        self
    }
    fn cos(self) -> Self {
        self
    }
    fn tanh(self) -> Self {
        self
    }
    fn lt(self, _: Self) -> bool {
        false
    }
    fn select(_: bool, a: Self, b: Self) -> Self {
        a.union(b)
    }
}
