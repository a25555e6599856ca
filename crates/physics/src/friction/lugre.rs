use super::bristles::{DEFLECTION, Passivity, damping};
use super::{At, InnerState, Law, Levels, sliding, stribeck::weight};
use crate::parameter::{above, at_least};
use math::{Over, Real};

crate::parameters! {
    /// LuGre: friction as the mean deflection z of elastic bristles.
    ///
    ///   dz/dt = v - sigma0 |v| z / g(v),    g(v) = Fc + (Fs - Fc) exp(-|v/vs|^n)
    ///   F = sigma0 z + sigma1(v) dz/dt + Fv v                          [N], opposes v > 0
    ///   sigma1(v) = sigma1 exp(-(v/vd)^2), constant where no vd is given
    ///
    /// Presliding, breakaway that falls with the rate of force, frictional lag, stick-slip. Under a
    /// load that oscillates below Fs it drifts: `elasto-plastic` does not. Passive where
    /// Fv >= sigma1 (Fs - Fc)/Fc, or with a fade where sigma1 vd/sqrt(2 e) <= 4 Fc.
    /// Source: [canudas1995]; passivity: [barabanov2000].
    pub struct LuGre {
        /// Coulomb force Fc
        coulomb: "N", above(0.0);
        /// Breakaway force Fs, the limit of sliding for v -> 0
        breakaway: "N", above(0.0);
        /// Stribeck velocity vs
        stribeck_velocity: "m/s", above(0.0);
        /// Stribeck exponent n
        stribeck_exponent: "-", above(0.0), default 2.0;
        /// Viscous coefficient Fv
        viscous: "N s/m", at_least(0.0), default 0.0;
        /// Bristle stiffness sigma0
        bristle_stiffness: "N/m", above(0.0);
        /// Bristle damping sigma1
        bristle_damping: "N s/m", at_least(0.0);
        /// Velocity vd at which the bristle damping fades; infinite: it does not fade
        damping_fade_velocity: "m/s", at_least(f64::MIN_POSITIVE), default f64::INFINITY;
    } with {
        /// n = 2: a square instead of a power
        gaussian: bool,
        /// The bristle damping fades
        faded: bool,
    }
}

impl LuGre<f64> {
    pub(super) fn from_values(values: &[f64]) -> Self {
        LuGre {
            coulomb: values[0],
            breakaway: values[1],
            stribeck_velocity: values[2],
            stribeck_exponent: values[3],
            viscous: values[4],
            bristle_stiffness: values[5],
            bristle_damping: values[6],
            damping_fade_velocity: values[7],
            gaussian: values[3] == 2.0,
            faded: values[7].is_finite(),
        }
    }

    pub(super) fn warning(&self, levels: &Levels<f64>) -> Option<String> {
        let passivity = Passivity {
            viscous: self.viscous,
            damping: self.bristle_damping,
            fade_velocity: self.damping_fade_velocity,
        };
        passivity.warning("lugre", levels)
    }
}

impl<P: Real> LuGre<P> {
    #[inline(always)]
    fn weight<S: Over<P>>(&self, v: S) -> S {
        weight(v, self.stribeck_velocity, self.stribeck_exponent, self.gaussian)
    }
}

impl<P: Real> Law<P> for LuGre<P> {
    const KEY: &'static str = "lugre";
    const TITLE: &'static str = "LuGre bristle model";
    const SOURCE: &'static str = "canudas1995";
    const STATES: &'static [InnerState] = &[DEFLECTION];
    const BRISTLES: bool = true;
    const CREEPS: bool = true;

    fn levels(&self) -> Levels<P> {
        Levels { coulomb: self.coulomb, breakaway: self.breakaway }
    }

    #[inline(always)]
    fn prepare<S: Over<P>>(&self, v: S) -> S {
        self.weight(v)
    }

    #[inline(always)]
    fn force<S: Over<P>>(&self, at: &At<S>, levels: &Levels<S>, z: &[S], dz: &mut [S], _mode: P) -> S {
        let v = at.v;
        let elastic = S::from(self.bristle_stiffness) * z[0];
        let rate = v - v.abs() * elastic / levels.at(at.prepared);
        let damping = damping(v, self.bristle_damping, self.damping_fade_velocity, self.faded);
        dz[0] = rate;
        S::from(self.viscous).fma(v, damping.fma(rate, elastic))
    }

    fn slip<S: Over<P>>(&self, v: S, dz: &[S]) -> S {
        v - dz[0]
    }

    fn stored<S: Over<P>>(&self, z: &[S]) -> S {
        S::c(0.5) * S::from(self.bristle_stiffness) * z[0] * z[0]
    }

    fn heat<S: Over<P>>(&self, v: S, force: S, z: &[S], dz: &[S]) -> S {
        force * v - S::from(self.bristle_stiffness) * z[0] * dz[0]
    }

    fn steady<S: Over<P>>(&self, v: S, levels: &Levels<S>) -> S {
        sliding(v, levels.at(self.weight(v)), self.viscous)
    }
}
