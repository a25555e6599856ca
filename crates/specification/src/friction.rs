//! The friction of a drive or rig: a law with its parameters, and its modifiers.

use serde::Deserialize;
use std::collections::BTreeMap;

/// See [`physics::friction::SealLips`].
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SealPressure {
    /// Coulomb force per gauge pressure in chamber a, N/Pa.
    #[serde(default)]
    pub coulomb_a: f64,
    /// Coulomb force per gauge pressure in chamber b, N/Pa.
    #[serde(default)]
    pub coulomb_b: f64,
    /// Breakaway force per gauge pressure in chamber a, N/Pa.
    #[serde(default)]
    pub breakaway_a: f64,
    /// Breakaway force per gauge pressure in chamber b, N/Pa.
    #[serde(default)]
    pub breakaway_b: f64,
}

/// Growth of friction with the age of the contact.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Growth {
    /// See [`physics::friction::Growth::Saturating`].
    Saturating,
    /// See [`physics::friction::Growth::Logarithmic`].
    Log,
    /// See [`physics::friction::Growth::Hyperbolic`].
    Hyperbolic,
}

/// See [`physics::friction::Dwell`].
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Dwell {
    /// Psi, growth of the increment with the age.
    pub growth: Growth,
    /// Increment b0, N.
    pub increment_n: f64,
    /// Time tau of the growth, s.
    pub time_s: f64,
    /// Exponent m of the saturating growth, -.
    #[serde(default = "kato_exponent")]
    pub exponent: f64,
    /// Sliding distance that renews the contact, m.
    pub distance_m: f64,
    /// Relative growth of the increment with the gauge pressure in chamber a, 1/Pa.
    #[serde(default)]
    pub pressure_a: f64,
    /// Relative growth of the increment with the gauge pressure in chamber b, 1/Pa.
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
    /// Fraction of the elastic force that relaxes, -.
    pub share: f64,
    /// Time constant, s.
    pub time_s: f64,
    /// Sliding distance that renews the bristles, m.
    pub distance_m: f64,
}

/// See [`physics::friction::Heating`]; the surroundings are those of the drive.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Temperature {
    /// Temperature at which the law's parameters hold, K.
    pub reference_k: f64,
    /// Decrease of the viscous coefficient, 1/K.
    #[serde(default)]
    pub viscous_per_k: f64,
    /// Relative change of Coulomb and breakaway force, 1/K.
    #[serde(default)]
    pub levels_per_k: f64,
    /// Thermal resistance from the contact to its surroundings, K/W.
    #[serde(default)]
    pub resistance_k_w: f64,
    /// Time constant of warming, s.
    pub time_s: f64,
}

/// See [`physics::friction::Wear`].
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Wear {
    /// Additional fraction of friction of a new seal, -.
    #[serde(default)]
    pub run_in: f64,
    /// Sliding distance of the run-in, m.
    pub run_in_distance_m: f64,
    /// Relative change of friction for each distance slid, 1/m.
    #[serde(default)]
    pub rate_per_m: f64,
    /// Distance slid before the start, m.
    #[serde(default)]
    pub slid_m: f64,
}

/// See [`physics::friction::Harmonic`].
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Harmonic {
    /// Period, m.
    pub period_m: f64,
    /// Fraction of the levels, -.
    pub amplitude: f64,
    /// Phase at the reference position, rad.
    #[serde(default)]
    pub phase_rad: f64,
}

/// A factor on friction at a position.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PositionPoint {
    /// Position, m.
    pub position_m: f64,
    /// Factor on the levels, -.
    pub factor: f64,
}

/// See [`physics::friction::Position`].
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Position {
    /// Positions increase; empty without a table.
    #[serde(default)]
    pub table: Vec<PositionPoint>,
    /// Periodic terms.
    #[serde(default)]
    pub harmonics: Vec<Harmonic>,
    /// Linear trend, 1/m.
    #[serde(default)]
    pub slope_per_m: f64,
    /// Position at which the trend is zero, m.
    #[serde(default)]
    pub reference_m: f64,
}

/// Factors on the levels for v > 0 and v < 0.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Direction {
    /// For v > 0, -.
    pub positive: f64,
    /// For v < 0, -.
    pub negative: f64,
}

/// A force across the axis, and the coefficient of friction of the guide that carries it.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SideLoad {
    /// Force across the axis, N.
    pub force_n: f64,
    /// Coefficient of friction of the guide, -.
    pub coefficient: f64,
}

/// Shape of the Stribeck curve.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum StribeckShape {
    /// A square: exp(-(v/vs)^2).
    Gaussian,
    /// No power: exp(-|v/vs|).
    Exponential,
    /// 1/(1 + (v/vs)^2).
    Lorentzian,
    /// exp(-|v/vs|^n), with the exponent n of the law.
    Free,
}

/// Bounds of a value; at most one for each side.
#[derive(Clone, Copy, Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Bounds {
    /// It is greater than this.
    #[serde(default)]
    pub above: Option<f64>,
    /// It is not less than this.
    #[serde(default)]
    pub at_least: Option<f64>,
    /// It is less than this.
    #[serde(default)]
    pub below: Option<f64>,
    /// It is not more than this.
    #[serde(default)]
    pub at_most: Option<f64>,
}

/// A parameter of a custom law.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FormulaParameter {
    /// Its name in formulas.
    pub key: String,
    /// Its unit in SI; `-` for a pure number.
    pub unit: String,
    /// The values that it may take, in the unit.
    #[serde(default)]
    pub bounds: Bounds,
    /// Default value, if there is one.
    #[serde(default)]
    pub default: Option<f64>,
    /// Its meaning, in words.
    #[serde(default)]
    pub meaning: String,
}

/// An inner state of a custom law.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FormulaState {
    /// Its name in formulas.
    pub key: String,
    /// Its name in a trajectory.
    pub name: String,
    /// Its unit in SI.
    pub unit: String,
    /// Absolute error scale, in the unit.
    pub scale: f64,
    /// Bounds within which the rate keeps it, in the unit.
    #[serde(default)]
    pub bounds: Bounds,
    /// Formula of its derivative by time, in the unit per second.
    pub rate: String,
}

/// Parameters that are Fc, Fs and Fv.
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FormulaLevels {
    /// Name of the parameter that is Fc.
    #[serde(default)]
    pub coulomb: Option<String>,
    /// Name of the parameter that is Fs.
    #[serde(default)]
    pub breakaway: Option<String>,
    /// Name of the parameter that is Fv.
    #[serde(default)]
    pub viscous: Option<String>,
}

/// A custom friction law: see [`physics::friction::formula::Text`].
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Formula {
    /// Its name in messages and tables.
    pub name: String,
    /// Title for users.
    #[serde(default)]
    pub title: String,
    /// Key in references.bib, if there is one.
    #[serde(default)]
    pub source: String,
    /// Its parameters, in their order.
    pub parameters: Vec<FormulaParameter>,
    /// Parameters that modifiers change.
    #[serde(default)]
    pub levels: FormulaLevels,
    /// Its inner states, in their order.
    #[serde(default)]
    pub states: Vec<FormulaState>,
    /// Name and formula, in their order.
    #[serde(default)]
    pub lets: Vec<(String, String)>,
    /// Formula of the friction force, N, positive where it opposes v > 0.
    pub force: String,
    /// Formula of the energy stored in the inner states, J.
    #[serde(default)]
    pub energy: Option<String>,
    /// Formula of the rate of irreversible slip, m/s.
    #[serde(default)]
    pub slip: Option<String>,
    /// Formula of the force in steady sliding, N.
    #[serde(default)]
    pub steady: Option<String>,
    /// F(-v, -z) = -F(v, z).
    #[serde(default)]
    pub odd: bool,
}

/// One spring with slider of a law of elements.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SlipElement {
    /// Stiffness of the spring, N/m.
    pub stiffness_n_m: f64,
    /// Fraction of the level of the law.
    pub share: f64,
}

/// Evolution of the state of a rate-and-state contact.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Evolution {
    /// See [`physics::friction::Evolution::Ageing`].
    Ageing,
    /// See [`physics::friction::Evolution::Slip`].
    Slip,
}

/// A law with its parameters and modifiers.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Friction {
    /// Its key.
    pub law: String,
    /// Values in SI by the keys of its parameters.
    pub parameters: BTreeMap<String, f64>,
    /// A custom law with the name `law`.
    #[serde(default)]
    pub formula: Option<Formula>,
    /// Absent: that of the exponent.
    #[serde(default)]
    pub stribeck_shape: Option<StribeckShape>,
    /// Empty: the default elements of the law.
    #[serde(default)]
    pub elements: Vec<SlipElement>,
    /// Evolution of the state of a rate-and-state law; absent: by ageing.
    #[serde(default)]
    pub evolution: Option<Evolution>,
    /// Dependence on the pressures in the chambers.
    #[serde(default)]
    pub pressure: Option<SealPressure>,
    /// Growth with the age of the contact.
    #[serde(default)]
    pub dwell: Option<Dwell>,
    /// Relaxation of the bristles.
    #[serde(default)]
    pub relaxation: Option<Relaxation>,
    /// Dependence on the position along the stroke.
    #[serde(default)]
    pub position: Option<Position>,
    /// Dependence on the direction of motion.
    #[serde(default)]
    pub direction: Option<Direction>,
    /// A force across the axis.
    #[serde(default)]
    pub side_load: Option<SideLoad>,
    /// Dependence on the temperature of the contact.
    #[serde(default)]
    pub temperature: Option<Temperature>,
    /// Run-in and wear.
    #[serde(default)]
    pub wear: Option<Wear>,
}

impl Friction {
    /// A law without modifiers.
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
