//! Components that move.

pub(crate) mod bumper;
pub(crate) mod carriage;
pub(crate) mod coupling;
pub(crate) mod cylinder;
pub(crate) mod end_stop;
pub(crate) mod force_sensor;
pub(crate) mod inertia;
pub(crate) mod load;
pub(crate) mod magnetic_coupling;
pub(crate) mod motor;
pub(crate) mod piston;
pub(crate) mod platform;
pub(crate) mod rod_lock;
pub(crate) mod shock_absorber;
pub(crate) mod slide;
pub(crate) mod table_force;
