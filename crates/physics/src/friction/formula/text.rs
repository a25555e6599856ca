use crate::parameter::Bounds;
pub use crate::written::{ParameterText, Problem, Refusal};

/// A law as its author writes it, quantities in SI.
#[derive(Clone, Debug, Default)]
pub struct Text {
    pub name: String,
    pub title: String,
    /// Key in references.bib; empty: none.
    pub source: String,
    pub parameters: Vec<ParameterText>,
    /// Names of the parameters that are Fc, Fs and Fv.
    pub levels: [Option<String>; 3],
    pub states: Vec<StateText>,
    /// Names and formulas, in their order.
    pub lets: Vec<(String, String)>,
    /// N, opposes v > 0.
    pub force: String,
    /// Energy stored in the inner states, J.
    pub energy: Option<String>,
    /// Rate at which the contact slips for good, m/s.
    pub slip: Option<String>,
    /// Force in steady sliding, N.
    pub steady: Option<String>,
    /// F(-v, -z) = -F(v, z).
    pub odd: bool,
}

#[derive(Clone, Debug)]
pub struct StateText {
    /// What formulas call it.
    pub key: String,
    /// What a trajectory calls it.
    pub name: String,
    pub unit: String,
    /// Absolute error scale, in the unit.
    pub scale: f64,
    /// Where the rate keeps it.
    pub bounds: Bounds,
    pub rate: String,
}
