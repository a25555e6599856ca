//! Assemblies: circuits of public parts, and names for their contents.

mod drive;
mod driven;
pub(crate) mod end_stop;
pub(crate) mod evaluate;
mod exchange;
mod friction;
mod gas;
pub(crate) mod leak;
mod members;
mod names;
mod network;
mod numbers;
mod own_law;
mod prescribed;
mod session;
mod starts;
mod tank;
mod timing;
mod variables;
mod wiring;

pub use drive::Drive;
pub use driven::{Driven, Servo};
pub use evaluate::along::{ALONG, Record, Restart};
pub use evaluate::foresight::Foresight;
pub use evaluate::shoot::{ByStart, DIRECTIONS, InputPlan, Shooting, Shot};
pub use friction::{friction_law, steady_sensitivity};
pub use members::Members;
pub use names::Names;
pub use network::Network;
pub use own_law::own_law;
pub(crate) use own_law::parameter_text;
pub use prescribed::{Mechanics, Prescribed, close};
pub use session::{Linear, Session};
pub use tank::Tank;
pub use timing::{Pulses, Timing};
pub use variables::{Assembly, Quantity, Settable, Starting, Target, Variables, valve_openings};
