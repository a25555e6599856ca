//! Control of a pneumatic axis: model of the drive, references, observer, laws.
//!
//! A law has no clock and reads no file: a sampled loop passes it samples and applies its commands.

#![warn(missing_docs)]

pub mod adaptation;
pub mod controller;
pub mod course;
pub mod export;
pub mod feasibility;
pub mod follower;
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
pub use controller::Controller;
pub use course::{Course, Fade};
pub use feasibility::{Demand, demand, least_factor, least_forces};
pub use follower::{Answer, Follower};
pub use gains::{FACTOR_BOUNDS, FACTORS, Gain, GainValues};
pub use hold::Hold;
pub use law::{AnyLaw, GAINS, LAWS, Law, Nmpc, Tick, sugeno};
pub use model::{ConstantGas, Model, Side, Slip, Valve};
pub use number::{Memory, Number};
pub use observer::{Noise, Observer};
pub use own::{Own, OwnLaw, SIGNALS, Seen};
pub use reference::{COEFFICIENTS, Effort, Efforts, Move, Piece, Reference, Wanted, blend};
pub use supervisor::{Event, EventKind, Inputs, Log, MotionRules, Reaction, Rules, Supervisor};
pub use types::{Armature, Arrangement, Coupled, Edges, MOST_VALVES, Plant, Sample, State};
pub use valves::{Commands, Pair, Pulses, Seven, Three, Valves};
