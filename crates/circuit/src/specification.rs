//! Descriptions in SI units, as they arrive from Python: absolute pressures, radians, kelvin.

mod friction;

pub use friction::*;
use serde::Deserialize;
use std::collections::BTreeMap;

#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Gas {
    pub heat_capacity_ratio: f64,
    pub gas_constant_j_kg_k: f64,
    /// An ideal gas has none.
    #[serde(default)]
    pub virial: Option<Virial>,
}

/// The second virial coefficient a - b exp(c/T).
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Virial {
    pub a_m3_kg: f64,
    pub b_m3_kg: f64,
    pub c_k: f64,
}

/// Pressure and temperature of ambient or supply.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct GasState {
    pub pressure_pa: f64,
    pub temperature_k: f64,
}

/// A volume without a piston. Heat passes its whole wall at `heat_transfer_w_k` times the difference of
/// temperatures; the leak goes into the ambient air.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FixedVolume {
    pub volume_m3: f64,
    pub heat_transfer_w_k: f64,
    pub wall_temperature_k: f64,
    #[serde(default)]
    pub leakage_m3_s_pa: f64,
}

/// What joins a volume to gas of constant pressure and temperature: a restriction after ISO 6358.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Line {
    pub conductance_m3_s_pa: f64,
    pub critical_pressure_ratio: f64,
    pub subsonic_index: f64,
    pub linear_above: f64,
    pub pressure_pa: f64,
    pub temperature_k: f64,
}

/// A tank on a line, or one that is shut where there is none.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Tank {
    pub gas: Gas,
    pub ambient: GasState,
    pub volume: FixedVolume,
    pub line: Option<Line>,
    /// Numbers of the tube with waves between line and volume.
    #[serde(default)]
    pub tube: Option<BTreeMap<String, f64>>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum CylinderKind {
    Rodless,
    ThroughRod,
    SingleRod,
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum ChamberLawName {
    #[default]
    EnergyBalance,
    AsPrinted,
}

/// What is left out follows from the drive.
#[derive(Clone, Copy, Debug, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct EndStop {
    pub stiffness_n_m: Option<f64>,
    pub damping_n_s_m: Option<f64>,
    pub damping_depth_m: Option<f64>,
}

#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Cylinder {
    pub kind: CylinderKind,
    pub bore_m: f64,
    #[serde(default)]
    pub rod_diameter_m: f64,
    pub stroke_m: f64,
    pub dead_volume_a_m3: f64,
    pub dead_volume_b_m3: f64,
    pub moving_mass_kg: f64,
    #[serde(default)]
    pub incline_rad: f64,
    pub heat_transfer_w_m2_k: f64,
    pub wall_temperature_k: f64,
    #[serde(default)]
    pub end_stop: EndStop,
    /// Leakage past the piston.
    #[serde(default)]
    pub leakage_m3_s_pa: f64,
    #[serde(default)]
    pub chamber_law: ChamberLawName,
}

#[derive(Clone, Debug, Deserialize)]
#[serde(tag = "kind", rename_all = "kebab-case")]
pub enum Valve {
    #[serde(rename = "proportional-5/3")]
    Proportional53(ProportionalValve),
}

#[derive(Clone, Debug, Deserialize)]
pub struct ProportionalValve {
    pub conductance_m3_s_pa: f64,
    pub critical_pressure_ratio: f64,
    pub subsonic_index: f64,
    pub linear_above: f64,
}

#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LoadSpring {
    pub stiffness_n_m: f64,
    pub rest_position_m: f64,
}

#[derive(Clone, Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Load {
    #[serde(default)]
    pub mass_kg: f64,
    #[serde(default)]
    pub force_n: f64,
    #[serde(default)]
    pub spring: Option<LoadSpring>,
}

/// A double-acting drive on a 5/3 proportional valve.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Drive {
    pub gas: Gas,
    pub ambient: GasState,
    pub supply: GasState,
    pub cylinder: Cylinder,
    pub valve: Valve,
    pub friction: Friction,
    #[serde(default)]
    pub load: Load,
}

/// Where a drive starts.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Initial {
    pub position_m: f64,
    #[serde(default)]
    pub velocity_m_s: f64,
    pub pressure_a_pa: f64,
    pub pressure_b_pa: f64,
    pub temperature_a_k: f64,
    pub temperature_b_k: f64,
    /// For how long the contact has stood; for friction that remembers it.
    #[serde(default)]
    pub contact_age_s: f64,
}

/// A component of a circuit: its numbers by the names of its kind's parameters, in SI units.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Component {
    pub name: String,
    pub kind: String,
    #[serde(default)]
    pub numbers: BTreeMap<String, f64>,
    #[serde(default)]
    pub choices: BTreeMap<String, String>,
    #[serde(default)]
    pub friction: Option<Friction>,
    #[serde(default)]
    pub formula: Option<ComponentFormula>,
    /// Rows of numbers in the order of the kind's columns.
    #[serde(default)]
    pub points: Option<Vec<Vec<f64>>>,
}

/// A formula of a component: see [`physics::written::Text`].
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ComponentFormula {
    pub name: String,
    #[serde(default)]
    pub title: String,
    /// Key in references.bib, if there is one.
    #[serde(default)]
    pub source: String,
    pub parameters: Vec<FormulaParameter>,
    /// Name and formula, in their order.
    #[serde(default)]
    pub lets: Vec<(String, String)>,
    /// What its kind asks for.
    pub output: String,
}

/// Components, and the ports that are joined: "valve.4", or "ambient".
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Circuit {
    pub gas: Gas,
    pub ambient: GasState,
    pub components: Vec<Component>,
    pub joints: Vec<Vec<String>>,
    #[serde(default)]
    pub junctions: Junctions,
}

/// What becomes of a joint of two restrictions and nothing else.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Junctions {
    /// It has the volume of its ports.
    #[default]
    Volume,
    /// It has none: the restrictions are merged.
    Series,
}
