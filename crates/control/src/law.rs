//! Control laws: they compute the command that moves a drive along its reference.

mod any;
mod base;
mod fuzzy;
mod inversion;
mod nmpc;
mod pid;
mod sliding;

pub use any::{AnyLaw, GAINS, LAWS};
pub use base::{Features, Law, Tick};
pub use fuzzy::{Fuzzy, sugeno};
pub use inversion::Inversion;
pub use nmpc::Nmpc;
pub use pid::Pid;
pub use sliding::{Sliding, SuperTwisting};
