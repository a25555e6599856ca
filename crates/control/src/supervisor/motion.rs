//! Whether the drive moves when it should move, and settles when it should rest.

use super::event::{EventKind, Log};
use crate::follower::Follower;
use crate::model::Model;
use crate::reference::Wanted;
use crate::thresholds::{MOTION_AIR, MOTION_HELD, MOTION_MOVED, MOTION_SWING, MOTION_SWINGS};
use crate::types::State;
use serde::Deserialize;

/// When a motion is complete. A file has tolerance, time and limit as a list.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
pub struct MotionRules {
    /// Error within which a drive has settled, m.
    pub tolerance: f64,
    /// For how long, s.
    pub settled_for: f64,
    /// Time within which it has to have moved, or settled, s.
    pub timeout: f64,
}

impl Default for MotionRules {
    fn default() -> Self {
        MotionRules { tolerance: 0.1e-3, settled_for: 0.05, timeout: 2.0 }
    }
}

/// State of a motion.
#[derive(Clone, Debug, Default)]
pub struct Motion {
    /// Position at the last movement, m, and the time since then with a target elsewhere, s.
    from: Option<f64>,
    waits: f64,
    /// Times since the reference is at rest, and since the error is within the tolerance, s.
    stands: f64,
    within: f64,
    /// Smallest and largest position since the reference is at rest, counted after half of the allowed settling time,
    /// m.
    range: Option<[f64; 2]>,
    told: bool,
    /// The drive has settled since the reference is at rest.
    settled: bool,
    swings: Swings,
}

/// Error along a reference that moves, within a time.
#[derive(Clone, Copy, Debug, Default)]
struct Swings {
    /// Duration, s.
    lasts: f64,
    /// Sign of the last error beyond the tolerance, and the number of its changes.
    side: f64,
    changes: u32,
    /// Distance of the reference, and the number of its reversals.
    way: f64,
    turns: u32,
    /// Least and largest error, m.
    range: [f64; 2],
    /// Whether the error oscillated in the previous window.
    swung: bool,
    told: bool,
}

impl Swings {
    /// Returns the error, peak to peak, m, if it oscillates. Its sign changes more than four times for each reversal
    /// of the reference, in two successive time windows.
    fn watch(&mut self, rules: &MotionRules, e: f64, velocity: f64, period: f64) -> Option<f64> {
        self.lasts += period;
        self.range = [self.range[0].min(e), self.range[1].max(e)];
        if e.abs() > rules.tolerance && e * self.side <= 0.0 {
            self.side = e.signum();
            self.changes += 1;
        }
        if velocity != 0.0 && velocity * self.way <= 0.0 {
            self.way = velocity.signum();
            self.turns += 1;
        }
        if self.lasts < rules.timeout {
            return None;
        }
        let [low, high] = self.range;
        let is_large = high - low > MOTION_SWING * rules.tolerance;
        let swung = is_large && self.changes > MOTION_SWINGS * (self.turns + 1);
        let is_news = swung && self.swung && !self.told;
        *self = Swings { told: self.told || is_news, swung, ..Swings::default() };
        is_news.then_some(high - low)
    }
}

/// Actual and wanted state of the drive.
#[derive(Clone, Copy, Debug)]
pub struct Moves {
    /// Actual state.
    pub state: State,
    /// Wanted state.
    pub wanted: Wanted,
    /// The reference stands.
    pub stands: bool,
    /// A command gives no air.
    pub no_air: bool,
}

impl Motion {
    /// Advances by a period, s; a fault is reported once for each motion.
    pub fn watch(&mut self, rules: &MotionRules, own: &Follower, time: f64, moves: &Moves, log: &mut Log) {
        let period = own.period;
        let Moves { state, wanted, stands, no_air } = *moves;
        let (x, e) = (state.position, wanted.position - state.position);
        let from = *self.from.get_or_insert(x);
        if (x - from).abs() > MOTION_MOVED {
            self.from = Some(x);
            self.waits = 0.0;
        }
        self.waits = if e.abs() > MOTION_MOVED { self.waits + period } else { 0.0 };
        if !stands {
            if let Some(size) = self.swings.watch(rules, e, wanted.velocity, period) {
                log.tell(time, EventKind::LimitCycle, size);
            }
            let Motion { from, waits, swings, .. } = *self;
            *self = Motion { from, waits, swings, told: self.told && waits > 0.0, ..Motion::default() };
        } else {
            self.stands += period;
            self.within = if e.abs() <= rules.tolerance { self.within + period } else { 0.0 };
            self.settled |= self.within >= rules.settled_for;
            if self.stands > 0.5 * rules.timeout {
                let [low, high] = self.range.unwrap_or([x; 2]);
                self.range = Some([low.min(x), high.max(x)]);
            }
        }
        if self.told {
            return;
        }
        let [low, high] = self.range.unwrap_or([x; 2]);
        let (kind, value) = if self.waits >= rules.timeout {
            held(&own.model, &state, e, no_air)
        } else if self.settled || self.stands < rules.timeout {
            return;
        } else if high - low > 2.0 * rules.tolerance {
            (EventKind::LimitCycle, high - low)
        } else {
            (EventKind::NotSettled, e)
        };
        log.tell(time, kind, value);
        self.told = true;
    }
}

/// Returns why a drive with an error does not move. With `no_air` its valve is shut, because the supply pressure is
/// below that of a chamber.
fn held(model: &Model, state: &State, e: f64, no_air: bool) -> (EventKind, f64) {
    let [a, b] = state.pressures.map(|p| p - model.ambient.pressure);
    if no_air || a.max(b) < MOTION_AIR * (model.supply.pressure - model.ambient.pressure) {
        return (EventKind::NoAir, a.max(b));
    }
    let force = model.gas_force(state.pressures) + model.load;
    let [level, _] = model.friction_levels([state.position, 0.0], state.pressures);
    let kind = if force * e.signum() > MOTION_HELD * level { EventKind::Blocked } else { EventKind::Stuck };
    (kind, force)
}
