//! Numbers that the physics is written in.
//!
//! A law is a function generic over [`Real`]. Run on `f64` it gives values, on [`Dual`] exact
//! derivatives, on [`Lanes`] several drives at once, on [`Deps`] the sparsity pattern.

#![warn(missing_docs)]

mod both;
mod deps;
mod dual;
pub mod elementary;
mod gather;
mod lanes;
mod plain;
mod real;
#[cfg(target_feature = "avx2")]
mod registers;

pub use both::Both;
pub use deps::Deps;
pub use dual::Dual;
pub use gather::Gather;
pub use lanes::Lanes;
pub use real::{Function, Lane, MOST_ARGUMENTS, MOST_RESULTS, Map, Over, Real, Task, Work, field, power};
#[cfg(target_feature = "avx2")]
pub use registers::{V4, has_eight, with_eight};

/// Returns whether this processor has registers of eight numbers. The build does not know this.
#[cfg(not(target_feature = "avx2"))]
pub fn has_eight() -> bool {
    false
}

/// Runs a task on eight numbers at once: see [`has_eight`].
#[cfg(not(target_feature = "avx2"))]
pub fn with_eight<T: Task>(_task: T) -> T::Out {
    panic!("this processor has no registers of eight numbers")
}
