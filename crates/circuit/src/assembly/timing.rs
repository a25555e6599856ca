//! Delayed effects of commands: dead times, armature travel, pulses. Time is not part of the equations. The schedule of
//! a session sets the values that the equations read, and the integration ends exactly on each entry.

use super::session::Session;
use crate::circuit::Circuit;
use crate::part::{InputId, PartId, valves::signal};
use math::Lane;

/// Timing of a command.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Timing {
    /// A spool follows the command after play and a dead time.
    Follow {
        part: PartId,
        /// Half of the width of the play.
        play: f64,
        /// Dead time, s.
        delay: f64,
    },
    /// An armature travels to the command. It starts after the dead time of its direction, s, and moves at a rate given
    /// by the time of a full travel, s.
    Travel {
        part: PartId,
        dead: [f64; 2],
        travel: [f64; 2],
        pulses: Option<Pulses>,
        /// It starts at the position of its first command, otherwise at rest.
        stands: bool,
    },
    /// An armature travels to position one under a command of 1, and to position zero under -1. Without a command it
    /// keeps its position,
    /// after a started travel has ended.
    Keep { part: PartId, dead: [f64; 2], travel: [f64; 2] },
    /// Mean value of the pulses.
    Average { part: PartId, times: [f64; 2], dead: [f64; 2], pulses: Pulses },
}

/// Pulses with a commanded width.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pulses {
    /// Period, s.
    pub period: f64,
}

/// Effect of an entry of a schedule on a timing.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Due {
    /// Sets the value of the part.
    Act,
    /// Starts an armature towards the value.
    Start,
    /// Starts or ends a pulse.
    Rise,
    Fall,
}

impl Due {
    pub const ALL: [Due; 4] = [Due::Act, Due::Start, Due::Rise, Due::Fall];
}

impl Timing {
    pub fn part(&self) -> PartId {
        match *self {
            Timing::Follow { part, .. }
            | Timing::Travel { part, .. }
            | Timing::Keep { part, .. }
            | Timing::Average { part, .. } => part,
        }
    }

    pub fn input(&self, input: usize) -> InputId {
        self.part().input(input)
    }

    /// Sets the command.
    pub fn commanded(&self) -> InputId {
        self.input(signal::COMMANDED)
    }

    /// Sets the part to the steady state of the command. An armature travels there when the run starts.
    pub(super) fn settled<R: Lane>(&self, circuit: &mut Circuit<R>, lane: usize, command: R) {
        circuit.set_input(self.commanded(), lane, command);
        let acts = match *self {
            Timing::Follow { .. } => {
                circuit.set_input(self.input(signal::REMEMBERED), lane, command);
                command
            }
            Timing::Travel { .. } | Timing::Keep { .. } => R::zero(),
            Timing::Average { times, dead, pulses, .. } => {
                R::c(average(command.get(lane), times, dead, pulses))
            }
        };
        circuit.set_input(self.input(signal::ACTS), lane, acts);
    }

    /// Returns whether the command accepts only whole numbers.
    pub fn is_whole(&self) -> bool {
        matches!(self, Timing::Travel { pulses: None, .. } | Timing::Keep { .. })
    }

    /// Returns whether the first command of a run counts as settled at its start.
    pub fn stands_at_first(&self) -> bool {
        matches!(self, Timing::Follow { .. } | Timing::Travel { stands: true, .. })
    }

    /// Returns whether the command acts at once and smoothly, so that derivatives by it exist.
    pub fn smooth(&self) -> Option<InputId> {
        matches!(self, Timing::Follow { .. }).then(|| self.input(signal::ACTS))
    }
}

/// Mean fraction of a period for which a valve is open under pulses of a fraction d of the period:
///
///   `0 for d T <= dead time on,   1 for (1 - d) T <= dead time off,   else d + (t_off - t_on)/T`
///
/// It jumps at both limits, because shorter pulses do not move the armature.
///
/// * `T`: period, s.
/// * `t_on`, `t_off`: times from a command to the middle of the travel, s.
fn average(d: f64, [on, off]: [f64; 2], dead: [f64; 2], Pulses { period }: Pulses) -> f64 {
    if d * period <= dead[0] {
        0.0
    } else if (1.0 - d) * period <= dead[1] {
        1.0
    } else {
        d + (off - on) / period
    }
}

/// Returns the middle of the play. The output of the play is constant while the command is within half of the width of
/// the play.
pub(super) fn behind_play(remembered: f64, command: f64, play: f64) -> f64 {
    remembered.clamp(command - play, command + play)
}

/// An entry of a schedule.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum What {
    /// An input.
    Input(usize),
    /// A delayed effect of a command: its timing, and the effect.
    Timing(usize, Due),
}

impl What {
    /// Returns whether it depends on the command at its time.
    pub fn waits(self) -> bool {
        matches!(self, What::Timing(_, Due::Start | Due::Rise | Due::Fall))
    }

    /// Returns it as a number, for this number of inputs.
    pub fn code(self, n_inputs: usize) -> u64 {
        let code = match self {
            What::Input(input) => input,
            What::Timing(timing, due) => n_inputs + timing * Due::ALL.len() + due as usize,
        };
        code as u64
    }

    /// Returns it from a number, for this number of inputs and timings.
    pub fn of(code: u64, n_inputs: usize, n_timings: usize) -> Option<Self> {
        let code = usize::try_from(code).ok()?;
        let Some(due) = code.checked_sub(n_inputs) else { return Some(What::Input(code)) };
        let (timing, due) = (due / Due::ALL.len(), Due::ALL[due % Due::ALL.len()]);
        (timing < n_timings).then_some(What::Timing(timing, due))
    }
}

/// Distance from its end of travel at which an armature counts as arrived.
const ARRIVED: f64 = 1e-9;

impl<R: Lane> Session<R> {
    /// Applies a command from now on.
    pub(super) fn command(&mut self, timing: usize, value: f64) {
        let now = self.time();
        let what = self.timings()[timing];
        self.act(what.commanded(), value);
        match what {
            Timing::Follow { play, delay, .. } => {
                let remembered = self.circuit().input(what.input(signal::REMEMBERED)).get(0);
                let acts = behind_play(remembered, value, play);
                self.act(what.input(signal::REMEMBERED), acts);
                if delay == 0.0 {
                    self.act(what.input(signal::ACTS), acts);
                } else {
                    self.later(now + delay, timing, Due::Act, acts);
                }
            }
            Timing::Average { times, dead, pulses, .. } => {
                self.act(what.input(signal::ACTS), average(value, times, dead, pulses));
            }
            Timing::Travel { pulses: None, .. } => self.switch(timing, value),
            // A command shorter than the dead time has no effect.
            Timing::Keep { .. } if value == 0.0 => self.forget(timing, Due::Start),
            Timing::Keep { .. } => self.switch(timing, f64::from(u8::from(value > 0.0))),
            Timing::Travel { pulses: Some(Pulses { period }), .. } => {
                if !self.is_due(timing, Due::Rise) {
                    self.later((now / period).ceil() * period, timing, Due::Rise, 0.0);
                }
            }
        }
    }

    /// Direction of an armature after its last switch: -1, 0 (at rest) or 1.
    fn goal(&self, timing: usize) -> f64 {
        let what = self.timings()[timing];
        let entry = |due: Due| self.schedule.iter().find(|entry| entry.1 == What::Timing(timing, due));
        if let Some(&(_, _, to)) = entry(Due::Start) {
            return to;
        }
        let speed = self.circuit().input(what.input(signal::ACTS)).get(0);
        let left = entry(Due::Act).map_or(0.0, |(arrives, ..)| arrives - self.time());
        (self.circuit().part_state(what.part(), self.state()).get(0) + speed * left).round()
    }

    /// Switches an armature. The travel starts after the dead time, unless the valve is switched back before. A
    /// repeated switch in the
    /// present direction has no effect.
    fn switch(&mut self, timing: usize, to: f64) {
        let (Timing::Travel { dead, .. } | Timing::Keep { dead, .. }) = self.timings()[timing] else {
            return;
        };
        if self.goal(timing) == to {
            return;
        }
        self.forget(timing, Due::Start);
        self.later(self.time() + dead[usize::from(to == 0.0)], timing, Due::Start, to);
    }

    /// Applies an entry of a timing that is due now.
    pub(super) fn happens(&mut self, timing: usize, due: Due, value: f64) {
        let (now, what) = (self.time(), self.timings()[timing]);
        match (due, what) {
            (Due::Act, _) => self.act(what.input(signal::ACTS), value),
            (Due::Start, Timing::Travel { travel, .. } | Timing::Keep { travel, .. }) => {
                self.forget(timing, Due::Act);
                let left = value - self.circuit().part_state(what.part(), self.state()).get(0);
                let time = left.abs() * travel[usize::from(value == 0.0)];
                let moves = left.abs() > ARRIVED;
                self.act(what.input(signal::ACTS), if moves { left / time } else { 0.0 });
                if moves {
                    self.later(now + time, timing, Due::Act, 0.0);
                }
            }
            (Due::Rise, Timing::Travel { pulses: Some(Pulses { period }), .. }) => {
                let share = self.circuit().input(what.commanded()).get(0);
                self.switch(timing, f64::from(u8::from(share > 0.0)));
                if share > 0.0 && share < 1.0 {
                    self.later(now + share * period, timing, Due::Fall, 0.0);
                }
                self.later(((now / period).round() + 1.0) * period, timing, Due::Rise, 0.0);
            }
            (Due::Fall, _) => self.switch(timing, 0.0),
            _ => {}
        }
    }
}
