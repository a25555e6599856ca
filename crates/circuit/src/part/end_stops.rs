use super::{Common, Own, Part};
use crate::ledger::Kind;
use crate::net::{AxisNode, Net};
use math::{Lane, Over, Real};
use physics::mechanics::EndStop;

/// An end stop at x = 0 and one at x = stroke.
#[derive(Clone, Debug)]
pub struct EndStops<P> {
    pub law: EndStop<P>,
    /// Stroke, m.
    pub stroke: P,
    pub axis: usize,
}

impl<R: Lane> EndStops<R> {
    pub(crate) fn gather(each: &[&EndStops<f64>]) -> Self {
        EndStops {
            law: EndStop::gather(&each.iter().map(|part| &part.law).collect::<Vec<_>>()),
            stroke: R::from_lanes(|lane| each[lane].stroke),
            axis: each[0].axis,
        }
    }
}

impl<P: Real> EndStops<P> {
    /// (penetration, closing speed) of whichever stop is nearer, and that stop's direction of push.
    #[inline(always)]
    fn contact<S: Over<P>>(&self, x: S, v: S) -> (S, S, S) {
        let over = x - S::from(self.stroke);
        let far = (-x).lt(over);
        (S::select(far, over, -x), S::select(far, v, -v), S::select(far, -S::one(), S::one()))
    }

    fn spring_energy<S: Over<P>>(&self, net: &Net<S>) -> S {
        let node = &net.axis[self.axis];
        let depth = self.contact(node.x, node.v).0.max(S::zero());
        S::c(0.5) * S::from(self.law.stiffness) * depth * depth
    }

    /// How far it is to each of the stops from `x`, m.
    pub(super) fn ahead(&self, x: P) -> [P; 2] {
        [x, self.stroke - x]
    }

    /// Adds the force of the stops to the axis.
    #[inline(always)]
    pub(super) fn push<S: Over<P>>(&self, node: &mut AxisNode<S>) {
        let (depth, closing, direction) = self.contact(node.x, node.v);
        node.end_stop = direction * self.law.force(depth, closing);
        node.force += node.end_stop;
    }
}

impl EndStops<f64> {
    /// Depth, m, and force that pushes back, N, of whichever stop is touched.
    pub(crate) fn pressed(&self, x: f64, v: f64) -> (f64, f64) {
        let (depth, closing, _) = self.contact(x, v);
        (depth.max(0.0), self.law.force(depth, closing))
    }
}

impl<P: Real> Part<P> for EndStops<P> {
    #[inline(always)]
    fn exchange<S: Over<P>>(&self, net: &mut Net<S>, _common: &Common<P>) {
        self.push(&mut net.axis[self.axis]);
    }

    fn n_obstacles(&self) -> usize {
        2
    }

    fn obstacles(&self, _y: Own<P>, net: &Net<P>, out: &mut [P]) {
        out.copy_from_slice(&self.ahead(net.axis[self.axis].x));
    }

    fn stored<S: Over<P>>(&self, _y: Own<S>, net: &Net<S>, _common: &Common<P>) -> [S; 3] {
        [S::zero(), self.spring_energy(net), S::zero()]
    }

    fn channels(&self) -> Vec<(&'static str, Kind)> {
        vec![("damper heat", Kind::Energy), ("damper", Kind::EntropyOfSolid)]
    }

    /// The work done on the stop. A piston that leaves faster than the stop can follow feels nothing of
    /// it, so its steps may be long: what the spring holds, and gives to the damper, is no integral.
    fn account<S: Over<P>>(&self, _y: Own<S>, net: &Net<S>, common: &Common<P>, out: &mut [S]) {
        let node = &net.axis[self.axis];
        let (depth, closing, _) = self.contact(node.x, node.v);
        let work = self.law.force(depth, closing) * closing;
        out[0] = -work;
        out[1] = work / S::from(common.ambient_temperature);
    }

    /// Heat of the damper = work - energy of the spring.
    fn standing<S: Over<P>>(&self, net: &Net<S>, common: &Common<P>, out: &mut [S]) {
        let spring = self.spring_energy(net);
        out[0] = spring;
        out[1] = -spring / S::from(common.ambient_temperature);
    }
}
