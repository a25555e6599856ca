//! Circuits of components, and their runs by the names of columns.

use super::ROOM;
use circuit::Network;
use ode::Options;
use serde_json::{Value, json};
use std::collections::BTreeMap;

pub fn network(components: &Value, joints: &Value) -> Result<Network, circuit::Error> {
    joined(components, joints, "volume")
}

/// What becomes of joints of two restrictions is "volume" or "series".
pub fn joined(components: &Value, joints: &Value, junctions: &str) -> Result<Network, circuit::Error> {
    let spec = json!({
        "gas": { "heat_capacity_ratio": 1.4, "gas_constant_j_kg_k": 287.05 },
        "ambient": { "pressure_pa": 101_300.0, "temperature_k": ROOM },
        "components": components,
        "joints": joints,
        "junctions": junctions,
    });
    Network::assemble(&serde_json::from_value(spec).expect("a circuit"), true)
}

/// The columns of a run by name, and the errors of its ledger.
pub fn run(
    network: &Network,
    plan: &[(&str, f64, f64)],
    sampling: (f64, f64),
    start: &[(&str, f64)],
) -> (BTreeMap<String, Vec<f64>>, [f64; 3]) {
    let plans: Vec<_> = plan.iter().map(|&(name, t, u)| (name.to_string(), vec![t], vec![u])).collect();
    let start = start.iter().map(|&(name, value)| (name.to_string(), value)).collect();
    let options = Options { rtol: 1e-9, ..Options::default() };
    let run = network.simulate(&plans, sampling, &start, options, &mut |_| false).expect("runs");
    let balance = run.balance.expect("a ledger");
    let names = network.assembly.columns().iter().cloned();
    (names.zip(run.columns).collect(), [balance.mass_error, balance.energy_error, balance.entropy_error])
}
