//! Gas properties.

mod ideal;
mod virial;
pub use ideal::IdealGas;
pub use virial::Virial;

use crate::heat::Transport;
use std::ops::Deref;

/// The gas of a circuit: ideal, or with a second virial coefficient.
#[derive(Clone, Copy, Debug)]
pub struct Gas<P> {
    /// Ratio of heat capacities, gas constant and what follows from both.
    pub ideal: IdealGas<P>,
    /// Numbers of the virial coefficient. `None` for an ideal gas.
    pub virial: Option<Virial<P>>,
    /// Viscosity and conductivity, the same in all lanes.
    pub transport: Transport,
}

math::gather!(Gas { ideal, virial } same { transport });

impl<P> Deref for Gas<P> {
    type Target = IdealGas<P>;

    #[inline(always)]
    fn deref(&self) -> &IdealGas<P> {
        &self.ideal
    }
}

impl<P: Copy> From<&IdealGas<P>> for Gas<P> {
    fn from(ideal: &IdealGas<P>) -> Self {
        Gas { ideal: *ideal, virial: None, transport: Transport::AIR }
    }
}

impl<P: Copy> From<&Gas<P>> for Gas<P> {
    fn from(gas: &Gas<P>) -> Self {
        *gas
    }
}
