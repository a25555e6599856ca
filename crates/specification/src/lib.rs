//! Descriptions in SI units, as they arrive from Python: absolute pressures, radians, kelvin.

#![warn(missing_docs)]

mod friction;

pub use friction::*;
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

from_json!(Circuit, ComponentFormula, Drive, Formula, Friction, Tank);

/// The gas of a circuit.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Gas {
    /// Ratio of the heat capacities cp/cv, -.
    pub heat_capacity_ratio: f64,
    /// Specific gas constant, J/(kg K).
    pub gas_constant_j_kg_k: f64,
    /// `None` for an ideal gas.
    #[serde(default)]
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
    /// K.
    pub temperature_k: f64,
}

/// A volume without a piston. Heat passes its whole wall at `heat_transfer_w_k` times the difference of
/// temperatures; the leak goes into the ambient air.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FixedVolume {
    /// m3.
    pub volume_m3: f64,
    /// Conductance of the whole wall, W/K.
    pub heat_transfer_w_k: f64,
    /// Temperature of the wall, K.
    pub wall_temperature_k: f64,
    /// Sonic conductance of the leak, m3/(s Pa); 0: none.
    #[serde(default)]
    pub leakage_m3_s_pa: f64,
}

/// A line from a volume to gas of constant pressure and temperature: a restriction after ISO 6358.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Line {
    /// Sonic conductance, for air, m3/(s Pa).
    pub conductance_m3_s_pa: f64,
    /// Pressure ratio at and below which the flow is choked, -.
    pub critical_pressure_ratio: f64,
    /// Subsonic index, -.
    pub subsonic_index: f64,
    /// Pressure ratio above which the flow is linear, -.
    pub linear_above: f64,
    /// Pressure on the other side, Pa absolute.
    pub pressure_pa: f64,
    /// Temperature on the other side, K.
    pub temperature_k: f64,
}

/// A tank on a line, or a shut tank.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Tank {
    /// The gas in it and around it.
    pub gas: Gas,
    /// The air around, into which it leaks.
    pub ambient: GasState,
    /// The volume.
    pub volume: FixedVolume,
    /// `None`: the tank is shut.
    pub line: Option<Line>,
    /// Numbers of the tube with waves between line and volume.
    #[serde(default)]
    pub tube: Option<BTreeMap<String, f64>>,
}

/// Side of the rod of a cylinder.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum CylinderKind {
    /// No rod.
    Rodless,
    /// A rod through both chambers.
    ThroughRod,
    /// A rod on the side of chamber b.
    SingleRod,
}

/// The balance that chambers obey: see `circuit::ChamberLaw`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum ChamberLawName {
    /// Balance of mass and energy.
    #[default]
    EnergyBalance,
    /// Balance of the source paper; only for reproducing the paper.
    AsPrinted,
}

/// End stops; missing values follow from the drive.
#[derive(Clone, Copy, Debug, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct EndStop {
    /// Stiffness, N/m.
    pub stiffness_n_m: Option<f64>,
    /// Damping at full depth, N s/m.
    pub damping_n_s_m: Option<f64>,
    /// Depth from which the damper acts fully, m.
    pub damping_depth_m: Option<f64>,
}

/// A double-acting cylinder.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Cylinder {
    /// Side of the rod.
    pub kind: CylinderKind,
    /// Diameter of the bore, m.
    pub bore_m: f64,
    /// Diameter of the rod, m.
    #[serde(default)]
    pub rod_diameter_m: f64,
    /// Stroke, m.
    pub stroke_m: f64,
    /// Volume of chamber a at x = 0, port and line included, m3.
    pub dead_volume_a_m3: f64,
    /// Volume of chamber b at the end of the stroke, port and line included, m3.
    pub dead_volume_b_m3: f64,
    /// Mass of piston, rod and carriage, kg.
    pub moving_mass_kg: f64,
    /// Incline of the axis, rad; positive: x points up.
    #[serde(default)]
    pub incline_rad: f64,
    /// Heat-transfer coefficient to the wall, W/(m2 K).
    pub heat_transfer_w_m2_k: f64,
    /// Temperature of the wall, K.
    pub wall_temperature_k: f64,
    /// End stops at both ends of the stroke.
    #[serde(default)]
    pub end_stop: EndStop,
    /// Sonic conductance of the leak past the piston, m3/(s Pa); 0: none.
    #[serde(default)]
    pub leakage_m3_s_pa: f64,
    /// The balance that both chambers obey.
    #[serde(default)]
    pub chamber_law: ChamberLawName,
}

/// The valve of a drive, by its kind.
#[derive(Clone, Debug, Deserialize)]
#[serde(tag = "kind", rename_all = "kebab-case")]
pub enum Valve {
    /// A proportional 5/3 valve.
    #[serde(rename = "proportional-5/3")]
    Proportional53(ProportionalValve),
}

/// The flow through each edge of a proportional valve, by ISO 6358.
#[derive(Clone, Debug, Deserialize)]
pub struct ProportionalValve {
    /// Sonic conductance of an edge that is fully open, for air, m3/(s Pa).
    pub conductance_m3_s_pa: f64,
    /// Pressure ratio at and below which the flow is choked, -.
    pub critical_pressure_ratio: f64,
    /// Subsonic index, -.
    pub subsonic_index: f64,
    /// Pressure ratio above which the flow is linear, -.
    pub linear_above: f64,
}

/// A spring between the load and the frame.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LoadSpring {
    /// Stiffness, N/m.
    pub stiffness_n_m: f64,
    /// Position without force, m.
    pub rest_position_m: f64,
}

/// The load of a cylinder.
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Load {
    /// Mass, kg.
    #[serde(default)]
    pub mass_kg: f64,
    /// External force in +x, N.
    #[serde(default)]
    pub force_n: f64,
    /// `None`: no spring acts on the load.
    #[serde(default)]
    pub spring: Option<LoadSpring>,
}

/// A double-acting drive on a 5/3 proportional valve.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Drive {
    /// The gas of the drive, its supply and the ambient.
    pub gas: Gas,
    /// The ambient air, into which the exhaust flows.
    pub ambient: GasState,
    /// The supply of the valve.
    pub supply: GasState,
    /// The cylinder.
    pub cylinder: Cylinder,
    /// The valve between the chambers, supply and exhaust.
    pub valve: Valve,
    /// Friction of the moving mass.
    pub friction: Friction,
    /// The load.
    #[serde(default)]
    pub load: Load,
}

/// The start of a drive.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Initial {
    /// m.
    pub position_m: f64,
    /// m/s.
    #[serde(default)]
    pub velocity_m_s: f64,
    /// Pa absolute.
    pub pressure_a_pa: f64,
    /// Pa absolute.
    pub pressure_b_pa: f64,
    /// K.
    pub temperature_a_k: f64,
    /// K.
    pub temperature_b_k: f64,
    /// Time for which the contact has been at rest, s; for friction with an age.
    #[serde(default)]
    pub contact_age_s: f64,
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
    pub numbers: BTreeMap<String, f64>,
    /// Options by the names of the choices; default: the first option.
    #[serde(default)]
    pub choices: BTreeMap<String, String>,
    /// Friction, if its kind has any.
    #[serde(default)]
    pub friction: Option<Friction>,
    /// Formula, if its kind takes one.
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
    /// Its name in messages and tables.
    pub name: String,
    /// Its name for people.
    #[serde(default)]
    pub title: String,
    /// Key in references.bib, if there is one.
    #[serde(default)]
    pub source: String,
    /// Its parameters, in their order.
    pub parameters: Vec<FormulaParameter>,
    /// Name and formula, in their order.
    #[serde(default)]
    pub lets: Vec<(String, String)>,
    /// The formula itself.
    pub output: String,
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
