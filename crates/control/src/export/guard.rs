//! Checks around exported code: sensors, limits of the reference, stop ramp. A caller that passes wrong numbers, or no
//! numbers, gets a command that is safe for the drive.
//!
//! A drive whose valve is shut, or that was stopped, remains in this state until it is disabled and enabled again.

use crate::course::Fade;
use crate::follower::Follower;
use crate::number::{Number, flag, memory};
use crate::reference::Wanted;
use crate::thresholds::*;

/// Values of the output `status`, and their meanings.
pub const STATUS: [(f64, &str); 5] = [
    (FOLLOWS, "the drive follows its reference"),
    (DISABLED, "not enabled: the valve is shut"),
    (NO_POSITION, "the position sensor is lost: the valve is shut"),
    (NO_PRESSURE, "a pressure sensor is lost: the valve is shut"),
    (REJECTED, "the reference was rejected: stop ramp, then the drive rests"),
];
const FOLLOWS: f64 = 0.0;
const DISABLED: f64 = 1.0;
const NO_POSITION: f64 = 2.0;
const NO_PRESSURE: f64 = 3.0;
const REJECTED: f64 = 4.0;

/// Limits that a caller may change: least and greatest position, m, speed, m/s, deceleration of a stop ramp, m/s2.
pub type Limits<S> = [S; 4];

memory! {
    /// Inputs of the code for one sample, in their order.
    pub struct GuardInputs<S> {
        pub position: S,
        pub pressures: Option<[S; 2]>,
        pub now: Wanted<S>,
        pub then: Wanted<S>,
        pub stands: S,
        pub enabled: S,
    }
}

memory! {
    /// State of the checks.
    pub struct Guard<S> {
        /// 1 if the last sample was enabled, else 0.
        enabled: S,
        status: S,
        /// Last accepted position, m, and pressures, Pa, and the number of successive rejected readings.
        position: S,
        pressures: [S; 2],
        missed: [S; 3],
        /// Last accepted position, velocity and acceleration of the reference.
        followed: [S; 3],
        /// Time since the stop ramp began and its duration, s. Its begin, m, m/s, m/s2, and its end, m.
        stops_for: S,
        duration: S,
        from: [S; 3],
        end: S,
    }
}

/// Count of numbers in a [`Guard`].
pub const GUARD: usize = 17;

/// Returns 1 if a number is between two others, else 0; also 0 for NaN.
fn between<S: Number>(low: S, x: S, high: S) -> S {
    flag(low, x) * flag(x, high)
}

/// Returns the first of two numbers if a flag is 1, else the second.
fn either<S: Number>(is: S, yes: S, no: S) -> S {
    S::select(S::c(0.5).lt(is), yes, no)
}

fn is<S: Number>(status: S, value: f64) -> S {
    between(S::c(value - 0.5), status, S::c(value + 0.5))
}

impl<S: Number> Guard<S> {
    /// Checks the inputs of a sample for a controller. `velocity` is the estimate at the last sample, m/s. Returns two
    /// flags, 1 or 0, that say whether the valve may open and whether control begins, then the status and the inputs after
    /// the checks.
    pub fn check(
        &mut self,
        own: &Follower,
        limits: &Limits<S>,
        asked: &GuardInputs<S>,
        velocity: S,
    ) -> ([S; 3], GuardInputs<S>) {
        let one = S::one();
        let enabled = flag(S::c(0.5), asked.enabled);
        let begins = enabled * (one - self.enabled);
        let position = self.position(own, asked.position, velocity, begins);
        let pressures = asked.pressures.map(|read| self.gas(own, read, begins));
        let is_good = self.accepts(own, limits, asked, position, begins);
        let is_lost = |missed: S, most: u32| flag(S::c(f64::from(most) - 0.5), missed);
        let [x, a, b] = self.missed;
        let (no_position, no_pressure) = (is_lost(x, POSITION_LOST), is_lost(a.max(b), PRESSURE_LOST));
        let before = either(begins, S::c(FOLLOWS), self.status);
        let was_shut = is(before, NO_POSITION) + is(before, NO_PRESSURE);
        let rejected = either(is_good, before, S::c(REJECTED));
        let lost = either(no_position, S::c(NO_POSITION), either(no_pressure, S::c(NO_PRESSURE), rejected));
        let status = either(enabled, either(was_shut, before, lost), S::c(DISABLED));
        let stops = is(status, REJECTED);
        let follows = is(status, FOLLOWS);
        self.stop(own, limits, stops * (one - is(before, REJECTED)), begins, position);
        (self.enabled, self.status) = (enabled, status);
        let fade = Fade { begin: S::zero(), duration: self.duration.max(S::c(own.period)), from: self.from };
        let at = |ramp: Wanted<S>, asked: Wanted<S>| {
            let pick = |ramp: S, asked: S, rests: S| either(follows, asked, either(stops, ramp, rests));
            let zero = S::zero();
            Wanted {
                position: pick(self.end + ramp.position, asked.position, position),
                velocity: pick(ramp.velocity, asked.velocity, zero),
                acceleration: pick(ramp.acceleration, asked.acceleration, zero),
                jerk: pick(ramp.jerk, asked.jerk, zero),
            }
        };
        let now = at(fade.at(self.stops_for), asked.now);
        let then = at(fade.at(self.stops_for + S::c(own.ahead())), asked.then);
        let stood = flag(fade.duration, self.stops_for);
        let stands = either(follows, flag(S::c(0.5), asked.stands), either(stops, stood, one));
        self.followed = [now.position, now.velocity, now.acceleration];
        self.stops_for = either(stops, self.stops_for + S::c(own.period), S::zero());
        let asked = GuardInputs { position, pressures, now, then, stands, enabled };
        ([follows + stops, begins, status], asked)
    }

    /// Returns the position, or the prediction if the reading is not credible: if |x - x_predicted| > 5 counts + 0.1 T
    /// v_max.
    fn position(&mut self, own: &Follower, reading: S, velocity: S, begins: S) -> S {
        let predicted = self.position + velocity.times(own.period);
        let speed = S::c(POSITION_SPEED * own.period * own.plant.speed);
        let apart = speed * (self.missed[0] + S::one()) + S::c(POSITION_JUMP * own.grain());
        let near = between(-apart, reading - predicted, apart);
        let inside = between(S::c(-STOP_NEAR), reading, S::c(own.model.stroke + STOP_NEAR));
        let good = inside * either(begins, S::one(), near);
        // Without a first reading nothing can be predicted.
        let missed = either(begins, S::c(f64::from(POSITION_LOST)), self.missed[0] + S::one());
        self.missed[0] = either(good, S::zero(), missed);
        self.position = either(good, reading, either(begins, S::zero(), predicted));
        self.position
    }

    /// Returns the pressures; a reading that is not credible is replaced by the last credible one.
    fn gas(&mut self, own: &Follower, read: [S; 2], begins: S) -> [S; 2] {
        let [low, high] = GUARD_PRESSURE;
        for (side, reading) in read.into_iter().enumerate() {
            let good = between(S::c(low), reading, S::c(high * own.model.supply.pressure));
            let missed = &mut self.missed[1 + side];
            *missed = either(good, S::zero(), either(begins, S::zero(), *missed) + S::one());
            let usual = either(begins, S::c(0.5 * own.model.supply.pressure), self.pressures[side]);
            self.pressures[side] = either(good, reading, usual);
        }
        self.pressures
    }

    /// Returns 1 if the reference is within the limits, finite and continuous. At the first sample the reference must
    /// be near the drive.
    fn accepts(
        &self,
        own: &Follower,
        limits: &Limits<S>,
        asked: &GuardInputs<S>,
        position: S,
        begins: S,
    ) -> S {
        let rounding = S::c(LIMIT_ROUNDING);
        let [low, high, fastest, _] = *limits;
        let within = |wanted: &Wanted<S>| {
            let speed = fastest + rounding;
            let far = S::c(f64::MAX);
            between(low - rounding, wanted.position, high + rounding)
                * between(-speed, wanted.velocity, speed)
                * between(-far, wanted.acceleration, far)
                * between(-far, wanted.jerk, far)
        };
        let [followed, velocity, _] = self.followed;
        let way = (velocity + asked.now.velocity).times(0.5 * own.period);
        let jump = asked.now.position - followed - way;
        let apart = either(begins, asked.now.position - position, jump);
        let least = either(begins, S::c(STOP_NEAR), S::c(REFERENCE_JUMP));
        within(&asked.now) * within(&asked.then) * between(-least, apart, least)
    }

    /// Begins a stop ramp at the last wanted position. At the first sample, the place of rest is the present position.
    fn stop(&mut self, own: &Follower, limits: &Limits<S>, stops: S, begins: S, position: S) {
        let (period, zero) = (S::c(own.period), S::zero());
        let [x, v, a] = self.followed;
        let from = [x + period * (v + (period * a).times(0.5)), v + period * a, a];
        let from =
            [either(begins, position, from[0]), either(begins, zero, from[1]), either(begins, zero, from[2])];
        let ahead = S::select(zero.lt(from[1]), S::c(own.model.stroke) - from[0], from[0]);
        let [.., deceleration] = *limits;
        let (fade, end) = Fade::stop(zero, from, deceleration, ahead - S::c(STOP_APART));
        self.stops_for = either(stops, zero, self.stops_for);
        self.duration = either(stops, fade.duration, self.duration);
        for (from, new) in self.from.iter_mut().zip(fade.from) {
            *from = either(stops, new, *from);
        }
        self.end = either(stops, end, self.end);
    }
}
