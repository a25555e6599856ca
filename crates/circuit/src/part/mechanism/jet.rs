//! Numbers with derivatives by the coordinates of a mechanism and along its motion.

use math::{Over, Real};
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

impl<S: Real, const N: usize> Add for Jet<S, N> {
    type Output = Self;
    #[inline(always)]
    fn add(self, o: Self) -> Self {
        let by_q = std::array::from_fn(|i| self.by_q[i] + o.by_q[i]);
        Jet { x: self.x + o.x, by_q, v: self.v + o.v, a: self.a + o.a }
    }
}

impl<S: Real, const N: usize> Sub for Jet<S, N> {
    type Output = Self;
    #[inline(always)]
    fn sub(self, o: Self) -> Self {
        let by_q = std::array::from_fn(|i| self.by_q[i] - o.by_q[i]);
        Jet { x: self.x - o.x, by_q, v: self.v - o.v, a: self.a - o.a }
    }
}

impl<S: Real, const N: usize> Mul for Jet<S, N> {
    type Output = Self;
    #[inline(always)]
    fn mul(self, o: Self) -> Self {
        Jet {
            x: self.x * o.x,
            by_q: std::array::from_fn(|i| self.by_q[i] * o.x + self.x * o.by_q[i]),
            v: self.v * o.x + self.x * o.v,
            a: self.a * o.x + self.x * o.a + S::c(2.0) * self.v * o.v,
        }
    }
}

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
        self.chain(root(self.x))
    }
    #[inline(always)]
    fn inverse(self) -> Self {
        self.chain(reciprocal(self.x))
    }
}

/// Returns the root of `x` with its first two derivatives.
fn root<S: Real>(x: S) -> [S; 3] {
    let root = x.sqrt();
    let first = S::c(0.5) / root;
    [root, first, -(first * S::c(0.5) / x)]
}

/// Returns the reciprocal of `x` with its first two derivatives.
fn reciprocal<S: Real>(x: S) -> [S; 3] {
    let inverse = S::one() / x;
    [inverse, -(inverse * inverse), S::c(2.0) * inverse * inverse * inverse]
}

/// A [`Jet`] with its own derivatives by the coordinates.
#[derive(Clone, Copy, Debug)]
pub struct Curved<P, const N: usize> {
    /// Value and derivatives.
    pub jet: Jet<P, N>,
    /// Second derivatives by q. Only the lower triangle is used.
    pub by_qq: [[P; N]; N],
    /// Derivatives of the first rate by q.
    pub v_by_q: [P; N],
    /// Derivatives of the second rate by q.
    pub a_by_q: [P; N],
}

impl<P: Real, const N: usize> Curved<P, N> {
    fn flat(jet: Jet<P, N>) -> Self {
        let zero = [P::zero(); N];
        Curved { jet, by_qq: [zero; N], v_by_q: zero, a_by_q: zero }
    }

    /// Returns the coordinates of a motion.
    pub fn coordinates(q: &[P; N], u: &[P; N]) -> [Self; N] {
        Jet::coordinates(q, u).map(Self::flat)
    }

    /// Returns the second derivative by two coordinates.
    #[inline(always)]
    pub fn second(&self, i: usize, j: usize) -> P {
        if j <= i { self.by_qq[i][j] } else { self.by_qq[j][i] }
    }

    #[inline]
    fn each(self, o: Self, f: impl Fn(P, P) -> P, jet: Jet<P, N>) -> Self {
        let mut by_qq = self.by_qq;
        for i in 0..N {
            for j in 0..=i {
                by_qq[i][j] = f(self.by_qq[i][j], o.by_qq[i][j]);
            }
        }
        Curved {
            jet,
            by_qq,
            v_by_q: std::array::from_fn(|i| f(self.v_by_q[i], o.v_by_q[i])),
            a_by_q: std::array::from_fn(|i| f(self.a_by_q[i], o.a_by_q[i])),
        }
    }

    #[inline(never)]
    fn chain(self, [f, f1, f2, f3]: [P; 4]) -> Self {
        let Jet { by_q: g, v, a, .. } = self.jet;
        let mut by_qq = self.by_qq;
        for i in 0..N {
            for j in 0..=i {
                by_qq[i][j] = f1 * by_qq[i][j] + f2 * g[i] * g[j];
            }
        }
        let (two, third) = (P::c(2.0), f3 * v * v);
        Curved {
            jet: self.jet.chain([f, f1, f2]),
            by_qq,
            v_by_q: std::array::from_fn(|i| f1 * self.v_by_q[i] + f2 * g[i] * v),
            a_by_q: std::array::from_fn(|i| {
                f1 * self.a_by_q[i] + f2 * (two * self.v_by_q[i] * v + g[i] * a) + third * g[i]
            }),
        }
    }
}

impl<P: Real, const N: usize> Add for Curved<P, N> {
    type Output = Self;
    #[inline]
    fn add(self, o: Self) -> Self {
        self.each(o, |a, b| a + b, self.jet + o.jet)
    }
}

impl<P: Real, const N: usize> Sub for Curved<P, N> {
    type Output = Self;
    #[inline]
    fn sub(self, o: Self) -> Self {
        self.each(o, |a, b| a - b, self.jet - o.jet)
    }
}

impl<P: Real, const N: usize> Mul for Curved<P, N> {
    type Output = Self;
    #[inline(never)]
    fn mul(self, o: Self) -> Self {
        let (one, other, two) = (self.jet, o.jet, P::c(2.0));
        let mut by_qq = self.by_qq;
        for i in 0..N {
            for j in 0..=i {
                by_qq[i][j] = self.by_qq[i][j] * other.x
                    + one.by_q[i] * other.by_q[j]
                    + one.by_q[j] * other.by_q[i]
                    + one.x * o.by_qq[i][j];
            }
        }
        Curved {
            jet: one * other,
            by_qq,
            v_by_q: std::array::from_fn(|i| {
                self.v_by_q[i] * other.x + one.by_q[i] * other.v + one.v * other.by_q[i] + one.x * o.v_by_q[i]
            }),
            a_by_q: std::array::from_fn(|i| {
                self.a_by_q[i] * other.x
                    + one.by_q[i] * other.a
                    + one.a * other.by_q[i]
                    + one.x * o.a_by_q[i]
                    + two * (self.v_by_q[i] * other.v + one.v * o.v_by_q[i])
            }),
        }
    }
}

impl<P: Real, const N: usize> Smooth<P> for Curved<P, N> {
    #[inline(always)]
    fn of(x: P) -> Self {
        Self::flat(Jet::constant(x))
    }
    #[inline]
    fn by(self, x: P) -> Self {
        self.each(self, |a, _| a * x, Smooth::<P>::by(self.jet, x))
    }
    #[inline(always)]
    fn sqrt(self) -> Self {
        let x = self.jet.x;
        let [f, f1, f2] = root(x);
        self.chain([f, f1, f2, -(P::c(1.5) * f2 / x)])
    }
    #[inline(always)]
    fn inverse(self) -> Self {
        let [f, f1, f2] = reciprocal(self.jet.x);
        self.chain([f, f1, f2, -(P::c(3.0) * f2 * f)])
    }
}
