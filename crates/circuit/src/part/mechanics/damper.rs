//! Balances of springs with dampers.

use crate::ground::{Common, Kind};
use math::{Over, Real};

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
