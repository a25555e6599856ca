//! Nodes of a circuit.

/// A gas node of a circuit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct GasId(pub(crate) usize);

/// An axis of a circuit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct AxisId(pub(crate) usize);
