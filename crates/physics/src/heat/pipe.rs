use super::Transport;
use crate::Gas;
use crate::flow::pipe::{LAMINAR, smooth_friction, turbulent_share};
use math::{Over, Real};
use std::f64::consts::PI;

/// Nusselt number of laminar flow at a wall of constant temperature. Source: [bejan2016].
const LAMINAR_NUMBER: f64 = 3.66;
/// Reynolds number at which flow becomes smooth.
const FLOW_SMOOTH: f64 = 10.0;

/// Returns the Nusselt number of turbulent flow in a pipe:
///
///   `Nu = (f/8)(Re - 1000) Pr/(1 + 12.7 sqrt(f/8)(Pr^(2/3) - 1))`
///
/// f friction factor, Re Reynolds number (2300 to 5e6), Pr Prandtl number (0.5 to 2000). `excess` is Pr^(2/3) - 1.
/// Source: [gnielinski1976].
#[inline(always)]
pub fn nusselt<S: Real>(reynolds: S, friction: S, prandtl: S, excess: S) -> S {
    let eighth = friction * S::c(0.125);
    let under = S::one() + S::c(12.7) * eighth.sqrt() * excess;
    eighth * (reynolds - S::c(1000.0)) * prandtl / under
}

crate::parameters! {
    /// Heat-transfer coefficient of gas that flows through a tube:
    ///
    ///   `h = c (k/d) (3.66 (1 - s) + s Nu_G)                                                          [W/(m2 K)]`
    ///
    /// Nu_G of [`nusselt`] is taken at max(Re, 2000), with the friction of a smooth pipe.
    /// The turbulent share s of this friction is 0 below Re 2000 and 1 above Re 4000.
    /// The law is uncertain by a factor of 1.4.
    pub struct Pipe {
        /// Derived: c k/d
        film: "W/(m2 K)", crate::any();
        /// Derived: factor from mass flow to Re
        reynolds: "s/kg", crate::any();
        /// Derived: Prandtl number
        prandtl: "1", crate::any();
        /// Derived: Pr^(2/3) - 1
        excess: "1", crate::any();
        /// Derived: mass flow at Re 10
        least_flow: "kg/s", crate::any();
    }
}

impl<P: Real> Pipe<P> {
    /// Creates the law from its factor c and the diameter of the tube, m.
    pub fn new(scale: P, diameter: P, gas: &Gas<P>) -> Self {
        let Transport { viscosity, conductivity } = gas.transport;
        let prandtl = gas.cp * P::c(viscosity / conductivity);
        let reynolds = P::c(4.0 / (PI * viscosity)) / diameter;
        Pipe {
            film: scale * P::c(conductivity) / diameter,
            reynolds,
            prandtl,
            excess: prandtl.pow(P::c(2.0 / 3.0)) - P::one(),
            least_flow: P::c(FLOW_SMOOTH) / reynolds,
        }
    }

    /// Returns the heat-transfer coefficient, W/(m2 K), at the size of a mass flow, kg/s.
    #[inline(always)]
    pub fn coefficient<S: Over<P>>(&self, m_dot: S) -> S {
        let reynolds = m_dot.times(self.reynolds);
        let share = turbulent_share(reynolds);
        let turbulent = reynolds.max(S::c(LAMINAR));
        let number =
            nusselt(turbulent, smooth_friction(turbulent), S::from(self.prandtl), S::from(self.excess));
        S::c(LAMINAR_NUMBER).fma(S::one() - share, number * share).times(self.film)
    }
}
