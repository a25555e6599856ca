//! Parts of valves.

pub(crate) mod latch;
pub(crate) mod regulator;
pub(crate) mod signal;
