//! End stops: where the drive would come to a stand under full braking.

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

/// What has to brake now.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Brake {
    /// The command behind which the way is the shortest, or the end stop is reached the slowest.
    pub command: f64,
    /// The command that presses against the way to that end.
    pub against: f64,
    /// Share of the room that the drive needs behind the shut valve, whatever the supply does; none where it is slow and
    /// touches the end stop softly.
    pub shut_needs: f64,
    /// How fast it is there at its stand or at the end stop, m/s.
    pub shut_speed: f64,
}

/// What has to brake now, if a command of now would leave too little way for that at the next sample, as the model may be
/// wrong by a share of it, `margin`: before the end to which the drive moves, or to which a command turns it. Where commands
/// may lead it `either_way`, before both.
pub fn brakes(
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
