use super::path::gathered;
use super::{Common, Own, Part};
use crate::ledger::Kind;
use crate::net::Net;
use math::{Over, Real};

gathered! {
    /// An elastomer that a mass runs into, by Hunt and Crossley:
    ///
    ///   F = F_r (d/d_r)^n (1 + lambda d'),  not below zero                    [N]
    ///
    /// d       depth, from x_0 on in +x or in -x                 m
    /// F_r     static force at the depth d_r                     N
    /// n       exponent                                          -
    /// lambda  damping, in proportion to the static force        s/m
    pub struct Bumper {
        numbers { position, rated_force, rated_depth, exponent, damping }
        laws {}
        same {
            /// It is met in +x.
            ahead: bool,
            axis: usize,
        }
    }
}

/// Depth, as a share of the rated one, from which on it counts: so small that no tolerance resolves its force, and a
/// power of it still has a slope.
const LEAST_DEPTH: f64 = 1e-12;

impl<P: Real> Bumper<P> {
    /// Depth and closing speed.
    fn contact<S: Over<P>>(&self, net: &Net<S>) -> (S, S) {
        let axis = &net.axis[self.axis];
        let depth = axis.x - S::from(self.position);
        if self.ahead { (depth, axis.v) } else { (-depth, -axis.v) }
    }

    /// Static force at a depth, N.
    fn rests<S: Over<P>>(&self, depth: S) -> S {
        let share = (depth / S::from(self.rated_depth)).max(S::c(LEAST_DEPTH));
        let force = S::from(self.rated_force) * share.pow(S::from(self.exponent));
        S::select(S::zero().lt(depth), force, S::zero())
    }

    /// Force that pushes back, N.
    fn pushes<S: Over<P>>(&self, (depth, closing): (S, S)) -> S {
        self.rests(depth) * S::from(self.damping).fma(closing, S::one()).max(S::zero())
    }

    fn spring_energy<S: Over<P>>(&self, net: &Net<S>) -> S {
        let (depth, _) = self.contact(net);
        self.rests(depth) * depth / (S::from(self.exponent) + S::one())
    }
}

impl<P: Real> Part<P> for Bumper<P> {
    fn force<S: Over<P>>(&self, net: &Net<S>) -> S {
        let force = self.pushes(self.contact(net));
        if self.ahead { force } else { -force }
    }

    #[inline(always)]
    fn exchange<S: Over<P>>(&self, net: &mut Net<S>, _common: &Common<P>) {
        let force = self.force(net);
        net.axis[self.axis].force -= force;
    }

    fn stored<S: Over<P>>(&self, _y: Own<S>, net: &Net<S>, _common: &Common<P>) -> [S; 3] {
        [S::zero(), self.spring_energy(net), S::zero()]
    }

    fn channels(&self) -> Vec<(&'static str, Kind)> {
        vec![("damper heat", Kind::Energy), ("damper", Kind::EntropyOfSolid)]
    }

    /// The work done on it: what it holds of that is no integral.
    fn account<S: Over<P>>(&self, _y: Own<S>, _dy: Own<S>, net: &Net<S>, common: &Common<P>, out: &mut [S]) {
        let contact = self.contact(net);
        let work = self.pushes(contact) * contact.1;
        out[0] = -work;
        out[1] = work / S::from(common.ambient_temperature);
    }

    fn standing<S: Over<P>>(&self, net: &Net<S>, common: &Common<P>, out: &mut [S]) {
        let spring = self.spring_energy(net);
        out[0] = spring;
        out[1] = -spring / S::from(common.ambient_temperature);
    }
}
