//! A supervisor in front of a law. It acts when sensors, references, the valve, the law or the user fail. It is not a
//! safety function according to any standard.
//!
//! It uses the observer and the model of its controller. Without a fault, samples, reference and commands pass
//! unchanged.

mod brake;
mod event;
mod gas;
mod motion;
mod position;

use crate::controller::{Answer, AnyLaw, Controller};
use crate::course::{Course, Fade, Slowed};
use crate::model::Model;
use crate::reference::{Reference, Wanted};
use crate::thresholds::{
    CLOCK_WITHIN, LIMIT_ROUNDING, MODEL_TRUSTED, REFERENCE_JUMP, REVERSED_FOR, SLOW_FACTOR, SLOW_FULL,
    SLOW_FULL_FOR, SLOW_LEAST, STOP_APART, STOP_NEAR,
};
use crate::types::{Edges, Moment, Sample, State};
use brake::Braking;
pub use event::{Event, EventKind, Log};
use gas::Gas;
pub use motion::MotionRules;
use motion::{Motion, Moves};
use position::{Position, Read};

/// Reaction to a fault.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Reaction {
    /// The fault is reported.
    Tell,
    /// Stop ramp, then the law holds the position.
    Stop,
    /// The valve is shut immediately.
    Block,
    /// The reference is slowed in time until commands no longer saturate; if this fails, a stop ramp follows.
    Slow,
}

/// Prediction of the model for a sample.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Believed<'a> {
    /// The model.
    pub model: &'a Model,
    /// The state at the last sample.
    pub last: &'a State,
    /// Predicted state.
    pub foreseen: &'a State,
    /// Openings of the edges since the last sample.
    pub edges: Edges<f64>,
}

/// Rules of a supervisor.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rules {
    /// Positions that the drive may reach, m.
    pub position: [f64; 2],
    /// m/s.
    pub speed: f64,
    /// Pa absolute.
    pub pressure: [f64; 2],
    /// Deceleration of stop ramps, m/s2.
    pub stop_deceleration: f64,
    /// Condition of a completed motion.
    pub motion: MotionRules,
    /// Reaction to a lost position sensor.
    pub on_position: Reaction,
    /// Reaction to a lost pressure sensor. The model then replaces its readings.
    pub on_pressure: Reaction,
    /// Reaction to a valve that does not respond.
    pub on_valve: Reaction,
    /// Reaction to a fallen supply.
    pub on_supply: Reaction,
}

impl Default for Rules {
    fn default() -> Self {
        Rules {
            position: [f64::NEG_INFINITY, f64::INFINITY],
            speed: f64::INFINITY,
            pressure: [0.0, f64::INFINITY],
            stop_deceleration: 10.0,
            motion: MotionRules::default(),
            on_position: Reaction::Block,
            on_pressure: Reaction::Tell,
            on_valve: Reaction::Block,
            on_supply: Reaction::Block,
        }
    }
}

impl Rules {
    /// Returns the reason why a reference is rejected, in words; `None` if it is accepted.
    pub fn refuses(&self, wanted: &Wanted, stroke: f64) -> Option<String> {
        let Wanted { position: x, velocity: v, .. } = *wanted;
        let [low, high] = [self.position[0].max(0.0), self.position[1].min(stroke)];
        if !(low - LIMIT_ROUNDING..=high + LIMIT_ROUNDING).contains(&x) {
            let whose = if [low, high] == [0.0, stroke] { "the stroke" } else { "limits.position" };
            return Some(format!(
                "the reference has the position {x} m: it must stay within {whose}, {low} to {high} m"
            ));
        }
        let fastest = self.speed;
        (v.is_nan() || v.abs() > fastest + LIMIT_ROUNDING)
            .then(|| format!("the reference has the speed {v} m/s: limits.speed is {fastest} m/s"))
    }
}

/// External inputs of the supervisor for one sample.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Inputs {
    /// Whether the drive may move.
    pub enabled: bool,
    /// Emergency stop.
    pub emergency_stop: bool,
    /// Limit switches at x = 0 and at the stroke.
    pub switches: [bool; 2],
    /// Whether the law missed its deadline.
    pub late: bool,
    /// Standard deviation of the time at which a position is read, s.
    pub jitter: f64,
}

impl Default for Inputs {
    fn default() -> Self {
        Inputs { enabled: true, emergency_stop: false, switches: [false; 2], late: false, jitter: 0.0 }
    }
}

/// Mode of the drive.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Mode {
    Follows,
    /// Back to the reference.
    Returns(Fade),
    /// Stop ramp to rest, then the law holds the position.
    Stops {
        fade: Fade,
        at: f64,
        stood: bool,
    },
    /// The valve is shut.
    Shut,
    /// The valve is shut until the drive is enabled.
    Off,
}

/// A supervisor with its state.
#[derive(Clone, Debug)]
pub struct Supervisor {
    /// Rules of this supervisor.
    pub rules: Rules,
    /// External inputs.
    pub inputs: Inputs,
    /// Law that takes over if the first one fails.
    pub standby: AnyLaw,
    /// Whether it also takes over from custom laws. If false, a failure of such a law ends the run.
    pub serves_own: bool,
    log: Log,
    mode: Mode,
    position: Position,
    gas: Gas,
    motion: Motion,
    /// Time of the last sample and correction of the clock, s.
    clock: Option<f64>,
    correction: f64,
    /// Clock of the slowed reference, and the time for which commands have been saturated, s.
    slows: bool,
    slowed: Option<Slowed>,
    full_for: f64,
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
    /// Whether the drive has pressure sensors.
    measures_gas: bool,
    /// Time for which the position has been lost, s.
    lost_for: f64,
    switched: [bool; 2],
    /// Direction of commands with a reversed effect on a fallen supply, and the time until which they are blocked, s.
    reversed: Option<(f64, f64)>,
    /// Time until which a command that is tried again may have a reversed effect, s.
    doubted_until: f64,
}

impl Supervisor {
    /// Adds a standby law.
    pub fn new(rules: Rules, standby: AnyLaw) -> Self {
        Supervisor {
            rules,
            inputs: Inputs::default(),
            standby,
            serves_own: false,
            log: Log::default(),
            mode: Mode::Follows,
            position: Position::default(),
            gas: Gas::default(),
            motion: Motion::default(),
            clock: None,
            correction: 0.0,
            slows: false,
            slowed: None,
            full_for: 0.0,
            asked: None,
            followed: None,
            command: 0.0,
            missed: 0,
            stands_by: false,
            braking: Braking::default(),
            modelled: false,
            is_held: false,
            measures_gas: false,
            lost_for: 0.0,
            switched: [false; 2],
            reversed: None,
            doubted_until: 0.0,
        }
    }

    /// Returns the events.
    pub fn log(&self) -> &Log {
        &self.log
    }

    /// Returns the time of a sample on an even clock. An invalid time becomes the time of the last sample.
    pub(crate) fn corrected(&self, time: f64) -> f64 {
        let time = time + self.correction;
        if time.is_finite() { time } else { self.clock.unwrap_or(0.0) }
    }

    /// Returns the command for a sample.
    pub(crate) fn decide(&mut self, own: &mut Controller, sample: &Sample, reference: &Reference) -> Answer {
        let mut sample = *sample;
        let skipped = self.keep_time(own.period, &mut sample);
        let mut returns = self.inputs.enabled && self.mode == Mode::Off;
        if returns {
            (self.slows, self.slowed) = (false, None);
        }
        let asked = Course::from(reference).by(self.slowed).at(sample.time);
        let place = own.state().map_or(f64::NAN, |state| state.position);
        if returns && self.position.is_off(sample.position, place) {
            self.log.tell(sample.time, EventKind::PositionLost, sample.position - place);
            self.mode = Mode::Shut;
            returns = false;
        } else if returns
            && (self.position.is_lost() || self.gas.is_lost() || self.gas.has_no_supply() || self.stands_by)
        {
            // A lost signal may be back: the supervisor starts again.
            own.restart();
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
        let [position, gas] = reactions;
        match if position == Some(Reaction::Block) || gas.is_none() { position } else { gas } {
            Some(Reaction::Slow) => self.slows = true,
            Some(reaction) => self.react(own, &sample, reaction),
            None => {}
        }
        self.slow(own, &sample);
        let course = self.course(sample.time, &state, reference).by(self.slowed);
        let mut answer = self.ask(own, &sample, &course);
        if !asked.position.is_nan() {
            answer.wanted = asked;
        }
        let (wanted, stands) = (course.at(sample.time), course.stands(sample.time, own.plant.lag));
        self.followed = Some(wanted);
        answer.command = self.guarded(own, &sample, answer.command, stands);
        if !self.is_shut() {
            let at = Moment { time: sample.time, period: own.period };
            let moves = Moves { state, wanted, stands, no_air: self.reversed.is_some() };
            self.motion.watch(&self.rules.motion, &own.model, at, &moves, &mut self.log);
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
        own: &mut Controller,
        sample: &mut Sample,
        last: Option<(State, (State, Edges<f64>))>,
    ) -> [Option<Reaction>; 2] {
        let Some((before, (foreseen, edges))) = last else {
            // There is no earlier sample. The usual mean replaces pressures that are not numbers.
            sample.pressures = sample.pressures.filter(|own| own.iter().all(|p| p.is_finite()));
            return [None; 2];
        };
        let was_lost = self.position.is_lost();
        self.measures_gas = sample.pressures.is_some();
        let read = Read {
            time: sample.time,
            reading: sample.position,
            period: own.period,
            jitter: self.inputs.jitter,
            grain: own.grain(),
            fastest: own.plant.speed,
            is_held: self.is_held,
            by_gas: self.measures_gas && !self.gas.is_lost(),
        };
        let believed = Believed { model: &own.model, last: &before, foreseen: &foreseen, edges };
        let (position, free) = self.position.checked(&read, &believed, &mut self.log);
        sample.position = position;
        if let (Some(free), Some(observer)) = (free, &mut own.observer) {
            let gas = observer.state;
            observer.state = State { pressures: gas.pressures, temperatures: gas.temperatures, ..free };
        }
        let mut reactions = [(self.position.is_lost() && !was_lost).then_some(self.rules.on_position), None];
        if let Some(pressures) = &mut sample.pressures {
            let at = Moment { time: sample.time, period: own.period };
            let believed = Believed { model: &own.model, last: &before, foreseen: &foreseen, edges };
            let found = self.gas.checked(at, pressures, &believed, &mut self.log);
            self.modelled = found.modelled;
            if let Some(way) = found.reversed {
                self.reverse_for(sample.time, way);
            }
            let Rules { on_pressure, on_valve, mut on_supply, .. } = self.rules;
            if on_supply == Reaction::Block && !found.starved {
                // A low supply that still fills the chambers is only reported.
                on_supply = Reaction::Tell;
            }
            for (happened, reaction) in
                [(found.supply, on_supply), (found.sensor, on_pressure), (found.valve, on_valve)]
            {
                if happened && reaction != Reaction::Tell {
                    reactions[1] = Some(reaction);
                }
            }
        }
        reactions
    }

    /// Registers a command that acted in reverse: commands in its direction are blocked for a time.
    fn reverse_for(&mut self, time: f64, way: f64) {
        self.reversed = Some((way, time + REVERSED_FOR));
        self.doubted_until = time + 2.0 * REVERSED_FOR;
    }

    fn check_reference(&mut self, own: &Controller, sample: &Sample, asked: &Wanted) {
        let Wanted { position, velocity, acceleration, jerk } = *asked;
        let is_number = [position, velocity, acceleration, jerk].iter().all(|own| own.is_finite());
        let jumps = self.asked.is_some_and(|last| {
            let way = 0.5 * (last.velocity + velocity) * own.period;
            (position - last.position - way).abs() > REFERENCE_JUMP
        });
        self.asked = is_number.then_some(*asked);
        let refused = !is_number || jumps || self.rules.refuses(asked, own.model.stroke).is_some();
        if refused && matches!(self.mode, Mode::Follows | Mode::Returns(_)) {
            self.stop(own, sample, EventKind::Reference, position);
        }
    }

    fn check_inputs(&mut self, own: &Controller, sample: &Sample, state: &State) {
        let v = state.velocity;
        if !self.inputs.enabled {
            if self.mode != Mode::Off {
                self.log.tell(sample.time, EventKind::Disabled, v);
                self.mode = Mode::Off;
            }
            return;
        }
        let moves = matches!(self.mode, Mode::Follows | Mode::Returns(_));
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

    fn react(&mut self, own: &Controller, sample: &Sample, reaction: Reaction) {
        match (reaction, self.mode) {
            (Reaction::Stop, Mode::Follows | Mode::Returns(_)) => self.begin_stop(own, sample),
            (Reaction::Block, Mode::Follows | Mode::Returns(_) | Mode::Stops { .. }) => {
                self.mode = Mode::Shut
            }
            _ => {}
        }
    }

    /// Slows the reference while the law commands the full opening and the supply pressure is low.
    fn slow(&mut self, own: &Controller, sample: &Sample) {
        let is_over = self.slowed.is_none_or(|clock| clock.end() <= sample.time);
        let is_full = self.command.abs() >= SLOW_FULL && self.mode == Mode::Follows;
        self.full_for = if is_full && is_over { self.full_for + own.period } else { 0.0 };
        if !self.slows || self.full_for < SLOW_FULL_FOR {
            return;
        }
        let clock = Slowed::from(self.slowed, sample.time, SLOW_FACTOR);
        if clock.rate() < SLOW_LEAST {
            return self.react(own, sample, Reaction::Stop);
        }
        self.log.tell(sample.time, EventKind::Slowed, 1.0 / clock.rate());
        self.slowed = Some(clock);
    }

    fn stop(&mut self, own: &Controller, sample: &Sample, kind: EventKind, value: f64) {
        self.log.tell(sample.time, kind, value);
        self.react(own, sample, Reaction::Stop);
    }

    /// Begins a stop ramp at the wanted position, or at the actual position if the two differ.
    fn begin_stop(&mut self, own: &Controller, sample: &Sample) {
        let Some(state) = own.state() else { return };
        let period = own.period;
        let seen = [state.position, state.velocity, state.acceleration(&own.model)];
        let from = self.followed.map_or(seen, |last| {
            let Wanted { position, velocity, acceleration, jerk } = last;
            let x = position + period * (velocity + 0.5 * period * acceleration);
            let v = velocity + period * acceleration;
            if (x - state.position).abs() < STOP_NEAR { [x, v, acceleration + period * jerk] } else { seen }
        });
        let ahead = if from[1] > 0.0 { own.model.stroke - from[0] } else { from[0] };
        let (fade, at) = Fade::stop(sample.time, from, self.rules.stop_deceleration, ahead - STOP_APART);
        self.mode = Mode::Stops { fade, at, stood: false };
    }

    fn begin_return(&mut self, own: &mut Controller, sample: &Sample, state: &State, asked: &Wanted) {
        let from = [state.position - asked.position, state.velocity - asked.velocity, -asked.acceleration];
        self.log.tell(sample.time, EventKind::Enabled, from[0]);
        own.begin_anew(self.command);
        self.motion = Motion::default();
        self.asked = None;
        self.followed = None;
        self.mode = Mode::Returns(Fade::back(sample.time, from, self.rules.stop_deceleration));
    }

    fn course<'a>(&mut self, time: f64, state: &State, reference: &'a Reference) -> Course<'a> {
        match &mut self.mode {
            Mode::Returns(fade) if fade.end() > time => Course::back_to(reference, *fade),
            Mode::Stops { fade, at, stood, .. } => {
                if fade.end() <= time && !*stood {
                    *stood = true;
                    self.log.tell(time, EventKind::Stopped, state.position);
                }
                Course::to_stand(*at, *fade)
            }
            Mode::Shut | Mode::Off => reference.into(),
            mode => {
                *mode = Mode::Follows;
                reference.into()
            }
        }
    }

    /// Shuts the valve and suspends the law.
    fn is_shut(&self) -> bool {
        matches!(self.mode, Mode::Shut | Mode::Off)
    }

    /// Returns the output of the law, or of the standby law.
    fn ask(&mut self, own: &mut Controller, sample: &Sample, course: &Course) -> Answer {
        if self.is_shut() {
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

    fn stand_by(&mut self, own: &mut Controller, time: f64) {
        self.stands_by = true;
        let number = crate::LAWS.iter().position(|key| *key == self.standby.key()).unwrap_or(0);
        self.log.tell(time, EventKind::StandBy, number as f64);
        own.switch(self.standby.clone());
    }

    /// Returns a command that keeps the drive off end stops and limit switches.
    fn guarded(&mut self, own: &Controller, sample: &Sample, mut command: f64, stands: bool) -> f64 {
        let Some(state) = own.state() else { return command };
        if command.is_nan() {
            return command;
        }
        // Without readings, the model can be trusted only for a short time.
        self.lost_for = if self.position.is_lost() { self.lost_for + own.period } else { 0.0 };
        let is_known = self.lost_for < MODEL_TRUSTED;
        self.reversed = self.reversed.filter(|&(way, until)| command * way >= 0.0 && sample.time < until);
        if self.reversed.is_some() {
            // The command would drain the chamber that it should fill.
            command = 0.0;
        }
        if let Some(brake) = self
            .braking
            .needed(own, command, &self.gas, self.measures_gas, self.doubted_until)
            .filter(|_| is_known)
        {
            if !self.braking.acts {
                self.log.tell(sample.time, EventKind::EndStop, state.velocity);
                if let Some(times) = self.braking.swings.watch(sample.time, state.velocity, stands) {
                    self.log.tell(sample.time, EventKind::Braked, f64::from(times));
                    self.react(own, sample, Reaction::Block);
                }
            }
            self.braking.acts = true;
            let takes_air = !self.measures_gas && self.reversed.is_some_and(|(way, _)| brake * way > 0.0);
            command = if takes_air { 0.0 } else { brake };
            if self.gas.has_no_supply() {
                // Every action of the law drains the chambers, and the supply does not refill them.
                self.react(own, sample, Reaction::Block);
            }
        } else {
            self.braking.acts = false;
        }
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
