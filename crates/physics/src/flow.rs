//! Flow through restrictions.

mod iso6358;
pub use iso6358::{Iso6358, LINEAR_ABOVE, P_0, RHO_0, T_0, choked_factor};
