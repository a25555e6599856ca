//! Leakage past a seal.

use math::Lane;
use physics::IdealGas;
use physics::flow::{Iso6358, LEAK_RATIO, LINEAR_ABOVE};

/// A leak by its sonic conductance, m3/(s Pa).
pub(crate) fn leak<P: Lane>(conductance: P, gas: &IdealGas<P>, is_air: bool) -> Iso6358<P> {
    let (ratio, index) = (P::c(LEAK_RATIO), P::c(0.5));
    Iso6358::for_gas(conductance, ratio, index, P::c(LINEAR_ABOVE), true, gas, is_air)
}
