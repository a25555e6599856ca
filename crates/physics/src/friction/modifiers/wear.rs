use crate::friction::{FLOOR, InnerState, Levels};
use crate::parameter::{above, any, at_least};
use math::{Over, Real};

/// Longest sliding distance that warnings consider, m: a hundred kilometres. Assumed.
pub(in crate::friction) const FARTHEST: f64 = 1e5;

crate::parameters! {
    /// Friction of a seal with run-in and wear, for any law: Fc and Fs times
    ///
    ///   `1 + a exp(-s/s0) + k s,   ds/dt = |w|`
    ///
    /// but never less than a hundredth. s is the irreversible sliding distance of the contact, and w its plastic slip
    /// rate. The parameters of the law are those of a seal after run-in and without wear. Source: [assumed].
    pub struct Wear {
        /// Additional fraction a of friction of a new seal
        run_in: "-", above(-1.0), default 0.0;
        /// Sliding distance s0 of the run-in
        run_in_distance: "m", above(0.0), default 1000.0;
        /// Relative change k for each distance slid
        rate: "1/m", any(), default 0.0;
        /// Distance slid before the start
        slid: "m", at_least(0.0), default 0.0;
    }
}

/// The state: sliding distance since the start.
pub(in crate::friction) const STATE: InnerState =
    InnerState { name: "sliding_distance_m", unit: "m", scale: 1.0 };

impl<P: Real> Wear<P> {
    /// Returns the levels of a contact with this sliding distance since the start, m.
    #[inline(always)]
    pub fn apply<S: Over<P>>(&self, base: &Levels<S>, way: S) -> Levels<S> {
        let slid = S::from(self.slid) + way;
        let new = S::from(self.run_in) * (-(slid / S::from(self.run_in_distance))).exp();
        base.times((S::one() + new + S::from(self.rate) * slid).max(S::c(FLOOR)))
    }
}
