use super::{Common, Own, Part};
use crate::net::Net;
use math::{Over, Real};

physics::parameters! {
    /// Gas at constant pressure and temperature: supply, ambient, or a chamber held by a regulator.
    pub struct Reservoir {
        /// Absolute pressure
        pressure: "Pa", physics::above(0.0);
        /// Temperature
        temperature: "K", physics::above(0.0);
        /// Derived: 1/sqrt(T)
        inverse_sqrt_t: "K^-0.5", physics::above(0.0);
    } with { node: usize }
}

impl<P: Real> Part<P> for Reservoir<P> {
    #[inline(always)]
    fn place<S: Over<P>>(&self, _y: Own<S>, net: &mut Net<S>, _common: &Common<P>) {
        let node = &mut net.gas[self.node];
        node.p = S::from(self.pressure);
        node.t = S::from(self.temperature);
        node.inverse_sqrt_t = S::from(self.inverse_sqrt_t);
        // What faces and restrictions add up here has no consequence, but must not grow for ever.
        node.volume = S::zero();
        node.volume_rate = S::zero();
        node.wall = S::zero();
        node.m_dot = S::zero();
        node.h_dot = S::zero();
    }
}
