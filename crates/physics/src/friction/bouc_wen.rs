use super::bristles::DEFLECTION;
use super::{At, Claims, InnerState, Law, Levels, levels_of};
use crate::parameter::{above, at_least};
use math::{Over, Real};

/// Lower limit of |q| in the power. It changes the rate by less than this fraction of v.
const SMALLEST_BASE: f64 = 1e-12;

crate::parameters! {
    /// Bouc-Wen: a hysteresis loop of free shape, independent of the rate.
    ///
    ///   `dz/dt = v - [b |v| q + (1 - b) v |q|] |q|^(n-1),    q = sigma0 z/Fc`
    ///   `F = sigma0 z + Fv v                                            [N], opposes v > 0`
    ///
    /// The classic form F = alpha k x + (1 - alpha) k h, dh/dt = A v - beta |v| |h|^(n-1) h - gamma v |h|^n has one
    /// parameter too many. Here A = 1, (1 - alpha) k = sigma0, beta = b (sigma0/Fc)^n, gamma = (1 - b)(sigma0/Fc)^n, so
    /// that the plateau is Fc. The part alpha k x is a spring of position and not friction, so it belongs to the
    /// drive's spring. b = 1, n = 1 is `dahl`. b = 1/2 unloads along a straight line of slope sigma0. b < 1/2, that is
    /// |gamma| > beta, is rejected, because the loop would produce energy. With b >= 1/2 it is always passive: the heat
    /// is sigma0 |z| |q|^n [b |v| + (1 - b) v sgn z] + Fv v^2. A load that oscillates below Fc drifts. Source:
    /// [wen1976].
    pub struct BoucWen {
        /// Force Fc of the plateau
        coulomb: "N", above(0.0);
        /// Viscous coefficient Fv
        viscous: "N s/m", at_least(0.0), default 0.0;
        /// Stiffness sigma0 of the contact at rest
        bristle_stiffness: "N/m", above(0.0);
        /// Exponent n: how sharply stiffness turns to sliding
        bouc_wen_exponent: "-", at_least(1.0), default 1.0;
        /// Shape b = beta/(beta + gamma): how unloading bends
        loop_shape: "-", at_least(0.5), default 0.5;
    }
}

impl<P: Real> Law<P> for BoucWen<P> {
    const KEY: &'static str = "bouc-wen";
    const TITLE: &'static str = "Bouc-Wen: a hysteresis loop of free shape, independent of the rate";
    const SOURCE: &'static str = "wen1976";
    const STATES: &'static [InnerState] = &[DEFLECTION];
    const BRISTLES: bool = true;
    const CLAIMS: Claims = Claims { rate_independent: true, always_passive: true, ..Claims::USUAL };

    levels_of!(coulomb coulomb viscous, spring bristle_stiffness);

    #[inline(always)]
    fn force<S: Over<P>>(&self, at: &At<S>, levels: &Levels<S>, z: &[S], dz: &mut [S], _mode: P) -> S {
        let (v, shape) = (at.v, S::from(self.loop_shape));
        let elastic = S::from(self.bristle_stiffness) * z[0];
        let deflected = elastic / levels.coulomb;
        let size = deflected.abs();
        let bend = size.max(S::c(SMALLEST_BASE)).pow(S::from(self.bouc_wen_exponent - P::one()));
        dz[0] = v - (shape * v.abs() * deflected + (S::one() - shape) * v * size) * bend;
        levels.viscous.fma(v, elastic)
    }
}
