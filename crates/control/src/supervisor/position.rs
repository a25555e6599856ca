//! Readings of a position against what the model foresees.

use super::event::{EventKind, Log};
use crate::observer::State;

/// Grains by which a reading may leave the model beside what the speed allows, and grains that the model moves while a
/// reading rests until that is stuck (assumed).
const JUMP: f64 = 5.0;
const STUCK: f64 = 20.0;
/// Speed up to which a model without measured pressures, or one that follows the position alone, may creep while its drive
/// rests, m/s (assumed).
const CREEPS: f64 = 5e-3;
/// Share of the highest speed by which the speed of the model may be wrong (assumed).
const SPEED_SHARE: f64 = 0.1;
/// Readings in a row that are not credible until the sensor is lost (assumed).
const LOST: u32 = 3;

/// What is known of a position sensor.
#[derive(Clone, Debug, Default)]
pub struct Position {
    /// The last credible reading.
    last: Option<f64>,
    /// Way of the model since the reading changed, m.
    moved: f64,
    /// Readings in a row that are not credible.
    bad: u32,
}

impl Position {
    /// The sensor is not read any more.
    pub fn is_lost(&self) -> bool {
        self.bad >= LOST
    }

    /// A reading, or what the model foresees where that is not credible. `grain` is how finely the model can know a
    /// position, m, `fastest` the highest speed, m/s; `is_held`: the law held at the last sample; `by_gas`: the model
    /// follows measured pressures.
    pub fn checked(
        &mut self,
        (time, reading): (f64, f64),
        (foreseen, is_held, by_gas): (&State, bool, bool),
        (grain, fastest, period): (f64, f64, f64),
        log: &mut Log,
    ) -> f64 {
        if self.is_lost() {
            return foreseen.position;
        }
        let miss = reading - foreseen.position;
        // A contact that is held may creep in the model and stick in truth: each reading puts the model back.
        let creeps = is_held || !by_gas && foreseen.velocity.abs() < CREEPS;
        let way = if creeps { 0.0 } else { foreseen.velocity * period };
        self.moved = if self.last == Some(reading) { self.moved + way } else { 0.0 };
        let jumps = miss.abs() > JUMP * grain + SPEED_SHARE * fastest * period * f64::from(1 + self.bad);
        let is_stuck = self.moved.abs() > STUCK * grain;
        if !jumps && !is_stuck && reading.is_finite() {
            self.bad = 0;
            self.last = Some(reading);
            return reading;
        }
        self.bad += 1;
        if self.bad == 1 {
            log.tell(time, EventKind::PositionPredicted, miss);
        }
        if self.is_lost() {
            log.tell(time, EventKind::PositionLost, miss);
        }
        foreseen.position
    }
}
