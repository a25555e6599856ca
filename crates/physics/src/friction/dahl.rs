use super::bristles::DEFLECTION;
use super::{At, Claims, InnerState, Law, Levels, levels_of};
use crate::parameter::{above, at_least};
use math::{Over, Real};

/// Lower limit of |1 - q sgn v| in the power. It changes the rate by less than this fraction of v.
const SMALLEST_BASE: f64 = 1e-12;

crate::parameters! {
    /// Dahl: presliding that depends on the path only, not on the speed.
    ///
    ///   `dz/dt = v |1 - q sgn v|^i sgn(1 - q sgn v),    q = sigma0 z/Fc`
    ///   `F = sigma0 z + Fv v                                            [N], opposes v > 0`
    ///
    /// z is the deflection, m. sigma0 z is the F of Dahl, who writes dF/dx = sigma0 |1 - (F/Fc) sgn v|^i. From rest, i
    /// = 1: F = Fc [1 - exp(-sigma0 x/Fc)]. The law has neither a Stribeck effect nor a breakaway force above Fc. A
    /// load that oscillates below Fc drifts. An exponent below 1 is rejected, because its rate has no slope at |F| =
    /// Fc. Always passive: the heat is sigma0 z (v - dz/dt) + Fv v^2, and v - dz/dt never has the opposite sign of z.
    /// Source: [dahl1968].
    pub struct Dahl {
        /// Coulomb force Fc
        coulomb: "N", above(0.0);
        /// Viscous coefficient Fv
        viscous: "N s/m", at_least(0.0), default 0.0;
        /// Stiffness sigma0 of the contact at rest
        bristle_stiffness: "N/m", above(0.0);
        /// Exponent i: the bend from stiffness to sliding
        dahl_exponent: "-", at_least(1.0), default 1.0;
    }
}

impl<P: Real> Law<P> for Dahl<P> {
    const KEY: &'static str = "dahl";
    const TITLE: &'static str = "Dahl: presliding, independent of the rate";
    const SOURCE: &'static str = "dahl1968";
    const STATES: &'static [InnerState] = &[DEFLECTION];
    const BRISTLES: bool = true;
    const CLAIMS: Claims = Claims { rate_independent: true, always_passive: true, ..Claims::USUAL };

    levels_of!(coulomb coulomb viscous, spring bristle_stiffness);

    #[inline(always)]
    fn force<S: Over<P>>(&self, at: &At<S>, levels: &Levels<S>, z: &[S], dz: &mut [S], _mode: P) -> S {
        let v = at.v;
        let elastic = S::from(self.bristle_stiffness) * z[0];
        let deflected = elastic / levels.coulomb;
        let left = S::one() - S::select(v.lt(S::zero()), -deflected, deflected);
        let bend = left.abs().max(S::c(SMALLEST_BASE)).pow(S::from(self.dahl_exponent - P::one()));
        dz[0] = v * left * bend;
        levels.viscous.fma(v, elastic)
    }
}
