use super::{At, Claims, Law, Levels, dry, levels_of};
use crate::parameter::{above, at_least};
use math::{Over, Real};

crate::parameters! {
    /// Coulomb and viscous friction.
    ///
    ///   `F(v) = Fc sgn(v) + Fv v                                       [N], opposes v > 0`
    ///   at rest: `F` = applied force, as long as `|applied| <= Fc`
    ///
    /// Sticking is exact: v = 0 until the applied force reaches Fc. No Stribeck effect, no
    /// presliding, no memory. Source: [armstrong1994].
    pub struct Coulomb {
        /// Coulomb force Fc
        coulomb: "N", above(0.0);
        /// Viscous coefficient Fv
        viscous: "N s/m", at_least(0.0), default 0.0;
    }
}

impl<P: Real> Law<P> for Coulomb<P> {
    const KEY: &'static str = "coulomb";
    const TITLE: &'static str = "Coulomb and viscous friction, exact sticking";
    const SOURCE: &'static str = "armstrong1994";
    const STICKS: bool = true;
    const CLAIMS: Claims =
        Claims { rate_independent: true, no_drift: true, always_passive: true, ..Claims::USUAL };

    levels_of!(coulomb coulomb viscous);

    #[inline(always)]
    fn force<S: Over<P>>(&self, at: &At<S>, levels: &Levels<S>, _z: &[S], _dz: &mut [S], mode: P) -> S {
        dry::force(at, mode, S::from(mode) * levels.coulomb + levels.viscous * at.v)
    }

    fn event<S: Over<P>>(&self, at: &At<S>, levels: &Levels<S>, _z: &[S], mode: P) -> S {
        dry::event(at, levels.coulomb, mode)
    }

    fn next_mode(&self, mode: P, at: &At<P>, levels: &Levels<P>, _z: &mut [P]) -> P {
        dry::next_mode(mode, at.applied, levels.coulomb)
    }
}
