//! Assemblies: circuits of public parts, and names for their contents.

mod along;
mod drive;
pub(crate) mod end_stop;
mod exchange;
mod foresight;
mod friction;
mod gas;
pub(crate) mod glances;
pub(crate) mod leak;
mod members;
mod network;
mod numbers;
mod own_law;
mod session;
mod shoot;
mod tank;
mod timing;
mod variables;
mod wiring;

pub use along::{ALONG, Record, Restart};
pub use drive::{Drive, Servo};
pub use foresight::Foresight;
pub use friction::{friction_law, steady_sensitivity};
pub use members::Members;
pub use network::Network;
pub use own_law::own_law;
pub(crate) use own_law::parameter_text;
pub use session::{Linear, Session};
pub use shoot::{ByStart, DIRECTIONS, Shooting, Shot};
pub use tank::Tank;
pub use timing::{Pulses, Timing};
pub use variables::{Assembly, Quantity, Settable, Starting, Target, Variables, valve_openings};
