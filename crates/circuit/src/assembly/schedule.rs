//! The entries of a schedule.

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

/// Returns the middle of the play. The output of the play is constant while the command is within half of the width of
/// the play.
pub(super) fn behind_play(remembered: f64, command: f64, play: f64) -> f64 {
    remembered.clamp(command - play, command + play)
}

/// An entry of a schedule.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum ScheduledAction {
    /// An input.
    Input(usize),
    /// A delayed effect of a command: its timing, and the effect.
    Timing(usize, Due),
}

impl ScheduledAction {
    /// Returns whether it depends on the command at its time.
    pub fn waits(self) -> bool {
        matches!(self, ScheduledAction::Timing(_, Due::Start | Due::Rise | Due::Fall))
    }

    /// Returns it as a number, for this number of inputs.
    pub fn code(self, n_inputs: usize) -> u64 {
        let code = match self {
            ScheduledAction::Input(input) => input,
            ScheduledAction::Timing(timing, due) => n_inputs + timing * Due::ALL.len() + due as usize,
        };
        code as u64
    }

    /// Returns it from a number, for this number of inputs and timings.
    pub fn of(code: u64, n_inputs: usize, n_timings: usize) -> Option<Self> {
        let code = usize::try_from(code).ok()?;
        let Some(due) = code.checked_sub(n_inputs) else { return Some(ScheduledAction::Input(code)) };
        let (timing, due) = (due / Due::ALL.len(), Due::ALL[due % Due::ALL.len()]);
        (timing < n_timings).then_some(ScheduledAction::Timing(timing, due))
    }
}
