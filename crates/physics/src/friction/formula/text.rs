use crate::parameter::Bounds;
pub use crate::written::{ParameterText, Problem, Refusal};
use serde::Deserialize;
use std::collections::BTreeMap;

/// A law as written by its author, with quantities in SI.
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Text {
    /// Its name in messages and tables.
    pub name: String,
    /// Its name for people.
    #[serde(default)]
    pub title: String,
    /// Key in references.bib. Empty without a source.
    #[serde(default)]
    pub source: String,
    /// Its parameters, in their order.
    pub parameters: Vec<ParameterText>,
    /// Names of the parameters that are Fc, Fs and Fv, by level.
    #[serde(default)]
    pub levels: BTreeMap<String, String>,
    /// Its inner states, in their order.
    #[serde(default)]
    pub states: Vec<StateText>,
    /// Names and formulas, in their order.
    #[serde(default)]
    pub lets: Vec<(String, String)>,
    /// Force, N, opposes v > 0.
    pub force: String,
    /// Energy stored in the inner states, J.
    pub energy: Option<String>,
    /// Rate of irreversible slip, m/s.
    pub slip: Option<String>,
    /// Force in steady sliding, N.
    pub steady: Option<String>,
    /// F(-v, -z) = -F(v, z).
    #[serde(default)]
    pub odd: bool,
}

/// An inner state of a custom law.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct StateText {
    /// Its name in formulas.
    pub key: String,
    /// Its name in a trajectory.
    pub name: String,
    /// Its unit in SI.
    pub unit: String,
    /// Absolute error scale, in the unit.
    pub scale: f64,
    /// Bounds within which the rate keeps it.
    #[serde(default)]
    pub bounds: Bounds,
    /// Formula of its derivative by time, in the unit per second.
    pub rate: String,
}
