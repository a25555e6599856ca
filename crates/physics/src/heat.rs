//! Heat between gas and wall.

mod film;
mod pipe;
pub use film::{Film, Geometry};
pub use pipe::{Pipe, nusselt};

use math::{Both, Over, Real};

/// Heat flow from the wall into the gas, W:  Q = h A (T_wall - T).
///
/// h heat-transfer coefficient W/(m2 K); A wetted wall m2; T gas temperature K. One constant coefficient for the whole
/// wall, and a wall at constant temperature. Source: [bejan2016].
#[inline(always)]
pub fn newton<S: Real>(coefficient: S, area: S, wall_temperature: S, t: S) -> S {
    coefficient * area * (wall_temperature - t)
}

/// Viscosity and thermal conductivity of a gas at 20 degC and 1 bar.
#[derive(Clone, Copy, Debug)]
pub struct Transport {
    /// Dynamic viscosity, Pa s.
    pub viscosity: f64,
    /// Thermal conductivity, W/(m K).
    pub conductivity: f64,
}

impl Transport {
    /// Dry air. Source: [coolprop2014].
    pub const AIR: Transport = Transport { viscosity: 1.8205e-5, conductivity: 0.025_873 };

    /// Specific gas constant, J/(kg K), viscosity and conductivity of nitrogen, argon, helium and carbon dioxide.
    /// Source: [coolprop2014].
    const KNOWN: [(f64, f64, f64); 4] = [
        (296.80, 1.7573e-5, 0.025_472),
        (208.13, 2.2306e-5, 0.017_496),
        (2077.3, 1.9618e-5, 0.153_50),
        (188.92, 1.4675e-5, 0.016_250),
    ];

    /// Returns the properties of a gas by its gas constant. Another gas has the viscosity of air, and a conductivity by
    /// Eucken's rule Pr = 4 k/(9 k - 5) (assumed).
    #[must_use]
    pub fn of(gas: &crate::IdealGas<f64>) -> Self {
        if gas.is_air() {
            return Transport::AIR;
        }
        let known = Self::KNOWN.iter().find(|(constant, ..)| (constant - gas.gas_constant).abs() < 0.05);
        if let Some(&(_, viscosity, conductivity)) = known {
            return Transport { viscosity, conductivity };
        }
        let (k, viscosity) = (gas.heat_capacity_ratio, Transport::AIR.viscosity);
        Transport { viscosity, conductivity: viscosity * gas.cp * (9.0 * k - 5.0) / (4.0 * k) }
    }
}

/// Gas of a volume with its wall, and its flows.
#[derive(Clone, Copy, Debug)]
pub struct Wetted<S> {
    /// Pressure, Pa absolute.
    pub p: S,
    /// Temperature, K.
    pub t: S,
    /// Temperature of the wall, K.
    pub wall_temperature: S,
    /// Wetted wall, m2.
    pub area: S,
    /// Volume, m3.
    pub volume: S,
    /// Rate of the volume, m3/s.
    pub volume_rate: S,
    /// Net mass flow into the volume, kg/s.
    pub m_dot: S,
    /// Sum of the sizes of all flows, kg/s: sqrt(m^2 + m_0^2) - m_0 of each, with the least flow m_0 of the law.
    pub turnover: S,
}

math::mapped!(Wetted { p, t, wall_temperature, area, volume, volume_rate, m_dot, turnover });

/// Law of the heat transfer of a volume.
#[derive(Clone, Debug)]
pub enum Heat<P> {
    /// A constant heat-transfer coefficient, W/(m2 K).
    Newton(P),
    /// Conduction, natural convection, change of density and jets of a chamber.
    Film(Film<P>),
    /// Flow through a tube.
    Pipe(Pipe<P>),
}

impl<P: Real> Heat<P> {
    /// Returns the least flow m_0 of the turnover, kg/s. `None` if the law ignores flows.
    #[inline(always)]
    pub fn least_flow(&self) -> Option<P> {
        match self {
            Heat::Newton(_) => None,
            Heat::Film(film) => Some(film.least_flow),
            Heat::Pipe(pipe) => Some(pipe.least_flow),
        }
    }

    /// Returns the slope of the heat flow by the rate of the volume, W s/m3; `None` if it does not depend on that rate.
    #[inline(always)]
    pub fn by_volume_rate(&self, gas: &Wetted<P>) -> Option<P> {
        if let Heat::Film(film) = self { Some(film.by_volume_rate(gas)) } else { None }
    }

    /// Returns the heat flow from the wall into the gas, W.
    #[inline(always)]
    pub fn flow<S: Over<P>>(&self, gas: &Wetted<S>) -> S {
        let coefficient = match self {
            Heat::Newton(coefficient) => S::from(*coefficient),
            Heat::Film(film) => film.coefficient(gas),
            Heat::Pipe(pipe) => pipe.coefficient(gas.turnover.times(P::c(0.5))),
        };
        newton(coefficient, gas.area, gas.wall_temperature, gas.t)
    }
}

impl<R: Real> Heat<R> {
    /// Returns two of them side by side if both are the same law.
    pub fn beside(&self, other: &Self) -> Option<Heat<Both<R>>> {
        match (self, other) {
            (Heat::Newton(one), Heat::Newton(two)) => Some(Heat::Newton(Both([*one, *two]))),
            (Heat::Film(one), Heat::Film(two)) => Some(Heat::Film(one.beside(two))),
            (Heat::Pipe(one), Heat::Pipe(two)) => Some(Heat::Pipe(one.beside(two))),
            _ => None,
        }
    }
}

math::gather_enum!(Heat { Newton, Film, Pipe });
