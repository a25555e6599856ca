//! Forces on a moving mass other than friction.

mod end_stop;
mod formula;
pub use end_stop::EndStop;
pub use formula::{FORCE, ForceFormula};
