//! Balances of a chamber, each in the states that it owns.

mod as_printed;
mod energy_balance;

pub use as_printed::AsPrinted;
pub use energy_balance::EnergyBalance;

/// What a chamber exchanges: net mass flow kg/s and enthalpy flow W into it, its volume m3 with
/// rate m3/s, and heat from the wall W.
#[derive(Clone, Copy, Debug)]
pub struct Exchange<S> {
    /// Mass flow into it, kg/s.
    pub m_dot: S,
    /// Enthalpy flow into it, W.
    pub h_dot: S,
    /// Its volume, m3.
    pub volume: S,
    /// Rate of its volume, m3/s.
    pub volume_rate: S,
    /// Heat from the wall into it, W.
    pub heat: S,
}
