//! Assemblies: circuits of public parts, with names for what they contain.

mod drive;
mod friction;
mod rig;

pub use drive::{Drive, Servo};
pub use friction::friction_law;
pub use rig::{End, Motion, Rig, Start};
