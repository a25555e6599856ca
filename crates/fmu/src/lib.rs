//! A drive as a library for other tools: the C interfaces of FMI 2.0 and 3.0, and a separate interface for C
//! programs.
//!
//! Every function checks its pointers and the phase of its instance, and catches all panics. The effect on
//! the drive is defined in [`model`], without `unsafe`.

pub mod abi;
mod c;
mod fmi2;
mod fmi3;
pub mod instance;
mod law;
pub mod model;
pub mod plan;
mod processor;
pub mod refusal;
