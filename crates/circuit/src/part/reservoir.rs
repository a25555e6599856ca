use super::Part;
use crate::net::Net;
use math::{Over, Real};

physics::parameters! {
    /// Gas at constant pressure and temperature: supply, ambient, or a chamber held by a regulator.
    /// Its node is filled once, when the net is made; no flow changes it.
    pub struct Reservoir {
        /// Absolute pressure
        pressure: "Pa", physics::above(0.0);
        /// Temperature
        temperature: "K", physics::above(0.0);
    } with { node: usize }
}

impl<P: Real> Reservoir<P> {
    pub(crate) fn fill<S: Over<P>>(&self, net: &mut Net<S>) {
        let node = &mut net.gas[self.node];
        node.p = S::from(self.pressure);
        node.t = S::from(self.temperature);
        node.inverse_sqrt_t = S::from(P::one() / self.temperature.sqrt());
    }
}

impl<P: Real> Part<P> for Reservoir<P> {}
