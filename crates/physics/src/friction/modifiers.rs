//! Modifiers of the forces of a friction law.

pub(crate) mod direction;
pub(crate) mod dwell;
pub(crate) mod position;
pub(crate) mod relaxation;
pub(crate) mod seal_lips;
pub(crate) mod side_load;
pub(crate) mod temperature;
pub(crate) mod wear;
