//! Parts that move.

pub(crate) mod axis;
pub(crate) mod bumper;
pub(crate) mod carriage;
pub(crate) mod coupling;
pub(crate) mod cylinder;
pub(crate) mod damper;
pub(crate) mod end_stops;
pub(crate) mod face;
pub(crate) mod formula_force;
pub(crate) mod link;
pub(crate) mod lock;
pub(crate) mod magnet;
pub(crate) mod motor;
pub(crate) mod shock_absorber;
pub(crate) mod spring;
pub(crate) mod table_force;
