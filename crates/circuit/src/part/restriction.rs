use super::{
    Common, Input, Own, Part,
    volume::{log, specific_entropy},
};
use crate::ledger::Kind;
use crate::net::{GasNode, Net};
use math::{Lane, Over, Real};
use physics::flow::Iso6358;

/// A component that throttles the flow between two gas nodes: an edge of a valve, a fitting, a leak.
/// Isenthalpic, without volume; gas arrives with the temperature of where it comes from.
#[derive(Clone, Debug)]
pub struct Restriction<P> {
    pub law: Iso6358<P>,
    /// Opening, 0 to 1: the share of the full conductance. An input: it may change at any time.
    pub opening: P,
    /// Nothing passes it in any lane.
    pub(crate) closed: bool,
    pub from: usize,
    pub to: usize,
    /// An end is a reservoir: what passes it crosses the boundary.
    pub from_boundary: bool,
    pub to_boundary: bool,
}

impl<R: Lane> Restriction<R> {
    pub(crate) fn gather(each: &[&Restriction<f64>]) -> Self {
        Restriction {
            law: Iso6358::gather(&each.iter().map(|part| &part.law).collect::<Vec<_>>()),
            opening: R::from_lanes(|lane| each[lane].opening),
            closed: each.iter().all(|part| part.closed),
            from: each[0].from,
            to: each[0].to,
            from_boundary: each[0].from_boundary,
            to_boundary: each[0].to_boundary,
        }
    }
}

impl<P: Real> Restriction<P> {
    /// Mass flow from `from` to `to`, kg/s, and where it goes backward.
    #[inline(always)]
    pub(crate) fn flow<S: Over<P>>(&self, one: &GasNode<S>, two: &GasNode<S>) -> (S, S::Mask) {
        let (w1, w2) = (one.inverse_sqrt_t, two.inverse_sqrt_t);
        self.law.mass_flow(S::from(self.opening), one.p, w1, two.p, w2)
    }

    #[inline(always)]
    pub(crate) fn pass<S: Over<P>>(&self, net: &mut Net<S>) {
        let (one, two) = (&net.gas[self.from], &net.gas[self.to]);
        let (m_dot, backward) = self.flow(one, two);
        let h_dot = m_dot * (net.cp * S::select(backward, two.t, one.t));
        post(net, (self.from, self.to), [self.from_boundary, self.to_boundary], m_dot, h_dot);
    }
}

/// Takes mass, kg/s, and enthalpy, W, from the first node and gives it to the second; a boundary keeps no account.
#[inline(always)]
pub(super) fn post<S: Real>(
    net: &mut Net<S>,
    (from, to): (usize, usize),
    boundary: [bool; 2],
    m_dot: S,
    h_dot: S,
) {
    if !boundary[0] {
        let one = &mut net.gas[from];
        one.m_dot -= m_dot;
        one.h_dot -= h_dot;
    }
    if !boundary[1] {
        let two = &mut net.gas[to];
        two.m_dot += m_dot;
        two.h_dot += h_dot;
    }
}

/// Accounts of a flow path.
pub(super) const CHANNELS: [(&str, Kind); 5] = [
    ("mass over the boundary", Kind::Mass),
    ("enthalpy over the boundary", Kind::Energy),
    ("entropy over the boundary", Kind::EntropyIn),
    ("throttling", Kind::EntropyOfGas),
    ("mixing", Kind::EntropyOfGas),
];

/// Rates of the accounts of a flow path with a mass flow, and where it goes backward.
pub(super) fn throttling<P: Real, S: Over<P>>(
    net: &Net<S>,
    (from, to): (usize, usize),
    [from_boundary, to_boundary]: [bool; 2],
    (m_dot, backward): (S, S::Mask),
    common: &Common<P>,
    out: &mut [S],
) {
    let (one, two) = (&net.gas[from], &net.gas[to]);
    let t_up = S::select(backward, two.t, one.t);
    let h_dot = m_dot * S::from(common.gas.cp) * t_up;
    let zero = S::zero();
    let sign = |boundary: bool, s: S| if boundary { s } else { zero };
    // Into the circuit: out of a reservoir at `from`, or back from one at `to`.
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

impl<P: Real> Part<P> for Restriction<P> {
    fn inputs(&self) -> &'static [Input] {
        const { &[Input { name: "opening", unit: "1", bounds: physics::within(0.0, 1.0) }] }
    }

    fn input(&self, _input: usize) -> P {
        self.opening
    }

    fn input_mut(&mut self, _input: usize) -> &mut P {
        &mut self.opening
    }

    fn channels(&self) -> Vec<(&'static str, Kind)> {
        CHANNELS.to_vec()
    }

    fn rests(&self) -> bool {
        self.closed
    }

    fn account<S: Over<P>>(&self, _y: Own<S>, _dy: Own<S>, net: &Net<S>, common: &Common<P>, out: &mut [S]) {
        let flow = self.flow(&net.gas[self.from], &net.gas[self.to]);
        let boundary = [self.from_boundary, self.to_boundary];
        throttling(net, (self.from, self.to), boundary, flow, common, out);
    }
}
