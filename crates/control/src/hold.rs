//! Holding: a drive at rest at its target.

use crate::model::{Model, Slip};
use crate::number::{Number, memory};
use crate::thresholds::*;

memory! {
    /// Holding: the force at which the seal rests is kept.
    pub struct Hold<S> {
        /// Time near the target, s, time within the band about any place, s, and the error at this place, m.
        waited: S,
        rested: S,
        place: S,
        /// Whether holding is active, 0 or 1, the kept force, N, and approximately the force at its beginning, N.
        holds: S,
        force: S,
        begun: S,
        /// While the reference is at rest: the error of the last rest, m, and the least error, m. Then the number of
        /// slips past the target since the least error.
        rest: S,
        nearest: S,
        vain: S,
        /// Time for which the drive has been kept many bands away, s, and whether it is moved nearer, 0 or 1.
        far_for: S,
        tries: S,
        /// Error at the last try, m, and the number of successive tries that did not reduce the error.
        tried: S,
        missed: S,
        /// Error at the beginning of holding, m, and how often the drive has left a rest while the reference is at rest.
        origin: S,
        slid: S,
    }
    beside {
        /// Error below which holding begins, m.
        pub band: f64,
        /// Time for which the error must have been within the band, s.
        pub after: f64,
        /// Distance by which the drive left its rest at the last sample, m; 0 if it did not.
        pub(crate) left: S,
    }
}

/// Inputs of holding for one sample.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Resting<S> {
    /// 1 while the reference is at rest, else 0.
    pub stands: S,
    /// Error of the position, m.
    pub error: S,
    /// Velocity, m/s.
    pub velocity: S,
    /// Force of the gas, N.
    pub gas: S,
    /// Breakaway friction, N.
    pub level: S,
}

impl<S: Number> Hold<S> {
    /// Returns the initial state, with a band, m, and the time within it, s.
    pub fn new(band: f64, after: f64) -> Self {
        Hold { band, after, ..Hold::default() }
    }

    /// Returns 1 if the drive is to be kept where it rests, else 0. It is kept after two slips past the target that
    /// came no nearer.
    /// A further slip would not help.
    fn kept(&self) -> S {
        S::select(self.vain.lt(S::c(HOLD_VAIN)), S::zero(), S::one())
    }

    /// Counts such slips while the reference is at rest; 1 if the place has changed, else 0.
    fn count(&mut self, stands: S, e: S, period: f64) -> S {
        let (zero, one) = (S::zero(), S::one());
        // The test uses the position: the observer's velocity is noisy after each slip.
        let has_moved = S::c(self.band).lt((e - self.place).abs());
        self.place = S::select(has_moved, e, self.place);
        self.rested = S::select(has_moved, zero, self.rested + S::c(period)) * stands;
        let rests = S::select(self.rested.lt(S::c(0.5 * self.after)), zero, one);
        let passed = S::select((e * self.rest).lt(S::c(-self.band * self.band)), rests, zero);
        let is_first = self.nearest.lt(S::c(f64::MIN_POSITIVE));
        let is_nearer =
            S::select(e.abs().lt(self.nearest.times(HOLD_NEARER)), rests, S::select(is_first, rests, zero));
        self.nearest = S::select(zero.lt(is_nearer), e.abs(), self.nearest) * stands;
        self.vain = S::select(zero.lt(is_nearer), zero, self.vain + passed) * stands;
        let takes = S::select(zero.lt(self.holds * self.kept()), zero, rests);
        self.rest = S::select(zero.lt(takes), e, self.rest) * stands;
        S::select(has_moved, one, zero)
    }

    /// A drive that is kept many bands away tries again after a time. Its force grows slowly until the contact slips,
    /// so the slip is small. After two successive tries that come no nearer, it stops trying. `moved` is 1 after the
    /// place has changed.
    fn try_again(&mut self, stands: S, e: S, moved: S, period: f64) {
        let (zero, one, after) = (S::zero(), S::one(), S::c(HOLD_TRIES_AFTER));
        let is_far = S::select(e.abs().lt(S::c(HOLD_MANY * self.band)), zero, self.kept());
        let goes_on = S::select(zero.lt(moved), zero, is_far);
        let before = self.far_for;
        self.far_for = S::select(zero.lt(goes_on), before + S::c(period), zero);
        let is_due = S::select(self.far_for.lt(after), zero, one);
        let begins = S::select(before.lt(after), is_due, zero);
        let is_nearer = (e.abs() + S::c(self.band)).lt(self.tried);
        let is_first = self.tried.lt(S::c(f64::MIN_POSITIVE));
        let missed = S::select(is_first, zero, S::select(is_nearer, zero, self.missed + one));
        self.missed = S::select(zero.lt(begins), missed, self.missed) * stands;
        self.tried = S::select(zero.lt(begins), e.abs(), self.tried) * stands;
        self.tries = S::select(self.missed.lt(S::c(HOLD_VAIN)), is_due, zero);
        self.rest = S::select(zero.lt(self.kept() * moved), e, self.rest);
    }

    /// Ends holding if the drive moves as no held drive can, so that the law takes over. The limits are a speed
    /// ([`HOLD_FASTEST`]), a distance from the beginning of holding ([`HOLD_FARTHEST`]), and a change of the gas force
    /// ([`HOLD_STRONGEST`]). Holding does not move the drive again while the reference is at rest.
    fn watch(&mut self, seen: &Resting<S>, model: &Model<S>) {
        let (zero, one) = (S::zero(), S::one());
        let held = zero.lt(self.holds);
        let gone = (seen.error - self.origin).abs();
        let far = S::select(S::c(HOLD_FARTHEST).lt(gone), one, zero);
        let fast = S::select(S::c(HOLD_FASTEST).lt(seen.velocity.abs()), one, zero);
        let full = (model.supply.pressure - model.ambient.pressure) * model.sides[0].area;
        let most = seen.level.times(HOLD_STRONGEST).max(S::c(HOLD_NOISE * full));
        let strong = S::select(most.lt((seen.gas - self.begun).abs()), one, zero);
        let leaves = zero.lt(S::select(held, far.max(fast).max(strong), zero));
        self.left = S::select(leaves, gone, zero);
        self.slid = S::select(leaves, self.slid + one, self.slid) * seen.stands;
        for own in [&mut self.holds, &mut self.waited, &mut self.rest, &mut self.nearest, &mut self.vain] {
            *own = S::select(leaves, zero, *own);
        }
        self.missed = S::select(zero.lt(self.slid), S::c(HOLD_VAIN), self.missed);
    }

    /// Returns whether holding is active, and the rate of the gas force during holding, N/s:
    ///
    ///   F_h' = c s e within a bound about the first force, F' = F_h' + k_s (F_h - F)
    ///
    /// F_h is the kept force, s the stiffness of the contact, and c and k_s the rates of contact and gas.
    pub(crate) fn rate(&mut self, seen: &Resting<S>, model: &Model<S>, period: f64) -> (S::Mask, S) {
        let Resting { stands, error: e, velocity: v, gas, level } = *seen;
        let zero = S::zero();
        self.watch(seen, model);
        let moved = self.count(stands, e, period);
        self.try_again(stands, e, moved, period);
        let held = zero.lt(self.holds);
        let limit = S::select(held, S::c(HOLD_LEAVE * self.band), S::c(self.band));
        let is_far = limit.lt((e - self.rest * self.kept()).abs());
        // A changed load may have moved the drive: it tries once more.
        self.vain = S::select(is_far, self.vain.min(S::c(HOLD_VAIN - 1.0)), self.vain);
        let kept = self.kept();
        let near = S::select(is_far, zero, stands);
        // A kept drive is held as soon as it slips, unless it has left its rest several times.
        let soon = S::select(self.slid.lt(S::c(HOLD_VAIN)), kept, zero);
        let near = S::select(S::c(HOLD_SPEED).lt(v.abs()), near * self.holds.max(soon), near);
        let waited = (self.waited + S::c(period)).max(soon.times(self.after));
        self.waited = S::select(zero.lt(near), waited, zero);
        let force = S::select(held, self.force, gas);
        let follows = self.begun + (force - self.begun).times(period / HOLD_FORGETS);
        self.begun = S::select(held, follows, gas);
        let drifts = model.slip == Slip::Always;
        let [creep, settle] = match (model.valve.arrangement.is_proportional(), drifts) {
            (false, _) => HOLD_SWITCHING,
            (true, false) => HOLD_ELASTIC,
            (true, true) => HOLD_DRIFTING,
        };
        // A kept drive: the force moves away from the level at which the contact slips, unless the described load is
        // so wrong that the drive has left its rest.
        let released = (S::c(-model.load) - force).times(HOLD_RELEASES * period);
        let released = S::select(zero.lt(self.slid), zero, released);
        let tries = zero.lt(self.tries * kept);
        let pushed = S::select(e.lt(zero), -level, level).times(period / HOLD_RAMP);
        let released = S::select(tries, pushed, released);
        let drawn = S::select(zero.lt(kept), released, e.times(creep * model.stick_stiffness * period));
        let room = S::select(tries, level.times(2.0), level.times(HOLD_ROOM[usize::from(drifts)]));
        self.force = (force + drawn).max(self.begun - room).min(self.begun + room);
        self.holds = S::select(self.waited.lt(S::c(self.after)), zero, near);
        self.origin = S::select(held, self.origin, S::select(zero.lt(self.holds), e, self.origin));
        let creep = (self.force - force).times(1.0 / period);
        (zero.lt(self.holds), creep + (self.force - gas).times(settle))
    }
}
