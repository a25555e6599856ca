//! The friction of a drive or rig: a law with its parameters, and its modifiers.

use physics::friction::formula::Text;
use physics::friction::{Element, Evolution, Growth};
use serde::Deserialize;
use std::collections::BTreeMap;

/// Numbers in SI by their keys.
pub type Numbers = BTreeMap<String, f64>;

/// See [`physics::friction::Dwell`].
#[derive(Clone, Debug, Deserialize)]
pub struct Dwell {
    /// Psi, growth of the increment with the age.
    pub growth: Growth,
    /// Values of its parameters.
    #[serde(flatten)]
    pub numbers: Numbers,
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
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Position {
    /// Positions increase; empty without a table.
    pub table: Vec<PositionPoint>,
    /// Periodic terms.
    pub harmonics: Vec<Numbers>,
    /// Linear trend, 1/m.
    pub slope_per_m: f64,
    /// Position at which the trend is zero, m.
    pub reference_m: f64,
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

/// A law with its parameters and modifiers.
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Friction {
    /// Its key.
    pub law: String,
    /// Values in SI by the keys of its parameters.
    pub parameters: Numbers,
    /// A custom law with the name `law`.
    pub formula: Option<Text>,
    /// Absent: that of the exponent.
    pub stribeck_shape: Option<StribeckShape>,
    /// Empty: the default elements of the law.
    #[serde(default)]
    pub elements: Vec<Element<f64>>,
    /// Evolution of the state of a rate-and-state law; absent: by ageing.
    pub evolution: Option<Evolution>,
    /// Dependence on the pressures in the chambers.
    pub pressure: Option<Numbers>,
    /// Growth with the age of the contact.
    pub dwell: Option<Dwell>,
    /// Relaxation of the bristles.
    pub relaxation: Option<Numbers>,
    /// Dependence on the position along the stroke.
    pub position: Option<Position>,
    /// Dependence on the direction of motion.
    pub direction: Option<Numbers>,
    /// A force across the axis.
    pub side_load: Option<Numbers>,
    /// Dependence on the temperature of the contact.
    pub temperature: Option<Numbers>,
    /// Run-in and wear.
    pub wear: Option<Numbers>,
}
