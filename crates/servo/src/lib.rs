//! The sampled loop: a circuit, sensors, a controller.

#![warn(missing_docs)]

mod belief;
mod controller;
pub mod faults;
mod noise;
mod numbers;
mod run;
mod sensor;
mod sensors;
pub mod specification;
mod valves;

pub use belief::{Axis, belief};
pub use controller::controller;
pub use noise::{Noise, philox};
pub use run::{COLUMNS, Led, Rows, Servo, Turn, run_together};
pub use sensor::{Encoder, Sensor};
pub use sensors::Sensors;

pub(crate) use circuit::refuse;
