//! Delayed effects of commands: dead times, armature travel, pulses. Time is not part of the equations.

use crate::circuit::Circuit;
use crate::part::valves::signal;
use crate::part::{InputId, PartId};
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
        /// Period of pulses with the commanded width, s.
        pulses: Option<f64>,
        /// It starts at the position of its first command, otherwise at rest.
        stands: bool,
    },
    /// An armature travels to position one under a command of 1, and to position zero under -1. Without a command it
    /// keeps its position,
    /// after a started travel has ended.
    Keep { part: PartId, dead: [f64; 2], travel: [f64; 2] },
    /// Mean value of pulses with this period, s.
    Average { part: PartId, times: [f64; 2], dead: [f64; 2], pulses: f64 },
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
    pub(crate) fn settled<R: Lane>(&self, circuit: &mut Circuit<R>, lane: usize, command: R) {
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

    /// Returns whether the first command of a run counts as settled at its start, as that of a lock does. A valve begins
    /// at rest.
    pub fn stands_at_first(&self) -> bool {
        matches!(self, Timing::Travel { stands: true, .. })
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
pub(crate) fn average(d: f64, [on, off]: [f64; 2], dead: [f64; 2], period: f64) -> f64 {
    if d * period <= dead[0] {
        0.0
    } else if (1.0 - d) * period <= dead[1] {
        1.0
    } else {
        d + (off - on) / period
    }
}
