//! Springs with dampers: their balances, and contacts that a mass hits.

use crate::ground::{Common, Kind, Net};
use math::{Lane, Over, Real};

/// Returns the balances of a part that turns work into heat, with springs that store some of the work.
pub(crate) const CHANNELS: [(&str, Kind); 2] =
    [("damper heat", Kind::Energy), ("damper", Kind::EntropyOfSolid)];

/// Writes the rates of the balances for this power, W, on the part. The energy in its springs is not an integral.
pub(crate) fn account<P: Real, S: Over<P>>(work: S, common: &Common<P>, out: &mut [S]) {
    out[0] = -work;
    out[1] = work / S::from(common.ambient_temperature);
}

/// Inside `impl Part`: the energy that the springs of a part store, and the part of its balances outside the integrals.
/// Heat is the work done minus this energy.
macro_rules! springs {
    ($energy:ident) => {
        fn stored<S: Over<P>>(&self, _y: Own<S>, net: &Net<S>, _common: &Common<P>) -> [S; 3] {
            [S::zero(), self.$energy(net), S::zero()]
        }

        fn channels(&self) -> Vec<(&'static str, $crate::ground::Kind)> {
            damper::CHANNELS.to_vec()
        }

        fn standing<S: Over<P>>(&self, net: &Net<S>, common: &Common<P>, out: &mut [S]) {
            damper::account(-self.$energy(net), common, out);
        }
    };
}
pub(crate) use springs;

/// Position of a contact that a mass hits from one side.
#[derive(Clone, Debug)]
pub struct Meets<P> {
    /// Position of the first touch, m.
    pub position: P,
    /// Whether it is hit in +x.
    pub ahead: bool,
    pub axis: usize,
}

math::gather!(Meets { position } same { ahead, axis });

impl<P: Lane> Meets<P> {
    /// Returns the penetration of the mass, m, and its rate, m/s.
    pub(crate) fn contact<S: Over<P>>(&self, net: &Net<S>) -> (S, S) {
        let axis = &net.axis[self.axis];
        let depth = axis.x - S::from(self.position);
        if self.ahead { (depth, axis.v) } else { (-depth, -axis.v) }
    }

    /// Converts a restoring force to a force in -x, N.
    pub(crate) fn force<S: Over<P>>(&self, pushes: S) -> S {
        if self.ahead { pushes } else { -pushes }
    }
}

/// Implements `Part` for a part that a mass hits. The part has a contact `meets`, a restoring force `pushes` at a
/// penetration and its rate, and springs.
macro_rules! hit_by_a_mass {
    ($part:ident) => {
        impl<P: Lane> Part<P> for $part<P> {
            fn force<S: Over<P>>(&self, net: &Net<S>) -> S {
                self.meets.force(self.pushes(self.meets.contact(net)))
            }

            #[inline(always)]
            fn exchange<S: Over<P>>(&self, net: &mut Net<S>, _common: &Common<P>) {
                let force = self.force(net);
                net.axis[self.meets.axis].force -= force;
            }

            damper::springs!(spring_energy);

            fn account<S: Over<P>>(
                &self,
                _y: Own<S>,
                _dy: Own<S>,
                net: &Net<S>,
                common: &Common<P>,
                out: &mut [S],
            ) {
                let contact = self.meets.contact(net);
                damper::account(self.pushes(contact) * contact.1, common, out);
            }
        }
    };
}
pub(crate) use hit_by_a_mass;
