use math::Real;

crate::parameters! {
    /// Ideal gas with constant heat capacities.
    ///
    ///   p V = m R T,   U = m cv T,   cv = R/(k - 1),   cp = k R/(k - 1)
    ///
    /// p pressure Pa, V volume m3, m mass kg, T temperature K, U internal energy J, cp and cv
    /// specific heat capacities J/(kg K). Air below 10 bar departs from it by less than 0.5 %
    /// (assumed). Source: [bejan2016].
    pub struct IdealGas {
        /// Ratio of specific heats k = cp/cv
        heat_capacity_ratio: "-", crate::above(1.0);
        /// Specific gas constant R
        gas_constant: "J/(kg K)", crate::above(0.0);
    }
}

impl<P: Real> IdealGas<P> {
    /// cv = R/(k - 1), J/(kg K).
    #[inline(always)]
    pub fn cv(&self) -> P {
        self.gas_constant / (self.heat_capacity_ratio - P::one())
    }

    /// cp = k R/(k - 1), J/(kg K).
    #[inline(always)]
    pub fn cp(&self) -> P {
        self.heat_capacity_ratio * self.cv()
    }
}
