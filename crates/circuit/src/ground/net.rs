//! The nodes that parts share during an evaluation of the right-hand side.

use crate::ground::{AxisId, GasId};
use math::Real;
use physics::chamber::GasState;
use physics::flow::End;
use std::ops::{Deref, Index};

/// A gas node: a volume or a reservoir. It can be used as the [`GasState`] of its gas.
#[derive(Clone, Copy, Debug)]
pub struct GasNode<S> {
    /// Volume, m3.
    pub volume: S,
    /// Rate of the volume, m3/s.
    pub volume_rate: S,
    /// Wetted wall, m2.
    pub wall: S,
    /// Pressure and temperature, with the reciprocals that all restrictions of the node share. All values of the node
    /// are set together. A stale reciprocal would show only in the step size.
    state: GasState<S>,
    /// Net mass flow into the node, kg/s.
    pub m_dot: S,
    /// Net enthalpy flow into the node, W.
    pub h_dot: S,
    /// Heat from the wall, W.
    pub heat: S,
    /// Temperature of the wall, K.
    pub wall_temperature: S,
    /// Sum of the sizes of all flows, kg/s, if the heat transfer depends on flows.
    pub turnover: S,
    /// Least flow m_0 of that sum, kg/s.
    pub(crate) least_flow: S,
    /// Whether the heat transfer depends on flows.
    pub(crate) is_stirred: bool,
}

/// A moving mass, or a carriage whose motion is prescribed.
#[derive(Clone, Copy, Debug)]
pub struct AxisNode<S> {
    /// Position, m.
    pub x: S,
    /// Velocity, m/s.
    pub v: S,
    /// Sum of all forces in +x except friction, N.
    pub force: S,
    /// Friction force, N, positive if it opposes v > 0.
    pub friction: S,
    /// Force of the end stops in +x, N.
    pub end_stop: S,
    /// Acceleration, m/s2.
    pub a: S,
    /// Gauge pressure at the seal of chamber a, Pa.
    pub gauge_a: S,
    /// Gauge pressure at the seal of chamber b, Pa.
    pub gauge_b: S,
    /// Values that the friction law prepared for this velocity.
    pub prepared: S,
}

/// All nodes of a circuit, and its gas constants in the scalar of the evaluation.
#[derive(Clone, Debug)]
pub struct Net<S> {
    /// Gas nodes. A [`GasId`] is an index of a gas node.
    pub gas: Vec<GasNode<S>>,
    /// Moving masses. An [`AxisId`] is an index of a moving mass.
    pub axis: Vec<AxisNode<S>>,
    /// Signals between parts: written in the phase of positions, and read after the pressures.
    pub signal: Vec<S>,
    /// Specific heat capacity at constant pressure, J/(kg K).
    pub cp: S,
    /// Specific enthalpy of each gas node, J/kg, for a real gas. It is empty for an ideal gas, whose enthalpy is cp T.
    pub enthalpy: Vec<S>,
    /// Slopes of platforms at the last values: two entries for each axis, if there are platforms.
    pub(crate) known: Vec<Vec<S>>,
    /// Workspace for rates that are not read, when only the nodes are observed.
    pub(crate) rates: Vec<S>,
    /// Identifier of the stored reservoir values, see `Circuit::filled`.
    pub(crate) filled: u64,
}

impl<S: Real> Net<S> {
    pub(crate) fn new(gas: usize, axes: usize, signals: usize, cp: S) -> Self {
        Net {
            gas: vec![GasNode::empty(); gas],
            axis: vec![AxisNode::at_rest(); axes],
            signal: vec![S::zero(); signals],
            cp,
            enthalpy: Vec::new(),
            known: Vec::new(),
            rates: Vec::new(),
            filled: 0,
        }
    }

    /// Returns the distance of one axis beyond another, x_from - x_to, m, and its rate, m/s.
    #[inline(always)]
    pub(crate) fn apart(&self, from: usize, to: usize) -> (S, S) {
        let (one, two) = (&self.axis[from], &self.axis[to]);
        (one.x - two.x, one.v - two.v)
    }
}

impl<S> Index<GasId> for Net<S> {
    type Output = GasNode<S>;
    fn index(&self, id: GasId) -> &GasNode<S> {
        &self.gas[id.0]
    }
}

impl<S> Index<AxisId> for Net<S> {
    type Output = AxisNode<S>;
    fn index(&self, id: AxisId) -> &AxisNode<S> {
        &self.axis[id.0]
    }
}

impl<S> Deref for GasNode<S> {
    type Target = GasState<S>;
    #[inline(always)]
    fn deref(&self) -> &GasState<S> {
        &self.state
    }
}

impl<S: Real> GasNode<S> {
    /// Returns the node as the end of a flow path.
    #[inline(always)]
    pub fn end(&self) -> End<S> {
        End { p: self.p, inverse_p: self.inverse_p, choked: self.p * self.inverse_sqrt_t }
    }

    /// Creates a node with gas at this state.
    pub(crate) fn at(state: GasState<S>) -> Self {
        let mut node = Self::empty();
        node.fill(state);
        node
    }

    /// Copies the state of its gas.
    #[inline(always)]
    pub(crate) fn fill(&mut self, state: GasState<S>) {
        self.state = state;
    }

    /// A node without volume and flow. Pressure and temperature are 1, so that no division by zero occurs.
    #[inline(always)]
    pub(crate) fn empty() -> Self {
        let (o, one) = (S::zero(), S::one());
        GasNode {
            volume: o,
            volume_rate: o,
            wall: o,
            state: GasState { p: one, t: one, inverse_p: one, inverse_sqrt_t: one },
            m_dot: o,
            h_dot: o,
            heat: o,
            wall_temperature: one,
            turnover: o,
            least_flow: o,
            is_stirred: false,
        }
    }

    /// Adds a mass flow into the node, kg/s, with its enthalpy, W.
    #[inline(always)]
    pub(crate) fn receive(&mut self, m_dot: S, h_dot: S) {
        self.m_dot += m_dot;
        self.h_dot += h_dot;
        if self.is_stirred {
            // Exactly zero without flow.
            let least = self.least_flow;
            self.turnover += m_dot.fma(m_dot, least * least).sqrt() - least;
        }
    }
}

impl<S: Real> AxisNode<S> {
    #[inline(always)]
    pub(crate) fn at_rest() -> Self {
        let o = S::zero();
        AxisNode { x: o, v: o, force: o, friction: o, end_stop: o, a: o, gauge_a: o, gauge_b: o, prepared: o }
    }
}
