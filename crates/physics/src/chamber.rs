//! Balances of a chamber, for each choice of state variables.

mod as_printed;
mod energy_balance;

use math::Real;

pub use as_printed::AsPrinted;
pub use energy_balance::EnergyBalance;

/// State of the gas in a chamber, with the derived quantities that flows need.
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

math::mapped!(GasState { p, t, inverse_p, inverse_sqrt_t });

impl<S: Real> GasState<S> {
    /// Creates the state at a pressure, Pa, and temperature, K.
    #[inline(always)]
    pub fn at(p: S, t: S) -> Self {
        GasState { p, t, inverse_p: S::one() / p, inverse_sqrt_t: S::one() / t.sqrt() }
    }
}

/// Exchange of a chamber: net mass flow, kg/s, and enthalpy flow, W, into it, its volume, m3, with rate, m3/s, and heat
/// from the wall, W.
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
