use crate::ground::{Common, Net, Part, inputs};
use math::{Lane, Over};
use physics::chamber::GasState;

physics::parameters! {
    /// Gas at constant pressure and temperature: supply, ambient, or a chamber held by a regulator. Its node is set
    /// when the net is made and when an input changes. Flows do not change its state.
    pub struct Reservoir {
        /// Absolute pressure
        pressure: "Pa", physics::above(0.0);
        /// Temperature of the gas
        temperature: "K", physics::above(0.0);
    } with {
        /// Index among the gas nodes of the net
        node: usize,
    }
}

impl<P: Lane> Reservoir<P> {
    pub(crate) fn state(&self) -> GasState<P> {
        GasState::at(self.pressure, self.temperature)
    }

    pub(crate) fn fill<S: Over<P>>(&self, net: &mut Net<S>, common: &Common<P>) {
        if let Some(virial) = &common.gas.virial {
            net.enthalpy[self.node] = S::from(virial.enthalpy(&common.gas, self.pressure, self.temperature));
        }
        let node = &mut net.gas[self.node];
        let GasState { p, t, inverse_p, inverse_sqrt_t } = self.state();
        node.fill(GasState {
            p: S::from(p),
            t: S::from(t),
            inverse_p: S::from(inverse_p),
            inverse_sqrt_t: S::from(inverse_sqrt_t),
        });
    }
}

impl<P: Lane> Part<P> for Reservoir<P> {
    inputs! {
        pressure: "pressure", "Pa", physics::above(0.0);
        temperature: "temperature", "K", physics::above(0.0);
    }
}
