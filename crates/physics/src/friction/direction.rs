use super::{At, Levels, dry};
use crate::parameter::above;
use math::{Over, Real};

crate::parameters! {
    /// Friction that depends on the direction of motion, as lip seals have it: on any law, both levels
    /// times a factor for each direction.
    ///
    /// The direction is the sign of v; for a law that sticks exactly it is its mode, and at rest that of
    /// the force which it holds. Source: [assumed].
    pub struct Direction {
        /// Factor for v > 0
        positive: "-", above(0.0), default 1.0;
        /// Factor for v < 0
        negative: "-", above(0.0), default 1.0;
    } with {
        /// The law sticks by a mode
        sticks: bool,
    }
}

impl<P: Real> Direction<P> {
    #[inline(always)]
    pub fn apply<S: Over<P>>(&self, base: &Levels<S>, at: &At<S>, mode: P) -> Levels<S> {
        let sign = if self.sticks { S::select(dry::is_stick(mode), at.applied, S::from(mode)) } else { at.v };
        let factor = S::select(sign.lt(S::zero()), S::from(self.negative), S::from(self.positive));
        base.times(factor)
    }
}
