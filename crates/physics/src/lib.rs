//! The laws of a pneumatic drive, one a file, each generic over the scalar.
//!
//! Signs: x and v grow towards chamber b's end (chamber a grows); mass flow is positive into a
//! chamber; friction opposes v; pressures are absolute.

mod parameter;

pub mod chamber;
pub mod flow;
pub mod friction;
pub mod gas;
pub mod heat;
pub mod mechanics;

pub use gas::IdealGas;
pub use parameter::{Bounds, Parameter, above, any, at_least, between};

/// Standard acceleration of gravity, m/s2 (exact by definition). Source: [bipm2019].
pub const STANDARD_GRAVITY: f64 = 9.806_65;
