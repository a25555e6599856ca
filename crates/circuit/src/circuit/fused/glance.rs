//! Fast outputs of the usual drive at one state, also evaluated without nodes.

use super::{Chambers, Whole};
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

impl Whole<'_, f64> {
    /// Returns the fast outputs at a state with the inner states `z` of friction.
    #[inline(always)]
    pub(crate) fn glance(&self, y: &[f64], z: &[f64]) -> Glance {
        let Whole { fused, cylinder, common } = *self;
        let [x, v, m_a, u_a, m_b, u_b, ..] = *y else { unreachable!("the states of a cylinder") };
        let axis = cylinder.stands([x, v]);
        let states = [Both::same(x), Both::same(v), Both([m_a, m_b]), Both([u_a, u_b])];
        let Chambers { rates, node } = fused.chambers(Both::same(cylinder.least_wall), states);
        let ([p_a, p_b], [t_a, t_b], [m_dot_a, m_dot_b]) = (node.p.0, node.t.0, rates[0].0);
        let mut dz = [0.0];
        let axis = cylinder.moves(axis, node.p.0, z, &mut dz[..z.len()], common);
        [axis.x, axis.v, axis.a, axis.friction, -axis.end_stop, p_a, t_a, m_dot_a, p_b, t_b, m_dot_b]
    }
}
