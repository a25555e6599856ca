use math::{Over, Real};

crate::parameters! {
    /// Mass flow through a long narrow gap, laminar and isothermal, with p1 the pressure that it comes from:
    ///
    ///   m_dot = c_l (p1^2 - p2^2)/T1,   c_l = pi D h^3/(24 mu L R)                     [kg/s]
    ///
    /// c_l  leak coefficient       kg K/(s Pa2)   D  diameter of the gap   m
    /// h    height of the gap      m              L  its length            m
    /// mu   dynamic viscosity      Pa s           R  gas constant          J/(kg K)
    ///
    /// Derived from the parabolic profile between two plates a distance h apart, w = pi D wide, where
    /// m_dot = -rho w h^3/(12 mu) dp/dx and rho = p/(R T). Odd in the ends.
    pub struct Laminar {
        /// Leak coefficient c_l
        coefficient: "kg K/(s Pa2)", crate::above(0.0);
    }
}

impl<P: Real> Laminar<P> {
    /// That of a gap: diameter, height and length, m, viscosity, Pa s, and gas constant, J/(kg K).
    pub fn of_gap([diameter, height, length]: [P; 3], viscosity: P, gas_constant: P) -> Self {
        let width = P::c(std::f64::consts::PI) * diameter;
        let coefficient = width * height * height * height / (P::c(24.0) * viscosity * length * gas_constant);
        Laminar { coefficient }
    }

    /// Mass flow from end 1 to end 2, kg/s, and where it goes from 2 to 1; p in Pa, T in K at each end.
    #[inline(always)]
    pub fn mass_flow<S: Over<P>>(&self, [p1, t1]: [S; 2], [p2, t2]: [S; 2]) -> (S, S::Mask) {
        let backward = p1.lt(p2);
        let t = S::select(backward, t2, t1);
        (S::from(self.coefficient) * (p1 - p2) * (p1 + p2) / t, backward)
    }
}
