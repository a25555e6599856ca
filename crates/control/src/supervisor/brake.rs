//! End stops: where the drive would come to a stand under full braking.

use crate::model::Model;
use crate::observer::{Observer, State};
use crate::spool::Spool;

/// Speed at which a drive may touch an end stop, m/s (assumed).
const TOUCH: f64 = 0.03;
/// Shares of the way by which the model may be wrong before it brakes, and while it does, and a distance, m (assumed).
const MARGINS: [f64; 2] = [0.5, 1.5];
const APART: f64 = 0.5e-3;
/// Steps in which a way is followed at most.
const STEPS: usize = 300;
/// Share of the force of the full pressure that brakes at least, for what needs no closer look (assumed).
const LEAST_BRAKE: f64 = 0.2;
/// Time in which a force of the gas turns, s (assumed).
const TURN: f64 = 0.03;

/// The command that has to brake now, if a command of now would leave too little way for that at the next sample; braking
/// goes on until there is much more way than it needs.
///
/// The way is that of the model under `command` for a period and under full braking from then on.
pub fn brakes(
    model: &Model,
    observer: &Observer,
    (command, is_braking): (f64, bool),
    period: f64,
) -> Option<f64> {
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
    let (mut state, mut spool) = observer.predict(model, acts, period);
    spool.command(acts, command);
    spool.command(acts + period, -way);
    let way_to = |state: &mut State, spool: &mut Spool| {
        let begin = state.position;
        let mut t = acts;
        for step in 0..STEPS {
            let opening = spool.halfway(t, t + period);
            t += period;
            state.advance(model, model.openings(opening), period, None);
            let ends = way * state.velocity < TOUCH || room(state.position) < 0.0;
            if ends && step > 0 {
                break;
            }
        }
        way * (state.position - begin)
    };
    let left = room(state.position) - APART;
    let needed = way_to(&mut state, &mut spool);
    let is_fast = way * velocity > TOUCH || way * state.velocity > TOUCH;
    let margin = MARGINS[usize::from(is_braking)];
    (is_fast && needed > 0.0 && (1.0 + margin) * needed > left).then_some(-way)
}

/// Time over which a force that is not there yet may act before braking begins, s (assumed).
const GAIN: f64 = 2e-3;
