use super::{Exchange, GasState};
use crate::gas::IdealGas;
use math::{Over, Real};

/// Mass and energy of an open, uniform volume of ideal gas, with states (m, U):
///
///   `dm/dt = sum m_dot`
///   `dU/dt = sum h_dot - p dV/dt + Q,      p = (k - 1) U/V,   T = U/(m cv)`
///
/// Here m_dot is the mass flow, kg/s, and h_dot = cp T_up m_dot its enthalpy flow, W. Both are positive inwards, with
/// the temperature of the source. Q is the heat from the wall, W. As (m, U) are the conserved quantities, every
/// one-step method keeps their sums to rounding. Source: [bejan2016].
pub struct EnergyBalance;

impl EnergyBalance {
    /// Returns (m, U) of gas at `p`, `t` in a volume.
    #[inline(always)]
    pub fn initial<P: Real, S: Over<P>>(gas: &IdealGas<P>, p: S, t: S, volume: S) -> [S; 2] {
        let u = p * volume / S::from(gas.heat_capacity_ratio - P::one());
        [p * volume / (S::from(gas.gas_constant) * t), u]
    }

    /// Returns p, T and their reciprocals from (m, U), with E = (k - 1) U = p V = m R T:
    ///
    ///   `p = E^2/(V E),   1/p = V^2/(V E),   1/T = m R V/(V E),   T = U/(m cv)`
    ///
    /// These are two independent divisions.
    #[inline(always)]
    pub fn state<P: Real, S: Over<P>>(gas: &IdealGas<P>, [m, u]: [S; 2], volume: S) -> GasState<S> {
        let energy = u.times(gas.heat_capacity_ratio - P::one());
        let inverse = S::one() / (volume * energy);
        GasState {
            p: energy * energy * inverse,
            t: u / m.times(gas.cv),
            inverse_p: volume * volume * inverse,
            inverse_sqrt_t: (m.times(gas.gas_constant) * volume * inverse).sqrt(),
        }
    }

    /// Returns (dm/dt, dU/dt).
    #[inline(always)]
    pub fn rate<S: Real>(p: S, x: &Exchange<S>) -> [S; 2] {
        [x.m_dot, (-p).fma(x.volume_rate, x.heat) + x.h_dot]
    }
}
