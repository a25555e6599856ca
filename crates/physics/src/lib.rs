//! The laws of a pneumatic drive, one in each file, generic over the scalar.
//!
//! Signs: x and v grow towards the end of chamber b (chamber a grows). Mass flow is positive into a chamber. Friction
//! opposes v. Pressures are absolute.

#![warn(missing_docs)]

mod parameter;

pub mod chamber;
pub mod constants;
pub mod curve;
pub mod flow;
pub mod friction;
pub mod gas;
pub mod heat;
pub mod mechanics;
pub mod written;

pub use gas::{Gas, IdealGas, Virial};
pub use parameter::{
    Bounds, LARGEST, Parameter, above, any, at_least, between, in_usual_unit, is_huge, within,
};
