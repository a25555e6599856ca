//! Flow through restrictions.

mod iso6358;
pub use iso6358::{Iso6358, LINEAR_ABOVE, choked_factor};
