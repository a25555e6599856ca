use crate::ground::{Common, Net, Part, gathered, inputs};
use math::{Lane, Over};
use physics::chamber::GasState;

gathered! {
    /// Gas at constant pressure and temperature: supply, ambient, or a chamber held by a regulator. Its node is set
    /// when the net is made and when an input changes. Flows do not change its state.
    pub struct Reservoir {
        numbers { pressure, temperature }
        same { node: usize }
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
        net.gas[self.node].fill(self.state().map(S::from));
    }
}

impl<P: Lane> Part<P> for Reservoir<P> {
    inputs! {
        pressure: "pressure", "Pa", physics::above(0.0);
        temperature: "temperature", "K", physics::above(0.0);
    }
}
