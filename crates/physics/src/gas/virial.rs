use super::IdealGas;
use crate::chamber::{EnergyBalance, GasState};
use math::{Over, Real};

/// Temperature, K, below which the coefficient no longer grows. It is far below the temperatures of a circuit, and
/// keeps
/// pressures of trial states finite.
const LEAST_T: f64 = 60.0;
/// Least value under the root of the density. Pressures at which two densities meet are far above the range of the law.
const LEAST_ROOT: f64 = 1e-6;
/// Newton steps from the temperature of the ideal gas. For carbon dioxide at 10 bar, the error is some hundredths of a
/// kelvin after the first step and less than a microkelvin after the second.
const STEPS: usize = 2;

crate::parameters! {
    /// Gas of constant heat capacity at low density, with its second virial coefficient B:
    ///
    ///   `p = rho R T (1 + B rho),   B = a - b exp(c/T),   T^2 B' = b c exp(c/T)`
    ///   `u = cv T - R T^2 B' rho,   h = u + p/rho = cp T + R rho (T B - T^2 B')`
    ///   `s = cv ln(T/T0) - R ln(rho/rho0) - R (B + T B') rho`
    ///
    /// rho density kg/m3, u, h and s per kg. All follow from one free energy, so that the balances of energy and
    /// entropy close. Valid while |B| rho is small compared with one, because the third coefficient is left out. Source
    /// of the form of B and of the numbers of gases: [libretexts-virial].
    #[derive(Copy)]
    pub struct Virial {
        /// Number a
        a: "m3/kg", crate::any();
        /// Number b
        b: "m3/kg", crate::any();
        /// Number c
        c: "K", crate::at_least(0.0);
    }
}

impl<P: Real> Virial<P> {
    /// Returns B and T^2 B' at a temperature.
    #[inline(always)]
    fn coefficient<S: Over<P>>(&self, t: S) -> [S; 2] {
        let grown = S::from(self.b) * (S::from(self.c) / t.max(S::c(LEAST_T))).exp();
        [S::from(self.a) - grown, S::from(self.c) * grown]
    }

    /// Returns (p, T, h) from (m, U) in a volume. They equal those of the ideal gas bit for bit if a and b are zero.
    #[inline(always)]
    pub fn p_t_h<S: Over<P>>(&self, gas: &IdealGas<P>, state: [S; 2], volume: S) -> (S, S, S) {
        let GasState { p, t: ideal, .. } = EnergyBalance::state(gas, state, volume);
        let density = state[0] / volume;
        let (r_rho, cv) = (S::from(gas.gas_constant) * density, S::from(gas.cv));
        let mut warmer = S::zero();
        for _ in 0..STEPS {
            let t = ideal + warmer;
            let [_, rise] = self.coefficient(t);
            let at = t.max(S::c(LEAST_T));
            let slope = cv + r_rho * rise * S::from(self.c) / (at * at);
            warmer -= (cv * warmer - r_rho * rise) / slope;
        }
        let t = ideal + warmer;
        let [second, rise] = self.coefficient(t);
        let h = S::from(gas.cp) * t + r_rho * (t * second - rise);
        (p * (S::one() + warmer / ideal) * (S::one() + second * density), t, h)
    }

    /// Returns the approximate fraction of the ideal pressure that the coefficient subtracts. The law is valid while it
    /// is small.
    pub fn off(&self, gas: &IdealGas<P>, p: P, t: P) -> P {
        P::one() - P::one() / self.denser(gas, p, t)
    }

    /// Returns the density relative to the ideal gas at a pressure and temperature.
    #[inline(always)]
    fn denser<S: Over<P>>(&self, gas: &IdealGas<P>, p: S, t: S) -> S {
        let [second, _] = self.coefficient(t);
        let under = S::one() + S::c(4.0) * second * p / (S::from(gas.gas_constant) * t);
        S::c(2.0) / (S::one() + under.max(S::c(LEAST_ROOT)).sqrt())
    }

    /// Returns the density at a pressure and temperature, kg/m3.
    #[inline(always)]
    pub fn density<S: Over<P>>(&self, gas: &IdealGas<P>, p: S, t: S) -> S {
        p / (S::from(gas.gas_constant) * t) * self.denser(gas, p, t)
    }

    /// Returns (m, U) of gas at `p`, `t` in a volume.
    pub fn initial<S: Over<P>>(&self, gas: &IdealGas<P>, p: S, t: S, volume: S) -> [S; 2] {
        let (r, k) = (S::from(gas.gas_constant), S::from(gas.heat_capacity_ratio));
        let denser = self.denser(gas, p, t);
        let m = p * volume / (r * t) * denser;
        let [_, rise] = self.coefficient(t);
        [m, p * volume / (k - S::one()) * denser - m * (m / volume) * r * rise]
    }

    /// Returns the specific enthalpy at a pressure and temperature, J/kg.
    #[inline(always)]
    pub fn enthalpy<S: Over<P>>(&self, gas: &IdealGas<P>, p: S, t: S) -> S {
        let [second, rise] = self.coefficient(t);
        let r_rho = S::from(gas.gas_constant) * self.density(gas, p, t);
        S::from(gas.cp) * t + r_rho * (t * second - rise)
    }

    /// Returns the specific entropy minus that of the ideal gas at the same temperature and density, J/(kg K).
    pub fn residual_entropy<S: Over<P>>(&self, gas: &IdealGas<P>, density: S, t: S) -> S {
        let [second, rise] = self.coefficient(t);
        -S::from(gas.gas_constant) * density * (second + rise / t)
    }

    /// Returns the temperature after a throttle, at the same enthalpy: Newton steps with the heat capacity of the ideal
    /// gas. Balances use it to split an entropy production. They close for any value.
    pub fn throttled<S: Over<P>>(&self, gas: &IdealGas<P>, h: S, t: S, p: S) -> S {
        (0..3).fold(t, |at, _| at + (h - self.enthalpy(gas, p, at)) / S::from(gas.cp))
    }
}
