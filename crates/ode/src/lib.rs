//! Stiff integration of `y' = f(t, y)`, independent of the meaning of the states.
//!
//! A [`System`] is written once, generic over the scalar. The [`Stepper`] takes its Jacobian from dual
//! numbers and its sparsity from dependency sets. One loop runs one or several lanes.

#![warn(missing_docs)]

mod approach;
mod control;
mod dense;
mod event;
mod linear;
mod output;
mod rosenbrock;
mod stages;
mod stepper;
mod structure;
mod swing;
mod system;

pub use control::{Failure, Options, Statistics};
pub use dense::Course;
pub use event::locate;
pub use linear::Dense;
pub use output::{Accepted, NoOutput, Output};
pub use rosenbrock::{RODAS3, RODAS5P, Rosenbrock};
pub use stages::Method;
pub use stepper::{Paused, Stepper, same_time};
pub use structure::{DIRECTIONS, Structure};
pub use system::System;
