//! Arguments of a friction law: motion and pressures, and the levels of its force.

use math::Real;

/// Arguments at which a law is evaluated.
#[derive(Clone, Copy, Debug)]
pub struct At<S> {
    /// Sliding velocity, m/s.
    pub v: S,
    /// Position, m.
    pub x: S,
    /// Gauge pressure in chamber a, Pa.
    pub gauge_a: S,
    /// Gauge pressure in chamber b, Pa.
    pub gauge_b: S,
    /// Sum of all other forces in +x, N: friction balances it in stick.
    pub applied: S,
    /// Result of [`Law::prepare`](super::Law::prepare) for this velocity.
    pub prepared: S,
}

math::mapped!(At { v, x, gauge_a, gauge_b, applied, prepared });

impl<S: Real> At<S> {
    /// Returns the state of rest at x = 0 under ambient pressure, without applied force.
    pub fn at_rest() -> Self {
        let o = S::zero();
        At { v: o, x: o, gauge_a: o, gauge_b: o, applied: o, prepared: o }
    }

    /// Returns the same with gauge pressures, Pa, in chambers a and b.
    pub fn pressed(self, gauge_a: S, gauge_b: S) -> Self {
        At { gauge_a, gauge_b, ..self }
    }
}

/// Force levels that dependences change, before the law is evaluated.
#[derive(Clone, Copy, Debug)]
pub struct Levels<S> {
    /// Coulomb force Fc, N.
    pub coulomb: S,
    /// Breakaway force Fs, N.
    pub breakaway: S,
    /// Viscous coefficient Fv, N s/m.
    pub viscous: S,
    /// Addition to Fc and Fs for a contact deflected towards +x, and the same subtraction towards -x: see
    /// [`Sense::Deflection`](super::Sense::Deflection).
    pub lean: [S; 2],
}

math::mapped!(Levels { coulomb, breakaway, viscous } arrays { lean });

impl<S: Real> Levels<S> {
    /// Creates equal levels in both directions.
    #[inline(always)]
    pub fn new(coulomb: S, breakaway: S, viscous: S) -> Self {
        Levels { coulomb, breakaway, viscous, lean: [S::zero(); 2] }
    }

    /// Returns the levels in the direction that has the sign of `way`.
    #[inline(always)]
    pub(super) fn towards(&self, way: S) -> Self {
        let [coulomb, breakaway] = self.lean.map(|lean| S::select(way.lt(S::zero()), -lean, lean));
        Levels::new(self.coulomb + coulomb, self.breakaway + breakaway, self.viscous)
    }

    /// Returns Fc and Fs times a factor.
    #[inline(always)]
    pub(super) fn times(&self, factor: S) -> Self {
        let lean = self.lean.map(|lean| lean * factor);
        Levels { coulomb: self.coulomb * factor, breakaway: self.breakaway * factor, lean, ..*self }
    }

    /// Returns Fc and Fs plus a force, N.
    #[inline(always)]
    pub(super) fn plus(&self, force: S) -> Self {
        Levels { coulomb: self.coulomb + force, breakaway: self.breakaway + force, ..*self }
    }

    /// Returns Fc + (Fs - Fc) weight, N.
    #[inline(always)]
    pub(super) fn at(&self, weight: S) -> S {
        (self.breakaway - self.coulomb).fma(weight, self.coulomb)
    }
}
