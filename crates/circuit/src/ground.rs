//! Shared ground of all floors: nodes, the work array, balances, and the contract of a part.

mod balance;
mod common;
mod error;
mod gathered;
mod ids;
mod jobs;
mod lifted;
mod net;
mod part;
pub(crate) mod path;

pub(crate) use crate::refuse;
pub use balance::{Channel, Kind};
pub use common::Common;
pub(crate) use common::{log, specific_entropy};
pub use error::Error;
pub(crate) use error::{check_bounds, refuse};
pub(crate) use gathered::{first_is_a_signal, force_on, gathered, inputs, one_path};
pub use ids::{AxisId, GasId};
pub use jobs::run_jobs;
pub use lifted::DIRECTIONS;
pub(crate) use lifted::{Lifted, Seeds, Sensitive, seeds, unfit};
pub use net::{AxisNode, GasNode, Net};
pub use part::{Given, Input, Of, Own, OwnMut, Part, State, Switching};
pub(crate) use part::{PRESSURE_TOLERANCE, Place, clip};
pub use path::Between;
pub(crate) use path::{post, post_ideal};
