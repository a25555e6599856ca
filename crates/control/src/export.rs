//! A law with its observer as source code of other languages. The equations run once on numbers that record each
//! operation. The record is printed.

mod conformance;
mod guard;
mod print;
mod traced;

use crate::adaptation::Adaptation;
use crate::types::{Sample, State};
pub use guard::STATUS;
use guard::{GUARD, Guard, GuardInputs};
pub use print::Language;
pub use traced::{LawGraph, Node, Traced, record};

use crate::controller::Controller;
use crate::course::Course;
use crate::follower::{Ahead, Answer, Follower, Takeover};
use crate::hold::Hold;
use crate::law::{AnyLaw, Fuzzy, Inversion, Law, Pid, Sliding, SuperTwisting};
use crate::number::{Memory, set_to};
use crate::observer::Observer;
use crate::reference::{Reference, between, blend};
use crate::thresholds::FARTHEST;
use crate::valves::Valves;
use math::Real;

/// Name, unit in SI (`1` for a pure number) and meaning of an input, parameter or result of exported code.
pub type ExportVariable = (&'static str, &'static str, &'static str);

/// A law with its observer and its checks as graphs. All of them take [`LawProgram::inputs`], the parameters and the state, in that
/// order.
#[derive(Clone, Debug)]
pub struct LawProgram {
    /// Key of the law.
    pub law: &'static str,
    /// Name of the files, and begin of the names in them.
    pub name: String,
    /// The period, s.
    pub period: f64,
    /// Time after which the present command acts, s. Some [`LawProgram::inputs`] refer to that time.
    pub ahead: f64,
    /// Inputs of a sample.
    pub inputs: Vec<ExportVariable>,
    /// Parameters with their values: gains of the law, then limits of the checks.
    pub parameters: Vec<(ExportVariable, f64)>,
    /// Numbers that are stored from one sample to the next, and between the pieces of a step.
    pub memory: [usize; 2],
    /// Whether the valve opens, whether the observer begins, the status, the checked inputs, and the state of the checks.
    pub check: LawGraph,
    /// State at the first sample, with the values learned earlier.
    pub begin: LawGraph,
    /// State at a later sample.
    pub observe: LawGraph,
    /// [`RESULTS`], then the state.
    pub command: LawGraph,
}

/// Inputs of a move of a reference: positions, m, and times, s.
pub const MOVE: [&str; 5] = ["start", "target", "begin_time", "duration", "at_time"];

/// Position, velocity, acceleration and jerk of a move at a time. The reference is at rest before and after the move.
pub fn along_a_move() -> LawGraph {
    record(MOVE.len(), |given| {
        let [from, to, begin, duration, t] = [0, 1, 2, 3, 4].map(|place| given[place]);
        between([from, to], blend((t - begin) / duration), Traced::one() / duration).numbers().to_vec()
    })
}

/// Results of [`LawProgram::command`] before the state.
pub const RESULTS: [ExportVariable; 4] = [
    ("command", "1", "command of the valve, -1 .. 1"),
    ("velocity", "m/s", "velocity, estimated"),
    ("disturbance", "N", "unmodelled force, estimated"),
    ("holds", "1", "1 while the drive is held at rest, else 0"),
];

/// Number of samples after which the number of commands that do not act yet is constant.
const SETTLED: u32 = 200;

/// Inputs of a sample. Without pressure sensors, the code does not have both pressures.
const INPUTS: [ExportVariable; 13] = [
    ("position", "m", "measured position"),
    ("pressure_a", "Pa", "absolute pressure of chamber a"),
    ("pressure_b", "Pa", "absolute pressure of chamber b"),
    ("position_now", "m", "position of the reference now"),
    ("velocity_now", "m/s", "velocity of the reference now"),
    ("acceleration_now", "m/s2", "acceleration of the reference now"),
    ("jerk_now", "m/s3", "jerk of the reference now"),
    ("position_then", "m", "position of the reference when the present command acts"),
    ("velocity_then", "m/s", "velocity of the reference when the present command acts"),
    ("acceleration_then", "m/s2", "acceleration of the reference when the present command acts"),
    ("jerk_then", "m/s3", "jerk of the reference when the present command acts"),
    ("stands", "1", "1 while the reference is at rest until the present command acts, else 0"),
    ("enabled", "1", "1 while the drive may move, else 0"),
];

/// Limits of the checks, with their values for a controller.
fn limits(controller: &Controller) -> Vec<(ExportVariable, f64)> {
    let rules = controller.supervisor.as_ref().map(|own| own.rules).unwrap_or_default();
    let [low, high] = [rules.position[0].max(0.0), rules.position[1].min(controller.model.stroke)];
    vec![
        (("position_low", "m", "smallest position of the reference"), low),
        (("position_high", "m", "largest position of the reference"), high),
        (("speed_limit", "m/s", "highest speed of the reference"), rules.speed.min(FARTHEST)),
        (("stop_deceleration", "m/s2", "deceleration of a stop ramp"), rules.stop_deceleration),
    ]
}

/// Returns the program of a law, its observer and its checks. Without pressure sensors, the pressures come from the
/// model, and friction and valve are not learned.
pub fn program(controller: &Controller, with_pressures: bool) -> Result<LawProgram, String> {
    macro_rules! any {
        ($($law:ident),*) => {
            match &controller.law {
                $(AnyLaw::$law(_) => Ok(LawRecorder { controller, with_pressures }.program($law::of)),)*
                AnyLaw::Nmpc(_) => Err(
                    "nmpc cannot be exported: its search for limits of the moves depends on numbers. Export inversion or \
                     super-twisting, or call the compiled core".into(),
                ),
                AnyLaw::Own(_) => Err("a custom law cannot be exported, because it already is code".into()),
            }
        };
    }
    if !matches!(controller.valves, Valves::One) {
        return Err("a law cannot be exported that commands several or switching valves: its code has one command. Export it for \
                    one proportional 5/3 valve, or call the compiled core"
            .into());
    }
    any!(Pid, Fuzzy, Sliding, SuperTwisting, Inversion)
}

struct LawRecorder<'c> {
    controller: &'c Controller,
    with_pressures: bool,
}

/// The pieces of a step.
#[derive(Clone, Copy, PartialEq)]
enum Piece {
    Begin,
    Observe,
    Command,
}

impl GuardInputs<Traced> {
    /// Returns the step for the inputs of the code, in their order.
    fn of(all: &[Traced], with_pressures: bool) -> Self {
        let pressures = with_pressures.then(|| [Traced::zero(); 2]);
        let mut own = GuardInputs { pressures, ..GuardInputs::default() };
        own.each(&mut set_to(all));
        own
    }

    fn sample(&self, time: f64) -> Sample<Traced> {
        Sample { time, position: self.position, pressures: self.pressures }
    }
}

impl<L: Law<Traced>> Follower<L, Traced> {
    /// Takes over learned values, if there are any: a new memory has zeros.
    fn keep_learned(&mut self, before: &mut Self) {
        let Some((adaptation, old)) = self.adaptation.as_mut().zip(before.adaptation.as_mut()) else {
            return;
        };
        let has_learned = Traced::zero().lt(before.model.valve.flow.gain);
        let mut learned = Vec::new();
        old.learned(&mut before.model, &mut |number| learned.push(*number));
        let mut learned = learned.into_iter();
        adaptation.learned(&mut self.model, &mut |number| {
            *number = Traced::select(has_learned, learned.next().unwrap_or(*number), *number);
        });
    }
}

impl LawRecorder<'_> {
    /// Returns two observers of a controller in steady operation: at time zero after its last command, and at the next
    /// sample.
    fn settled(&self) -> [Observer; 2] {
        let Follower { model, period, noise, .. } = &**self.controller;
        let sample =
            |k: u32| Sample { time: -f64::from(k) * period, position: 0.5 * model.stroke, pressures: None };
        let mut own = Observer::new(model, &sample(SETTLED), *period, *noise);
        for k in (0..=SETTLED).rev() {
            own.update(model, &sample(k));
            own.spool.command(sample(k).time + model.valve.delay, 0.0);
        }
        let mut next = own.clone();
        next.update(model, &Sample { time: *period, ..sample(0) });
        [own, next]
    }

    fn traced<L: Law<Traced>>(&self, law: L, observer: &Observer) -> Follower<L, Traced> {
        let Follower { model, plant, hold, period, noise, .. } = &**self.controller;
        Follower {
            model: model.map(Traced::c),
            plant: *plant,
            law,
            valves: Valves::One,
            hold: hold.as_ref().map(|own| Hold::new(own.band, own.after)),
            adaptation: self.controller.adaptation.as_ref().map(|_| Adaptation::new(model)),
            period: *period,
            takeover: Takeover::default(),
            noise: *noise,
            speed: Traced::zero(),
            observer: Some(observer.at_rest()),
            friction: Some(Traced::zero()),
            push: Traced::zero(),
            coupled: None,
        }
    }

    /// Returns the program of a law that is made of its gains.
    fn program<L: Law<Traced>>(&self, law: impl Fn(&[Traced]) -> Option<L>) -> LawProgram {
        let is_input = |own: &ExportVariable| self.with_pressures || own.1 != "Pa";
        let inputs: Vec<_> = INPUTS.into_iter().filter(is_input).collect();
        let mut any = self.controller.law.clone();
        let gains =
            any.gains().into_iter().map(|(gain, value)| ((gain.key, gain.unit, gain.meaning), *value));
        let mut parameters: Vec<_> = gains.collect();
        let of_limits = parameters.len();
        parameters.extend(limits(self.controller));
        let settled = self.settled();
        let follower = |parameters: &[Traced], observer| {
            self.traced(law(parameters).expect("the gains come first"), observer)
        };
        let memory = settled.each_ref().map(|observer| {
            let mut count = 0;
            follower(&vec![Traced::zero(); of_limits], observer).numbers(&mut |_| count += 1);
            count
        });
        let piece = |piece: Piece| {
            let (observer, remembers) = match piece {
                Piece::Begin => (&settled[1], memory[0]),
                Piece::Observe => (&settled[0], memory[0]),
                Piece::Command => (&settled[1], memory[1]),
            };
            record(inputs.len() + parameters.len() + remembers, |given| {
                let (sample, rest) = given.split_at(inputs.len());
                let (parameters, remembered) = rest.split_at(parameters.len());
                let mut own = follower(parameters, observer);
                if piece == Piece::Begin {
                    let mut before = follower(parameters, &settled[0]);
                    before.numbers(&mut set_to(remembered));
                    own.keep_learned(&mut before);
                } else {
                    own.numbers(&mut set_to(remembered));
                }
                self.step(piece, &mut own, &GuardInputs::of(sample, self.with_pressures))
            })
        };
        LawProgram {
            law: self.controller.law.key(),
            name: format!("pneudrive_{}", self.controller.law.key().replace('-', "_")),
            period: self.controller.period,
            ahead: self.controller.ahead(),
            begin: piece(Piece::Begin),
            observe: piece(Piece::Observe),
            command: piece(Piece::Command),
            check: self.check(inputs.len(), parameters.len(), of_limits),
            inputs,
            parameters,
            memory,
        }
    }

    /// The checks of a sample. Their state ends with the velocity of the last command.
    fn check(&self, inputs: usize, parameters: usize, of_limits: usize) -> LawGraph {
        record(inputs + parameters + GUARD + 1, |given| {
            let (sample, rest) = given.split_at(inputs);
            let (parameters, state) = rest.split_at(parameters);
            let limits = [0, 1, 2, 3].map(|place| parameters[of_limits + place]);
            let mut own = Guard::default();
            own.each(&mut set_to(&state[..GUARD]));
            let asked = GuardInputs::of(sample, self.with_pressures);
            let (flags, mut checked) = own.check(self.controller, &limits, &asked, state[GUARD]);
            let mut results = flags.to_vec();
            checked.each(&mut |number| results.push(*number));
            own.each(&mut |number| results.push(*number));
            results
        })
    }

    /// A piece of a step, with its results.
    fn step<L: Law<Traced>>(
        &self,
        piece: Piece,
        own: &mut Follower<L, Traced>,
        given: &GuardInputs<Traced>,
    ) -> Vec<Traced> {
        let at = given.sample(self.controller.period);
        let mut results = Vec::new();
        match piece {
            Piece::Begin | Piece::Observe => {
                if let (Piece::Begin, Some(observer)) = (piece, &mut own.observer) {
                    own.friction = None;
                    observer.state = State::at_rest(&own.model, &at);
                }
                own.observe(&at);
                own.adapt(self.with_pressures);
            }
            Piece::Command => {
                let nowhere = Reference::Moves { start: 0.0, moves: vec![] };
                let GuardInputs { now, then, stands, .. } = *given;
                own.speed = now.velocity.abs();
                let preview = Course::from(&nowhere);
                let ahead = Ahead { now, then, stands, preview: &preview };
                let Answer { command, velocity, disturbance, holds, .. } = own.command(&at, &ahead);
                if let Some(observer) = &mut own.observer {
                    observer.spool.command(at.time + own.model.valve.delay, command);
                }
                let holds = Traced::select(holds, Traced::one(), Traced::zero());
                results = vec![command, velocity, disturbance, holds];
            }
        }
        own.numbers(&mut |number| results.push(*number));
        results
    }
}
