//! Assemblies: circuits of public parts, and names for their contents.

mod along;
mod driven;
mod exchange;
mod friction;
mod gas;
mod glances;
mod instance;
mod joints;
mod members;
mod names;
mod network;
mod numbers;
mod own_law;
mod prescribed;
mod recorder;
mod schedule;
mod session;
mod shoot;
mod starts;
mod variables;
mod warnings;
mod wiring;

pub use along::{ALONG, Record};
pub use driven::Driven;
pub use friction::{friction_law, steady_sensitivity};
pub use members::Members;
pub use names::Names;
pub use network::Network;
pub use own_law::own_law;
pub use prescribed::{Mechanics, Prescribed, close};
pub use recorder::{Run, sample_times};
pub use session::{Linear, Sampling, Session};
pub use shoot::{InputPlan, Shooting, Shot};
pub use variables::{Assembly, Settable, Target, Variables, valve_openings};
pub use warnings::IMPACT_ENERGY_J_M2;
