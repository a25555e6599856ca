//! Control laws: they compute the command that moves a drive along its reference.

mod any;
mod base;
mod fuzzy;
mod inversion;
mod nmpc;
mod pid;
mod sliding;

use crate::gains::Factor;
pub use any::{AnyLaw, LAWS};
pub use base::{Law, Tick, Tuned};
pub use fuzzy::{Fuzzy, sugeno};
pub use inversion::Inversion;
pub use nmpc::Nmpc;
pub use pid::Pid;
pub use sliding::{Sliding, SuperTwisting};

/// Gain that a factor of a controller file multiplies. A factor has no effect on a law without a gain for it.
pub const FACTORED: &[Factor] = &[
    Factor { law: "pid", key: "gain", gain: "gain" },
    Factor { law: "pid", key: "damping", gain: "derivative_time" },
    Factor { law: "pid", key: "filter", gain: "filter_time" },
    Factor { law: "fuzzy", key: "gain", gain: "gain" },
    Factor { law: "fuzzy", key: "damping", gain: "derivative_time" },
    Factor { law: "fuzzy", key: "filter", gain: "filter_time" },
    Factor { law: "sliding-mode", key: "gain", gain: "bandwidth" },
    Factor { law: "sliding-mode", key: "damping", gain: "width" },
    Factor { law: "super-twisting", key: "gain", gain: "bandwidth" },
    Factor { law: "super-twisting", key: "damping", gain: "band" },
    Factor { law: "inversion", key: "gain", gain: "bandwidth" },
    Factor { law: "nmpc", key: "gain", gain: "bandwidth" },
    Factor { law: "nmpc", key: "damping", gain: "move_penalty" },
];
