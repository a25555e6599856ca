use math::{Over, Real};

crate::parameters! {
    /// Spring and damper that a piston meets at the end of its stroke:
    ///
    ///   `F = max(0, k d + c min(d/d_c, 1) d_dot)                              [N], pushes back`
    ///
    /// d penetration m, d_dot closing speed m/s. The damping grows with depth, so that the force does not jump at
    /// contact, and the stop never pulls. Source: [assumed], the usual spring-damper stop.
    pub struct EndStop {
        /// Spring stiffness k
        stiffness: "N/m", crate::above(0.0);
        /// Damping c at full depth
        damping: "N s/m", crate::at_least(0.0);
        /// Depth d_c from which the damper acts fully
        damping_depth: "m", crate::above(0.0);
    }
}

impl<P: Real> EndStop<P> {
    /// Returns the restoring force, N, for penetration `d` and closing speed. Zero for a negative penetration.
    #[inline(always)]
    pub fn force<S: Over<P>>(&self, d: S, closing: S) -> S {
        let depth = d.max(S::zero());
        let share = (depth * S::from(P::one() / self.damping_depth)).min(S::one());
        let push = (S::from(self.stiffness) * depth + S::from(self.damping) * share * closing).max(S::zero());
        S::select(S::zero().lt(d), push, S::zero())
    }
}
