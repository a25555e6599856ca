use super::{FLOOR, InnerState, Levels};
use crate::parameter::{above, any, at_least};
use math::{Over, Real};

/// The greatest rise above ambient, K, that warnings consider. Assumed.
pub(super) const HOTTEST: f64 = 60.0;

crate::parameters! {
    /// Friction that depends on the temperature of the contact, on any law; its own heat warms it:
    ///
    ///   T = T_amb + theta,   dtheta/dt = (R P - theta)/tau             P: heat of friction, W
    ///   Fv(T) = Fv exp(-b (T - T0)),   Fc and Fs times 1 + c (T - T0)
    ///
    /// the latter never less than a hundredth. theta is what the contact is warmer than its surroundings: at rest
    /// it is nought. The heat that leaves the drive is that of friction, when it is made: what the contact
    /// holds is not booked. Source: [assumed], viscosity of grease that falls exponentially, stiffness of an
    /// elastomer that changes linearly, one thermal mass.
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
        /// Temperature T_amb of the surroundings; the circuit's own
        ambient: "K", above(0.0);
    }
}

/// The state theta.
pub(super) const STATE: InnerState = InnerState { name: "contact_warming_k", unit: "K", scale: 10.0 };

impl<P: Real> Heating<P> {
    /// The levels of a contact at this rise above its surroundings, K.
    #[inline(always)]
    pub fn apply<S: Over<P>>(&self, base: &Levels<S>, warming: S) -> Levels<S> {
        let above = S::from(self.ambient - self.reference) + warming;
        let levels = base.times(S::from(self.levels).fma(above, S::one()).max(S::c(FLOOR)));
        Levels { viscous: base.viscous * (-(S::from(self.viscous) * above)).exp(), ..levels }
    }

    /// theta after `duration`, s, of a constant heat of friction, W: the solution of [`Heating::rate`].
    pub fn after(&self, warming: P, heat: P, duration: P) -> P {
        let last = self.resistance * heat;
        last + (warming - last) * (-(duration / self.time)).exp()
    }

    /// dtheta/dt with the heat of friction, W.
    #[inline(always)]
    pub fn rate<S: Over<P>>(&self, warming: S, heat: S) -> S {
        S::from(self.resistance).fma(heat, -warming) / S::from(self.time)
    }
}
