use math::{Over, Real};

crate::parameters! {
    /// Mass flow through a long narrow gap, laminar and isothermal, with the upstream pressure p1:
    ///
    ///   `m_dot = c_l (p1^2 - p2^2)/T1,   c_l = pi D h^3/(24 mu L R)                     [kg/s]`
    ///
    /// * `c_l`: leak coefficient, kg K/(s Pa2).
    /// * `D`: diameter of the gap, m.
    /// * `h`: height of the gap, m.
    /// * `L`: length of the gap, m.
    /// * `mu`: dynamic viscosity, Pa s.
    /// * `R`: gas constant, J/(kg K).
    ///
    /// The law is derived from the parabolic profile between two plates at a distance h with the width w = pi D. There,
    /// m_dot = -rho w h^3/(12 mu) dp/dx and rho = p/(R T). It is odd in the ends.
    pub struct Laminar {
        /// Leak coefficient c_l
        coefficient: "kg K/(s Pa2)", crate::above(0.0);
    }
}

impl<P: Real> Laminar<P> {
    /// Creates the law of a gap: diameter, height and length, m, viscosity, Pa s, and gas constant, J/(kg K).
    pub fn of_gap([diameter, height, length]: [P; 3], viscosity: P, gas_constant: P) -> Self {
        let width = P::c(std::f64::consts::PI) * diameter;
        let coefficient = width * height * height * height / (P::c(24.0) * viscosity * length * gas_constant);
        Laminar { coefficient }
    }

    /// Returns the mass flow from end 1 to end 2, kg/s, and the mask of flow from 2 to 1. p is in Pa and T in K at each
    /// end.
    #[inline(always)]
    pub fn mass_flow<S: Over<P>>(&self, [p1, t1]: [S; 2], [p2, t2]: [S; 2]) -> (S, S::Mask) {
        let backward = p1.lt(p2);
        let t = S::select(backward, t2, t1);
        (S::from(self.coefficient) * (p1 - p2) * (p1 + p2) / t, backward)
    }
}
