//! Descriptions in SI units, as they arrive from Python: absolute pressures, radians, kelvin.

#![warn(missing_docs)]

mod friction;

pub use friction::*;
use physics::friction::formula::Text as FrictionFormula;
use physics::written::Text as ComponentFormula;
use serde::{Deserialize, Deserializer, de::Error};
use std::collections::BTreeMap;

/// A description that can be read from JSON. Each crate uses this trait instead of `serde_json::from_str`, which would
/// be compiled again in each calling crate. This crate is optimised for size.
pub trait FromJson: Sized {
    /// Error in JSON.
    ///
    /// # Errors
    /// It is not JSON, or of another form.
    fn from_json(json: &str) -> serde_json::Result<Self>;
}

/// Implements the reading of descriptions in this crate; see [`FromJson`].
#[macro_export]
macro_rules! from_json {
    ($($table:ty),*) => {
        $(impl $crate::FromJson for $table {
            fn from_json(json: &str) -> $crate::serde_json::Result<Self> {
                $crate::serde_json::from_str(json)
            }
        })*
    };
}
pub use serde_json;

/// Reads a nested description in the same way.
///
/// # Errors
/// It is of another form.
pub fn within<'a, D: Deserializer<'a>, T: FromJson>(table: D) -> Result<T, D::Error> {
    T::from_json(&serde_json::Value::deserialize(table)?.to_string()).map_err(D::Error::custom)
}

from_json!(Circuit, ComponentFormula, FrictionFormula, Friction);

/// The gas of a circuit.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Gas {
    /// Ratio of the heat capacities cp/cv, -.
    pub heat_capacity_ratio: f64,
    /// Specific gas constant, J/(kg K).
    pub gas_constant_j_kg_k: f64,
    /// `None` for an ideal gas.
    pub virial: Option<Virial>,
}

/// The second virial coefficient a - b exp(c/T).
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Virial {
    /// Number a, m3/kg.
    pub a_m3_kg: f64,
    /// Number b, m3/kg.
    pub b_m3_kg: f64,
    /// Number c, K.
    pub c_k: f64,
}

/// Pressure and temperature of ambient or supply.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct GasState {
    /// Pa absolute.
    pub pressure_pa: f64,
    /// Temperature, K.
    pub temperature_k: f64,
}

/// A component of a circuit: its numbers by the names of its kind's parameters, in SI units.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Component {
    /// Name in the circuit; names of joints and columns contain it.
    pub name: String,
    /// Key of its kind.
    pub kind: String,
    /// Values in SI by the keys of the parameters.
    #[serde(default)]
    pub numbers: Numbers,
    /// Options by the names of the choices; default: the first option.
    #[serde(default)]
    pub choices: BTreeMap<String, String>,
    /// Friction, if its kind has any.
    pub friction: Option<Friction>,
    /// Formula, if its kind takes one.
    pub formula: Option<ComponentFormula>,
    /// Rows of numbers in the order of the kind's columns.
    pub points: Option<Vec<Vec<f64>>>,
}

/// Components, and the ports that are joined: "valve.4", or "ambient".
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Circuit {
    /// The gas in the whole circuit.
    pub gas: Gas,
    /// The air around, into which open exhausts and leaks go.
    pub ambient: GasState,
    /// Its components.
    pub components: Vec<Component>,
    /// The joined ports of each joint.
    pub joints: Vec<Vec<String>>,
    /// Treatment of joints of two restrictions.
    #[serde(default)]
    pub junctions: Junctions,
}

/// Treatment of a joint of two restrictions only.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Junctions {
    /// The joint has the volume of its ports.
    #[default]
    Volume,
    /// The joint has no volume: the restrictions are merged.
    Series,
}
