use super::Exchange;
use crate::gas::IdealGas;
use math::{Over, Real};

/// Mass and energy of an open, uniform volume of ideal gas, with states (m, U):
///
///   dm/dt = sum m_dot
///   dU/dt = sum h_dot - p dV/dt + Q,      p = (k - 1) U/V,   T = U/(m cv)
///
/// m_dot mass flow kg/s and h_dot = cp T_up m_dot its enthalpy W, both positive inwards, with the
/// temperature of where the gas comes from; Q heat from the wall W. As (m, U) are the conserved
/// quantities, every one-step method keeps their sums to rounding. Source: [bejan2016].
pub struct EnergyBalance;

impl EnergyBalance {
    /// (m, U) of gas at `p`, `t` in a volume.
    pub fn initial<P: Real>(gas: &IdealGas<P>, p: P, t: P, volume: P) -> [P; 2] {
        let u = p * volume / (gas.heat_capacity_ratio - P::one());
        [p * volume / (gas.gas_constant * t), u]
    }

    /// (p, T) from (m, U).
    #[inline(always)]
    pub fn p_t<P: Real, S: Over<P>>(gas: &IdealGas<P>, state: [S; 2], volume: S) -> (S, S) {
        let [m, u] = state;
        let k1 = gas.heat_capacity_ratio - P::one();
        (S::from(k1) * u / volume, S::from(k1 / gas.gas_constant) * u / m)
    }

    /// (dm/dt, dU/dt).
    #[inline(always)]
    pub fn rate<S: Real>(p: S, x: &Exchange<S>) -> [S; 2] {
        [x.m_dot, (-p).fma(x.volume_rate, x.heat) + x.h_dot]
    }
}
