use super::bristles::DEFLECTION;
use super::{At, Choices, Claims, Described, InnerState, Law, Levels, Sense, levels_of};
use crate::parameter::{above, at_least, between};
use math::{Over, Real};
use serde::Deserialize;

/// Evolution of the state of the contact.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Evolution {
    /// dtheta/dt = 1 - |w| theta/L: the contact ages with time, also at rest. Source: [dieterich1979].
    #[default]
    Ageing,
    /// dtheta/dt = -(|w| theta/L) ln(|w| theta/L): it changes only by slip. Source: [ruina1983].
    Slip,
}

/// The state psi = ln(v0 theta/L): 0 in steady sliding at the reference velocity.
const STATE: InnerState = InnerState { name: "contact_log_age", unit: "-", scale: 1.0 };

/// Upper limit of exponents: slip of 1e43 reference velocities, or equally young contacts, which no motion reaches.
const LARGEST_EXPONENT: f64 = 100.0;

/// Lower limit of |w|/v0 in its logarithm, which is multiplied by |w|.
const SMALLEST_RATIO: f64 = 1e-300;

/// Least velocity of steady sliding, m/s. Slower sliding uses the state for this velocity.
const SLOWEST: f64 = 1e-18;

/// Steady sliding is known up to this fraction of vc.
const FASTEST: f64 = 0.999;

/// ln of the largest argument of asinh in steady sliding. Its square is still finite.
const LARGEST_LOG: f64 = 340.0;

crate::parameters! {
    /// Rate and state: friction that grows with the logarithm of the velocity at once, and with that of the contact's
    /// age, over an elastic contact.
    ///
    ///   `F = sigma0 z + Fv v,    dz/dt = v - w                            [N], opposes v > 0`
    ///   `sigma0 z = a F0 asinh( w/(2 v0) exp((1 + b psi)/a) ),   psi = ln(v0 theta/L)`
    ///   `u = 2 v0 sinh(sigma0 z/(a F0)) exp(-(1 + b psi)/a),  w = u/(1 + |u|/vc)    the same solved for the slip rate`
    ///   `ageing:  dpsi/dt = (v0/D) exp(-psi) - |w|/D          slip:  dpsi/dt = -(|w|/D)(psi + ln(|w|/v0))`
    ///   `D = max(L, b F0/sigma0),   (1 + b psi)/a not below ln(v0/vc)`
    ///
    /// * `F0`: level: steady friction at v0, mu0 times the normal force, N.
    /// * `a`: direct effect over F0 (a/mu0 of the source).
    /// * `b`: evolution effect over F0 (b/mu0 of the source).
    /// * `psi`: logarithm of the age theta over that of steady sliding at v0, so that the age stays positive.
    ///
    /// Steady sliding: F0 [1 + (a - b) ln(|v|/v0)] + Fv v if the logarithm is far from -1/a. Modifiers of the level
    /// scale a F0 and b F0 with it, as a normal force does. asinh is the logarithm of the source, made finite at rest.
    /// The difference is exp(-2 F/(a F0))/4 of a F0. The contact is elastic because the force then determines the slip.
    /// Without elasticity, a velocity of 1e-20 m/s would have to be resolved for the force at rest. The elastic contact
    /// delays the direct effect in velocity steps by a F0/sigma0. A contact softer than b F0/L would show stick-slip
    /// without any mass, about sigma0 |v|/F0 times a second. This would be a motion of the spring and not of the
    /// sources. The contact is therefore renewed over at least its elastic deflection b F0/sigma0. In sliding, vc adds
    /// the fraction a |v|/vc of the level: 1e-4 at 1 m/s for a = 0.1. If the curve would fall below zero, half of this
    /// remains.
    ///
    /// It creeps at rest under any load, at v0 exp(-(1 + b psi - F/F0)/a), and does not have a fixed breakaway force.
    /// The peak grows by b F0 for each e-fold of the rest time (ageing). It never produces energy: w has the sign of z.
    /// Sources: [dieterich1979], [ruina1983]; values of rock: [marone1998].
    pub struct RateAndState {
        /// Level F0: steady friction at the reference velocity
        coulomb: "N", above(0.0);
        /// Direct effect a, fraction of the level for each e-fold of the velocity
        direct_effect: "-", between(0.004, 1.0);
        /// Evolution effect b, fraction of the level for each e-fold of the age
        evolution_effect: "-", at_least(0.0);
        /// Sliding distance L that renews the contact
        distance: "m", above(0.0);
        /// Reference velocity v0
        reference_velocity: "m/s", above(0.0);
        /// Stiffness sigma0 of the contact
        bristle_stiffness: "N/m", above(0.0);
        /// Viscous coefficient Fv
        viscous: "N s/m", at_least(0.0), default 0.0;
        /// Velocity vc, upper limit of slip
        slip_velocity: "m/s", above(0.0), default 1000.0;
    } with {
        /// Evolution of the inner state of the contact
        evolution: Evolution,
    }
}

impl Described for RateAndState<f64> {
    fn build(values: &[f64], choices: &Choices) -> Self {
        RateAndState::from_values(values, choices.evolution)
    }

    fn warning(&self, levels: &Levels<f64>) -> Option<String> {
        let needed = self.evolution_effect * levels.coulomb / self.distance;
        (self.bristle_stiffness < needed).then(|| {
            let (given, taken) = (1e6 * self.distance, 1e6 * self.renewal(levels));
            format!(
                "this rate-and-state contact is too soft for friction.distance = {given:.3} um: it gives way elastically by \
                 evolution_effect coulomb/bristle_stiffness = {taken:.3} um, over which it is renewed instead; \
                 bristle_stiffness = {needed:.3e} N/m or more keeps the distance"
            )
        })
    }
}

impl<P: Real> RateAndState<P> {
    /// Returns D, m: the distance that renews the contact, at least its elastic deflection.
    fn renewal<S: Over<P>>(&self, levels: &Levels<S>) -> S {
        let largest = levels.coulomb + levels.lean[0].abs();
        (S::from(self.evolution_effect / self.bristle_stiffness) * largest).max(S::from(self.distance))
    }

    /// Returns (1 + b psi)/a: the strength of the contact at the state psi, in e-folds. Slip without load is at most as
    /// viscous as vc.
    fn hold<S: Over<P>>(&self, psi: S) -> S {
        let least = S::from((self.reference_velocity / self.slip_velocity).ln());
        (S::from(self.evolution_effect).fma(psi, S::one()) / S::from(self.direct_effect)).max(least)
    }

    /// Returns w, m/s, under the elastic force on a contact of state psi.
    fn slip_rate<S: Over<P>>(&self, elastic: S, psi: S, levels: &Levels<S>) -> S {
        let push = (elastic / (S::from(self.direct_effect) * levels.coulomb)).abs();
        // Returns 2 sinh(push) as exp(push) [1 - exp(-2 push)]. The bracket is accurate for a weak and a strong push.
        let tanh = push.tanh();
        let bracket = (tanh + tanh) / (S::one() + tanh);
        let folds = (push - self.hold(psi)).min(S::c(LARGEST_EXPONENT));
        let speed = S::from(self.reference_velocity) * bracket * folds.exp();
        let slip = speed / (S::one() + speed / S::from(self.slip_velocity));
        S::select(elastic.lt(S::zero()), -slip, slip)
    }

    /// Returns dpsi/dt, 1/s.
    fn evolve<S: Over<P>>(&self, psi: S, slip: S, levels: &Levels<S>) -> S {
        let (v0, distance) = (S::from(self.reference_velocity), self.renewal(levels));
        let renewal = slip.abs() / distance;
        match self.evolution {
            Evolution::Ageing => (-psi).min(S::c(LARGEST_EXPONENT)).exp() * v0 / distance - renewal,
            Evolution::Slip => -renewal * (psi + (slip.abs() / v0).max(S::c(SMALLEST_RATIO)).ln()),
        }
    }
}

impl<P: Real> Law<P> for RateAndState<P> {
    const KEY: &'static str = "rate-and-state";
    const TITLE: &'static str = "Rate and state: logarithmic in velocity and in the age of the contact";
    const SOURCE: &'static str = "ruina1983";
    const STATES: &'static [InnerState] = &[DEFLECTION, STATE];
    const SENSE: Sense = Sense::Deflection;
    const EVOLVES: bool = true;
    const CLAIMS: Claims = Claims { always_passive: true, ..Claims::USUAL };

    levels_of!(coulomb coulomb viscous, spring bristle_stiffness);

    fn force<S: Over<P>>(&self, at: &At<S>, levels: &Levels<S>, z: &[S], dz: &mut [S], _mode: P) -> S {
        let elastic = S::from(self.bristle_stiffness) * z[0];
        let slip = self.slip_rate(elastic, z[1], &levels.towards(elastic));
        dz[0] = at.v - slip;
        dz[1] = self.evolve(z[1], slip, levels);
        levels.viscous.fma(at.v, elastic)
    }

    fn steady<S: Over<P>>(&self, v: S, levels: &Levels<S>) -> S {
        let (v0, vc) = (S::from(self.reference_velocity), S::from(self.slip_velocity));
        let speed = v.abs().max(S::c(SLOWEST)).min(S::c(FASTEST) * vc);
        let held = self.hold(-(speed / v0).ln());
        // Returns asinh of half of u/v0 exp(held).
        let log = (speed / (v0 * (S::one() - speed / vc))).ln() + held;
        let half = S::c(0.5) * log.min(S::c(LARGEST_LOG)).exp();
        let push = (half + half.fma(half, S::one()).sqrt()).ln();
        let level = S::from(self.direct_effect) * levels.towards(v).coulomb * push;
        super::sliding(v, level, levels.viscous)
    }
}
