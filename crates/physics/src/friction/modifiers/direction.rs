use crate::friction::{At, Levels, dry};
use crate::parameter::above;
use math::{Over, Real};

/// Quantity that shows the direction of a contact.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Sense {
    /// The sign of v, for a law that slips by |v| times a function, so that nothing jumps with the sign.
    Velocity,
    /// The sign of the mode, and at rest the sign of the force in stick.
    Mode,
    /// The sign of each deflection, see [`Levels::towards`], for a law that slips or breaks away by the force of its
    /// springs. The sign of v may change while the springs carry their largest force. A level that jumped with v would
    /// drive the mass back at once, again and again.
    Deflection,
}

crate::parameters! {
    /// Friction that depends on the direction of motion, as with lip seals. It works with any law: both levels are
    /// multiplied by a factor for each direction.
    ///
    /// The direction is usually the sign of v. For a law that sticks exactly, it is the mode, and at rest the sign of
    /// the force in stick. A law may also slip or break away by the force of its springs (`gms`, `rate-and-state`,
    /// `armstrong` in stick). Then the direction is the sign of each deflection. Source: [assumed].
    pub struct Direction {
        /// Factor for v > 0
        positive: "-", above(0.0), default 1.0;
        /// Factor for v < 0
        negative: "-", above(0.0), default 1.0;
    } with {
        /// Quantity that shows the direction of the law
        sense: Sense,
    }
}

impl<P: Real> Direction<P> {
    #[inline(always)]
    pub(in crate::friction) fn apply<S: Over<P>>(&self, base: &Levels<S>, at: &At<S>, mode: P) -> Levels<S> {
        let [positive, negative] = [self.positive, self.negative].map(S::from);
        let factor = |way: S| S::select(way.lt(S::zero()), negative, positive);
        match self.sense {
            Sense::Velocity => base.times(factor(at.v)),
            Sense::Mode => base.times(factor(S::select(dry::is_stick(mode), at.applied, S::from(mode)))),
            Sense::Deflection => {
                let half = S::c(0.5);
                let (mean, lean) = (half * (positive + negative), half * (positive - negative));
                Levels { lean: [base.coulomb * lean, base.breakaway * lean], ..base.times(mean) }
            }
        }
    }
}
