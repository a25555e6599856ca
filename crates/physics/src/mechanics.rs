//! Forces on a moving mass other than friction.

mod end_stop;
mod formula;
mod inertia;
pub use end_stop::EndStop;
pub use formula::{FORCE, examine_force};
pub use inertia::{Inertia, SlottedLever, TwoLinks};
