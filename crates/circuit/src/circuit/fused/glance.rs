//! Fast outputs of the usual drive at one state, also evaluated without nodes.

use super::super::{AxisId, Circuit, GasId};
use super::Chambers;
use crate::part::mechanics::cylinder::INNER;
use math::Both;

/// Position, velocity, acceleration, friction, end stop force towards -x. Next come pressure, temperature and net mass
/// flow of chamber a, then of b, as in the nodes.
pub(crate) type Glance = [f64; 11];

/// Indices of a [`Glance`].
pub(crate) mod place {
    pub const POSITION: usize = 0;
    pub const VELOCITY: usize = 1;
    pub const ACCELERATION: usize = 2;
    pub const FRICTION: usize = 3;
    pub const END_STOP: usize = 4;
    pub const PRESSURE: [usize; 2] = [5, 8];
    pub const TEMPERATURE: [usize; 2] = [6, 9];
    pub const MASS_FLOW: [usize; 2] = [7, 10];
}

impl Circuit<f64> {
    /// Axis and chambers of a circuit that has fast outputs.
    pub(crate) fn glanced(&self) -> Option<(AxisId, [GasId; 2])> {
        self.fused.as_ref()?;
        let (_, cylinder) = &self.parts.cylinders[0];
        Some((AxisId(cylinder.axis.node), cylinder.volumes.each_ref().map(|volume| GasId(volume.node))))
    }

    /// Returns the fast outputs of such a circuit at a state.
    #[inline(always)]
    pub(crate) fn glance(&self, y: &[f64]) -> Glance {
        let fused = self.fused.as_ref().expect("a circuit without nodes");
        let (_, cylinder) = &self.parts.cylinders[0];
        let [x, v, m_a, u_a, m_b, u_b, ..] = *y else { unreachable!("the states of a cylinder") };
        let z = &y[INNER..self.topology.n_states];
        let axis = cylinder.stands([x, v]);
        let states = [Both::same(x), Both::same(v), Both([m_a, m_b]), Both([u_a, u_b])];
        let Chambers { rates, pressure, temperature, .. } =
            fused.chambers(Both::same(cylinder.least_wall), states);
        let ([p_a, p_b], [t_a, t_b], [m_dot_a, m_dot_b]) = (pressure.0, temperature.0, rates[0].0);
        let mut dz = [0.0];
        let axis = cylinder.moves(axis, pressure.0, z, &mut dz[..z.len()], &self.common);
        [axis.x, axis.v, axis.a, axis.friction, -axis.end_stop, p_a, t_a, m_dot_a, p_b, t_b, m_dot_b]
    }
}
