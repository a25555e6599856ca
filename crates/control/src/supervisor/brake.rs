//! End stops: what has to brake before them, by where the drive would come to a stand.

use super::gas::Gas;
use crate::controller::Controller;
use crate::model::Model;
use crate::observer::{Observer, State};
use crate::spool::Spool;

/// Speed at which a drive may touch an end stop, m/s (assumed).
const TOUCH: f64 = 0.03;
/// Below this speed the valve is shut rather than opened against the motion where the end stop is then touched at most so
/// fast, m/s (assumed): full braking opens the chamber ahead to a supply that may have fallen.
const SLOW: f64 = 0.1;
const SOFT: f64 = 0.04;
/// A distance by which the model may be wrong, m (assumed).
const APART: f64 = 0.5e-3;
/// Steps in which a way is followed at most (assumed).
const STEPS: usize = 300;
/// Share of the force of the full pressure that brakes at least, for what needs no closer look (assumed).
const LEAST_BRAKE: f64 = 0.2;
/// Time in which a force of the gas turns, s (assumed).
const TURN: f64 = 0.03;
/// Time over which a force that is not there yet may act before braking begins, s: along the motion, and where it first has
/// to turn the drive (assumed).
const GAIN: [f64; 2] = [2e-3, 6e-3];
/// Time for which a drive is followed that still moves away from the end, s (assumed).
const AWAY: f64 = 0.03;

/// Shares of the way by which the model may be wrong before it brakes, before it does so by trapped air alone, and while it
/// brakes (assumed).
const MARGINS: [f64; 3] = [0.5, 1.0, 1.5];
/// Unknown force, as a share of the Coulomb friction, behind which a supply may have fallen, and time for which that is
/// remembered, s (assumed): the pressure that a model believes in may hide it while the drive brakes.
const MISSING: f64 = 2.0;
const MISSED_FOR: f64 = 1.0;
/// What a brake counts on as the pressure of a supply that did not fill a chamber, as a share of that chamber's, both above
/// ambient; and what it hopes for where the shut valve leaves the drive faster than a speed, m/s, at the end stop (assumed).
const COUNTED_ON: f64 = 0.4;
const HOPED_FOR: f64 = 0.8;
const LOST: f64 = 0.15;
/// Share of the way behind a shut valve that has to be left beyond it where little air is ahead (assumed).
const SURE: f64 = 0.2;

/// Times that a drive which is to stand has to be braked above a speed, m/s, each within a time of the last one, s, until
/// its law is taken off (assumed).
const TIMES: u32 = 3;
const FAST: f64 = 0.1;
const WITHIN: f64 = 0.5;

/// How often a drive that is to stand had to be braked, and when last, s: its law swings it about the target.
#[derive(Clone, Copy, Debug, Default)]
pub struct Swings {
    times: u32,
    last: f64,
}

impl Swings {
    /// Braking begins; how often it did by now, where that is too often.
    pub fn watch(&mut self, time: f64, velocity: f64, stands: bool) -> Option<u32> {
        if stands && velocity.abs() > FAST {
            self.times = if time - self.last < WITHIN { self.times + 1 } else { 1 };
            self.last = time;
        } else if !stands {
            self.times = 0;
        }
        (self.times >= TIMES).then_some(self.times)
    }
}

/// What brakes, with what it remembers.
#[derive(Clone, Debug)]
pub struct Braking {
    /// It brakes.
    pub acts: bool,
    /// How often it did.
    pub swings: Swings,
    /// The model as it was at first, on a supply that has fallen.
    fallen: Option<Box<Model>>,
    /// For how long no force has been missing, s.
    explained_for: f64,
}

impl Default for Braking {
    fn default() -> Self {
        Braking { acts: false, swings: Swings::default(), fallen: None, explained_for: f64::INFINITY }
    }
}

/// What an observer without pressure sensors says, were what force is missing beyond friction that of the chamber which
/// presses against it: so little gas may be trapped there.
fn less_trapped(observer: &Observer, model: &Model, friction: f64) -> Observer {
    let mut seen = observer.clone();
    let State { disturbance, pressures, .. } = &mut seen.state;
    let beyond = *disturbance - disturbance.clamp(-friction, friction);
    for (pressure, side) in pressures.iter_mut().zip(&model.sides) {
        if side.sign * beyond < 0.0 {
            let less = (*pressure + side.sign * beyond / side.area).max(model.ambient.pressure);
            *disturbance -= side.sign * side.area * (less - *pressure);
            *pressure = less;
        }
    }
    seen
}

impl Braking {
    /// The command that has to brake before an end stop now, if any. Where the supply may have fallen, and as long as it
    /// brakes, the trapped air alone has to be able to stop the drive. `gas` is what pressures say, if they are `measured`; until
    /// `doubted_until`, s, a command may act in reverse.
    pub fn needed(
        &mut self,
        own: &Controller,
        command: f64,
        (gas, measured): (&Gas, bool),
        doubted_until: f64,
    ) -> Option<f64> {
        let fallen = self.fallen.get_or_insert_with(|| Box::new(own.model.clone()));
        let ambient = own.model.ambient.pressure;
        let below = gas.supplied_below().unwrap_or(ambient);
        let has_none = gas.has_no_supply();
        let first = MARGINS[usize::from(has_none)];
        let margin = if self.acts { MARGINS[2] } else { first };
        // Without pressure sensors a supply that has fallen is a force that is missing.
        let d = own.state().map_or(0.0, |state| state.disturbance);
        let misses = d.abs() > MISSING * own.plant.coulomb;
        self.explained_for = if misses { 0.0 } else { self.explained_for + own.period };
        let is_weak = !measured && self.explained_for < MISSED_FOR;
        let observer = own.observer.as_ref()?;
        let trapped = is_weak.then(|| less_trapped(observer, &own.model, own.plant.coulomb));
        let trapped = trapped.as_ref().unwrap_or(observer);
        let tries = observer.time() < doubted_until;
        let mut weak = |margin| {
            let mut on = |share: f64| {
                fallen.supply.pressure = ambient + share * (below - ambient);
                brakes(fallen, trapped, (command, margin), own.period, tries)
            };
            let found = on(COUNTED_ON)?;
            if has_none {
                // Where all else hits, what the supply may still have is tried.
                let is_lost = found.shut_needs > 1.0 && found.shut_speed > LOST;
                let hoped = if is_lost { on(HOPED_FOR) } else { None };
                return Some(hoped.unwrap_or(found).command);
            }
            // Shut it stops whatever the supply does. Where that is not enough, or just so with little air ahead, a supply that
            // presses brakes best, as most doubts pass.
            let ahead = trapped.state.pressures[usize::from(found.against < 0.0)];
            let has_little = ahead - ambient < COUNTED_ON * (own.model.supply.pressure - ambient);
            let needs = found.shut_needs * if has_little { 1.0 + SURE } else { 1.0 };
            Some(if needs > 1.0 { found.against } else { 0.0 })
        };
        if gas.may_lack_supply() {
            return weak(margin);
        }
        let brake = brakes(&own.model, observer, (command, margin), own.period, false);
        let mut brake = brake.map(|found| found.command);
        if gas.is_doubted || is_weak || tries {
            brake = brake.or_else(|| weak(margin));
        }
        brake.or_else(|| if self.acts { weak(first) } else { None })
    }
}

/// What has to brake now.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Brake {
    /// The command behind which the way is the shortest, or the end stop is reached the slowest.
    command: f64,
    /// The command that presses against the way to that end.
    against: f64,
    /// Share of the room that the drive needs behind the shut valve, whatever the supply does; none where it is slow and
    /// touches the end stop softly.
    shut_needs: f64,
    /// How fast it is there at its stand or at the end stop, m/s.
    shut_speed: f64,
}

/// What has to brake now, if a command of now would leave too little way for that at the next sample, as the model may be
/// wrong by a share of it, `margin`: before the end to which the drive moves, or to which a command turns it. Where commands
/// may lead it `either_way`, before both.
fn brakes(
    model: &Model,
    observer: &Observer,
    (command, margin): (f64, f64),
    period: f64,
    either_way: bool,
) -> Option<Brake> {
    let along = if observer.state.velocity >= 0.0 { 1.0 } else { -1.0 };
    let before = |way| brakes_before(way, model, observer, (command, margin), period);
    before(along).or_else(|| if command * along < 0.0 || either_way { before(-along) } else { None })
}

/// The same before one end, that in +x (1) or in -x (-1).
///
/// The way is that of the model under `command` for a period, then under full braking or with the valve shut, whichever
/// is shorter: an open chamber that is pressed above the supply loses its air to that.
fn brakes_before(
    way: f64,
    model: &Model,
    observer: &Observer,
    (command, margin): (f64, f64),
    period: f64,
) -> Option<Brake> {
    let position = observer.state.position;
    let velocity = way * observer.state.velocity;
    let far = |v: f64| {
        let area = model.sides[0].area.min(model.sides[1].area);
        let pressure = LEAST_BRAKE * (model.supply.pressure - model.ambient.pressure);
        let least = pressure * area / model.mass;
        v * (model.valve.lag() + 2.0 * period + TURN) + 0.5 * v * v / least
    };
    // What it may gain until a command of now acts, at the most.
    let room = |x: f64| if way > 0.0 { model.stroke - x } else { x };
    let [along, turned] = GAIN;
    let (gain, away) = if velocity >= 0.0 { (along, 0.0) } else { (turned, AWAY) };
    let gained = velocity.max(0.0) + gain * model.supply.pressure * model.sides[0].area / model.mass;
    if room(position) > far(gained) {
        return None;
    }
    let acts = observer.time() + model.valve.delay;
    let (state, spool) = observer.predict(model, acts, period);
    let way_to = |mut state: State, mut spool: Spool, brake: f64| {
        spool.command(acts, command);
        spool.command(acts + period, brake);
        let begin = state.position;
        let (mut t, mut still) = (acts, away);
        for step in 0..STEPS {
            let edges = spool.edges(model, t, t + period);
            t += period;
            state.advance(model, edges, period, None);
            let is_slow = way * state.velocity < TOUCH;
            still = if is_slow { still - period } else { 0.0 };
            let ends = is_slow && still <= 0.0 || room(state.position) < 0.0;
            if ends && step > 0 {
                break;
            }
        }
        (way * (state.position - begin), way * state.velocity)
    };
    let left = room(state.position) - APART;
    let [full, shut] = [-way, 0.0].map(|brake| way_to(state, spool.clone(), brake));
    // Of two that both reach the end stop, the slower one.
    let reach = [full, shut].iter().all(|(needed, end)| *needed > left && *end > TOUCH);
    let is_shut_better = if reach { shut.1 < full.1 } else { shut.0 < full.0 };
    let needed = if is_shut_better { shut.0 } else { full.0 };
    let is_soft = velocity < SLOW && shut.1 <= SOFT;
    let command = if is_shut_better || is_soft { 0.0 } else { -way };
    let is_fast = velocity > TOUCH || full.1 > TOUCH;
    let shut_needs = if is_soft { 0.0 } else { shut.0 / left.max(0.0) };
    let brake = Brake { command, against: -way, shut_needs, shut_speed: shut.1 };
    (is_fast && needed > 0.0 && (1.0 + margin) * needed > left).then_some(brake)
}
