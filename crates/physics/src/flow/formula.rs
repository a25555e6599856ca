use crate::constants::{RHO_0, T_0};
use crate::gas::IdealGas;
use crate::parameter::{above, within};
use crate::written::{Formula, Given, OwnFormula, Role};
use math::{Over, Real};

/// Output and variables of a formula of a mass flow.
pub const MASS_FLOW: Role = Role {
    output: ("mass_flow", "kg/s"),
    variables: &[
        Given::new("p_up", "Pa", above(0.0), "pressure upstream, the higher one, absolute"),
        Given::new("p_down", "Pa", above(0.0), "pressure downstream, absolute"),
        Given::new("t_up", "K", above(0.0), "temperature upstream"),
        Given::new(
            "opening",
            "1",
            within(0.0, 1.0),
            "opening fraction, 0 to 1; a formula that uses it makes a component with a command",
        ),
    ],
    constants: &[
        Given::new("gas_constant", "J/(kg K)", above(0.0), "of the gas"),
        Given::new("heat_capacity_ratio", "1", above(1.0), "ratio of specific heats of the gas"),
        Given::new("rho_0", "kg/m3", above(0.0), "density of the reference atmosphere, 1.185 kg/m3"),
        Given::new("t_0", "K", above(0.0), "temperature of the reference atmosphere, 293.15 K"),
    ],
};
const N: usize = 4;

/// Points at which a formula is checked: pressures, Pa, ratios p_down/p_up, temperatures, K, openings.
const PRESSURES: [f64; 4] = [2e4, 1e5, 7e5, 2e6];
const RATIOS: [f64; 7] = [1e-3, 0.2, 0.5, 0.8, 0.98, 0.9999, 1.0];
const TEMPERATURES: [f64; 3] = [200.0, 293.15, 400.0];
const OPENINGS: [f64; 4] = [0.0, 1e-3, 0.5, 1.0];
/// Flow at equal pressures that counts as rounding, relative to the flow at half the pressure.
const ROUNDING: f64 = 1e-9;

/// A flow path whose mass flow is given by a user's formula:
///
///   `m_dot = f(p_up, p_down, t_up, opening)      from the higher pressure to the lower          [kg/s]`
///
/// The law is odd in its ends: from node 2 to node 1, the ends are exchanged in the formula. With `one_way`, this flow
/// is zero.
#[derive(Clone, Debug)]
pub struct FlowFormula<P> {
    /// m_dot, with the values of its parameters and of the gas.
    pub formula: Formula<P>,
    /// Whether flow from end 2 to end 1 is zero.
    pub one_way: bool,
}

impl<P: Real> FlowFormula<P> {
    /// Creates it from parameters in their order, for a gas.
    pub fn new(own: &'static OwnFormula, mut values: Vec<P>, gas: &IdealGas<P>, one_way: bool) -> Self {
        values.extend([gas.gas_constant, gas.heat_capacity_ratio, P::c(RHO_0), P::c(T_0)]);
        FlowFormula { formula: Formula::new(own, values), one_way }
    }

    /// Returns the mass flow from end 1 to end 2, kg/s, for pressures, Pa, and temperatures, K.
    #[inline]
    pub fn mass_flow<S: Over<P>>(&self, opening: S, [p1, t1]: [S; 2], [p2, t2]: [S; 2]) -> S {
        let backward = p1.lt(p2);
        let pick = |one: S, two: S| S::select(backward, two, one);
        let given = [pick(p1, p2), pick(p2, p1), pick(t1, t2), opening];
        let m_dot = self.formula.value(|k| given[k]);
        S::select(backward, if self.one_way { S::zero() } else { -m_dot }, m_dot)
    }
}

impl FlowFormula<f64> {
    /// Refuses invalid values of the formula. The message names the place.
    pub fn examine(&self) -> Result<(), String> {
        let own = self.formula.own;
        for p_up in PRESSURES {
            for t_up in TEMPERATURES {
                for opening in OPENINGS {
                    let flows = RATIOS.map(|ratio| {
                        let at = [p_up, ratio * p_up, t_up, opening];
                        let (m_dot, _) = self.formula.slopes(&at)?;
                        Ok::<_, String>((at, m_dot))
                    });
                    let flows = flows.into_iter().collect::<Result<Vec<([f64; N], f64)>, _>>()?;
                    let most = flows.iter().fold(0.0, |most: f64, (_, m_dot)| most.max(m_dot.abs()));
                    if let Some((at, m_dot)) = flows.iter().find(|(_, m_dot)| *m_dot < -ROUNDING * most) {
                        return Err(format!(
                            "formula \"{}\": mass_flow = {m_dot:.4e} kg/s at {}: gas would flow from the lower pressure to \
                             the higher; p_up is always the higher one, and a flow the other way comes by itself",
                            own.name,
                            self.formula.place(at)
                        ));
                    }
                    let (at, rest) = &flows[flows.len() - 1];
                    if rest.abs() > ROUNDING * most {
                        return Err(format!(
                            "formula \"{}\": mass_flow = {rest:.4e} kg/s at {}, at equal pressures: it must be 0 there, or \
                             the flow would jump where it changes its direction",
                            own.name,
                            self.formula.place(at)
                        ));
                    }
                }
            }
        }
        Ok(())
    }
}

math::gather!(FlowFormula { formula } same { one_way });
