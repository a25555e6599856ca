use super::restriction::{CHANNELS, post, throttling};
use super::{Common, Own, Part};
use crate::ledger::Kind;
use crate::net::Net;
use math::{Lane, Over, Real};
use physics::flow::Iso6358;

/// The cup of a quick exhaust valve: a flow path from `from` to `to` that opens as the pressure at `from` rises above
/// that at `pilot`:
///
///   s = 3 u^2 - 2 u^3,   u = clip((p_from - p_pilot)/dp, 0, 1)
///
/// dp  difference from which on it is fully open  Pa
#[derive(Clone, Debug)]
pub struct Cup<P> {
    pub law: Iso6358<P>,
    pub switching_pressure: P,
    pub pilot: usize,
    pub from: usize,
    pub to: usize,
    /// An end is a reservoir: what passes it crosses the boundary.
    pub boundary: [bool; 2],
}

impl<R: Lane> Cup<R> {
    pub(crate) fn gather(each: &[&Cup<f64>]) -> Self {
        let Cup { pilot, from, to, boundary, .. } = *each[0];
        Cup {
            law: Iso6358::gather(&each.iter().map(|part| &part.law).collect::<Vec<_>>()),
            switching_pressure: R::from_lanes(|lane| each[lane].switching_pressure),
            pilot,
            from,
            to,
            boundary,
        }
    }
}

impl<P: Real> Cup<P> {
    /// Mass flow from `from` to `to`, kg/s, and where it goes backward.
    #[inline(always)]
    pub(crate) fn flow<S: Over<P>>(&self, net: &Net<S>) -> (S, S::Mask) {
        let (pilot, one, two) = (&net.gas[self.pilot], &net.gas[self.from], &net.gas[self.to]);
        let u = ((one.p - pilot.p) / S::from(self.switching_pressure)).max(S::zero()).min(S::one());
        let share = u * u * (S::c(3.0) - S::c(2.0) * u);
        self.law.mass_flow(share, one.p, one.inverse_sqrt_t, two.p, two.inverse_sqrt_t)
    }
}

impl<P: Real> Part<P> for Cup<P> {
    #[inline(always)]
    fn exchange<S: Over<P>>(&self, net: &mut Net<S>, _common: &Common<P>) {
        let (m_dot, backward) = self.flow(net);
        let t = S::select(backward, net.gas[self.to].t, net.gas[self.from].t);
        post(net, (self.from, self.to), self.boundary, m_dot, m_dot * (net.cp * t));
    }

    fn channels(&self) -> Vec<(&'static str, Kind)> {
        CHANNELS.to_vec()
    }

    fn account<S: Over<P>>(&self, _y: Own<S>, _dy: Own<S>, net: &Net<S>, common: &Common<P>, out: &mut [S]) {
        throttling(net, (self.from, self.to), self.boundary, self.flow(net), common, out);
    }
}
