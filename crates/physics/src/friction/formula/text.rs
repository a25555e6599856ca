use crate::parameter::Bounds;
pub use ::formula::Problem;
use std::fmt;

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
pub struct ParameterText {
    pub key: String,
    pub unit: String,
    pub bounds: Bounds,
    pub default: Option<f64>,
    pub meaning: String,
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

/// Why a law of one's own is refused.
#[derive(Clone, Debug)]
pub struct Refusal {
    /// Where: `force`, `let.g`, `states.z.rate`, `parameters.vs.unit`.
    pub key: String,
    /// The formula there, where it is one.
    pub formula: String,
    pub problem: Problem,
}

impl fmt::Display for Refusal {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: {}", self.key, self.problem)?;
        if let Some((line, column, text, caret)) = self.problem.shown(&self.formula) {
            let line = if self.formula.contains('\n') { format!("line {line}, ") } else { String::new() };
            write!(f, " ({line}column {column})\n    {text}\n    {caret}")?;
        }
        if !self.problem.remedy.is_empty() {
            write!(f, "\n    {}", self.problem.remedy)?;
        }
        Ok(())
    }
}
