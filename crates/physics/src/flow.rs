//! Flow through restrictions.

mod iso6358;
pub use iso6358::{Iso6358, RHO_0, T_0, choked_factor};
