//! Flow through restrictions.

mod edge;
mod formula;
mod iso6358;
mod laminar;
pub mod pipe;
mod series;
pub use edge::{leaking, opened};
pub use formula::{FlowFormula, MASS_FLOW};
pub use iso6358::{End, Iso6358, LINEAR_ABOVE, choked_factor};
pub use laminar::Laminar;
pub use series::in_series;

/// Critical pressure ratio of an ideal nozzle for a diatomic gas, (2/(k + 1))^(k/(k - 1)) at k = 1.4.
pub const NOZZLE_RATIO: f64 = 0.528;
/// Sonic conductance of a bore relative to its area, m3/(s Pa m2): 0.2 dm3/(s bar) for 1 mm2. This is the rule C = S/5
/// for its effective area S.
pub const BORE_CONDUCTANCE: f64 = 2e-3;
/// Critical pressure ratio of a leak past a seal: a narrow gap, which differs strongly from an ideal nozzle (assumed).
pub const LEAK_RATIO: f64 = 0.2;
