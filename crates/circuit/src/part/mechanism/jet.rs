//! Numbers with derivatives by the coordinates of a mechanism and along its motion.

use math::{Dual, Over, Real};
use std::ops::{Add, Mul, Sub};

/// A number in the geometry of a mechanism, with the constants `P` of its description.
pub trait Smooth<P>: Copy + Add<Output = Self> + Sub<Output = Self> + Mul<Output = Self> {
    /// Returns a constant.
    fn of(x: P) -> Self;
    /// Returns this number times a constant.
    fn by(self, x: P) -> Self;
    /// Returns the square root.
    fn sqrt(self) -> Self;
    /// Returns the reciprocal.
    fn inverse(self) -> Self;
}

/// A function of the coordinates q, along a motion q(t) with rates u and q'' = 0.
#[derive(Clone, Copy, Debug)]
pub struct Jet<S, const N: usize> {
    /// Value of the function.
    pub x: S,
    /// Derivatives by q.
    pub by_q: [S; N],
    /// First rate along the motion.
    pub v: S,
    /// Second rate along the motion.
    pub a: S,
}

impl<S: Real, const N: usize> Jet<S, N> {
    fn constant(x: S) -> Self {
        Jet { x, by_q: [S::zero(); N], v: S::zero(), a: S::zero() }
    }

    /// Returns the coordinates of a motion.
    pub fn coordinates(q: &[S; N], u: &[S; N]) -> [Self; N] {
        std::array::from_fn(|i| {
            let mut own = Jet { v: u[i], ..Self::constant(q[i]) };
            own.by_q[i] = S::one();
            own
        })
    }

    /// Returns a function of this number, from its value and two derivatives.
    #[inline(always)]
    fn chain(self, [f, f1, f2]: [S; 3]) -> Self {
        Jet { x: f, by_q: self.by_q.map(|g| f1 * g), v: f1 * self.v, a: f1 * self.a + f2 * self.v * self.v }
    }
}

math::operator!([S: Real, const N: usize] Jet<S, N>, |f, g| Add add Jet {
    x: f.x + g.x,
    by_q: std::array::from_fn(|i| f.by_q[i] + g.by_q[i]),
    v: f.v + g.v,
    a: f.a + g.a,
});
math::operator!([S: Real, const N: usize] Jet<S, N>, |f, g| Sub sub Jet {
    x: f.x - g.x,
    by_q: std::array::from_fn(|i| f.by_q[i] - g.by_q[i]),
    v: f.v - g.v,
    a: f.a - g.a,
});
math::operator!([S: Real, const N: usize] Jet<S, N>, |f, g| Mul mul Jet {
    x: f.x * g.x,
    by_q: std::array::from_fn(|i| f.by_q[i] * g.x + f.x * g.by_q[i]),
    v: f.v * g.x + f.x * g.v,
    a: f.a * g.x + f.x * g.a + S::c(2.0) * f.v * g.v,
});

impl<P: Real, S: Over<P>, const N: usize> Smooth<P> for Jet<S, N> {
    #[inline(always)]
    fn of(x: P) -> Self {
        Self::constant(S::from(x))
    }
    #[inline(always)]
    fn by(self, x: P) -> Self {
        let x = S::from(x);
        Jet { x: self.x * x, by_q: self.by_q.map(|g| g * x), v: self.v * x, a: self.a * x }
    }
    #[inline(always)]
    fn sqrt(self) -> Self {
        let root = self.x.sqrt();
        let first = S::c(0.5) / root;
        self.chain([root, first, -(first * S::c(0.5) / self.x)])
    }
    #[inline(always)]
    fn inverse(self) -> Self {
        let inverse = S::one() / self.x;
        self.chain([inverse, -(inverse * inverse), S::c(2.0) * inverse * inverse * inverse])
    }
}

impl<P: Real, const N: usize> Jet<Dual<P, N>, N> {
    /// Returns the coordinates of a motion. All numbers that follow from them have derivatives by the coordinates.
    pub fn curved(q: &[P; N], u: &[P; N]) -> [Self; N] {
        Self::coordinates(&std::array::from_fn(|k| Dual::variable(q[k], k)), &u.map(Dual::from))
    }
}
