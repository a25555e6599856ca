//! Handles to contents of a circuit.

use crate::part::{InputId, PartId, PartKind};

/// A carriage of a circuit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct CarriageId(pub(crate) usize);

impl CarriageId {
    /// Jerk, m/s3.
    pub fn jerk(self) -> InputId {
        PartId { kind: PartKind::Carriage, index: self.0 }.input(0)
    }

    /// Compliance flag of a motor: 1 lets it deflect under the force, 0 keeps it at its command.
    pub fn giving_way(self) -> InputId {
        self.jerk().part.input(1)
    }
}
