//! Braking before end stops, by the predicted position at which the drive would come to rest.

use super::gas::Gas;
use crate::controller::Controller;
use crate::model::Model;
use crate::observer::Observer;
use crate::spool::Spool;
use crate::thresholds::{
    BRAKE_APART, BRAKE_AWAY, BRAKE_COUNTED_ON, BRAKE_FAST, BRAKE_GAIN, BRAKE_HITS, BRAKE_HOPED_FOR,
    BRAKE_LEAST, BRAKE_MARGINS, BRAKE_MISSED_FOR, BRAKE_MISSING, BRAKE_SLOW, BRAKE_SOFT, BRAKE_STEPS,
    BRAKE_SURE, BRAKE_TIMES, BRAKE_TOUCH, BRAKE_TURN, BRAKE_WITHIN,
};
use crate::types::State;

/// Number of times that a drive at its target had to be braked, and the last time, s. A high count shows that the law
/// makes the drive oscillate about the target.
#[derive(Clone, Copy, Debug, Default)]
pub struct Swings {
    times: u32,
    last: f64,
}

impl Swings {
    /// Registers that braking begins. Returns the count of brakings if there are too many.
    pub fn watch(&mut self, time: f64, velocity: f64, stands: bool) -> Option<u32> {
        if stands && velocity.abs() > BRAKE_FAST {
            self.times = if time - self.last < BRAKE_WITHIN { self.times + 1 } else { 1 };
            self.last = time;
        } else if !stands {
            self.times = 0;
        }
        (self.times >= BRAKE_TIMES).then_some(self.times)
    }
}

/// Braking before end stops, with its state.
#[derive(Clone, Debug)]
pub struct Braking {
    /// It brakes.
    pub acts: bool,
    /// Count of brakings.
    pub swings: Swings,
    /// The described model with a fallen supply.
    fallen: Option<Box<Model>>,
    /// Time since a force was last missing, s.
    explained_for: f64,
}

impl Default for Braking {
    fn default() -> Self {
        Braking { acts: false, swings: Swings::default(), fallen: None, explained_for: f64::INFINITY }
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
    /// Returns the command if the drive must brake before an end stop now. If the supply may have fallen, or while it
    /// brakes, the trapped air alone must be able to stop the drive. `gas` has the findings from the pressures, if they
    /// are `measured`. A command may act in reverse until `doubted_until`, s.
    pub fn needed(
        &mut self,
        own: &Controller,
        command: f64,
        gas: &Gas,
        measured: bool,
        doubted_until: f64,
    ) -> Option<f64> {
        let fallen = self.fallen.get_or_insert_with(|| Box::new(own.model.clone()));
        let ambient = own.model.ambient.pressure;
        let below = gas.supplied_below().unwrap_or(ambient);
        let has_none = gas.has_no_supply();
        let first = BRAKE_MARGINS[usize::from(has_none)];
        let margin = if self.acts { BRAKE_MARGINS[2] } else { first };
        // Without pressure sensors, a fallen supply appears as an unmodelled force.
        let d = own.state().map_or(0.0, |state| state.disturbance);
        let misses = d.abs() > BRAKE_MISSING * own.plant.coulomb;
        self.explained_for = if misses { 0.0 } else { self.explained_for + own.period };
        let is_weak = !measured && self.explained_for < BRAKE_MISSED_FOR;
        let observer = own.observer.as_ref()?;
        let trapped = is_weak.then(|| less_trapped(observer, &own.model, own.plant.coulomb));
        let trapped = trapped.as_ref().unwrap_or(observer);
        let tries = observer.time() < doubted_until;
        let mut weak = |margin| {
            let mut on = |share: f64| {
                fallen.supply.pressure = ambient + share * (below - ambient);
                brakes(fallen, trapped, command, margin, own.period, tries)
            };
            let found = on(BRAKE_COUNTED_ON)?;
            if has_none {
                // If every other command hits the end stop, the remaining supply pressure is used.
                let is_lost = found.shut_needs > 1.0 && found.shut_speed > BRAKE_HITS;
                let hoped = if is_lost { on(BRAKE_HOPED_FOR) } else { None };
                return Some(hoped.unwrap_or(found).command);
            }
            // A shut valve stops the drive independently of the supply. If it does not suffice, or hardly does with
            // little air ahead, an intact supply brakes best. Most doubts about the supply prove wrong.
            let ahead = trapped.state.pressures[usize::from(found.against < 0.0)];
            let has_little = ahead - ambient < BRAKE_COUNTED_ON * (own.model.supply.pressure - ambient);
            let needs = found.shut_needs * if has_little { 1.0 + BRAKE_SURE } else { 1.0 };
            Some(if needs > 1.0 { found.against } else { 0.0 })
        };
        if gas.may_lack_supply() {
            return weak(margin);
        }
        let brake = brakes(&own.model, observer, command, margin, own.period, false);
        let mut brake = brake.map(|found| found.command);
        if gas.is_doubted || is_weak || tries {
            brake = brake.or_else(|| weak(margin));
        }
        brake.or_else(|| if self.acts { weak(first) } else { None })
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
    /// Speed at the end of the simulation or at the end stop with the valve shut, m/s.
    shut_speed: f64,
}

/// Returns the decision to brake if the present command would leave too little room at the next sample. The room has a
/// relative margin, `margin`, for errors of the model. It checks the end to which the drive moves or is turned by a
/// command. It checks both ends if commands may act `either_way`.
fn brakes(
    model: &Model,
    observer: &Observer,
    command: f64,
    margin: f64,
    period: f64,
    either_way: bool,
) -> Option<Brake> {
    let along = if observer.state.velocity >= 0.0 { 1.0 } else { -1.0 };
    let before = |way| brakes_before(way, model, observer, command, margin, period);
    before(along).or_else(|| if command * along < 0.0 || either_way { before(-along) } else { None })
}

/// Returns the decision for one end: in +x (1) or in -x (-1).
///
/// The model gives the distance under `command` for a period, then under full braking or with the valve shut: the
/// shorter of both. An open chamber that is pressed above the supply loses its air to the supply.
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
            state.advance(model, edges, period, None);
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
    let brake = Brake { command, against: -way, shut_needs, shut_speed: shut.1 };
    (is_fast && needed > 0.0 && (1.0 + margin) * needed > left).then_some(brake)
}
