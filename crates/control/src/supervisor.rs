//! A supervisor in front of a law. It acts when sensors, references, the valve, the law or the user fail. It is not a
//! safety function according to any standard.
//!
//! It uses the observer and the model of its controller. Without a fault, samples, reference and commands pass
//! unchanged.

mod brake;
mod event;
mod gas;
mod mode;
mod motion;
mod position;
mod rules;

use crate::course::{Course, Fade};
use crate::follower::{Answer, Follower};
use crate::law::AnyLaw;
use crate::reference::{Reference, Wanted};
use crate::thresholds::{CLOCK_WITHIN, MODEL_TRUSTED, REFERENCE_JUMP};
use crate::types::{Edges, Sample, State};
use brake::Braking;
pub use event::{Event, EventKind, Log};
use gas::Gas;
use mode::Mode;
pub use motion::MotionRules;
use motion::{Motion, Moves};
use position::{Position, Read};
use rules::Believed;
pub use rules::{Inputs, Reaction, Rules};

/// A supervisor with its state.
#[derive(Clone, Debug, Default)]
pub struct Supervisor {
    /// Rules of this supervisor.
    pub rules: Rules,
    /// External inputs.
    pub inputs: Inputs,
    /// Law that takes over if the first one fails.
    pub standby: AnyLaw,
    /// Whether it also takes over from custom laws. If false, a failure of such a law ends the run.
    pub serves_own: bool,
    /// Its events.
    pub log: Log,
    mode: Mode,
    position: Position,
    gas: Gas,
    motion: Motion,
    /// Time of the last sample and correction of the clock, s.
    clock: Option<f64>,
    correction: f64,
    /// Reference and course at the last sample.
    asked: Option<Wanted>,
    followed: Option<Wanted>,
    command: f64,
    /// Number of successive steps without a command of the law.
    missed: u32,
    stands_by: bool,
    braking: Braking,
    /// Whether the model replaces a chamber's pressure.
    modelled: bool,
    /// Whether holding was active at the last sample.
    is_held: bool,
    /// Time for which the position has been lost, s.
    lost_for: f64,
    switched: [bool; 2],
}

impl Supervisor {
    /// Adds a standby law.
    pub fn new(rules: Rules, standby: AnyLaw) -> Self {
        Supervisor { rules, standby, ..Supervisor::default() }
    }

    /// Returns the time of a sample on an even clock. An invalid time becomes the time of the last sample.
    pub(crate) fn corrected(&self, time: f64) -> f64 {
        let time = time + self.correction;
        if time.is_finite() { time } else { self.clock.unwrap_or(0.0) }
    }

    /// Returns the command for a sample.
    pub(crate) fn decide(&mut self, own: &mut Follower, sample: &Sample, reference: &Reference) -> Answer {
        let mut sample = *sample;
        let skipped = self.keep_time(own.period, &mut sample);
        let mut returns = self.inputs.enabled && self.mode == Mode::Off;
        let asked = reference.at(sample.time);
        let place = own.state().map_or(f64::NAN, |state| state.position);
        if returns && self.position.is_off(sample.position, place) {
            self.log.tell(sample.time, EventKind::PositionLost, sample.position - place);
            self.mode = Mode::Shut;
            returns = false;
        } else if returns
            && (self.position.is_lost() || self.gas.is_lost() || self.gas.supply_told || self.stands_by)
        {
            // A lost signal may be back: the supervisor starts again.
            own.observer = None;
            (self.position, self.gas) = Default::default();
            self.lost_for = 0.0;
        }
        // State at the last sample, and the state predicted from it.
        let last = own.state().zip(own.foresee(sample.time));
        let reactions = self.check_sensors(own, &mut sample, last);
        if own.state().is_some() || sample.position.is_finite() {
            own.learn(&sample, !self.modelled);
        }
        let Some(state) = own.state() else { return own.rest(asked, 0.0) };
        if returns {
            self.begin_return(own, &sample, &state, &asked);
        }
        if let Some(by) = skipped {
            self.stop(own, &sample, EventKind::Clock, by);
        }
        self.check_reference(own, &sample, &asked);
        self.check_inputs(own, &sample, &state);
        if let Some(reaction) = Reaction::first(reactions) {
            self.react(own, &sample, reaction);
        }
        // Without readings, the model can be trusted only for a short time. Then the enclosed air stops the drive.
        if self.lost_for >= MODEL_TRUSTED && matches!(self.mode, Mode::Stops { shuts: true, .. }) {
            self.mode = Mode::Shut;
        }
        let course = self.mode.course(sample.time, &state, reference, &mut self.log);
        let mut answer = self.ask(own, &sample, &course);
        if let Some(left) = own.rest_left() {
            self.log.tell(sample.time, EventKind::RestLost, left);
        }
        if !asked.position.is_nan() {
            answer.wanted = asked;
        }
        let (wanted, stands) = (course.at(sample.time), course.stands(sample.time, own.plant.lag));
        self.followed = Some(wanted);
        answer.command = self.guarded(own, &sample, answer.command);
        if !self.mode.is_shut() {
            let moves = Moves { state, wanted, stands, no_air: self.gas.starved };
            self.motion.watch(&self.rules.motion, own, sample.time, &moves, &mut self.log);
        }
        (self.command, self.is_held) = (answer.command, answer.holds);
        answer
    }

    /// Returns the error of the clock, if any, and corrects the sample's time.
    fn keep_time(&mut self, period: f64, sample: &mut Sample) -> Option<f64> {
        let clock = sample.time;
        sample.time = self.corrected(clock);
        let gone = self.clock.map_or(period, |last| sample.time - last);
        let is_wrong =
            !(clock.is_finite() && (CLOCK_WITHIN[0] * period..=CLOCK_WITHIN[1] * period).contains(&gone));
        if is_wrong {
            sample.time = self.clock.unwrap_or(0.0) + period;
            if clock.is_finite() {
                self.correction = sample.time - clock;
            }
        }
        self.clock = Some(sample.time);
        is_wrong.then_some(gone - period)
    }

    /// Replaces readings that are not credible. Returns the reactions to faults of the position and of the gas.
    fn check_sensors(
        &mut self,
        own: &mut Follower,
        sample: &mut Sample,
        last: Option<(State, (State, Edges<f64>))>,
    ) -> [Option<Reaction>; 2] {
        let Some((before, (foreseen, edges))) = last else {
            // There is no earlier sample. The usual mean replaces pressures that are not numbers.
            sample.pressures = sample.pressures.filter(|own| own.iter().all(|p| p.is_finite()));
            return [None; 2];
        };
        let was_lost = self.position.is_lost();
        let read = Read {
            reading: sample.position,
            jitter: self.inputs.jitter,
            is_held: self.is_held,
            by_gas: sample.pressures.is_some() && !self.gas.is_lost(),
        };
        let believed = Believed { own, time: sample.time, last: &before, foreseen: &foreseen, edges };
        let (position, free) = self.position.checked(&read, &believed, &mut self.log);
        sample.position = position;
        let mut reactions = [
            (self.position.is_lost() && !was_lost)
                .then_some(self.rules.on_position.at_speed(before.velocity)),
            None,
        ];
        if let Some(pressures) = &mut sample.pressures {
            let found = self.gas.checked(pressures, &believed, &mut self.log);
            self.modelled = found.modelled;
            let Rules { on_pressure, on_valve, mut on_supply, .. } = self.rules;
            if on_supply == Reaction::Block && !self.gas.starved && !self.position.is_lost() {
                // A low supply that still fills the chambers is only reported. Without a position, the model may be wrong.
                on_supply = Reaction::Tell;
            }
            for (happened, reaction) in [
                (found.supply, on_supply),
                (found.sensor, on_pressure.at_speed(before.velocity)),
                (found.valve, on_valve),
            ] {
                if happened && reaction != Reaction::Tell {
                    reactions[1] = Some(reaction);
                }
            }
        }
        if let (Some(free), Some(observer)) = (free, &mut own.observer) {
            let gas = observer.state;
            observer.state = State { pressures: gas.pressures, temperatures: gas.temperatures, ..free };
        }
        reactions
    }

    fn check_reference(&mut self, own: &Follower, sample: &Sample, asked: &Wanted) {
        let Wanted { position, velocity, .. } = *asked;
        let is_number = asked.numbers().iter().all(|own| own.is_finite());
        let jumps = self.asked.is_some_and(|last| {
            let way = 0.5 * (last.velocity + velocity) * own.period;
            (position - last.position - way).abs() > REFERENCE_JUMP
        });
        self.asked = is_number.then_some(*asked);
        let refused = !is_number || jumps || self.rules.refuses(asked, own.model.stroke).is_some();
        if refused && self.mode.moves() {
            self.stop(own, sample, EventKind::Reference, position);
        }
    }

    fn check_inputs(&mut self, own: &Follower, sample: &Sample, state: &State) {
        let v = state.velocity;
        if !self.inputs.enabled {
            if self.mode != Mode::Off {
                self.log.tell(sample.time, EventKind::Disabled, v);
                self.mode = Mode::Off;
            }
            return;
        }
        let moves = self.mode.moves();
        if moves && self.inputs.emergency_stop {
            self.stop(own, sample, EventKind::EmergencyStop, v);
        } else if moves {
            let Rules { position: [low, high], speed, pressure, .. } = self.rules;
            let x = state.position;
            let pressed = state.pressures.iter().any(|p| !(pressure[0]..=pressure[1]).contains(p));
            if x < low || x > high || v.abs() > speed || pressed {
                self.stop(own, sample, EventKind::Limit, x);
            }
        }
    }

    fn react(&mut self, own: &Follower, sample: &Sample, reaction: Reaction) {
        match (reaction, self.mode) {
            (Reaction::Stop | Reaction::StopAndBlock, Mode::Follows | Mode::Returns(_)) => {
                if let Some(state) = own.state() {
                    let deceleration = self.rules.stop_deceleration;
                    self.mode = Mode::stop(sample.time, own, &state, self.followed, deceleration);
                }
            }
            (Reaction::Block, Mode::Follows | Mode::Returns(_) | Mode::Stops { .. }) => {
                self.mode = Mode::Shut
            }
            _ => {}
        }
        if let (Reaction::StopAndBlock, Mode::Stops { shuts, .. }) = (reaction, &mut self.mode) {
            *shuts = true;
        }
    }

    fn stop(&mut self, own: &Follower, sample: &Sample, kind: EventKind, value: f64) {
        self.log.tell(sample.time, kind, value);
        self.react(own, sample, Reaction::Stop);
    }

    fn begin_return(&mut self, own: &mut Follower, sample: &Sample, state: &State, asked: &Wanted) {
        let from = [state.position - asked.position, state.velocity - asked.velocity, -asked.acceleration];
        self.log.tell(sample.time, EventKind::Enabled, from[0]);
        own.begin_anew(self.command);
        self.motion = Motion::default();
        self.asked = None;
        self.followed = None;
        self.mode = Mode::Returns(Fade::back(sample.time, from, self.rules.stop_deceleration));
    }

    /// Returns the output of the law, or of the standby law.
    fn ask(&mut self, own: &mut Follower, sample: &Sample, course: &Course) -> Answer {
        if self.mode.is_shut() {
            return own.rest(course.at(sample.time), 0.0);
        }
        let time = sample.time;
        // A custom law supports references only.
        if own.law.needs_reference() && course.reference().is_none() {
            self.stand_by(own, time);
        }
        let late = self.inputs.late && !self.stands_by;
        let answer = if late { None } else { Some(own.ask(sample, course)) };
        if let Some(answer) = answer.filter(|answer| answer.command.is_finite()) {
            self.missed = 0;
            return answer;
        }
        if !late && own.law.needs_reference() && !self.serves_own {
            return own.rest(course.at(time), f64::NAN);
        }
        self.missed += 1;
        let kind = if late { EventKind::Late } else { EventKind::LawFailed };
        self.log.tell(time, kind, f64::from(self.missed));
        let kept = own.rest(course.at(time), self.command);
        if self.missed < 2 {
            return kept;
        }
        if !self.stands_by {
            self.stand_by(own, time);
            let answer = own.ask(sample, course);
            if answer.command.is_finite() {
                self.missed = 0;
                return answer;
            }
        }
        self.react(own, sample, Reaction::Block);
        Answer { command: 0.0, ..kept }
    }

    fn stand_by(&mut self, own: &mut Follower, time: f64) {
        self.stands_by = true;
        let number = crate::law::LAWS.iter().position(|key| *key == self.standby.key()).unwrap_or(0);
        self.log.tell(time, EventKind::StandBy, number as f64);
        own.switch(self.standby.clone());
    }

    /// Returns a command that keeps the drive off end stops and limit switches.
    fn guarded(&mut self, own: &Follower, sample: &Sample, mut command: f64) -> f64 {
        let Some(state) = own.state() else { return command };
        if command.is_nan() {
            return command;
        }
        self.lost_for = if self.position.is_lost() { self.lost_for + own.period } else { 0.0 };
        let is_known = self.lost_for < MODEL_TRUSTED;
        let brake = self.braking.needed(own, command, &self.gas).filter(|_| is_known);
        if brake.is_some() && !self.braking.acts {
            self.log.tell(sample.time, EventKind::EndStop, state.velocity);
        }
        self.braking.acts = brake.is_some();
        command = brake.unwrap_or(command);
        let switches = self.inputs.switches;
        for (end, reached) in switches.into_iter().enumerate() {
            if reached && !self.switched[end] {
                self.log.tell(sample.time, EventKind::LimitSwitch, state.position);
            }
            if reached {
                command = if end == 0 { command.max(0.0) } else { command.min(0.0) };
            }
        }
        self.switched = switches;
        command
    }
}
