//! Numbers that the physics is written in.
//!
//! A law is a function generic over [`Real`]. Run on `f64` it gives values, on [`Dual`] exact
//! derivatives, on [`Lanes`] several drives at once, on [`Deps`] the sparsity pattern.

#![warn(missing_docs)]

mod both;
mod deps;
mod dual;
pub mod elementary;
mod lanes;
mod real;
#[cfg(target_feature = "avx2")]
mod registers;

pub use both::Both;
pub use deps::Deps;
pub use dual::Dual;
pub use lanes::Lanes;
pub use real::{Lane, Over, Real, field, power};
#[cfg(target_feature = "avx2")]
pub use registers::V4;
#[cfg(target_feature = "avx512f")]
pub use registers::V8;
