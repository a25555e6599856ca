//! Check of position readings against the prediction of the model.

use super::event::{EventKind, Log};
use super::rules::Believed;
use crate::model::Model;
use crate::thresholds::*;
use crate::types::State;

/// State of a position sensor.
#[derive(Clone, Debug, Default)]
pub struct Position {
    /// The last credible reading.
    last: Option<f64>,
    /// Distance of the model since the reading changed, m.
    moved: f64,
    /// Whether friction may have stopped the drive since then.
    stopped: bool,
    /// State of the model without readings since the reading changed. The observer itself follows the readings,
    /// because it explains their deviation as a disturbance force.
    twin: Option<Twin>,
    /// Number of successive readings that are not credible.
    bad: u32,
    /// Jump of the first of these readings, m; `None` without a jump.
    jumped: Option<f64>,
}

/// Model with this much friction, a state that advances by it alone, and one that advances by the unchanged model.
#[derive(Clone, Debug)]
struct Twin {
    rubbing: Model,
    rubs: State,
    free: State,
}

/// A reading, and the state of its sensor and of the drive.
#[derive(Clone, Copy, Debug)]
pub struct Read {
    /// Reading, m.
    pub reading: f64,
    /// Standard deviation of the time of a reading, s.
    pub jitter: f64,
    /// Whether holding was active at the last sample.
    pub is_held: bool,
    /// The model follows measured pressures.
    pub by_gas: bool,
}

impl Position {
    /// The sensor is not read any more.
    pub fn is_lost(&self) -> bool {
        self.bad >= POSITION_LOST
    }

    /// Returns whether a reading after a jump is still off by the jump. The alternative is a reading that agrees with
    /// the model again.
    pub fn is_off(&self, reading: f64, place: f64) -> bool {
        let off = reading - place;
        self.is_lost() && self.jumped.is_some_and(|jump| (off - jump).abs() < off.abs())
    }

    /// Returns a reading, or the prediction of the model if the reading is not credible. For resting readings that
    /// are not credible, it also returns the state at the last sample without them. Friction may be [`POSITION_BEARS`]
    /// times the described one: such friction stops a slow drive before its model, and keeps it at rest.
    ///
    /// A reading x is not credible in three cases. First, |x - x_model| > 5 counts + (0.1 T + 5 jitter) v_max.
    /// Second, the model moves by 20 counts while x rests. Third, a model with more friction, which advances without
    /// readings, is 2 mm away from x.
    pub fn checked(&mut self, read: &Read, believed: &Believed, log: &mut Log) -> (f64, Option<State>) {
        let Read { reading, jitter, .. } = *read;
        let Believed { own, time, last: seen, foreseen, edges } = *believed;
        let (model, period, grain) = (&own.model, own.period, own.grain());
        if self.is_lost() {
            return (foreseen.position, None);
        }
        let [level, _] = model.friction_levels([reading, 0.0], seen.pressures);
        self.count(read, believed, level);
        let mut miss = reading - foreseen.position;
        let apart = (POSITION_SPEED * period).max(POSITION_JUMP * jitter) * own.plant.speed;
        let jumps = miss.abs() > POSITION_JUMP * grain + apart;
        let gone = self.dead_reckoned(read, believed);
        miss = gone.map_or(miss, |gone| -gone);
        // A reading may be as late as the next one. The jitter of its time counts as far as it exceeds the
        // uncertainty of the speed.
        let jittered = (POSITION_JUMP * jitter - POSITION_SPEED * period).max(0.0) * foreseen.velocity.abs();
        let is_stuck = gone.is_some() || self.moved.abs() > POSITION_STUCK * grain + jittered;
        if !jumps && !is_stuck && reading.is_finite() {
            self.bad = 0;
            self.last = Some(reading);
            self.twin.iter_mut().for_each(|twin| _ = model.advance(&mut twin.free, edges, period, None));
            return (reading, None);
        }
        self.bad += 1;
        if self.bad == 1 {
            self.jumped = jumps.then_some(miss);
            log.tell(time, EventKind::PositionPredicted, miss);
        }
        if self.is_lost() {
            log.tell(time, EventKind::PositionLost, miss);
        }
        let free = self.twin.as_ref().filter(|_| self.bad == 1 && !jumps).map(|twin| twin.free);
        let mut now = free.unwrap_or(*foreseen);
        if free.is_some() {
            model.advance(&mut now, edges, period, None);
        }
        (now.position, free)
    }

    /// Counts the distance of the model since the reading changed. `level` is the breakaway friction, N.
    fn count(&mut self, read: &Read, believed: &Believed, level: f64) {
        let Read { reading, is_held, by_gas, .. } = *read;
        let Believed { own, last: seen, foreseen, .. } = *believed;
        // A held contact may creep in the model and stick in reality: each reading corrects the model.
        let creeps = is_held || foreseen.velocity.abs() < POSITION_CREEPS[usize::from(!by_gas)];
        // The same holds for a contact that sticks in reality: its force is mistaken for a disturbance.
        let force = own.model.gas_force(seen.pressures) + own.model.load;
        let sticks = by_gas && self.stopped && force.abs() < POSITION_BEARS * level;
        if self.last == Some(reading) {
            self.moved += if creeps || sticks { 0.0 } else { foreseen.velocity * own.period };
        } else {
            let v = foreseen.velocity;
            self.moved = 0.0;
            let bears = POSITION_BEARS * level * POSITION_STUCK * own.grain();
            self.stopped = 0.5 * own.model.mass * v * v < bears;
        }
    }

    /// Advances the model with more friction while the reading rests. Returns its distance from the reading, m, if the
    /// drive must have moved.
    fn dead_reckoned(&mut self, read: &Read, believed: &Believed) -> Option<f64> {
        let Read { reading, is_held, by_gas, .. } = *read;
        let Believed { own, last: seen, edges, .. } = *believed;
        let (model, period) = (&own.model, own.period);
        // Without measured pressures, a law that holds drives its gas by the model alone while the drive rests.
        if self.last != Some(reading) || (is_held && !by_gas) {
            self.twin = None;
            return None;
        }
        let twin = self.twin.get_or_insert_with(|| {
            let mut rubbing = model.clone();
            rubbing.friction_shares[0] *= POSITION_FRICTION[usize::from(!by_gas)];
            Twin { rubbing, rubs: *seen, free: *seen }
        });
        // It returns to the observed state.
        let share = period / (period + POSITION_RETURNS);
        twin.rubs = twin.rubs.zip(seen, |own, seen| own + share * (seen - own));
        twin.rubbing.advance(&mut twin.rubs, edges, period, None);
        twin.free = State { pressures: seen.pressures, temperatures: seen.temperatures, ..twin.free };
        let gone = twin.rubs.position - reading;
        let room = if gone > 0.0 { model.stroke - reading } else { reading };
        (gone.abs() > POSITION_GONE.max(POSITION_STUCK * own.grain()) && room > POSITION_AT_END)
            .then_some(gone)
    }
}
