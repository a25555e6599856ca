use super::{Transport, Wetted};
use crate::Gas;
use crate::constants::STANDARD_GRAVITY;
use math::{Dual, Over, Real};
use std::f64::consts::PI;

/// Conduction: Nu 5.78 of a long cylinder on 4 V/A, the first zero of J0 squared.
const CONDUCTION: f64 = 1.45;
/// Natural convection, Nu = 0.13 Ra^(1/3).
const NATURAL: f64 = 0.13;
/// Jet, Nu = 0.56 Re^0.67 on the bore of the port.
const JET: f64 = 0.56;
/// Exponents of p sqrt(dT) in the natural convection, and of sqrt(Re) less one in the jet.
const NATURAL_POWER: f64 = 2.0 / 3.0;
const JET_RISE: f64 = 4.0 * 0.335 - 1.0;
/// Reynolds number at which the jet becomes smooth, and at which flow counts as inflow.
const JET_SMOOTH: f64 = 100.0;
const FLOW_SMOOTH: f64 = 10.0;
/// Smoothing of the temperature difference, K2, and of the rate of change, (kg/(s m3))2.
const DIFFERENCE_SMOOTH: f64 = 1.0;
const RATE_SMOOTH: f64 = 1e-4;
/// Values of p sqrt(dT), Pa K^0.5, and of sqrt(Re) about which the powers are approximated.
const NATURAL_CENTRE: f64 = 1.5e6;
const JET_CENTRE: f64 = 150.0;
/// Numerator y (a + b y) and denominator 1 + a y + b y^2 of y^(2/3). The error is 2.3 % from y = 0.12 to 16. It is a
/// minimax fit of this project.
const NATURAL_OVER: [f64; 2] = [2.654_75, 2.518_53];
const NATURAL_UNDER: [f64; 2] = [4.079_07, 0.173_594];
/// The same of the Pade approximant about 1 of y^a, the power of the jet.
const JET_OVER: [f64; 2] = [1.0 - JET_RISE, 1.0 + JET_RISE];
const JET_UNDER: [f64; 2] = [1.0 + JET_RISE, 1.0 - JET_RISE];
/// Approximated sqrt(Re)^(1 + a) at rest, over that at the centre.
const JET_REST: f64 = {
    let y = 10.0 / JET_CENTRE;
    y * (JET_OVER[0] + JET_OVER[1] * y) / (JET_UNDER[0] + JET_UNDER[1] * y)
};

/// Size of a vessel.
#[derive(Clone, Copy, Debug)]
pub struct Geometry<P> {
    /// Diameter of the vessel D, m; 1.9 V^(1/3) of a tank.
    pub bore: P,
    /// Area of the piston, m2, by which the length of the chamber follows from its volume; infinite without a piston.
    pub area: P,
    /// Diameter d of the port through which gas enters, m.
    pub port: P,
}

crate::parameters! {
    /// Heat-transfer coefficient of gas in a chamber or a tank:
    ///
    ///   `h = c (h_cond + h_free + h_rate + h_jet)                                                    [W/(m2 K)]`
    ///   `h_cond = 1.45 k A/V`
    ///   `h_free = 0.13 (g cp rho^2 k^2 dT/(mu T_f))^(1/3)`
    ///   `h_rate = sqrt(k cp) (r^2 + e^2)^(1/4),   r = (m' - rho V')/V`
    ///   `h_jet = 0.56 (k/l) ((Re^2 + 100^2)^0.335 - 100^0.67),   Re = 4 m_in/(pi d mu)`
    ///
    /// A is the wetted wall, V the volume. T_f = (T + T_w)/2, rho = p/(R T_f), dT = sqrt((T - T_w)^2 + 1 K^2).
    ///
    /// e = 0.01 kg/(s m3). m_in is the sum of (m + sqrt(m^2 + m_0^2) - m_0)/2, with m_0 at Re 10.
    ///
    /// l = sqrt(D^2 + (V/A_piston)^2).
    ///
    /// h_cond is the slow limit of conduction, h_rate its limit for fast changes. Sources: natural convection
    /// [geankoplis1993], jet [woodfield2007]. Square roots and rational functions approximate the powers 1/3 and 0.335.
    /// h_free is within 3 % from 1 to 20 bar and from 5 to 150 K. h_jet is within 5 % from Re 300 to 3e5. The law itself
    /// is uncertain by a factor of 2.
    pub struct Film {
        /// Derived: 1.45 c k
        conduction: "W/(m K)", crate::any();
        /// Derived: factor of the natural convection
        natural: "W/m2", crate::any();
        /// Derived: c sqrt(k cp)
        layer: "W s^0.5/(m2 K)", crate::any();
        /// Derived: 0.56 c k
        jet: "W/(m K)", crate::any();
        /// Derived: factor from inflow to Re
        reynolds: "s/kg", crate::any();
        /// Derived: D^2
        bore_squared: "m2", crate::any();
        /// Derived: 1/A_piston
        per_area: "1/m2", crate::any();
        /// Derived: 2/R
        double_per_gas_constant: "kg K/J", crate::any();
        /// Derived: mass flow at Re 10
        least_flow: "kg/s", crate::any();
    }
}

impl<P: Real> Film<P> {
    /// Creates the law from its factor c and the size of the vessel.
    pub fn new(scale: P, size: &Geometry<P>, gas: &Gas<P>) -> Self {
        let Transport { viscosity, conductivity } = gas.transport;
        let cp = gas.cp;
        // (g cp k^2/mu)^(1/3) / R^(2/3)
        let group = cp * P::c(STANDARD_GRAVITY * conductivity * conductivity / viscosity);
        let group = (group / (gas.gas_constant * gas.gas_constant)).pow(P::c(1.0 / 3.0));
        let natural = P::c(2.0 * NATURAL) * group * P::c(NATURAL_CENTRE).pow(P::c(NATURAL_POWER));
        let at_centre = P::c(JET_CENTRE).pow(P::c(1.0 + JET_RISE));
        let mut film = Film {
            conduction: scale * P::c(CONDUCTION * conductivity),
            natural: scale * natural,
            layer: scale * (P::c(conductivity) * cp).sqrt(),
            jet: scale * P::c(JET * conductivity) * at_centre,
            reynolds: P::one(),
            bore_squared: size.bore * size.bore,
            per_area: P::one() / size.area,
            double_per_gas_constant: P::c(2.0) / gas.gas_constant,
            least_flow: P::one(),
        };
        film.set_port(size.port, gas);
        film
    }

    /// Sets the diameter of the port, m.
    pub fn set_port(&mut self, port: P, gas: &Gas<P>) {
        self.reynolds = P::c(4.0 / (PI * gas.transport.viscosity)) / port;
        self.least_flow = P::c(FLOW_SMOOTH) / self.reynolds;
    }

    /// Returns the coefficient of a layer at the wall that follows a change of density, r in kg/(s m3).
    #[inline(always)]
    fn layer<S: Over<P>>(&self, rate: S) -> S {
        rate.fma(rate, S::c(RATE_SMOOTH)).sqrt().sqrt().times(self.layer)
    }

    /// Returns the heat-transfer coefficient, W/(m2 K).
    #[inline(always)]
    pub(super) fn coefficient<S: Over<P>>(&self, gas: &Wetted<S>) -> S {
        let sum = gas.t + gas.wall_temperature;
        let inverse = S::one() / (gas.volume * sum);
        let (per_volume, per_sum) = (inverse * sum, inverse * gas.volume);
        let rate = (gas.m_dot - self.density(gas.p, per_sum) * gas.volume_rate) * per_volume;

        let difference = gas.t - gas.wall_temperature;
        let spread = difference.fma(difference, S::c(DIFFERENCE_SMOOTH)).sqrt().sqrt();
        let y = gas.p * spread * S::c(1.0 / NATURAL_CENTRE);
        let natural = y * y.fma_c(NATURAL_OVER[1], S::c(NATURAL_OVER[0]));
        let under_natural = y.fma(y.fma_c(NATURAL_UNDER[1], S::c(NATURAL_UNDER[0])), S::one());

        let reynolds = (gas.turnover + gas.m_dot).times(P::c(0.5) * self.reynolds);
        let root = reynolds.fma(reynolds, S::c(JET_SMOOTH * JET_SMOOTH)).sqrt().sqrt();
        let y = root * S::c(1.0 / JET_CENTRE);
        let under_jet = y.fma_c(JET_UNDER[1], S::c(JET_UNDER[0]));
        let jet = y * y.fma_c(JET_OVER[1], S::c(JET_OVER[0])) - under_jet * S::c(JET_REST);
        let length = gas.volume.times(self.per_area);
        let under_jet = under_jet * length.fma(length, S::from(self.bore_squared)).sqrt();

        // One division for both.
        let inverse = S::one() / (under_natural * under_jet);
        (gas.area * per_volume).times(self.conduction)
            + (natural * under_jet * inverse * per_sum).times(self.natural)
            + self.layer(rate)
            + (jet * under_natural * inverse).times(self.jet)
    }

    /// Returns p/(R T_f), kg/m3, from the reciprocal of T + T_w.
    #[inline(always)]
    fn density<S: Over<P>>(&self, p: S, per_sum: S) -> S {
        (p * per_sum).times(self.double_per_gas_constant)
    }

    /// Returns the slope of the heat flow by the rate of the volume, W s/m3.
    #[inline(always)]
    pub(super) fn by_volume_rate(&self, gas: &Wetted<P>) -> P {
        let density = self.density(gas.p, P::one() / (gas.t + gas.wall_temperature));
        let rate = Dual::<P, 1>::variable((gas.m_dot - density * gas.volume_rate) / gas.volume, 0);
        let [slope] = self.layer(rate).eps;
        super::newton(-(slope * density / gas.volume), gas.area, gas.wall_temperature, gas.t)
    }
}
