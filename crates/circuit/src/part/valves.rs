//! Parts of valves.

pub(crate) mod latch;
pub(crate) mod regulator;
pub(crate) mod second_order;
pub(crate) mod signal;
