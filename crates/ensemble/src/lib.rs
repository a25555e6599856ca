//! Many members of one circuit that differ in numbers, commands or starts. They run side by side and are
//! reduced while they run.
//!
//! The result of a member is a pure function of the description and its own row of numbers. It does not
//! depend on neighbours, chunks or threads.

#![warn(missing_docs)]

mod lanes;
mod plan;
mod reduction;
mod run;
mod worker;

pub use plan::{Column, Ensemble, EnsembleRequest, Kernel, Plan};
pub use reduction::{Reducer, Reduction, Statistic};
pub use run::Outcome;
pub use worker::MemberStatus;
