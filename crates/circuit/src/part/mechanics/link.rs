use crate::ground::{Common, Kind, Net, Own, Part, force_on};
use crate::part::mechanics::damper;
use math::{Lane, Over};

physics::parameters! {
    /// Spring and damper between two axes, without play: a force sensor, a coupling.
    ///
    ///   F = k (x_from - x_to) + c (v_from - v_to)              [N], in +x on `to`, -F on `from`
    pub struct Link {
        /// Stiffness k
        stiffness: "N/m", physics::above(0.0);
        /// Damping c
        damping: "N s/m", physics::at_least(0.0), default 0.0;
    } with {
        /// Index among the axes of the net
        from: usize,
        /// Index among the axes of the net
        to: usize,
    }
}

impl<P: Lane> Part<P> for Link<P> {
    /// Returns the force in +x on `to`, N.
    #[inline(always)]
    fn force<S: Over<P>>(&self, net: &Net<S>) -> S {
        let (one, two) = (&net.axis[self.from], &net.axis[self.to]);
        S::from(self.stiffness) * (one.x - two.x) + S::from(self.damping) * (one.v - two.v)
    }

    force_on!(to, from);

    fn stored<S: Over<P>>(&self, _y: Own<S>, net: &Net<S>, _common: &Common<P>) -> [S; 3] {
        let stretch = net.axis[self.from].x - net.axis[self.to].x;
        [S::zero(), S::c(0.5) * S::from(self.stiffness) * stretch * stretch, S::zero()]
    }

    fn channels(&self) -> Vec<(&'static str, Kind)> {
        damper::CHANNELS.to_vec()
    }

    fn account<S: Over<P>>(&self, _y: Own<S>, _dy: Own<S>, net: &Net<S>, common: &Common<P>, out: &mut [S]) {
        let speed = net.axis[self.from].v - net.axis[self.to].v;
        damper::account(S::from(self.damping) * speed * speed, common, out);
    }
}
