//! Flow paths: their flows and balances.

use crate::ground::{Common, GasId, Kind, Net, log, specific_entropy};
use math::{Over, Real};
use physics::Virial;

/// The ends of a flow path. Gas passes it at constant enthalpy, and arrives with the temperature of its source.
#[derive(Clone, Copy, Debug)]
pub struct Between {
    /// Flow out of this node is positive.
    pub from: GasId,
    /// Flow into this node is positive.
    pub to: GasId,
    /// Whether an end is a reservoir, so that its flow crosses the boundary.
    pub(crate) boundary: [bool; 2],
}

/// Moves mass, kg/s, with the enthalpy of its source from one end to the other. A reservoir has no balance.
#[inline(always)]
pub(crate) fn post<S: Real>(net: &mut Net<S>, path: Between, flow: (S, S::Mask)) {
    let Between { from, to, .. } = path;
    if net.enthalpy.is_empty() {
        post_ideal(net, path, flow);
    } else {
        let h = S::select(flow.1, net.enthalpy[to.0], net.enthalpy[from.0]);
        exchange(net, path, flow.0, flow.0 * h);
    }
}

/// Does the same for an ideal gas.
#[inline(always)]
pub(crate) fn post_ideal<S: Real>(net: &mut Net<S>, path: Between, (m_dot, backward): (S, S::Mask)) {
    let (one, two) = (&net.gas[path.from.0], &net.gas[path.to.0]);
    exchange(net, path, m_dot, m_dot * (net.cp * S::select(backward, two.t, one.t)));
}

#[inline(always)]
fn exchange<S: Real>(net: &mut Net<S>, path: Between, m_dot: S, h_dot: S) {
    let Between { from, to, boundary } = path;
    if !boundary[0] {
        net.gas[from.0].receive(-m_dot, -h_dot);
    }
    if !boundary[1] {
        net.gas[to.0].receive(m_dot, h_dot);
    }
}

/// Balances of a flow path.
pub(crate) const CHANNELS: [(&str, Kind); 5] = [
    ("mass over the boundary", Kind::Mass),
    ("enthalpy over the boundary", Kind::Energy),
    ("entropy over the boundary", Kind::EntropyIn),
    ("throttling", Kind::EntropyOfGas),
    ("mixing", Kind::EntropyOfGas),
];

/// Computes the rates of the balances of a flow path for a mass flow and its direction.
pub(crate) fn throttling<P: Real, S: Over<P>>(
    net: &Net<S>,
    path: Between,
    (m_dot, backward): (S, S::Mask),
    common: &Common<P>,
    out: &mut [S],
) {
    if let Some(virial) = &common.gas.virial {
        return throttling_of(virial, net, path, (m_dot, backward), common, out);
    }
    let Between { from, to, boundary: [from_boundary, to_boundary] } = path;
    let (one, two) = (&net[from], &net[to]);
    let t_up = S::select(backward, two.t, one.t);
    let h_dot = m_dot * S::from(common.gas.cp) * t_up;
    let zero = S::zero();
    let sign = |boundary: bool, s: S| if boundary { s } else { zero };
    // Flow into the circuit: out of a reservoir at `from`, or back from a reservoir at `to`.
    let one_in = |flow: S| sign(from_boundary, flow) - sign(to_boundary, flow);
    let carried =
        |boundary: bool, p: S| if boundary { m_dot * specific_entropy(t_up, p, common) } else { zero };
    out[0] = one_in(m_dot);
    out[1] = one_in(h_dot);
    out[2] = carried(from_boundary, one.p) - carried(to_boundary, two.p);
    out[3] = m_dot * S::from(common.gas.gas_constant) * log(one.p / two.p);
    let receiver = S::select(backward, one.t, two.t);
    let ratio = t_up / receiver;
    let mixing = m_dot.abs() * S::from(common.gas.cp) * (ratio - S::one() - log(ratio));
    let into_forward = if to_boundary { zero } else { mixing };
    let into_backward = if from_boundary { zero } else { mixing };
    out[4] = S::select(backward, into_backward, into_forward);
}

/// The same for a real gas. Throttling conserves enthalpy, and mixing conserves energy.
fn throttling_of<P: Real, S: Over<P>>(
    virial: &Virial<P>,
    net: &Net<S>,
    path: Between,
    (m_dot, backward): (S, S::Mask),
    common: &Common<P>,
    out: &mut [S],
) {
    let Between { from, to, boundary: [from_boundary, to_boundary] } = path;
    let (one, two, zero) = (&net[from], &net[to], S::zero());
    let up = [S::select(backward, two.p, one.p), S::select(backward, two.t, one.t)];
    let down = [S::select(backward, one.p, two.p), S::select(backward, one.t, two.t)];
    let h = |[p, t]: [S; 2]| virial.enthalpy(&common.gas, p, t);
    let s = |[p, t]: [S; 2]| specific_entropy(t, p, common);
    let throttled = [down[0], virial.throttled(&common.gas, h(up), up[1], down[0])];
    let (before, after) = (s(up), s(throttled));
    let sign = |boundary: bool, s: S| if boundary { s } else { zero };
    let one_in = |flow: S| sign(from_boundary, flow) - sign(to_boundary, flow);
    out[0] = one_in(m_dot);
    out[1] = one_in(m_dot * h(up));
    out[2] = sign(from_boundary, m_dot * S::select(backward, after, before))
        - sign(to_boundary, m_dot * S::select(backward, before, after));
    out[3] = m_dot.abs() * (after - before);
    let mixing = m_dot.abs() * (s(down) - after + (h(up) - h(down)) / down[1]);
    out[4] = S::select(backward, sign(!from_boundary, mixing), sign(!to_boundary, mixing));
}
