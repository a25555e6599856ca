//! Parts that move.

pub(crate) mod axis;
pub(crate) mod buffers;
pub(crate) mod carriage;
pub(crate) mod couplings;
pub(crate) mod cylinder;
pub(crate) mod damper;
pub(crate) mod end_stops;
pub(crate) mod face;
pub(crate) mod forces;
pub(crate) mod lock;
pub(crate) mod motor;
