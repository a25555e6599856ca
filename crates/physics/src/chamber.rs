//! Balances of a chamber, each in the states that it owns.

mod as_printed;
mod energy_balance;

use math::Real;

pub use as_printed::AsPrinted;
pub use energy_balance::EnergyBalance;

/// What the gas of a chamber is at, with what flows ask of it.
#[derive(Clone, Copy, Debug)]
pub struct GasState<S> {
    /// Pressure, Pa absolute.
    pub p: S,
    /// Temperature, K.
    pub t: S,
    /// 1/p, 1/Pa.
    pub inverse_p: S,
    /// 1/sqrt(T), 1/K^0.5.
    pub inverse_sqrt_t: S,
}

impl<S: Real> GasState<S> {
    /// At a pressure, Pa, and temperature, K.
    #[inline(always)]
    pub fn at(p: S, t: S) -> Self {
        GasState { p, t, inverse_p: S::one() / p, inverse_sqrt_t: S::one() / t.sqrt() }
    }
}

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
