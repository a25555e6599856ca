//! Handover between laws without a bump of the command.

use crate::reference::blend;
use crate::thresholds::TAKEOVER_TIME;

/// The last command, and the difference to it that remains after a handover.
#[derive(Clone, Debug, Default)]
pub(crate) struct Takeover {
    last: f64,
    bump: Option<Bump>,
}

/// Time at which a law took over, s, and the difference between its command and the previous one.
#[derive(Clone, Copy, Debug)]
struct Bump {
    begin: Option<f64>,
    offset: f64,
}

impl Takeover {
    /// The next command continues from the last one.
    pub(super) fn begin(&mut self) {
        self.bump = Some(Bump { begin: None, offset: 0.0 });
    }

    /// The next command continues from this one.
    pub(super) fn begin_from(&mut self, command: f64) {
        self.last = command;
        self.begin();
    }

    /// Returns the command of a law at a time, s, plus the rest of the difference:
    ///
    ///   u + (u_last - u_first) (1 - blend(t/T))
    pub(super) fn smooth(&mut self, time: f64, mut command: f64) -> f64 {
        if !command.is_finite() {
            return command;
        }
        if let Some(bump) = &mut self.bump {
            let begin = *bump.begin.get_or_insert_with(|| {
                bump.offset = self.last - command;
                time
            });
            let [gone, ..] = blend((time - begin) / TAKEOVER_TIME);
            command = (command + bump.offset * (1.0 - gone)).clamp(-1.0, 1.0);
            if gone >= 1.0 {
                self.bump = None;
            }
        }
        self.last = command;
        command
    }
}
