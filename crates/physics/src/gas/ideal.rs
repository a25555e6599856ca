use crate::constants::{AIR_GAS_CONSTANT, AIR_HEAT_CAPACITY_RATIO};
use math::{Lane, Real};

crate::parameters! {
    /// Ideal gas with constant heat capacities.
    ///
    ///   `p V = m R T,   U = m cv T,   cv = R/(k - 1),   cp = k R/(k - 1)`
    ///
    /// p pressure Pa, V volume m3, m mass kg, T temperature K, U internal energy J, cp and cv specific heat capacities
    /// J/(kg K). Air below 10 bar differs from it by less than 0.5 % (assumed). Source: [bejan2016].
    #[derive(Copy)]
    pub struct IdealGas {
        /// Ratio of specific heats k = cp/cv
        heat_capacity_ratio: "-", crate::above(1.0);
        /// Specific gas constant R
        gas_constant: "J/(kg K)", crate::above(0.0);
        /// Derived: specific heat capacity at constant volume cv
        cv: "J/(kg K)", crate::above(0.0);
        /// Derived: specific heat capacity at constant pressure cp
        cp: "J/(kg K)", crate::above(0.0);
        /// Derived: 1/cv
        inverse_cv: "kg K/J", crate::above(0.0);
    }
}

impl IdealGas<f64> {
    /// Dry air.
    pub fn air() -> Self {
        IdealGas::new(AIR_HEAT_CAPACITY_RATIO, AIR_GAS_CONSTANT)
    }
}

impl<R: Lane> IdealGas<R> {
    /// Returns whether this is exactly the gas of [`IdealGas::air`], in every lane.
    pub fn is_air(&self) -> bool {
        let is = |number: R, of_air: f64| (0..R::L).all(|lane| number.get(lane) == of_air);
        is(self.heat_capacity_ratio, AIR_HEAT_CAPACITY_RATIO) && is(self.gas_constant, AIR_GAS_CONSTANT)
    }
}

impl<P: Real> IdealGas<P> {
    /// Creates the gas from k and R, J/(kg K).
    pub fn new(heat_capacity_ratio: P, gas_constant: P) -> Self {
        let cv = gas_constant / (heat_capacity_ratio - P::one());
        IdealGas {
            heat_capacity_ratio,
            gas_constant,
            cv,
            cp: heat_capacity_ratio * cv,
            inverse_cv: P::one() / cv,
        }
    }
}
