use super::{Common, Own, OwnRates, Part, State};
use crate::net::Net;
use math::{Over, Real};

physics::parameters! {
    /// A servo axis whose motion is prescribed by a piecewise constant jerk: position, velocity and
    /// acceleration are states, so that the motion is exact and the equations stay free of time.
    pub struct Carriage {
        /// Jerk: an input
        jerk: "m/s3", physics::any(), default 0.0;
    } with { node: usize }
}

impl<P: Real> Part<P> for Carriage<P> {
    fn states(&self) -> Vec<State> {
        vec![
            State { name: "carriage position", unit: "m", scale: 0.1 },
            State { name: "carriage velocity", unit: "m/s", scale: 0.1 },
            State { name: "carriage acceleration", unit: "m/s2", scale: 1.0 },
        ]
    }

    #[inline(always)]
    fn place<S: Over<P>>(&self, y: Own<S>, net: &mut Net<S>, _common: &Common<P>) {
        let node = &mut net.axis[self.node];
        [node.x, node.v, node.a] = y.first();
        node.force = S::zero();
    }

    #[inline(always)]
    fn rate<S: Over<P>>(&self, y: Own<S>, mut dy: OwnRates<S>, _net: &mut Net<S>, _common: &Common<P>) {
        let [_, v, a] = y.first();
        dy.set([v, a, S::from(self.jerk)]);
    }
}
