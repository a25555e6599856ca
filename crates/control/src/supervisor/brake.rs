//! Braking before end stops, by the predicted position at which the drive would come to rest.

use super::gas::Gas;
use crate::follower::Follower;
use crate::model::Model;
use crate::observer::Observer;
use crate::spool::Spool;
use crate::thresholds::*;
use crate::types::State;

/// Braking before end stops, with its state.
#[derive(Clone, Debug)]
pub struct Braking {
    /// It brakes.
    pub acts: bool,
    /// The model of the first sample, with a fallen supply.
    fallen: Option<Box<Model>>,
    /// Time since a force was last missing, s.
    explained_for: f64,
}

impl Default for Braking {
    fn default() -> Self {
        Braking { acts: false, fallen: None, explained_for: f64::INFINITY }
    }
}

/// Returns an observer without pressure sensors that assumes less trapped gas. It assigns the unmodelled force beyond
/// friction to the chamber that would act against it. The result is the least possible trapped gas.
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
    /// Returns the command if the drive must brake before an end stop now. If the supply may have fallen, the trapped
    /// air alone must be able to stop the drive. `gas` has the findings from the pressures, if they are `measured`.
    pub fn needed(&mut self, own: &Follower, command: f64, gas: &Gas, measured: bool) -> Option<f64> {
        let fallen = self.fallen.get_or_insert_with(|| Box::new(own.model.clone()));
        let observer = own.observer.as_ref()?;
        // Without pressure sensors, a fallen supply appears as an unmodelled force.
        let misses = observer.state.disturbance.abs() > BRAKE_MISSING * own.plant.coulomb;
        self.explained_for = if misses { 0.0 } else { self.explained_for + own.period };
        let margin = BRAKE_MARGINS[usize::from(self.acts)];
        let is_weak = !measured && self.explained_for < BRAKE_MISSED_FOR;
        if !gas.may_lack_supply() {
            let found = brakes(&own.model, observer, command, margin, own.period);
            if found.is_some() || !is_weak {
                return found.map(|found| found.command);
            }
        }
        let trapped = is_weak.then(|| less_trapped(observer, &own.model, own.plant.coulomb));
        let ambient = own.model.ambient.pressure;
        let below = gas.supplied_below().unwrap_or(ambient);
        fallen.supply.pressure = ambient + BRAKE_COUNTED_ON * (below - ambient);
        let found = brakes(fallen, trapped.as_ref().unwrap_or(observer), command, margin, own.period)?;
        // A shut valve stops the drive independently of the supply. If it does not suffice, an intact supply brakes
        // best. Most doubts about the supply prove wrong.
        Some(match gas.has_no_supply() {
            true => found.command,
            false if found.shut_needs > 1.0 => found.against,
            false => 0.0,
        })
    }
}

/// Decision to brake now.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Brake {
    /// Command with the shortest braking distance, or with the lowest speed at the end stop.
    command: f64,
    /// Command whose force points away from this end.
    against: f64,
    /// Fraction of the room that the drive needs with the valve shut, for any supply pressure. It is zero if the
    /// drive is slow and touches the end stop softly.
    shut_needs: f64,
}

/// Returns the decision to brake if the present command would leave too little room at the next sample. The end counts
/// to which the drive moves, and the end to which the command turns it.
fn brakes(model: &Model, observer: &Observer, command: f64, margin: f64, period: f64) -> Option<Brake> {
    let along = if observer.state.velocity >= 0.0 { 1.0 } else { -1.0 };
    let before = |way| brakes_before(way, model, observer, command, margin, period);
    before(along).or_else(|| if command * along < 0.0 { before(-along) } else { None })
}

/// Returns the decision for one end: in +x (1) or in -x (-1).
///
/// The model gives the distance s under `command` for a period, then under full braking or with the valve shut: the
/// shorter of both. It brakes if
///
///   (1 + m) s > room,   with the margin m of [`BRAKE_MARGINS`]
///
/// An open chamber that is pressed above the supply loses its air to the supply.
fn brakes_before(
    way: f64,
    model: &Model,
    observer: &Observer,
    command: f64,
    margin: f64,
    period: f64,
) -> Option<Brake> {
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
    let acts = observer.time() + model.valve.delay;
    let (state, spool) = observer.predict(model, acts, period);
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
    let shut_needs = if is_soft { 0.0 } else { shut.0 / left.max(0.0) };
    let brake = Brake { command, against: -way, shut_needs };
    (is_fast && needed > 0.0 && (1.0 + margin) * needed > left).then_some(brake)
}
