//! Flow elements and supplies against closed forms.

mod support;

use serde_json::{Value, json};
use support::circuits::{network, run};
use support::{AMBIENT, K, R, ROOM};

const RHO_0: f64 = 1.185;

fn one(name: &str, kind: &str, numbers: Value) -> Value {
    json!({ "name": name, "kind": kind, "numbers": numbers })
}

fn supply(pressure: f64) -> Value {
    one("supply", "reservoir", json!({ "pressure": pressure }))
}

fn tank(volume: f64) -> Value {
    one("tank", "tank", json!({ "volume": volume }))
}

fn closes(ledger: [f64; 3]) {
    assert!(ledger[0].abs() < 1e-12 && ledger[1].abs() < 1e-6 && ledger[2].abs() < 1e-4, "{ledger:?}");
}

fn near(found: f64, expected: f64, share: f64) {
    assert!((found / expected - 1.0).abs() < share, "{found}, expected {expected}");
}

#[test]
fn a_flow_control_that_throttles_both_ways_needs_no_check_valve() {
    let through = |kind: &str, component: Value| {
        let mut component = component;
        component["name"] = json!("path");
        component["kind"] = json!(kind);
        let joints = json!([["supply.1", "path.1"], ["path.2", "tank.1"]]);
        let made = network(&json!([supply(3e5), component, tank(1e-3)]), &joints).expect("assembles");
        let start = [("tank.pressure_pa", 6e5), ("tank.temperature_k", ROOM)];
        run(&made, &[], (0.5, 100.0), &start).0["tank.pressure_pa"].clone()
    };
    let both = json!({ "numbers": { "needle_conductance": 1e-8 }, "choices": { "throttles": "both" } });
    let fitting = json!({ "numbers": { "conductance": 1e-8, "critical_pressure_ratio": 0.3 } });
    assert_eq!(through("flow-control", both), through("fitting", fitting));
    let needs = json!([{ "name": "fc", "kind": "flow-control", "numbers": { "needle_conductance": 1e-8 } }]);
    let message =
        network(&needs, &json!([["fc.1", "ambient"], ["fc.2"]])).err().map(|error| error.to_string());
    assert!(message.expect("refused").contains("fc.conductance is missing"));
}
