//! Flow through restrictions.

mod iso6358;
mod laminar;
pub use iso6358::{Iso6358, LINEAR_ABOVE, choked_factor};
pub use laminar::Laminar;
