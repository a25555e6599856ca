//! Evaluations of a circuit along given states.

pub(crate) mod along;
pub(crate) mod glances;
pub(crate) mod shoot;
