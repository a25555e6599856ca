//! Forces on a moving mass other than friction.

mod end_stop;
pub use end_stop::EndStop;
