use crate::ground::{
    Between, Common, Given, Net, Own, OwnMut, Part, State, clip, first_is_a_signal, gathered, inputs,
};
use math::{Lane, Over};
use physics::flow::Iso6358;

gathered! {
    /// A pressure regulator. Its seat from node 1 to node 2 is closed by the pressure behind it, with a lag. Its relief
    /// leads from node 2 to node 3:
    ///
    ///   `y'  = (clip((p_set - p2)/dp_full, 0, 1) - y)/tau`
    ///   `y_r = clip((p2 - p_set - dp_on)/dp_relief, 0, 1)`
    ///
    /// * `y`, `y_r`: open fractions of the conductances.
    /// * `p_set`: set pressure (a number or a signal), Pa absolute.
    /// * `dp_full`: drop below the set pressure at which the seat is fully open, Pa.
    /// * `tau`: time constant of the seat, s.
    pub struct Regulator {
        numbers { set_pressure, full_opening_drop, time_constant, relief_offset, relief_rise }
        laws { seat: Iso6358, relief: Iso6358 }
        same {
            /// Index of the opening of the seat among the signals.
            signal: usize,
            /// Index of the set pressure among the signals, if it is a signal.
            set: Option<usize>,
            /// Flow paths of the seat and the relief.
            paths: [Between; 2],
        }
    }
}

impl<P: Lane> Regulator<P> {
    #[inline(always)]
    fn set_pressure<S: Over<P>>(&self, net: &Net<S>) -> S {
        self.set.map_or(S::from(self.set_pressure), |signal| net.signal[signal])
    }

    /// Returns the opening fraction of the seat at a set pressure and a pressure behind it, Pa.
    fn target<S: Over<P>>(&self, set_pressure: S, p: S) -> S {
        clip((set_pressure - p) / S::from(self.full_opening_drop))
    }
}

impl<P: Lane> Part<P> for Regulator<P> {
    fn states(&self) -> Vec<State> {
        vec![State::own("opening", "1", 1.0)]
    }

    inputs! { set_pressure: "set pressure", "Pa", physics::above(0.0) }

    first_is_a_signal!(signal);

    fn paths(&self) -> &[Between] {
        &self.paths
    }

    #[inline(always)]
    fn flow<S: Over<P>>(&self, path: usize, net: &Net<S>) -> (S, S::Mask) {
        let (one, two) = (&net[self.paths[path].from], &net[self.paths[path].to]);
        let (law, share) = if path == 0 {
            (&self.seat, net.signal[self.signal])
        } else {
            let above = self.set_pressure(net) + S::from(self.relief_offset);
            (&self.relief, clip((one.p - above) / S::from(self.relief_rise)))
        };
        law.flow(share, &one.end(), &two.end())
    }

    #[inline(always)]
    fn rate<S: Over<P>>(&self, y: Own<S>, mut dy: OwnMut<S>, net: &mut Net<S>, _common: &Common<P>) {
        let [seat] = y.first();
        let target = self.target(self.set_pressure(net), net[self.paths[0].to].p);
        dy.set([(target - seat) / S::from(self.time_constant)]);
    }

    fn begin(&self, given: &Given<P>, mut y: OwnMut<P>, _net: &Net<P>, _common: &Common<P>) {
        let behind = given.gas(self.paths[0].to.0).map_or(self.set_pressure, |[p, _]| p);
        y.set([self.target::<P>(self.set_pressure, behind)]);
    }
}
