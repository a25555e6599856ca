//! Descriptions in SI units, as they arrive from Python: absolute pressures, radians, kelvin.

use serde::Deserialize;
use std::collections::BTreeMap;

#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Gas {
    pub heat_capacity_ratio: f64,
    pub gas_constant_j_kg_k: f64,
}

/// Pressure and temperature of ambient or supply.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct GasState {
    pub pressure_pa: f64,
    pub temperature_k: f64,
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

#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct EndStop {
    pub stiffness_n_m: f64,
    pub damping_n_s_m: f64,
    pub damping_depth_m: f64,
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
    pub end_stop: EndStop,
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

#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Friction {
    pub law: String,
    pub parameters: BTreeMap<String, f64>,
    #[serde(default)]
    pub pressure: Option<SealPressure>,
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

/// A friction rig: a servo drags the piston through a force sensor, both chambers at held pressure.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Rig {
    pub friction: Friction,
    pub area_a_m2: f64,
    pub area_b_m2: f64,
    pub moving_mass_kg: f64,
    pub ambient_pressure_pa: f64,
    pub pressure_a_pa: f64,
    pub pressure_b_pa: f64,
    pub stroke_m: f64,
    #[serde(default)]
    pub incline_rad: f64,
    pub sensor_stiffness_n_m: f64,
    pub sensor_damping_n_s_m: f64,
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
}
