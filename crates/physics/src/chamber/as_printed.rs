use super::Exchange;
use crate::gas::IdealGas;
use math::{Over, Real};

/// Equations (2) and (3) of the paper, solved together for (dp/dt, dT/dt), states (p, T):
///
///   `(2)  V dp/dt = k R (T_i m_i - T_o m_o) - k p dV/dt - (p V/T) dT/dt + (k - 1) Q`
///   `(3)  dT/dt = T (dp/dt / p + (dV/dt)/V - m_dot R T/(p V))`
///
/// They are wrong, because (2) subtracts the stored heat a second time. Solved together they give
///
///   `2 V dp/dt = k R (T_i m_i - T_o m_o) - (k + 1) p dV/dt + R T m_dot + (k - 1) Q`
///
/// This is a polytrope of exponent (k + 1)/2 with half the heat transfer, and energy is not conserved. For reproducing
/// the paper only. docs/theory/as-printed.md shows the consequences. The dead volume in V keeps x = 0 finite. The
/// caller passes the printed area. Source: [bracha].
pub struct AsPrinted;

impl AsPrinted {
    /// Returns (dp/dt, dT/dt). `h_dot` contains cp T of the flows, so k R (T_i m_i - T_o m_o) = (k - 1) h_dot.
    #[inline(always)]
    pub fn rate<P: Real, S: Over<P>>(gas: &IdealGas<P>, p: S, t: S, x: &Exchange<S>) -> [S; 2] {
        let (k, r) = (S::from(gas.heat_capacity_ratio), S::from(gas.gas_constant));
        let k1 = k - S::one();
        let twice = k1 * (x.h_dot + x.heat) - (k + S::one()) * p * x.volume_rate + r * t * x.m_dot;
        let p_dot = twice / (S::c(2.0) * x.volume);
        let t_dot = t * (p_dot / p + x.volume_rate / x.volume - x.m_dot * r * t / (p * x.volume));
        [p_dot, t_dot]
    }
}
