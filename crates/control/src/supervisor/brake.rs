//! Braking before end stops, by the predicted position at which the drive would come to rest.

use super::gas::Gas;
use crate::follower::Follower;
use crate::model::Model;
use crate::observer::Observer;
use crate::spool::Spool;
use crate::thresholds::*;
use crate::types::State;

/// Braking before end stops, with its state.
#[derive(Clone, Debug, Default)]
pub struct Braking {
    /// It brakes.
    pub acts: bool,
    /// The model of the first sample, without a supply.
    fallen: Option<Box<Model>>,
}

impl Braking {
    /// Returns the command that brakes if the present command would leave too little room at the next sample. The end
    /// counts to which the drive moves, and the end to which the command turns it. If the supply may have fallen, the
    /// trapped air alone must be able to stop the drive.
    pub fn needed(&mut self, own: &Follower, command: f64, gas: &Gas) -> Option<f64> {
        let fallen = self.fallen.get_or_insert_with(|| {
            let mut model = own.model.clone();
            model.supply.pressure = model.ambient.pressure;
            Box::new(model)
        });
        // It is not certain that the supply pressure acts if it has fallen, or if a pressure is not measured.
        let model = if gas.supply_told || gas.lacks_sensor() { fallen } else { &own.model };
        let margin = BRAKE_MARGINS[usize::from(self.acts)];
        let observer = own.observer.as_ref()?;
        let along = if observer.state.velocity >= 0.0 { 1.0 } else { -1.0 };
        let before = |way| brakes_before(way, model, observer, command, margin, own.period);
        before(along).or_else(|| if command * along < 0.0 { before(-along) } else { None })
    }
}

/// Returns the command that brakes before one end: in +x (1) or in -x (-1). It is the one with the shortest braking
/// distance, or with the lowest speed at the end stop.
///
/// The model gives the distance s under `command` for a period, then under full braking or with the valve shut: the
/// shorter of both. It brakes if
///
///   (1 + m) s > room
///
/// with the margin m of [`BRAKE_MARGINS`].
///
/// An open chamber that is pressed above the supply loses its air to the supply.
fn brakes_before(
    way: f64,
    model: &Model,
    observer: &Observer,
    command: f64,
    margin: f64,
    period: f64,
) -> Option<f64> {
    let position = observer.state.position;
    let velocity = way * observer.state.velocity;
    let far = |v: f64| {
        let area = model.sides[0].area.min(model.sides[1].area);
        let pressure = BRAKE_LEAST * (model.supply.pressure - model.ambient.pressure);
        let least = pressure * area / model.mass;
        v * (model.valve.lag() + 2.0 * period + BRAKE_TURN) + 0.5 * v * v / least
    };
    // Highest speed that the drive can gain until the present command acts.
    let room = |x: f64| if way > 0.0 { model.stroke - x } else { x };
    let [along, turned] = BRAKE_GAIN;
    let (gain, away) = if velocity >= 0.0 { (along, 0.0) } else { (turned, BRAKE_AWAY) };
    let gained = velocity.max(0.0) + gain * model.supply.pressure * model.sides[0].area / model.mass;
    if room(position) > far(gained) {
        return None;
    }
    let acts = observer.time + model.valve.delay;
    let (state, spool) = observer.predict(model, acts, period, 0.0);
    let way_to = |mut state: State, mut spool: Spool, brake: f64| {
        spool.command(acts, command);
        spool.command(acts + period, brake);
        let begin = state.position;
        let (mut t, mut still) = (acts, away);
        for step in 0..BRAKE_STEPS {
            let edges = spool.edges(model, t, t + period);
            t += period;
            model.advance(&mut state, edges, period, None);
            let is_slow = way * state.velocity < BRAKE_TOUCH;
            still = if is_slow { still - period } else { 0.0 };
            let ends = is_slow && still <= 0.0 || room(state.position) < 0.0;
            if ends && step > 0 {
                break;
            }
        }
        (way * (state.position - begin), way * state.velocity)
    };
    let left = room(state.position) - BRAKE_APART;
    let [full, shut] = [-way, 0.0].map(|brake| way_to(state, spool.clone(), brake));
    // If both commands reach the end stop, the slower one is used.
    let reach = [full, shut].iter().all(|(needed, end)| *needed > left && *end > BRAKE_TOUCH);
    let is_shut_better = if reach { shut.1 < full.1 } else { shut.0 < full.0 };
    let needed = if is_shut_better { shut.0 } else { full.0 };
    let is_soft = velocity < BRAKE_SLOW && shut.1 <= BRAKE_SOFT;
    let command = if is_shut_better || is_soft { 0.0 } else { -way };
    let is_fast = velocity > BRAKE_TOUCH || full.1 > BRAKE_TOUCH;
    (is_fast && needed > 0.0 && (1.0 + margin) * needed > left).then_some(command)
}
