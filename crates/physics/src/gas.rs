//! Gas properties.

mod ideal;
pub use ideal::IdealGas;
