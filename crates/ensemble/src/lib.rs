//! Many members of one circuit that differ in numbers, commands or starts: run side by side, reduced while they run.
//!
//! What a member gives is a pure function of the description and of its own row of numbers: it depends on no neighbour,
//! no chunk, no thread.

#![warn(missing_docs)]

mod lanes;
mod reduction;
mod run;

pub use reduction::{Follower, Reduction, What};
pub use run::{Asked, Column, Ensemble, Kernel, Outcome, Plan, Status};
