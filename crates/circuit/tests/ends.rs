//! Cylinders with a spring, a cushion or something to run into at their end, against what is known of it.

mod support;

use serde_json::{Value, json};
use support::ROOM;
use support::circuits::{network, run};

/// Hardly any.
fn friction() -> Value {
    json!({ "law": "coulomb", "parameters": { "coulomb": 1e-3 } })
}

/// A cylinder at a reservoir, with a wide breather and a fitting before chamber a.
fn single_acting(pressure: f64, preload: f64) -> (Value, Value) {
    let components = json!([
        { "name": "supply", "kind": "reservoir", "numbers": { "pressure": pressure } },
        { "name": "inlet", "kind": "fitting", "numbers": { "conductance": 1e-9, "critical_pressure_ratio": 0.3 } },
        { "name": "clamp", "kind": "cylinder/single-acting", "friction": friction(), "numbers": {
            "bore": 0.025, "rod_diameter": 0.01, "stroke": 0.05, "dead_volume_a": 5e-6, "dead_volume_b": 5e-6,
            "moving_mass": 0.4, "spring_stiffness": 600.0, "spring_preload": preload, "breather_conductance": 1e-8 } },
    ]);
    (components, json!([["supply.1", "inlet.1"], ["inlet.2", "clamp.a"]]))
}

#[test]
fn a_single_acting_cylinder_stands_where_pressure_and_spring_are_equal() {
    let area = 0.25 * std::f64::consts::PI * 0.025 * 0.025;
    let stand = |pressure: f64, preload: f64| {
        let (components, joints) = single_acting(pressure, preload);
        let network = network(&components, &joints).expect("assembles");
        let start: Vec<(&str, f64)> = vec![
            ("clamp.position_m", 0.01),
            ("clamp.velocity_m_s", 0.0),
            ("clamp.a.pressure_pa", 101_300.0),
            ("clamp.a.temperature_k", ROOM),
            ("clamp.b.pressure_pa", 101_300.0),
            ("clamp.b.temperature_k", ROOM),
        ];
        let (columns, ledger) = run(&network, &[], (4.0, 100.0), &start);
        assert!(ledger[0].abs() < 1e-12 && ledger[1].abs() < 1e-6 && ledger[2].abs() < 1e-5, "{ledger:?}");
        let last = |name: &str| columns[name][400];
        assert!((last("clamp.b.pressure_pa") - 101_300.0).abs() < 1.0);
        // Chamber b breathes: out while the rod comes out, in while it goes back.
        let out = last("clamp.position_m") - 0.01;
        assert!(columns["clamp.b.mass_flow_kg_s"].iter().any(|flow| flow * out.signum() < -1e-6));
        (last("clamp.position_m"), last("clamp.end_stop_force_n"))
    };
    let gauge = 30.0 / area; // preload 15 N and 25 mm of 600 N/m
    let (x, stop) = stand(101_300.0 + gauge, 15.0);
    assert!((x - 0.025).abs() < 1e-5 && stop == 0.0, "{x}");
    // Vented, the preload holds it against its end; a stop that knew nothing of the spring would give way.
    for preload in [15.0, 5000.0] {
        let (x, stop) = stand(101_300.0, preload);
        let dead_length = 5e-6 / area;
        assert!((stop + preload).abs() < 0.02 * preload && x < 0.0 && -x < 0.5 * dead_length, "{x} {stop}");
    }
}
