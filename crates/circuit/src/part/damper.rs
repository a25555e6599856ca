//! Springs with dampers: their accounts, and contacts that a mass runs into.

use super::Common;
use crate::ledger::Kind;
use crate::net::Net;
use math::{Lane, Over, Real};

/// Accounts of a part that turns work into heat of its own, whose springs hold some of that work.
pub(super) const CHANNELS: [(&str, Kind); 2] =
    [("damper heat", Kind::Energy), ("damper", Kind::EntropyOfSolid)];

/// Rates of the accounts where this work, W, is done on the part: what its springs hold of that is no integral.
pub(super) fn account<P: Real, S: Over<P>>(work: S, common: &Common<P>, out: &mut [S]) {
    out[0] = -work;
    out[1] = work / S::from(common.ambient_temperature);
}

/// What the accounts hold beside their integrals: heat is the work done less the energy of the springs, J.
pub(super) fn standing<P: Real, S: Over<P>>(spring: S, common: &Common<P>, out: &mut [S]) {
    account(-spring, common, out);
}

/// Position of a contact that a mass runs into, from one side.
#[derive(Clone, Debug)]
pub struct Meets<P> {
    /// Where it is touched, m.
    pub position: P,
    /// It is met in +x.
    pub ahead: bool,
    pub axis: usize,
}

impl<R: Lane> Meets<R> {
    pub(crate) fn gather(each: &[&Meets<f64>]) -> Self {
        let Meets { ahead, axis, .. } = *each[0];
        Meets { position: R::of_each(each, |own| own.position), ahead, axis }
    }
}

impl<P: Real> Meets<P> {
    /// Penetration of the mass, m, and its rate, m/s.
    pub(super) fn contact<S: Over<P>>(&self, net: &Net<S>) -> (S, S) {
        let axis = &net.axis[self.axis];
        let depth = axis.x - S::from(self.position);
        if self.ahead { (depth, axis.v) } else { (-depth, -axis.v) }
    }

    /// A force that pushes back as one in -x, N.
    pub(super) fn force<S: Over<P>>(&self, pushes: S) -> S {
        if self.ahead { pushes } else { -pushes }
    }

    /// Lets a force in -x, N, act on the mass.
    pub(super) fn push<S: Over<P>>(&self, force: S, net: &mut Net<S>) {
        net.axis[self.axis].force -= force;
    }
}
