//! Properties of recorded samples, each computed in one pass.
#![warn(missing_docs)]

mod bins;
mod turning;

pub use bins::{Bins, bin_means};
pub use turning::turning_points;
