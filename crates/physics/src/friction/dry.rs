//! Stick and slip as modes: -1 and +1 slide in that direction, 0 sticks with v = 0 exactly.

use super::At;
use math::{Over, Real};

/// Returns the force of a law in slip, or in stick the force that holds the mass.
///
/// `slip` must be smooth in v around zero, with the mode as the sign. Each mode can then be integrated past its end to
/// locate the end.
#[inline(always)]
pub(super) fn force<P: Real, S: Over<P>>(at: &At<S>, mode: P, slip: S) -> S {
    S::select(is_stick(mode), at.applied, slip)
}

#[inline(always)]
pub(super) fn is_stick<P: Real>(mode: P) -> P::Mask {
    (mode * mode).lt(P::c(0.5))
}

/// Stick holds while |applied| < breakaway, N. Slip holds while the velocity has the mode's sign, m/s.
pub(super) fn event<P: Real, S: Over<P>>(at: &At<S>, breakaway: S, mode: P) -> S {
    S::select(is_stick(mode), breakaway - at.applied.abs(), S::from(mode) * at.v)
}

/// From stick, the mass moves in the direction of the force. From slip it stops, unless the force is already large
/// enough to push it back.
pub(super) fn next_mode<P: Real>(mode: P, applied: P, breakaway: P) -> P {
    let way = P::select(applied.lt(P::zero()), -P::one(), P::one());
    let stopped = P::select(breakaway.lt(applied.abs()), way, P::zero());
    P::select(is_stick(mode), way, stopped)
}
