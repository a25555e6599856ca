//! End stops: where the drive would come to a stand under full braking.

use crate::model::Model;
use crate::observer::{Observer, State};
use crate::spool::Spool;

/// Speed at which a drive may touch an end stop, m/s (assumed).
const TOUCH: f64 = 0.03;
/// A distance by which the model may be wrong, m (assumed).
const APART: f64 = 0.5e-3;
/// Steps in which a way is followed at most (assumed).
const STEPS: usize = 300;
/// Share of the force of the full pressure that brakes at least, for what needs no closer look (assumed).
const LEAST_BRAKE: f64 = 0.2;
/// Time in which a force of the gas turns, s (assumed).
const TURN: f64 = 0.03;

/// What has to brake now.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Brake {
    /// The command behind which the way is the shortest, or the end stop is reached the slowest.
    pub command: f64,
    /// The shut valve stops the drive before the end stop, whatever the supply does.
    pub is_shut_enough: bool,
}

/// What has to brake now, if a command of now would leave too little way for that at the next sample, as the model may be
/// wrong by a share of it, `margin`.
///
/// The way is that of the model under `command` for a period, then under full braking or with the valve shut, whichever
/// is shorter: an open chamber that is pressed above the supply loses its air to that.
pub fn brakes(
    model: &Model,
    observer: &Observer,
    (command, margin): (f64, f64),
    period: f64,
) -> Option<Brake> {
    let State { position, velocity, .. } = observer.state;
    let far = |v: f64| {
        let area = model.sides[0].area.min(model.sides[1].area);
        let pressure = LEAST_BRAKE * (model.supply.pressure - model.ambient.pressure);
        let least = pressure * area / model.mass;
        v * (model.valve.lag() + 2.0 * period + TURN) + 0.5 * v * v / least
    };
    // What it may gain until a command of now acts, at the most.
    let way = if velocity >= 0.0 { 1.0 } else { -1.0 };
    let room = |x: f64| if way > 0.0 { model.stroke - x } else { x };
    let gained = velocity.abs() + GAIN * model.supply.pressure * model.sides[0].area / model.mass;
    if room(position) > far(gained) {
        return None;
    }
    let acts = observer.time() + model.valve.delay;
    let (state, spool) = observer.predict(model, acts, period);
    let way_to = |mut state: State, mut spool: Spool, brake: f64| {
        spool.command(acts, command);
        spool.command(acts + period, brake);
        let begin = state.position;
        let mut t = acts;
        for step in 0..STEPS {
            let edges = spool.edges(model, t, t + period);
            t += period;
            state.advance(model, edges, period, None);
            let ends = way * state.velocity < TOUCH || room(state.position) < 0.0;
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
    let ((needed, _), command) = if is_shut_better { (shut, 0.0) } else { (full, -way) };
    let is_fast = way * velocity > TOUCH || full.1 > TOUCH;
    let brake = Brake { command, is_shut_enough: shut.0 <= left };
    (is_fast && needed > 0.0 && (1.0 + margin) * needed > left).then_some(brake)
}

/// Time over which a force that is not there yet may act before braking begins, s (assumed).
const GAIN: f64 = 2e-3;
