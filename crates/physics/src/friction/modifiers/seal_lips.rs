use crate::friction::{At, FLOOR, Levels};
use crate::parameter::any;
use math::{Over, Real};

crate::parameters! {
    /// Lip seals pressed against the bore by the pressure in each chamber. For any law:
    ///
    ///   `Fc(p) = Fc + c_a (p_a - p_amb) + c_b (p_b - p_amb)`
    ///   `Fs(p) = Fs + s_a (p_a - p_amb) + s_b (p_b - p_amb)                            [N]`
    ///
    /// The form is affine, because the radial load of a lip is affine in the pressure difference across it. The affine
    /// form also holds below ambient pressure. The levels never fall below a hundredth of their value without pressure.
    /// Source: [assumed], lip seal under pressure: F = pi D mu (q0 + c_w dp).
    pub struct SealLips {
        /// Coulomb force per gauge pressure in chamber a
        coulomb_a: "N/Pa", any(), default 0.0;
        /// Coulomb force per gauge pressure in chamber b
        coulomb_b: "N/Pa", any(), default 0.0;
        /// Breakaway force per gauge pressure in chamber a
        breakaway_a: "N/Pa", any(), default 0.0;
        /// Breakaway force per gauge pressure in chamber b
        breakaway_b: "N/Pa", any(), default 0.0;
    }
}

impl<S: Real> Levels<S> {
    /// Returns the levels under the seal lips of a contact, if it has any.
    #[inline(always)]
    pub(in crate::friction) fn under<P: Real>(self, lips: Option<&SealLips<P>>, at: &At<S>) -> Self
    where
        S: Over<P>,
    {
        let Some(lips) = lips else { return self };
        let affine = |level: S, a: P, b: P| {
            let sum = S::from(a).fma(at.gauge_a, S::from(b).fma(at.gauge_b, level));
            sum.max(S::c(FLOOR) * level)
        };
        Levels {
            coulomb: affine(self.coulomb, lips.coulomb_a, lips.coulomb_b),
            breakaway: affine(self.breakaway, lips.breakaway_a, lips.breakaway_b),
            ..self
        }
    }
}
