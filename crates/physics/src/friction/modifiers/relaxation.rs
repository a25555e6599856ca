use crate::friction::{At, InnerState};
use crate::parameter::{above, between};
use math::{Over, Real};

crate::parameters! {
    /// Stress relaxation of the bristles while the contact is held. Each bristle is a standard linear solid: a spring
    /// sigma0 (1 - rho) parallel to a spring sigma0 rho in series with a dashpot. It works with bristle laws. Here z is
    /// the deflection, d that of the dashpot, and w = v - dz/dt the slip rate of the law:
    ///
    ///   `s = z - rho d                              replaces z in the law`
    ///   `dd/dt = (z - d)/tau - d |w| / L            the dashpot follows, and slip renews bristles`
    ///   `dz/dt = v - w - A                          A: the deflection that leaves with renewed dashpots`
    ///   `A = rho max(0, d |w|/L - max(0, (z - d)/tau))        for d > 0, mirrored for d < 0`
    ///
    /// If the contact is held after sliding, the force falls by the fraction rho of its elastic part with the time
    /// constant tau. Steady sliding is exactly that of the law (there dd/dt = 0, so A = 0 and w = v), and |s| stays
    /// within the law's limit. The stored energy is W = (1 - rho) W(z) + rho W(z - d). The heat exceeds that of the law
    /// by sigma0 (s A + rho (z - d) dd/dt) >= 0 for any rho, tau and L. The proof is in docs/theory/friction.md. Source
    /// of the element: [ferry1980].
    pub struct Relaxation {
        /// Fraction rho of the elastic force that relaxes
        share: "-", between(0.0, 1.0);
        /// Time constant tau
        time: "s", above(0.0);
        /// Sliding distance L that renews the bristles
        distance: "m", above(0.0);
    }
}

/// The state d.
pub(in crate::friction) const STATE: InnerState =
    InnerState { name: "relaxed_deflection_m", unit: "m", scale: 1e-3 };

impl<P: Real> Relaxation<P> {
    /// Returns s, which replaces z in the law.
    #[inline(always)]
    pub(in crate::friction) fn seen<S: Over<P>>(&self, z: S, d: S) -> S {
        z - S::from(self.share) * d
    }

    /// Returns (dz/dt, dd/dt) from the rate v - w that the law gives at velocity v.
    #[inline(always)]
    pub(in crate::friction) fn rates<S: Over<P>>(&self, at: &At<S>, z: S, d: S, law_rate: S) -> [S; 2] {
        let o = S::zero();
        let yielding = (z - d) / S::from(self.time);
        let renewal = d * (at.v - law_rate).abs() / S::from(self.distance);
        let leaving =
            S::select(d.lt(o), (renewal - yielding.min(o)).min(o), (renewal - yielding.max(o)).max(o));
        [law_rate - S::from(self.share) * leaving, yielding - renewal]
    }

    /// Returns a weighted sum of a function of the law at the deflections z and z - d.
    pub(in crate::friction) fn mixed<S: Over<P>>(&self, of_all: S, of_springs: S) -> S {
        let share = S::from(self.share);
        (S::one() - share) * of_all + share * of_springs
    }
}
