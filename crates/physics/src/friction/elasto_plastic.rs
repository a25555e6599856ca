use super::bristles::{DEFLECTION, bristle_law, bristle_parameters};
use super::{At, Claims, InnerState, Law, Levels, sliding};
use crate::parameter::between;
use math::{Over, Real};
use std::f64::consts::PI;

bristle_parameters! {
    /// Elasto-plastic bristles: elastic up to a fraction of their largest deflection, without drift below breakaway.
    ///
    ///   `dz/dt = v - w,    w = alpha |v| sigma0 z / g(v)       plastic slip rate`
    ///   `g(v) = Fc + (Fs - Fc) exp(-|v/vs|^n)`
    ///   `alpha = 0 for q <= c or v z < 0,  1/2 - 1/2 cos(pi (q - c)/(1 - c)) for c < q < 1,  1 above,`
    ///   `with q = sigma0 |z| / g(v)`
    ///   `F = sigma0 z + sigma1(v) dz/dt + Fv v                          [N], opposes v > 0`
    ///   `sigma1(v) = sigma1 exp(-(v/vd)^2), constant without vd`
    ///
    /// LuGre is alpha = 1. Up to c g/sigma0, a deflection returns without loss. Here c is relative to the present
    /// largest deflection, so that it keeps its meaning if the level grows with pressure or age. Passive under the conditions
    /// of LuGre. Source: [dupont2002].
    pub struct ElastoPlastic {
        /// Fraction c of the largest deflection at which slip begins
        breakaway_share: "-", between(0.0, 1.0), default 0.9;
    }
}

/// Returns alpha, the fraction of the motion that is slip. The bristles are deflected to the fraction `q` of their
/// limit, and slip begins at the fraction `begin`. `loading` has the sign of v z.
#[inline(always)]
pub fn plastic_share<S: Real>(begin: S, loading: S, q: S) -> S {
    let way = ((q - begin) / (S::one() - begin)).max(S::zero()).min(S::one());
    let slips = S::c(0.5) - S::c(0.5) * (S::c(PI) * way).cos();
    S::select(loading.lt(S::zero()), S::zero(), slips)
}

impl<P: Real> Law<P> for ElastoPlastic<P> {
    const KEY: &'static str = "elasto-plastic";
    const TITLE: &'static str = "Elasto-plastic bristle model: no drift below breakaway";
    const SOURCE: &'static str = "dupont2002";
    const STATES: &'static [InnerState] = &[DEFLECTION];
    const BRISTLES: bool = true;
    const DAMPED: bool = true;
    const CLAIMS: Claims = Claims { no_drift: true, ..Claims::USUAL };

    bristle_law!();

    #[inline(always)]
    fn force<S: Over<P>>(&self, at: &At<S>, levels: &Levels<S>, z: &[S], dz: &mut [S], _mode: P) -> S {
        let v = at.v;
        let elastic = S::from(self.bristle_stiffness) * z[0];
        let deflected = elastic / levels.at(self.weight(v));
        let slips = plastic_share(S::from(self.breakaway_share), v * z[0], deflected.abs());
        let rate = v - slips * v.abs() * deflected;
        dz[0] = rate;
        self.force_of(v, levels.viscous, elastic, rate)
    }

    fn steady<S: Over<P>>(&self, v: S, levels: &Levels<S>) -> S {
        sliding(v, levels.at(self.weight(v)), levels.viscous)
    }
}
