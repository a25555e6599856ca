//! Sparsity from the type: a "number" that only records the states it depends on.

use crate::dual::Dual;
use crate::real::{Over, Real, functions};

/// A set of some of the states. One run of a right-hand side with such sets gives the columns of the Jacobian's
/// pattern. Both sides of a `select` count, so that the pattern holds for every value and mode.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Deps(u64);

impl Deps {
    /// Largest number of states in a set. A pattern of more states takes several runs.
    pub const CAPACITY: usize = 64;

    /// Returns the set `{i}`, or the empty set if `i >= CAPACITY`.
    pub fn of(i: usize) -> Self {
        Deps(u32::try_from(i).ok().and_then(|i| 1_u64.checked_shl(i)).unwrap_or(0))
    }

    /// Returns whether variable `i` is in the set.
    pub fn contains(&self, i: usize) -> bool {
        self.0 >> i & 1 == 1
    }

    fn union(self, other: Self) -> Self {
        Deps(self.0 | other.0)
    }
}

impl From<f64> for Deps {
    fn from(_: f64) -> Self {
        Deps(0)
    }
}

impl<const N: usize> From<Dual<f64, N>> for Deps {
    fn from(_: Dual<f64, N>) -> Self {
        Deps(0)
    }
}

crate::operators! {
    [] Deps, |a, b| +: a.union(b), -: a.union(b), *: a.union(b), /: a.union(b), neg: a
}

impl Over<f64> for Deps {}
impl<const N: usize> Over<Dual<f64, N>> for Deps {}

impl Real for Deps {
    type Mask = bool;

    fn c(_: f64) -> Self {
        Deps(0)
    }
    fn fma(self, a: Self, b: Self) -> Self {
        self.union(a).union(b)
    }
    functions!(same: sqrt exp ln sin cos tanh);
    fn pow(self, exponent: Self) -> Self {
        self.union(exponent)
    }
    fn lt(self, _: Self) -> bool {
        false
    }
    fn select(_: bool, a: Self, b: Self) -> Self {
        a.union(b)
    }
}
