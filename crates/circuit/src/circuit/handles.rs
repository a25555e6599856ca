//! Handles to contents of a circuit.

use crate::part::{InputId, PartId, PartKind};

/// A flow path of a circuit, and the direction in which its flow is positive.
#[derive(Clone, Copy, Debug)]
pub struct Path {
    pub(crate) kind: PartKind,
    pub(crate) index: usize,
    /// A single path, also if its part has several.
    pub(crate) path: usize,
    pub(crate) backward: bool,
}

impl Path {
    /// The path of a restriction.
    pub fn of(opening: InputId) -> Self {
        Path { kind: opening.kind, index: opening.index, path: 0, backward: false }
    }

    /// One of the paths of a part.
    pub fn along(part: PartId, path: usize) -> Self {
        Path { kind: part.kind, index: part.index, path, backward: false }
    }

    /// Returns the same path with the flow positive in the other direction.
    #[must_use]
    pub fn backward(self) -> Self {
        Path { backward: !self.backward, ..self }
    }
}

/// A carriage of a circuit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct CarriageId(pub(crate) usize);

impl CarriageId {
    /// Jerk, m/s3.
    pub fn jerk(self) -> InputId {
        InputId { kind: PartKind::Carriage, index: self.0, input: 0 }
    }

    /// Compliance flag of a motor: 1 lets it deflect under the force, 0 keeps it at its command.
    pub fn giving_way(self) -> InputId {
        InputId { input: 1, ..self.jerk() }
    }
}
