use crate::ground::{Common, Kind, Net, Own, OwnMut, Part, State, force_on, gathered, inputs};
use crate::part::mechanics::damper;
use math::{Lane, Over};

gathered! {
    /// A motor that moves a mass at a velocity u with any necessary force, through a spring and a damper:
    ///
    ///   `d' = u - v,   F = k d + c (u - v)              [N], in +x on the mass`
    ///   `I' = F,       W' = F v`
    ///
    /// so in steady motion v = u. I over a time is the mean force, and W is the work done on the mass.
    ///
    /// * `k`, `c`: stiffness, damping, N/m and N s/m.
    /// * `d`: stretch, m.
    pub struct Motor {
        numbers { velocity, stiffness, damping }
        same {
            /// Absolute error scale of the stretch, m.
            scale: f64,
            axis: usize,
            /// Indices of stretch, impulse and work among the signals.
            signals: [usize; 3],
        }
    }
}

impl<P: Lane> Motor<P> {
    /// Returns the velocity of the motor relative to the mass, m/s.
    fn closing<S: Over<P>>(&self, net: &Net<S>) -> S {
        S::from(self.velocity) - net.axis[self.axis].v
    }
}

impl<P: Lane> Part<P> for Motor<P> {
    fn states(&self) -> Vec<State> {
        vec![
            State::own("stretch_m", "m", self.scale),
            State::own("impulse_n_s", "N s", 1.0),
            State::own("work_j", "J", 1.0),
        ]
    }

    inputs! { velocity: "velocity", "m/s", physics::any() }

    #[inline(always)]
    fn place<S: Over<P>>(&self, y: Own<S>, net: &mut Net<S>, _common: &Common<P>) {
        for (signal, state) in self.signals.into_iter().zip(y.first::<3>()) {
            net.signal[signal] = state;
        }
    }

    #[inline(always)]
    fn force<S: Over<P>>(&self, net: &Net<S>) -> S {
        S::from(self.stiffness) * net.signal[self.signals[0]] + S::from(self.damping) * self.closing(net)
    }

    force_on!(axis);

    #[inline(always)]
    fn rate<S: Over<P>>(&self, _y: Own<S>, mut dy: OwnMut<S>, net: &mut Net<S>, _common: &Common<P>) {
        let force = self.force(net);
        dy.set([self.closing(net), force, force * net.axis[self.axis].v]);
    }

    fn stored<S: Over<P>>(&self, _y: Own<S>, net: &Net<S>, _common: &Common<P>) -> [S; 3] {
        let stretch = net.signal[self.signals[0]];
        [S::zero(), S::c(0.5) * S::from(self.stiffness) * stretch * stretch, S::zero()]
    }

    fn channels(&self) -> Vec<(&'static str, Kind)> {
        [("work of the motor", Kind::Energy)].into_iter().chain(damper::CHANNELS).collect()
    }

    fn account<S: Over<P>>(&self, _y: Own<S>, _dy: Own<S>, net: &Net<S>, common: &Common<P>, out: &mut [S]) {
        let closing = self.closing(net);
        out[0] = self.force(net) * S::from(self.velocity);
        damper::account(S::from(self.damping) * closing * closing, common, &mut out[1..]);
    }
}
