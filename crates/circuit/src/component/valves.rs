//! Valves and regulators.

pub(crate) mod impulse;
pub(crate) mod piloted;
pub(crate) mod regulator;
pub(crate) mod soft_start;
pub(crate) mod switching;
pub(crate) mod valve;
