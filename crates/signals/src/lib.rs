//! What samples of a recording show, each in one pass over them.
#![warn(missing_docs)]

mod bins;
mod turning;

pub use bins::{Bins, bin_means};
pub use turning::turning_points;
