//! Handover between laws without a bump of the command.

use crate::reference::blend;
use crate::thresholds::TAKEOVER_TIME;

/// The last command, and the difference to it that remains after a handover.
#[derive(Clone, Debug, Default)]
pub(crate) struct Takeover {
    /// The last command.
    pub(super) last: f64,
    /// The next command is the first one of another law, and continues from the last one.
    pub(super) begins: bool,
    /// Time at which a law took over, s, and the difference between its command and the previous one.
    bump: Option<(f64, f64)>,
}

impl Takeover {
    /// Returns the command of a law at a time, s, plus the rest of the difference:
    ///
    ///   u + (u_last - u_first) (1 - blend(t/T))
    pub(super) fn smooth(&mut self, time: f64, mut command: f64) -> f64 {
        if !command.is_finite() {
            return command;
        }
        if std::mem::take(&mut self.begins) {
            self.bump = Some((time, self.last - command));
        }
        if let Some((begin, offset)) = self.bump {
            let [gone, ..] = blend((time - begin) / TAKEOVER_TIME);
            command = (command + offset * (1.0 - gone)).clamp(-1.0, 1.0);
            if gone >= 1.0 {
                self.bump = None;
            }
        }
        self.last = command;
        command
    }
}
