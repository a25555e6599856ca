//! Control of a pneumatic axis: model of the drive, references, observer, laws.
//!
//! A law has no clock and reads no file: a sampled loop passes it samples and applies its commands.

#![warn(missing_docs)]

pub mod adaptation;
pub mod controller;
pub mod course;
pub mod export;
pub mod feasibility;
pub mod gains;
pub mod hold;
pub mod law;
pub mod model;
pub mod number;
pub mod observer;
pub mod own;
pub mod reference;
pub mod spool;
pub mod supervisor;
pub mod thresholds;
pub mod types;
pub mod valves;

pub use adaptation::Adaptation;
pub use controller::{Answer, AnyLaw, Controller, LAWS};
pub use course::{Course, Fade, Slowed};
pub use feasibility::{Demand, demand, least_factor, least_forces};
pub use gains::{Choice, FACTOR_BOUNDS, FACTORS, Factor, Gain, Gains};
pub use hold::Hold;
pub use law::{CHOICES, FACTORED, Law, Nmpc, Predicting, Predictor, Tick, Tuned, nmpc, sugeno};
pub use model::{Held, Model, Openings, Side, Slip, Valve};
pub use number::{Memory, Number};
pub use observer::{Noise, Observer};
pub use own::{Own, OwnLaw, SIGNALS, Seen, Signal};
pub use reference::{COEFFICIENTS, Effort, Efforts, Move, Piece, Reference, Wanted, blend};
pub use supervisor::{Event, EventKind, Inputs, Log, MotionRules, Reaction, Rules, Supervisor};
pub use types::{Armature, Arrangement, Edges, Plant, Sample, State};
pub use valves::{Commands, MOST_VALVES, Pair, Pulses, Seven, Three, Valves};
