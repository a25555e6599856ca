use crate::ground::{Common, Net, Own, OwnMut, Part, State, clip, first_is_a_signal, gathered};
use crate::part::mechanics::damper;
use math::{Lane, Over};

/// Time constant of forgetting the slip of the jaws, s. This time delays the first elastic return after sliding.
const FORGETS: f64 = 1e-4;

gathered! {
    /// Jaws that clamp a rod: an elastic grip that slips above its holding force.
    ///
    ///   `F = clip(k (z + T v), -y F_h, y F_h)      z' = v - (z - w)/tau,   w = clip(z, -y F_h/k, y F_h/k)       [N], in -x`
    ///
    /// w stores the energy k w^2/2. The other part of the work of F becomes heat: F is never less than k w against the
    /// motion.
    ///
    /// * `y`: closing of the jaws, 0 to 1.
    /// * `F_h`: holding force, N.
    /// * `k`: stiffness of grip and rod, N/m.
    /// * `T`: time constant of the damping, s.
    pub struct Lock {
        numbers { holding_force, stiffness, damping_time }
        same {
            axis: usize,
            /// Indices of y and z among the signals.
            shut: usize,
            deflection: usize,
            /// Error scale of z, m.
            scale: f64,
        }
    }
}

impl<P: Lane> Lock<P> {
    /// Returns the largest force that it can carry now, N.
    fn limit<S: Over<P>>(&self, net: &Net<S>) -> S {
        S::from(self.holding_force) * clip(net.signal[self.shut])
    }

    /// Returns the force of the grip at the distance `z` from its rest position, N.
    fn grip<S: Over<P>>(&self, z: S, net: &Net<S>) -> S {
        let limit = self.limit(net);
        (S::from(self.stiffness) * z).max(-limit).min(limit)
    }

    fn energy<S: Over<P>>(&self, net: &Net<S>) -> S {
        let grip = self.grip(net.signal[self.deflection], net);
        S::c(0.5) * grip * grip / S::from(self.stiffness)
    }
}

impl<P: Lane> Part<P> for Lock<P> {
    fn states(&self) -> Vec<State> {
        vec![State::own("deflection_m", "m", self.scale)]
    }

    first_is_a_signal!(deflection);

    fn force<S: Over<P>>(&self, net: &Net<S>) -> S {
        let ahead = S::from(self.damping_time).fma(net.axis[self.axis].v, net.signal[self.deflection]);
        self.grip(ahead, net)
    }

    #[inline(always)]
    fn exchange<S: Over<P>>(&self, net: &mut Net<S>, _common: &Common<P>) {
        let force = self.force(net);
        net.axis[self.axis].force -= force;
    }

    #[inline(always)]
    fn rate<S: Over<P>>(&self, y: Own<S>, mut dy: OwnMut<S>, net: &mut Net<S>, _common: &Common<P>) {
        let [z] = y.first();
        let kept = self.grip(z, net) / S::from(self.stiffness);
        dy.set([net.axis[self.axis].v - (z - kept) * S::c(1.0 / FORGETS)]);
    }

    damper::springs!(energy);

    fn account<S: Over<P>>(&self, _y: Own<S>, _dy: Own<S>, net: &Net<S>, common: &Common<P>, out: &mut [S]) {
        damper::account(self.force(net) * net.axis[self.axis].v, common, out);
    }
}
