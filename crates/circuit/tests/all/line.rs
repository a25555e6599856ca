//! A tube with waves against what is known of waves and of friction in pipes.

use crate::support::ROOM;
use crate::support::circuits::{network, run};
use serde_json::{Value, json};
use std::f64::consts::PI;

fn line(numbers: &Value) -> Value {
    let mut line = json!({ "name": "hose", "kind": "tube/distributed", "numbers": numbers });
    line["numbers"]["diameter"] = json!(4e-3);
    line
}

fn supply(pressure: f64) -> Value {
    json!({ "name": "supply", "kind": "reservoir", "numbers": { "pressure": pressure } })
}

/// Mass flow out of a tube from one pressure to another, kg/s, once it is steady.
fn steady(numbers: &Value, from: f64, to: f64, duration: f64) -> f64 {
    let mut sink = supply(to);
    sink["name"] = json!("sink");
    let components = json!([supply(from), line(numbers), sink]);
    let network =
        network(&components, &json!([["supply.1", "hose.1"], ["hose.2", "sink.1"]])).expect("assembles");
    let start: Vec<_> = network.assembly.given_names().into_iter().map(str::to_string).collect();
    let start: Vec<_> = start
        .iter()
        .map(|name| (name.as_str(), if name.ends_with("pressure_pa") { 0.5 * (from + to) } else { ROOM }))
        .collect();
    let (columns, ledger) = run(&network, &[], (duration, 100.0), &start);
    assert!(ledger[0].abs() < 1e-12 && ledger[1].abs() < 1e-6, "{ledger:?}");
    let (inlet, outlet) = (&columns["hose.mass_flow_kg_s"], &columns["hose.outlet_flow_kg_s"]);
    let (inlet, outlet) = (inlet[inlet.len() - 1], outlet[outlet.len() - 1]);
    assert!((inlet / outlet - 1.0).abs() < 1e-6, "{inlet} {outlet}");
    outlet
}

#[test]
fn slow_flow_is_that_of_hagen_and_poiseuille() {
    // m' = pi d^4 (p1^2 - p2^2)/(256 mu L R T), warmed by the wall to its temperature.
    // So long that its mouths, 0.1 % of a pressure linear, take little of it.
    let (p1, p2, length) = (1.06e5, 1.013e5, 200.0);
    let numbers = json!({ "length": length, "cells": 8.0, "heat_transfer": 1e4 });
    let expected = PI * 4e-3_f64.powi(4) * (p1 * p1 - p2 * p2) / (256.0 * 1.82e-5 * length * 287.05 * ROOM);
    let ratio = steady(&numbers, p1, p2, 60.0) / expected;
    assert!((ratio - 1.0).abs() < 3e-3, "{ratio}");
}

#[test]
fn fast_flow_is_choked_at_the_end_behind_the_friction_of_a_smooth_pipe() {
    // Sonic conductance of 1 m of 4 mm tube: 1.390 at 7 bar, 1.304 at 3 bar (components.md 4.3, worked out for the
    // steady tube with two mouths); here the gas is that of adiabatic cells.
    let conductance = |p: f64| {
        let numbers = json!({ "length": 1.0, "cells": 40.0, "heat_transfer": 0.0 });
        steady(&numbers, p, 1e4, 1.0) / (1.185 * p) * 1e8
    };
    for (p, expected) in [(7e5, 1.390), (3e5, 1.304)] {
        let own = conductance(p);
        assert!((own / expected - 1.0).abs() < 0.02, "{own} {expected}");
    }
}

#[test]
fn a_shock_empties_no_cell() {
    // From a cell at 7 bar into one at 0.2 bar, at once: the front runs faster than sound behind it.
    let ends = |name: &str| json!({ "name": name, "kind": "tank", "numbers": { "volume": 1e-4 } });
    let components = json!([ends("one"), line(&json!({ "length": 0.5, "cells": 10.0 })), ends("two")]);
    let network =
        network(&components, &json!([["one.1", "hose.1"], ["hose.2", "two.1"]])).expect("assembles");
    let start: Vec<_> = network.assembly.given_names().into_iter().map(str::to_string).collect();
    let start: Vec<_> = (start.iter().enumerate())
        .map(|(i, name)| {
            let full = i < start.len() / 2;
            (name.as_str(), if name.ends_with("_k") { ROOM } else { [2e4, 7e5][usize::from(full)] })
        })
        .collect();
    let (columns, ledger) = run(&network, &[], (0.2, 1000.0), &start);
    assert!(ledger[0].abs() < 1e-12 && ledger[1].abs() < 1e-6, "{ledger:?}");
    let ends = ["one.pressure_pa", "two.pressure_pa"].map(|name| *columns[name].last().expect("a sample"));
    assert!((ends[0] / ends[1] - 1.0).abs() < 1e-2, "{ends:?}");
}

#[test]
fn a_lumped_tube_has_the_flow_of_the_steady_one_and_its_own_volume() {
    // Subsonic flow by the pressure between the halves, solved elsewhere, over that of the whole tube.
    let cases = [
        (json!({}), 1.006_437),
        (json!({ "conductance": 5e-9, "critical_pressure_ratio": 0.15 }), 1.002_415),
    ];
    for (mut numbers, subsonic) in cases {
        (numbers["length"], numbers["diameter"]) = (json!(1.0), json!(4e-3));
        let flow = |kind: &str, to: f64| {
            let hose = json!({ "name": "hose", "kind": kind, "numbers": numbers });
            let mut sink = supply(to);
            sink["name"] = json!("sink");
            let joints = json!([["supply.1", "hose.1"], ["hose.2", "sink.1"]]);
            let network = network(&json!([supply(7e5), hose, sink]), &joints).expect("assembles");
            let start = [("hose.cell.pressure_pa", 6e5), ("hose.cell.temperature_k", ROOM)];
            let (columns, ledger) =
                run(&network, &[], (1.0, 100.0), &start[..2 * usize::from(kind != "tube")]);
            assert!(ledger[0].abs() < 1e-12 && ledger[1].abs() < 1e-6, "{ledger:?}");
            columns["hose.mass_flow_kg_s"][100]
        };
        let ratio = |to: f64| flow("tube/lumped", to) / flow("tube", to);
        assert!((ratio(1e5) - 1.0).abs() < 1e-5, "{}", ratio(1e5));
        assert!((ratio(4.5e5) - subsonic).abs() < 3e-5, "{}", ratio(4.5e5));
    }
    // Filled from both ends by so little that both halves are linear, without heat: C of each half from C/g.
    let numbers = json!({ "length": 1.0, "diameter": 4e-3, "conductance": 1e-10, "critical_pressure_ratio": 0.2,
                          "heat_transfer": 0.0 });
    let hose = json!({ "name": "hose", "kind": "tube/lumped", "numbers": numbers });
    let (p, step) = (5e5, 200.0);
    let network =
        network(&json!([supply(p), hose]), &json!([["supply.1", "hose.1", "hose.2"]])).expect("assembles");
    let start = [("hose.cell.pressure_pa", p - step), ("hose.cell.temperature_k", ROOM)];
    let (columns, _) = run(&network, &[], (2.0, 100.0), &start);
    // 1 - b = 2 u g^2 has u = 0.69633 and g = 0.75792 for b = 0.2.
    let (u, g) = (0.696_33_f64, 0.757_92);
    let at_chord = (1.0 - ((0.999 - (1.0 - u)) / u).powi(2)).sqrt() / 1e-3;
    let conductance = 2.0 * (1e-10 / g) * 1.185 * at_chord * (293.15 / ROOM).sqrt();
    let volume = 0.25 * PI * 4e-3 * 4e-3;
    let time = volume / (1.4 * 287.05 * ROOM * conductance);
    for i in [50, 100, 200] {
        let left = p - columns["hose.cell.pressure_pa"][i];
        let expected = step * (-0.01 * i as f64 / time).exp();
        assert!((left - expected).abs() < 0.002 * step, "{i}: {left} {expected}");
    }
}

#[test]
fn a_tube_is_steady_where_it_is_short_and_has_waves_where_it_is_long() {
    let flow = |kind: &str, length: f64| {
        let hose = json!({ "name": "hose", "kind": kind, "numbers": { "length": length, "diameter": 4e-3 } });
        let tank = json!({ "name": "tank", "kind": "tank", "numbers": { "volume": 1e-4 } });
        let joints = json!([["supply.1", "hose.1"], ["hose.2", "tank.1"]]);
        let network = network(&json!([supply(7e5), hose, tank]), &joints).expect("assembles");
        let start: Vec<_> = network.assembly.given_names().into_iter().map(str::to_string).collect();
        let start: Vec<_> = (start.iter())
            .map(|name| (name.as_str(), if name.ends_with("pressure_pa") { 1e5 } else { ROOM }))
            .collect();
        run(&network, &[], (0.05, 1000.0), &start).0["tank.pressure_pa"].clone()
    };
    // 343.2 m/s over 20 times 20 Hz: 0.858 m.
    for (length, kind) in [(0.85, "tube"), (0.87, "tube/distributed")] {
        assert!(flow("tube/auto", length) == flow(kind, length), "{length}");
    }
    assert!(flow("tube", 0.87) != flow("tube/distributed", 0.87));
}
