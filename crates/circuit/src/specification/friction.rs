//! The friction of a drive or rig: a law with its parameters, and what acts on it.

use serde::Deserialize;
use std::collections::BTreeMap;

#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SealPressure {
    #[serde(default)]
    pub coulomb_a: f64,
    #[serde(default)]
    pub coulomb_b: f64,
    #[serde(default)]
    pub breakaway_a: f64,
    #[serde(default)]
    pub breakaway_b: f64,
}

/// How friction grows with the age of the contact.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Growth {
    Saturating,
    Log,
    Hyperbolic,
}

/// See [`physics::friction::Dwell`].
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Dwell {
    pub growth: Growth,
    pub increment_n: f64,
    pub time_s: f64,
    #[serde(default = "kato_exponent")]
    pub exponent: f64,
    pub distance_m: f64,
    /// Per Pa of gauge pressure in chamber a.
    #[serde(default)]
    pub pressure_a: f64,
    #[serde(default)]
    pub pressure_b: f64,
}

fn kato_exponent() -> f64 {
    0.4
}

/// See [`physics::friction::Relaxation`].
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Relaxation {
    pub share: f64,
    pub time_s: f64,
    pub distance_m: f64,
}

/// See [`physics::friction::Heating`]; the surroundings are those of the drive.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Temperature {
    pub reference_k: f64,
    #[serde(default)]
    pub viscous_per_k: f64,
    #[serde(default)]
    pub levels_per_k: f64,
    #[serde(default)]
    pub resistance_k_w: f64,
    pub time_s: f64,
}

/// See [`physics::friction::Wear`].
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Wear {
    #[serde(default)]
    pub run_in: f64,
    pub run_in_distance_m: f64,
    #[serde(default)]
    pub rate_per_m: f64,
    #[serde(default)]
    pub slid_m: f64,
}

#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Harmonic {
    pub period_m: f64,
    pub amplitude: f64,
    #[serde(default)]
    pub phase_rad: f64,
}

/// A factor on friction at a position.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PositionPoint {
    pub position_m: f64,
    pub factor: f64,
}

/// See [`physics::friction::Position`].
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Position {
    /// Positions rise; empty: none.
    #[serde(default)]
    pub table: Vec<PositionPoint>,
    #[serde(default)]
    pub harmonics: Vec<Harmonic>,
    #[serde(default)]
    pub slope_per_m: f64,
    #[serde(default)]
    pub reference_m: f64,
}

/// Factors on the levels for v > 0 and v < 0.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Direction {
    pub positive: f64,
    pub negative: f64,
}

/// A force across the axis and the coefficient of friction of the guide that takes it.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SideLoad {
    pub force_n: f64,
    pub coefficient: f64,
}

/// Shape of the Stribeck curve.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum StribeckShape {
    Gaussian,
    Exponential,
    Lorentzian,
    Free,
}

/// Bounds of a value; at most one for each side.
#[derive(Clone, Copy, Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Bounds {
    #[serde(default)]
    pub above: Option<f64>,
    #[serde(default)]
    pub at_least: Option<f64>,
    #[serde(default)]
    pub below: Option<f64>,
    #[serde(default)]
    pub at_most: Option<f64>,
}

/// A parameter of a law of one's own.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FormulaParameter {
    pub key: String,
    pub unit: String,
    #[serde(default)]
    pub bounds: Bounds,
    #[serde(default)]
    pub default: Option<f64>,
    #[serde(default)]
    pub meaning: String,
}

/// An inner state of a law of one's own.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FormulaState {
    pub key: String,
    pub name: String,
    pub unit: String,
    pub scale: f64,
    #[serde(default)]
    pub bounds: Bounds,
    pub rate: String,
}

/// Which parameters are Fc, Fs and Fv.
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FormulaLevels {
    #[serde(default)]
    pub coulomb: Option<String>,
    #[serde(default)]
    pub breakaway: Option<String>,
    #[serde(default)]
    pub viscous: Option<String>,
}

/// A friction law of one's own: see [`physics::friction::formula::Text`].
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Formula {
    pub name: String,
    #[serde(default)]
    pub title: String,
    /// Key in references.bib, if there is one.
    #[serde(default)]
    pub source: String,
    pub parameters: Vec<FormulaParameter>,
    #[serde(default)]
    pub levels: FormulaLevels,
    #[serde(default)]
    pub states: Vec<FormulaState>,
    /// Name and formula, in their order.
    #[serde(default)]
    pub lets: Vec<(String, String)>,
    pub force: String,
    #[serde(default)]
    pub energy: Option<String>,
    #[serde(default)]
    pub slip: Option<String>,
    #[serde(default)]
    pub steady: Option<String>,
    #[serde(default)]
    pub odd: bool,
}

/// One spring with slider of a law of elements.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SlipElement {
    pub stiffness_n_m: f64,
    /// Of the level of the law.
    pub share: f64,
}

/// How the state of a contact of rate and state evolves.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Evolution {
    Ageing,
    Slip,
}

/// A law with its parameters, and what acts on it.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Friction {
    pub law: String,
    pub parameters: BTreeMap<String, f64>,
    /// A law of one's own, by the name of `law`.
    #[serde(default)]
    pub formula: Option<Formula>,
    /// Absent: that of the exponent.
    #[serde(default)]
    pub stribeck_shape: Option<StribeckShape>,
    /// Empty: those that the law makes of its stiffness.
    #[serde(default)]
    pub elements: Vec<SlipElement>,
    #[serde(default)]
    pub evolution: Option<Evolution>,
    #[serde(default)]
    pub pressure: Option<SealPressure>,
    #[serde(default)]
    pub dwell: Option<Dwell>,
    #[serde(default)]
    pub relaxation: Option<Relaxation>,
    #[serde(default)]
    pub position: Option<Position>,
    #[serde(default)]
    pub direction: Option<Direction>,
    #[serde(default)]
    pub side_load: Option<SideLoad>,
    #[serde(default)]
    pub temperature: Option<Temperature>,
    #[serde(default)]
    pub wear: Option<Wear>,
}

impl Friction {
    /// A law that nothing else acts on.
    pub fn of(law: &str, parameters: BTreeMap<String, f64>) -> Self {
        Friction {
            law: law.into(),
            parameters,
            formula: None,
            stribeck_shape: None,
            elements: Vec::new(),
            evolution: None,
            pressure: None,
            dwell: None,
            relaxation: None,
            position: None,
            direction: None,
            side_load: None,
            temperature: None,
            wear: None,
        }
    }
}
