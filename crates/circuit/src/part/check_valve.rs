use super::restriction::{post, throttling};
use super::{Common, Own, Part};
use crate::ledger::Kind;
use crate::net::Net;
use math::{Lane, Over, Real};
use physics::flow::Iso6358;

/// A flow path that opens by itself in one direction; see [`Iso6358::one_way`]. Isenthalpic, without volume.
#[derive(Clone, Debug)]
pub struct CheckValve<P> {
    pub law: Iso6358<P>,
    /// Pressure difference from which on it opens, Pa.
    pub cracking_pressure: P,
    pub from: usize,
    pub to: usize,
    /// An end is a reservoir: what passes it crosses the boundary.
    pub boundary: [bool; 2],
}

impl<R: Lane> CheckValve<R> {
    pub(crate) fn gather(each: &[&CheckValve<f64>]) -> Self {
        CheckValve {
            law: Iso6358::gather(&each.iter().map(|part| &part.law).collect::<Vec<_>>()),
            cracking_pressure: R::from_lanes(|lane| each[lane].cracking_pressure),
            from: each[0].from,
            to: each[0].to,
            boundary: each[0].boundary,
        }
    }
}

impl<P: Real> CheckValve<P> {
    /// Mass flow from `from` to `to`, kg/s.
    #[inline(always)]
    pub(crate) fn flow<S: Over<P>>(&self, net: &Net<S>) -> S {
        let (one, two) = (&net.gas[self.from], &net.gas[self.to]);
        self.law.one_way(S::from(self.cracking_pressure), one.p, one.inverse_sqrt_t, two.p)
    }
}

impl<P: Real> Part<P> for CheckValve<P> {
    #[inline(always)]
    fn exchange<S: Over<P>>(&self, net: &mut Net<S>, _common: &Common<P>) {
        let m_dot = self.flow(net);
        let h_dot = m_dot * (net.cp * net.gas[self.from].t);
        post(net, (self.from, self.to), self.boundary, m_dot, h_dot);
    }

    fn channels(&self) -> Vec<(&'static str, Kind)> {
        super::restriction::CHANNELS.to_vec()
    }

    fn account<S: Over<P>>(&self, _y: Own<S>, _dy: Own<S>, net: &Net<S>, common: &Common<P>, out: &mut [S]) {
        let m_dot = self.flow(net);
        // Never backward.
        throttling(net, (self.from, self.to), self.boundary, (m_dot, m_dot.lt(S::zero())), common, out);
    }
}
