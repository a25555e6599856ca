use super::bristles::{DEFLECTION, Passivity, damping};
use super::{At, InnerState, Law, Levels, sliding, stribeck::weight};
use crate::parameter::{above, at_least, between};
use math::{Over, Real};
use std::f64::consts::PI;

crate::parameters! {
    /// Elasto-plastic bristles: elastic up to a share of their greatest deflection, so that nothing
    /// drifts below breakaway.
    ///
    ///   dz/dt = v - w,    w = alpha |v| sigma0 z / g(v)       plastic slip rate
    ///   g(v) = Fc + (Fs - Fc) exp(-|v/vs|^n)
    ///   alpha = 0 for q <= c or v z < 0,  1/2 - 1/2 cos(pi (q - c)/(1 - c)) for c < q < 1,  1 above,
    ///   with q = sigma0 |z| / g(v)
    ///   F = sigma0 z + sigma1(v) dz/dt + Fv v                          [N], opposes v > 0
    ///   sigma1(v) = sigma1 exp(-(v/vd)^2), constant where no vd is given
    ///
    /// LuGre is alpha = 1. Up to c g/sigma0 a deflection comes back without loss; c is a share of the
    /// present greatest deflection, so that it keeps its meaning where the level grows with pressure
    /// or age. Passive under the conditions of LuGre. Source: [dupont2002].
    pub struct ElastoPlastic {
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
        /// Share c of the greatest deflection at which slip begins
        breakaway_share: "-", between(0.0, 1.0), default 0.9;
    } with {
        /// n = 2: a square instead of a power
        gaussian: bool,
        /// The bristle damping fades
        faded: bool,
    }
}

impl ElastoPlastic<f64> {
    pub(super) fn from_values(values: &[f64]) -> Self {
        ElastoPlastic {
            coulomb: values[0],
            breakaway: values[1],
            stribeck_velocity: values[2],
            stribeck_exponent: values[3],
            viscous: values[4],
            bristle_stiffness: values[5],
            bristle_damping: values[6],
            damping_fade_velocity: values[7],
            breakaway_share: values[8],
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
        passivity.warning("elasto-plastic", levels)
    }
}

impl<P: Real> ElastoPlastic<P> {
    #[inline(always)]
    fn weight<S: Over<P>>(&self, v: S) -> S {
        weight(v, self.stribeck_velocity, self.stribeck_exponent, self.gaussian)
    }

    /// alpha: which share of a motion is slip, for bristles deflected to the share `q` of their limit.
    #[inline(always)]
    fn plastic_share<S: Over<P>>(&self, v: S, z: S, q: S) -> S {
        let begin = S::from(self.breakaway_share);
        let way = ((q - begin) / (S::one() - begin)).max(S::zero()).min(S::one());
        let loading = S::c(0.5) - S::c(0.5) * (S::c(PI) * way).cos();
        S::select((v * z).lt(S::zero()), S::zero(), loading)
    }
}

impl<P: Real> Law<P> for ElastoPlastic<P> {
    const KEY: &'static str = "elasto-plastic";
    const TITLE: &'static str = "Elasto-plastic bristle model: no drift below breakaway";
    const SOURCE: &'static str = "dupont2002";
    const STATES: &'static [InnerState] = &[DEFLECTION];
    const BRISTLES: bool = true;

    fn levels(&self) -> Levels<P> {
        Levels { coulomb: self.coulomb, breakaway: self.breakaway }
    }

    #[inline(always)]
    fn force<S: Over<P>>(&self, at: &At<S>, levels: &Levels<S>, z: &[S], dz: &mut [S], _mode: P) -> S {
        let v = at.v;
        let elastic = S::from(self.bristle_stiffness) * z[0];
        let deflected = elastic / levels.at(self.weight(v));
        let rate = v - self.plastic_share(v, z[0], deflected.abs()) * v.abs() * deflected;
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
