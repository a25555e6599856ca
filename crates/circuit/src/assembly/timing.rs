//! Delayed effects of commands: dead times, the travel of an armature, pulses. Time does not enter the
//! equations: the schedule of a session sets what they read, and the integration ends on each entry exactly.

use super::session::Session;
use crate::circuit::Circuit;
use crate::part::{InputId, PartId, signal};
use math::Lane;

/// Timing of a command.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Timing {
    /// A spool takes the command behind its play after a dead time.
    Follow {
        part: PartId,
        /// Half of the width of the play.
        play: f64,
        /// Dead time, s.
        delay: f64,
    },
    /// An armature travels to the command: after the dead time to there or back, s, in the time of a travel of one, s.
    Travel {
        part: PartId,
        dead: [f64; 2],
        travel: [f64; 2],
        pulses: Option<Pulses>,
        /// It starts where its first command has it; else at rest.
        stands: bool,
    },
    /// An armature travels to one under a command 1 and to zero under -1, each as above; without a command it keeps its
    /// position, and a travel that has begun goes on to its end.
    Keep { part: PartId, dead: [f64; 2], travel: [f64; 2] },
    /// The mean of pulses.
    Average { part: PartId, times: [f64; 2], dead: [f64; 2], pulses: Pulses },
}

/// Pulses of a width that is commanded.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pulses {
    /// Period, s.
    pub period: f64,
}

/// Effect of an entry of a schedule on a timing.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Due {
    /// The value acts on the part.
    Act,
    /// An armature starts: the value is where it goes.
    Start,
    /// A pulse begins, and one ends.
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

    /// The command.
    pub fn commanded(&self) -> InputId {
        self.input(signal::COMMANDED)
    }

    /// Sets the part as if the command had stood for long; an armature goes there when the run begins.
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

    /// Whether the command is one of whole numbers.
    pub fn is_whole(&self) -> bool {
        matches!(self, Timing::Travel { pulses: None, .. } | Timing::Keep { .. })
    }

    /// Whether the first command of a run has acted for long when it begins.
    pub fn stands_at_first(&self) -> bool {
        matches!(self, Timing::Follow { .. } | Timing::Travel { stands: true, .. })
    }

    /// Where the command acts at once and smoothly, so that something can be differentiated by it.
    pub fn smooth(&self) -> Option<InputId> {
        matches!(self, Timing::Follow { .. }).then(|| self.input(signal::ACTS))
    }
}

/// The mean share of a period for which a valve is open under pulses of a share d of it:
///
///   0 for d T <= dead time on,   1 for (1 - d) T <= dead time off,   else d + (t_off - t_on)/T
///
/// It jumps at both: pulses that are too short do not move the armature.
///
/// T            period                                                s
/// t_on, t_off  times from a command to the middle of the travel      s
fn average(d: f64, [on, off]: [f64; 2], dead: [f64; 2], Pulses { period }: Pulses) -> f64 {
    if d * period <= dead[0] {
        0.0
    } else if (1.0 - d) * period <= dead[1] {
        1.0
    } else {
        d + (off - on) / period
    }
}

/// The middle of the play: it stays where the command is within half of its width.
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
    /// Whether it depends on the command at its time.
    pub fn waits(self) -> bool {
        matches!(self, What::Timing(_, Due::Start | Due::Rise | Due::Fall))
    }

    /// As a number, where there are so many inputs.
    pub fn code(self, n_inputs: usize) -> u64 {
        let code = match self {
            What::Input(input) => input,
            What::Timing(timing, due) => n_inputs + timing * Due::ALL.len() + due as usize,
        };
        code as u64
    }

    /// From a number, where there are so many inputs and timings.
    pub fn of(code: u64, n_inputs: usize, n_timings: usize) -> Option<Self> {
        let code = usize::try_from(code).ok()?;
        let Some(due) = code.checked_sub(n_inputs) else { return Some(What::Input(code)) };
        let (timing, due) = (due / Due::ALL.len(), Due::ALL[due % Due::ALL.len()]);
        (timing < n_timings).then_some(What::Timing(timing, due))
    }
}

/// Distance from its end of travel at which an armature has arrived.
const ARRIVED: f64 = 1e-9;

impl<R: Lane> Session<R> {
    /// A command from now on.
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
            // Shorter than the dead time, a command does not move it.
            Timing::Keep { .. } if value == 0.0 => self.forget(timing, Due::Start),
            Timing::Keep { .. } => self.switch(timing, f64::from(u8::from(value > 0.0))),
            Timing::Travel { pulses: Some(Pulses { period }), .. } => {
                if !self.is_due(timing, Due::Rise) {
                    self.later((now / period).ceil() * period, timing, Due::Rise, 0.0);
                }
            }
        }
    }

    /// Where an armature goes by what it was told last, or stands: -1, 0 or 1.
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

    /// Switches an armature: it starts after the dead time, unless it is switched back before. Told again where it goes by
    /// then, it does not begin anew.
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

    /// Applies the entry of a timing that is due now.
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
