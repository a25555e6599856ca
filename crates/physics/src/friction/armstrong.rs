use super::bristles::DEFLECTION;
use super::{At, Claims, InnerState, Law, Levels, Sense, Shape, dry, levels_of, sliding, weight};
use crate::parameter::{above, at_least};
use math::{Over, Real};

crate::parameters! {
    /// Armstrong: seven parameters, with presliding, a memory of the velocity, and static friction that rises during a
    /// stop.
    ///
    ///   `stick:  F = kt z + Fv v,   dz/dt = v`
    ///           It ends at `kt |z| = Fc + E` while v loads the contact.
    ///   `slip:   F = G sgn(v) + Fv v,   G = Fc + E/[1 + (u/vs)^2]                           [N], opposes v > 0`
    ///           It ends at `v = 0`.
    ///   `E = (Fs - Fc) [1 - l gamma/(t + gamma)]           static friction above Fc after a stop of length t`
    ///   `tau du/dt = v - u                                 frictional memory`
    ///
    /// At the start of a stop t = 0, and l becomes the missing fraction of Fs - Fc in G: E continues from its value at
    /// the arrival, Ea = G - Fc, as Ea + (Fs - Fc - Ea) t/(t + gamma). During slip, E is constant (t = 0 and l from the
    /// breakaway), so that t > 0 indicates stick. A drive begins well rested, l = 0.
    ///
    /// Three choices are necessary, because the source leaves details open or is not a differential equation. (1) The u
    /// of the
    /// source is v delayed by tau. Here it is a first-order lag with the same time constant. At the frequency w, its
    /// phase is -atan(w tau) instead of -w tau, and its amplitude 1/sqrt(1 + (w tau)^2) instead of 1. The differences
    /// are 0.009 rad and 4.2 % at w tau = 0.3. (2) In slip z follows, dz/dt = v - |v| kt z/G, so that a stop starts
    /// with the force at the end of slip, not with zero. (3) Viscous friction also acts in stick, where it damps the
    /// spring kt. Always passive: with the store kt z^2/2 the heat of slip is |v| (G - kt z sgn v + (kt z)^2/G) + Fv
    /// v^2 > 0. Source: [armstrong1994].
    pub struct Armstrong {
        /// Coulomb force Fc
        coulomb: "N", above(0.0);
        /// Breakaway force Fs after a long stop
        breakaway: "N", above(0.0);
        /// Stribeck velocity vs
        stribeck_velocity: "m/s", above(0.0);
        /// Viscous coefficient Fv
        viscous: "N s/m", at_least(0.0), default 0.0;
        /// Presliding stiffness kt
        bristle_stiffness: "N/m", above(0.0);
        /// Frictional memory tau: time by which friction lags behind the velocity
        memory_time: "s", above(0.0);
        /// Time gamma of a stop after which half of the lost static friction has returned
        recovery_time: "s", above(0.0);
    }
}

/// Indices of z, u, t and l among the inner states.
const Z: usize = 0;
const U: usize = 1;
const T: usize = 2;
const L: usize = 3;

impl<P: Real> Armstrong<P> {
    /// Returns E/(Fs - Fc): the present fraction of static friction.
    #[inline(always)]
    fn rested<S: Over<P>>(&self, z: &[S]) -> S {
        let gamma = S::from(self.recovery_time);
        S::one() - z[L] * gamma / (z[T] + gamma)
    }

    /// Returns 1/[1 + (u/vs)^2].
    #[inline(always)]
    fn weight<S: Over<P>>(&self, u: S) -> S {
        weight(u, self.stribeck_velocity, P::c(2.0), Shape::Lorentzian)
    }
}

impl<P: Real> Law<P> for Armstrong<P> {
    const KEY: &'static str = "armstrong";
    const TITLE: &'static str = "Armstrong: seven parameters, frictional memory and rising static friction";
    const SOURCE: &'static str = "armstrong1994";
    const STATES: &'static [InnerState] = &[
        InnerState { name: "presliding_deflection_m", ..DEFLECTION },
        InnerState { name: "remembered_velocity_m_s", unit: "m/s", scale: 1e-2 },
        InnerState { name: "stop_time_s", unit: "s", scale: 1.0 },
        InnerState { name: "lost_share", unit: "-", scale: 1.0 },
    ];
    const STICKS: bool = true;
    const STOPS: bool = false;
    const SENSE: Sense = Sense::Deflection;
    const CLAIMS: Claims = Claims { no_drift: true, always_passive: true, ..Claims::USUAL };

    levels_of!(coulomb breakaway viscous, spring bristle_stiffness);

    #[inline(always)]
    fn force<S: Over<P>>(&self, at: &At<S>, levels: &Levels<S>, z: &[S], dz: &mut [S], mode: P) -> S {
        let (v, way, stick) = (at.v, S::from(mode), dry::is_stick(mode));
        let elastic = S::from(self.bristle_stiffness) * z[Z];
        let level = levels.towards(S::select(stick, elastic, way)).at(self.rested(z) * self.weight(z[U]));
        dz[Z] = v - way * v * elastic / level;
        dz[U] = (v - z[U]) / S::from(self.memory_time);
        dz[T] = S::select(stick, S::one(), S::zero());
        dz[L] = S::zero();
        levels.viscous.fma(v, S::select(stick, elastic, way * level))
    }

    fn slips_at(&self, at: &At<P>, _levels: &Levels<P>, z: &[P]) -> P::Mask {
        let standing = P::select(P::zero().lt(z[T]), P::zero(), at.v.abs());
        P::zero().lt(standing)
    }

    fn event<S: Over<P>>(&self, at: &At<S>, levels: &Levels<S>, z: &[S], mode: P) -> S {
        let elastic = S::from(self.bristle_stiffness) * z[Z];
        let loading = S::select(elastic.lt(S::zero()), -at.v, at.v);
        // If the level falls below a contact during unloading, the unloading continues.
        let holds = (levels.towards(elastic).at(self.rested(z)) - elastic.abs()).max(-loading);
        S::select(dry::is_stick(mode), holds, S::from(mode) * at.v)
    }

    fn next_mode(&self, mode: P, _at: &At<P>, _levels: &Levels<P>, z: &mut [P]) -> P {
        let (stick, way) = (dry::is_stick(mode), P::select(z[Z].lt(P::zero()), -P::one(), P::one()));
        let there = self.rested(z) * P::select(stick, P::one(), self.weight(z[U]));
        (z[T], z[L]) = (P::zero(), P::one() - there);
        P::select(stick, way, P::zero())
    }

    fn steady<S: Over<P>>(&self, v: S, levels: &Levels<S>) -> S {
        sliding(v, levels.towards(v).at(self.weight(v)), levels.viscous)
    }
}
