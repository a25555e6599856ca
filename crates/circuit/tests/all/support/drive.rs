//! A drive in its written form, as in a drive file, and the circuit that it stands for.

use circuit::specification::{Circuit, Friction, Gas, GasState};
use circuit::{Assembly, Driven, Error, Look, Names, Network, Run, Session, Shooting, Shot};
use ode::{Options, Output};
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value, json};
use std::sync::Arc;

/// Side of the rod of a cylinder.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum CylinderKind {
    Rodless,
    ThroughRod,
    SingleRod,
}

/// The balance that chambers obey: see `circuit::ChamberLaw`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum ChamberLawName {
    #[default]
    EnergyBalance,
    AsPrinted,
}

/// End stops; missing values follow from the drive.
#[derive(Clone, Copy, Debug, Default, Deserialize, Serialize)]
#[serde(deny_unknown_fields, default)]
pub struct EndStop {
    pub stiffness_n_m: Option<f64>,
    pub damping_n_s_m: Option<f64>,
    pub damping_depth_m: Option<f64>,
}

/// A double-acting cylinder.
#[derive(Clone, Debug, Deserialize, Serialize)]
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
    #[serde(default)]
    pub leakage_m3_s_pa: f64,
    #[serde(default)]
    pub chamber_law: ChamberLawName,
}

/// The valve of a drive, by its kind.
#[derive(Clone, Debug, Deserialize, Serialize)]
#[serde(tag = "kind", rename_all = "kebab-case")]
pub enum Valve {
    #[serde(rename = "proportional-5/3")]
    Proportional53(ProportionalValve),
}

/// The flow through each edge of a proportional valve, by ISO 6358.
#[derive(Clone, Debug, Deserialize, Serialize)]
pub struct ProportionalValve {
    pub conductance_m3_s_pa: f64,
    pub critical_pressure_ratio: f64,
    pub subsonic_index: f64,
    pub linear_above: f64,
}

/// A spring between the load and the frame.
#[derive(Clone, Copy, Debug, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct LoadSpring {
    pub stiffness_n_m: f64,
    pub rest_position_m: f64,
}

/// The load of a cylinder.
#[derive(Clone, Debug, Default, Deserialize, Serialize)]
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
pub struct Spec {
    pub gas: Gas,
    pub ambient: GasState,
    pub supply: GasState,
    pub cylinder: Cylinder,
    pub valve: Valve,
    pub friction: Friction,
    #[serde(default)]
    pub load: Load,
}

/// The start of a drive.
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
    #[serde(default)]
    pub contact_age_s: f64,
}

/// Names of a drive and those of its circuit, as in `python/pneudrive/describe/system.py`.
const NAMES: [(&str, &str); 24] = [
    ("time_s", "time_s"),
    ("position_m", "cylinder.position_m"),
    ("velocity_m_s", "cylinder.velocity_m_s"),
    ("acceleration_m_s2", "cylinder.acceleration_m_s2"),
    ("pressure_a_pa", "cylinder.a.pressure_pa"),
    ("temperature_a_k", "cylinder.a.temperature_k"),
    ("pressure_b_pa", "cylinder.b.pressure_pa"),
    ("temperature_b_k", "cylinder.b.temperature_k"),
    ("friction_force_n", "cylinder.friction_force_n"),
    ("end_stop_force_n", "cylinder.end_stop_force_n"),
    ("command", "valve.command"),
    ("mass_flow_a_kg_s", "cylinder.a.mass_flow_kg_s"),
    ("mass_flow_b_kg_s", "cylinder.b.mass_flow_kg_s"),
    ("opening_supply_a", "valve.opening_1_4"),
    ("opening_a_exhaust", "valve.opening_4_5"),
    ("opening_supply_b", "valve.opening_1_2"),
    ("opening_b_exhaust", "valve.opening_2_3"),
    ("load_force_n", "cylinder.load_force_n"),
    ("supply_pressure_pa", "supply.pressure_pa"),
    ("supply_temperature_k", "supply.temperature_k"),
    ("mass_a_kg", "cylinder.a.mass_kg"),
    ("internal_energy_a_j", "cylinder.a.internal_energy_j"),
    ("mass_b_kg", "cylinder.b.mass_kg"),
    ("internal_energy_b_j", "cylinder.b.internal_energy_j"),
];
const UNITS: [&str; 11] =
    ["_m3_s_pa", "_w_m2_k", "_n_s_m", "_n_m", "_rad", "_m3", "_kg", "_pa", "_k", "_m", "_n"];

/// The table of names of a drive.
pub fn names() -> Arc<Names> {
    let table = NAMES.map(|(short, full)| (short.into(), full.into())).to_vec();
    Arc::new(Names { of: "cylinder".into(), table, only: true })
}

fn without_unit(key: &str) -> &str {
    UNITS.iter().find_map(|unit| key.strip_suffix(unit)).unwrap_or(key)
}

/// The circuit of a drive, both as JSON.
pub fn expand(drive: &Value) -> Value {
    let numbers = |table: &Value, prefix: &str| -> Map<String, Value> {
        let each = table.as_object().into_iter().flatten();
        let each = each.filter(|(_, value)| value.is_number());
        each.map(|(key, value)| (format!("{prefix}{}", without_unit(key)), value.clone())).collect()
    };
    let (cylinder, valve, load) = (&drive["cylinder"], &drive["valve"], &drive["load"]);
    let mut own = numbers(cylinder, "");
    own.extend(numbers(&cylinder["end_stop"], "end_stop_"));
    let kind = |table: &Value| table["kind"].as_str().unwrap_or("none").to_string();
    let law = cylinder["chamber_law"].as_str().unwrap_or("energy-balance");
    let mut components = vec![
        json!({ "name": "supply", "kind": "reservoir", "numbers": numbers(&drive["supply"], "") }),
        json!({ "name": "valve", "kind": format!("valve/{}", kind(valve)), "numbers": numbers(valve, "") }),
        json!({
            "name": "cylinder",
            "kind": format!("cylinder/{}", kind(cylinder)),
            "numbers": own,
            "choices": { "chamber_law": law },
            "friction": drive["friction"],
        }),
        json!({ "name": "load", "kind": "load", "numbers": numbers(load, "") }),
    ];
    let mut rod = vec!["cylinder.rod", "load.1"];
    if load["spring"].is_object() {
        components
            .push(json!({ "name": "spring", "kind": "spring", "numbers": numbers(&load["spring"], "") }));
        rod.push("spring.1");
    }
    json!({
        "gas": drive["gas"],
        "ambient": drive["ambient"],
        "components": components,
        "joints": [["supply.1", "valve.1"], ["valve.4", "cylinder.a"], ["valve.2", "cylinder.b"], rod],
    })
}

/// The name of a number of a drive in its circuit: "cylinder.bore_m" is "cylinder.bore".
pub fn number(name: &str) -> String {
    if name.starts_with("friction.") {
        return format!("cylinder.{name}");
    }
    if name.starts_with("ambient.") || name.starts_with("gas.") {
        return name.into();
    }
    let name = name.replace("load.spring.", "spring.").replace(".end_stop.", ".end_stop_");
    without_unit(&name).into()
}

impl Spec {
    /// The circuit that it stands for.
    pub fn circuit(&self) -> Circuit {
        let drive = json!({
            "gas": { "heat_capacity_ratio": 1.4, "gas_constant_j_kg_k": 287.05 },
            "ambient": { "pressure_pa": self.ambient.pressure_pa, "temperature_k": self.ambient.temperature_k },
            "supply": { "pressure_pa": self.supply.pressure_pa, "temperature_k": self.supply.temperature_k },
            "cylinder": self.cylinder,
            "valve": self.valve,
            "load": self.load,
            "friction": null,
        });
        let mut circuit: Circuit = serde_json::from_value(expand(&drive)).expect("a circuit");
        circuit.gas = self.gas.clone();
        circuit.components[2].friction = Some(self.friction.clone());
        circuit
    }
}

/// A drive as a circuit under the names of a drive.
#[derive(Clone, Debug)]
pub struct Drive(Network);

impl Drive {
    pub fn assemble(spec: &Spec, ledger: bool) -> Result<Self, Error> {
        Network::called(&spec.circuit(), ledger, names()).map(Drive)
    }

    pub fn assembly(&self) -> &Assembly {
        &self.0.assembly
    }

    pub fn columns(&self) -> &[String] {
        self.assembly().columns()
    }

    pub fn n_states(&self) -> usize {
        self.assembly().circuit.n_states()
    }

    /// The axis of the piston.
    pub fn axis(&self) -> circuit::AxisId {
        let starts = &self.assembly().variables.starts;
        let axis = starts.iter().find_map(|(own, _)| match own {
            circuit::Starting::Axis(axis) => Some(*axis),
            _ => None,
        });
        axis.expect("a piston")
    }

    pub fn warnings(&self) -> &[String] {
        &self.0.warnings
    }

    pub fn start_names(&self) -> Vec<String> {
        self.assembly().start_names()
    }

    pub fn driven(&self) -> Result<Driven<'_>, Error> {
        self.0.driven()
    }

    pub fn set_command<R: math::Lane>(&self, circuit: &mut circuit::Circuit<R>, lane: usize, u: R) {
        self.assembly().set(circuit, 0, lane, u);
    }

    /// The equations and their state at `initial` with the command `u`.
    pub fn start(&self, initial: &Initial, u: f64) -> (circuit::Circuit<f64>, Vec<f64>) {
        let mut circuit = circuit::Circuit::clone(&self.assembly().circuit);
        self.set_command(&mut circuit, 0, u);
        let start = [
            initial.position_m,
            initial.velocity_m_s,
            initial.pressure_a_pa,
            initial.temperature_a_k,
            initial.pressure_b_pa,
            initial.temperature_b_k,
        ];
        self.assembly().stand_in(circuit, &[], &start, initial.contact_age_s)
    }

    pub fn session(&self, initial: &Initial, options: Options) -> Session {
        Session::new(self.assembly(), 0.0, self.start(initial, 0.0), options)
    }

    /// A session under commands, each constant from its time to the next.
    pub fn planned(
        &self,
        (times, commands): (&[f64], &[f64]),
        duration: f64,
        initial: &Initial,
        options: Options,
    ) -> Session {
        let mut session = Session::new(self.assembly(), 0.0, self.start(initial, commands[0]), options);
        let each = times.iter().copied().zip(commands.iter().copied());
        session.plan(0, each.filter(|(time, _)| 0.0 < *time && *time < duration));
        session
    }

    pub fn simulate(
        &self,
        times: &[f64],
        commands: &[f64],
        (duration, rate): (f64, f64),
        initial: &Initial,
        options: Options,
        interrupted: &mut dyn FnMut(f64) -> bool,
    ) -> Result<Run, Error> {
        let mut session = self.planned((times, commands), duration, initial, options);
        let columns: Vec<usize> = (0..self.columns().len()).collect();
        session.record(duration, circuit::sample_times(duration, rate), &columns, &mut Look::new(interrupted))
    }

    /// Segments with derivatives; `json` is this drive.
    pub fn shoot(
        &self,
        json: &str,
        asked: &Shooting,
        interrupted: &mut dyn FnMut(f64) -> bool,
    ) -> Result<Shot, Error> {
        let circuit = expand(&serde_json::from_str(json).expect("JSON")).to_string();
        let parameters = asked.parameters.iter().map(|name| number(name)).collect();
        self.0.shoot(&circuit, &Shooting { parameters, ..asked.clone() }, interrupted)
    }
}

/// The plan of one input.
pub fn plan(input: &str, times: Vec<f64>, values: Vec<f64>) -> Vec<circuit::InputPlan> {
    vec![circuit::InputPlan { input: input.into(), times, values }]
}

/// Keeps the states at times, row by row.
struct Kept {
    times: Vec<f64>,
    rows: Vec<Vec<f64>>,
}

impl Output<f64, circuit::Circuit<f64>> for Kept {
    fn due(&self, _lane: usize) -> f64 {
        self.times.get(self.rows.len()).copied().unwrap_or(f64::INFINITY)
    }

    fn sample(&mut self, _lane: usize, _t: f64, y: &[f64], _circuit: &circuit::Circuit<f64>) {
        self.rows.push(y.to_vec());
    }
}

/// The integrated states of a session, one row after the other: x, v, m_a, U_a, m_b, U_b and inner states. The last
/// rows are those at the end.
pub fn states(mut session: Session, (duration, rate): (f64, f64)) -> Result<Vec<f64>, Error> {
    let mut kept = Kept { times: circuit::sample_times(duration, rate), rows: Vec::new() };
    let n = session.state().len();
    session.advance(duration, &mut kept, &mut Look::new(&mut |_| false))?;
    kept.rows.resize(kept.times.len(), session.settled());
    Ok(kept.rows.iter().flat_map(|y| &y[..n]).copied().collect())
}
