use crate::friction::{FLOOR, InnerState, Levels};
use crate::parameter::{above, any, at_least};
use math::{Over, Real};

/// Largest rise above ambient, K, that warnings consider. Assumed.
pub(in crate::friction) const HOTTEST: f64 = 60.0;

crate::parameters! {
    /// Friction that depends on the temperature of the contact, for any law. Its own heat warms the contact:
    ///
    ///   `T = T_amb + theta,   dtheta/dt = (R P - theta)/tau             P: heat of friction, W`
    ///   `Fv(T) = Fv exp(-b (T - T0)),   Fc and Fs times 1 + c (T - T0)`
    ///
    /// The latter factor is at least a hundredth. theta is the rise of the contact above its surroundings. It is zero
    /// at the start from rest. Friction heat leaves the energy balance when it is produced. The heat stored in the
    /// contact is not booked. Source: [assumed]. The viscosity of grease falls exponentially, the stiffness of an
    /// elastomer changes linearly, and there is one thermal mass.
    pub struct Heating {
        /// Temperature T0 at which the law's parameters hold
        reference: "K", above(0.0);
        /// Decrease b of the viscous coefficient
        viscous: "1/K", at_least(0.0), default 0.0;
        /// Relative change c of Coulomb and breakaway force
        levels: "1/K", any(), default 0.0;
        /// Thermal resistance R from contact to surroundings
        resistance: "K/W", at_least(0.0), default 0.0;
        /// Time constant tau of warming
        time: "s", above(0.0);
        /// Temperature T_amb of the surroundings, from the circuit
        ambient: "K", above(0.0);
    }
}

/// The state theta.
pub(in crate::friction) const STATE: InnerState =
    InnerState { name: "contact_warming_k", unit: "K", scale: 10.0 };

impl<P: Real> Heating<P> {
    /// Returns the levels of a contact at this rise above its surroundings, K.
    #[inline(always)]
    pub fn apply<S: Over<P>>(&self, base: &Levels<S>, warming: S) -> Levels<S> {
        let above = S::from(self.ambient - self.reference) + warming;
        let levels = base.times(S::from(self.levels).fma(above, S::one()).max(S::c(FLOOR)));
        Levels { viscous: base.viscous * (-(S::from(self.viscous) * above)).exp(), ..levels }
    }

    /// Returns theta after a constant friction heat, W, for `duration`, s: the solution of [`Heating::rate`].
    pub fn after(&self, warming: P, heat: P, duration: P) -> P {
        let last = self.resistance * heat;
        last + (warming - last) * (-(duration / self.time)).exp()
    }

    /// Returns dtheta/dt for the friction heat, W.
    #[inline(always)]
    pub fn rate<S: Over<P>>(&self, warming: S, heat: S) -> S {
        S::from(self.resistance).fma(heat, -warming) / S::from(self.time)
    }
}
