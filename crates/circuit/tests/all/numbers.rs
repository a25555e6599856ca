//! Numbers of a circuit by name: what a run is differentiated by, and what members of one topology differ in.

use crate::support::ROOM;
use crate::support::drive::plan;
use circuit::{Network, Shooting, specification};
use ode::Options;
use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::time::Instant;

/// A cylinder on a valve with a tube, and without a ledger.
fn circuit() -> Value {
    let friction = json!({ "law": "lugre", "parameters": { "coulomb": 20.0, "breakaway": 30.0,
        "stribeck_velocity": 0.02, "viscous": 40.0, "bristle_stiffness": 1e5, "bristle_damping": 300.0 } });
    json!({
        "gas": { "heat_capacity_ratio": 1.4, "gas_constant_j_kg_k": 287.05 },
        "ambient": { "pressure_pa": 101_300.0, "temperature_k": ROOM },
        "components": [
            { "name": "supply", "kind": "reservoir", "numbers": { "pressure": 7e5 } },
            { "name": "valve", "kind": "valve/proportional-5/3",
              "numbers": { "conductance": 2e-8, "critical_pressure_ratio": 0.3, "delay": 0.004 } },
            { "name": "hose", "kind": "tube/distributed", "numbers": { "length": 1.0, "diameter": 4e-3, "cells": 2.0 } },
            { "name": "left", "kind": "cylinder/rodless", "friction": friction, "numbers": {
                "bore": 0.025, "stroke": 0.5, "dead_volume_a": 1e-5, "dead_volume_b": 1e-5, "moving_mass": 2.0,
                "heat_transfer": 30.0 } },
            { "name": "load", "kind": "load", "numbers": { "mass": 0.7 } },
        ],
        "joints": [["supply.1", "valve.1"], ["valve.4", "hose.1"], ["hose.2", "left.a"], ["valve.2", "left.b"],
            ["left.rod", "load.1"]],
    })
}

fn assemble(circuit: &Value) -> Network {
    let spec: specification::Circuit = serde_json::from_value(circuit.clone()).expect("a circuit");
    Network::assemble(&spec, false).expect("assembles")
}

/// The circuit with some numbers of its components.
fn with(numbers: &[(&str, f64)]) -> Value {
    let mut circuit = circuit();
    for (name, value) in numbers {
        let (component, key) = name.split_once('.').expect("a component and a key");
        let components = circuit["components"].as_array_mut().expect("components");
        let own = components.iter_mut().find(|own| own["name"] == component).expect("a component");
        match key.strip_prefix("friction.parameters.") {
            Some(key) => own["friction"]["parameters"][key] = json!(value),
            None => own["numbers"][key] = json!(value),
        }
    }
    circuit
}

fn start(network: &Network) -> BTreeMap<String, f64> {
    let value = |name: &str| match name.rsplit('.').next() {
        Some("pressure_pa") => 3e5,
        Some("temperature_k") => ROOM,
        Some("position_m") => 0.1,
        _ => 0.0,
    };
    network.assembly.given_names().into_iter().map(|name| (name.to_string(), value(name))).collect()
}

/// The state after a stroke.
fn after(mut session: circuit::Session) -> Vec<f64> {
    let command = session.inputs().iter().position(|input| input.name == "valve.command").expect("a valve");
    session.set(command, 0.7).expect("a command");
    session.go_on(0.1, &mut circuit::Look::new(&mut |_| false)).expect("goes on");
    session.state().to_vec()
}

/// The least of some times: what else runs on the machine only adds to them.
fn least(times: impl Iterator<Item = f64>) -> f64 {
    times.fold(f64::INFINITY, f64::min)
}

const NAMES: [&str; 5] =
    ["left.bore", "hose.length", "valve.delay", "left.friction.parameters.coulomb", "supply.pressure"];

#[test]
fn members_of_one_topology_are_analysed_once_and_are_the_circuits_with_their_numbers() {
    let (json, network) = (circuit().to_string(), assemble(&circuit()));
    let options = Options::default();
    let mut members = network.members(&json, &NAMES.map(Into::into)).expect("numbers");
    let values = |k: f64| [0.02 + 1e-6 * k, 0.5 + 1e-4 * k, 0.001 + 1e-7 * k, 10.0 + 1e-3 * k, 6e5 + k];
    let mut shares = |k: u32| {
        let own = members.member(&values(f64::from(k))).expect("a member");
        own.circuit.shares_analysis(&network.assembly.circuit)
    };
    let set = least((0..10).map(|tenth| {
        let begun = Instant::now();
        assert!((1000 * tenth..1000 * (tenth + 1)).all(&mut shares));
        begun.elapsed().as_secs_f64() / 1e3
    }));
    for k in [0, 1234, 9999] {
        let own = members.member(&values(f64::from(k))).expect("a member");
        let numbers = NAMES.into_iter().zip(values(f64::from(k))).collect::<Vec<_>>();
        let alone = assemble(&with(&numbers));
        let of_alone = after(alone.assembly.session(&start(&alone), options).expect("starts"));
        let of_member = after(own.session(&start(&network), options).expect("starts"));
        assert_eq!(of_member, of_alone, "{k}");
    }
    // Against what it takes to describe and analyse each by itself.
    let alone = least((0..20).map(|k| {
        let begun = Instant::now();
        drop(assemble(&with(&[("left.bore", values(f64::from(k))[0])])));
        begun.elapsed().as_secs_f64()
    }));
    println!("a member {:.2} us, alone {:.1} us, ratio {:.0}", 1e6 * set, 1e6 * alone, alone / set);
    assert!(alone > 2.0 * set, "{set} s for a member, {alone} s alone");
}

#[test]
fn a_member_of_other_parts_is_analysed_by_itself() {
    let (json, network) = (circuit().to_string(), assemble(&circuit()));
    for (name, value) in [("left.leakage", 1e-10), ("hose.cells", 3.0)] {
        let mut members = network.members(&json, &[name.into()]).expect("a number");
        let own = members.member(&[value]).expect("a member");
        assert!(!own.circuit.shares_analysis(&network.assembly.circuit), "{name}");
        let alone = assemble(&with(&[(name, value)]));
        let of_alone = after(alone.assembly.session(&start(&alone), Options::default()).expect("starts"));
        assert_eq!(
            after(own.session(&start(&alone), Options::default()).expect("starts")),
            of_alone,
            "{name}"
        );
    }
    let mut members =
        network.members(&json, &["left.bore".into(), "left.moving_mass".into()]).expect("numbers");
    let refused =
        |values: &[f64], members: &mut circuit::Members| members.member(values).expect_err("no").to_string();
    assert!(refused(&[-1.0, 2.0], &mut members).contains("left.bore = -1 m is out of bounds"));
    assert!(refused(&[0.02], &mut members).contains("1 values for 2 numbers"));
    let unknown = |name: &str| network.members(&json, &[name.into()]).expect_err("none").to_string();
    assert!(unknown("right.bore").contains("belongs to no component"));
    assert!(unknown("left.weight").contains("no parameter \"weight\"; it has bore"));
    assert!(unknown("hose.heat_transfer").contains("follows Nu = 3.66 for laminar flow"));
}

#[test]
fn a_run_is_differentiated_by_numbers_of_components() {
    // Smooth: the piston moves all the time.
    let names =
        ["left.bore", "hose.length", "hose.loss", "left.friction.parameters.viscous", "valve.conductance"];
    let shot = |circuit: &Value, parameters: &[&str]| {
        let network = assemble(circuit);
        let names = network.assembly.start_names();
        let value = |name: &String| match &name[..] {
            "left.a.pressure_pa" => 6e5,
            "left.position_m" => 0.1,
            "left.velocity_m_s" => 0.3,
            _ if name.ends_with("pressure_pa") => 5e5,
            _ if name.ends_with("temperature_k") => ROOM,
            _ => 0.0,
        };
        let asked = Shooting {
            plans: plan("valve.command", vec![0.0], vec![0.8]),
            sample_times: vec![0.0, 0.02, 0.05],
            starts: vec![0],
            initial: names.iter().map(value).collect(),
            parameters: parameters.iter().map(ToString::to_string).collect(),
            by_start: Some(vec![]),
            outputs: vec!["left.position_m".into(), "left.a.pressure_pa".into()],
            options: Options { rtol: 1e-11, ..Options::default() },
            threads: 1,
        };
        network.shoot(&circuit.to_string(), &asked, &mut |_| false)
    };
    let plain = shot(&with(&[]), &names).expect("runs");
    assert!(plain.failures[0].is_none(), "{:?}", plain.failures);
    for (k, (name, value)) in names.into_iter().zip([0.025, 1.0, 0.5, 40.0, 2e-8]).enumerate() {
        let at = |value: f64| shot(&with(&[("hose.loss", 0.5), (name, value)]), &[]).expect("runs").values;
        let step = 1e-5 * value;
        let (up, down) = (at(value + step), at(value - step));
        let exact = shot(&with(&[("hose.loss", 0.5)]), &names).expect("runs").sensitivities;
        for (i, size) in [(4, 0.1), (5, 1e5)] {
            let slope = (up[i] - down[i]) / (2.0 * step) * value / size;
            let own = exact[i * names.len() + k] * value / size;
            assert!((slope - own).abs() < 1e-5 * slope.abs() + 1e-7, "{name} {i}: {slope} {own}");
            assert!(own.abs() > 1e-6, "{name} moves output {i}");
        }
    }
    let refused = |name: &str| shot(&with(&[]), &[name]).err().map(|e| e.to_string()).unwrap_or_default();
    assert!(refused("valve.delay").contains("has no derivative by it"), "{}", refused("valve.delay"));
    assert!(refused("hose.cells").contains("has no derivative by it"));
    assert!(refused("gas.gas_constant_j_kg_k").contains("is a number of the gas and cannot be free"));
}

#[test]
fn a_tank_behind_merged_restrictions_is_differentiated_by_their_numbers() {
    let circuit = |conductance: f64, length: f64| {
        json!({
            "gas": { "heat_capacity_ratio": 1.4, "gas_constant_j_kg_k": 287.05 },
            "ambient": { "pressure_pa": 101_300.0, "temperature_k": ROOM },
            "components": [
                { "name": "supply", "kind": "reservoir", "numbers": { "pressure": 7e5 } },
                { "name": "hole", "kind": "fitting",
                  "numbers": { "conductance": conductance, "critical_pressure_ratio": 0.3 } },
                { "name": "hose", "kind": "tube", "numbers": { "length": length, "diameter": 4e-3 } },
                { "name": "tank", "kind": "tank", "numbers": { "volume": 1e-3 } },
            ],
            "joints": [["supply.1", "hole.1"], ["hole.2", "hose.1"], ["hose.2", "tank.1"]],
            "junctions": "series",
        })
    };
    let names = ["hole.conductance", "hose.length"];
    let shot = |circuit: &Value, parameters: &[&str]| {
        let network = assemble(circuit);
        let starts = network.assembly.start_names();
        assert_eq!(starts, ["tank.pressure_pa", "tank.temperature_k"]);
        let asked = Shooting {
            plans: plan("supply.pressure_pa", vec![0.0], vec![7e5]),
            sample_times: vec![0.0, 0.2],
            starts: vec![0],
            initial: vec![101_300.0, ROOM],
            parameters: parameters.iter().map(ToString::to_string).collect(),
            by_start: Some(vec![]),
            outputs: vec!["tank.pressure_pa".into()],
            options: Options { rtol: 1e-11, ..Options::default() },
            threads: 1,
        };
        network.shoot(&circuit.to_string(), &asked, &mut |_| false)
    };
    let exact = shot(&circuit(2e-8, 1.0), &names).expect("runs").sensitivities;
    let at = |one: f64, two: f64| shot(&circuit(2e-8 * one, two), &[]).expect("runs").values[1];
    let h = 1e-5;
    for (k, slope) in [at(1.0 + h, 1.0) - at(1.0 - h, 1.0), at(1.0, 1.0 + h) - at(1.0, 1.0 - h)]
        .map(|difference| difference / (2.0 * h))
        .into_iter()
        .enumerate()
    {
        let own = exact[2 + k] * [2e-8, 1.0][k];
        assert!((own / slope - 1.0).abs() < 1e-5 && own.abs() > 1e3, "{}: {own} {slope}", names[k]);
    }
    let refused = shot(&circuit(2e-8, 1.0), &["hole.subsonic_index"]).expect_err("no derivative").to_string();
    assert!(refused.contains("hole.subsonic_index: restrictions in series need 0.5"), "{refused}");
}

/// Commands every 2 ms never let the spool arrive. Joined segments are the whole run, and so are their derivatives.
#[test]
fn a_segment_begins_with_the_spool_where_its_commands_put_it() {
    let mut circuit = with(&[("valve.frequency", 60.0)]);
    circuit["components"].as_array_mut().expect("components").retain(|own| own["name"] != "hose");
    circuit["joints"] = json!([
        ["supply.1", "valve.1"],
        ["valve.4", "left.a"],
        ["valve.2", "left.b"],
        ["left.rod", "load.1"]
    ]);
    let (network, circuit) = (assemble(&circuit), circuit.to_string());
    let times: Vec<f64> = (0..60).map(|k| 2e-3 * f64::from(k)).collect();
    let asked = |starts: &[usize], rows: &[&[f64]]| Shooting {
        plans: plan("valve.command", times.clone(), times.iter().map(|t| 0.5 * (50.0 * t).sin()).collect()),
        sample_times: times.clone(),
        starts: starts.to_vec(),
        initial: rows.concat(),
        parameters: vec!["valve.frequency".into()],
        by_start: None,
        outputs: vec!["left.a.pressure_pa".into()],
        options: Options { rtol: 1e-9, ..Options::default() },
        threads: 1,
    };
    let shoot = |starts: &[usize], rows: &[&[f64]]| {
        network.shoot(&circuit, &asked(starts, rows), &mut |_| false).expect("runs")
    };
    let known = start(&network);
    let first: Vec<f64> =
        network.assembly.start_names().iter().map(|name| known.get(name).copied().unwrap_or(0.0)).collect();
    let (whole, half) = (shoot(&[0], &[&first]), shoot(&[0, 30], &[&first, &first]));
    let joined = shoot(&[0, 30], &[&first, &half.ends[..first.len()]]);
    let width = joined.directions;
    for sample in [31, 33, 40, 59] {
        let (own, expected) = (joined.values[sample], whole.values[sample]);
        assert!((own - expected).abs() < 1e-7 * expected, "{sample}: {own} {expected}");
        let slopes = &joined.sensitivities[sample * width..][..width];
        let carried = half.end_sensitivities.iter().step_by(width);
        let own = slopes[0] + slopes[1..].iter().zip(carried).map(|(a, b)| a * b).sum::<f64>();
        let expected = whole.sensitivities[sample * width];
        assert!((own - expected).abs() < 1e-4 * expected.abs(), "{sample}: {own} {expected}");
    }
}

/// A motor on a slide that rubs with Fc + Fv v: the mean force, its slope over velocity, and the work are known.
#[test]
fn a_motor_gives_the_mean_force_at_a_velocity_its_slope_and_the_work() {
    let friction = json!({ "law": "coulomb", "parameters": { "coulomb": 20.0, "viscous": 40.0 } });
    let circuit = json!({
        "gas": { "heat_capacity_ratio": 1.4, "gas_constant_j_kg_k": 287.05 },
        "ambient": { "pressure_pa": 101_300.0, "temperature_k": ROOM },
        "components": [
            { "name": "motor", "kind": "motor", "numbers": { "velocity": 0.1 } },
            { "name": "sled", "kind": "slide", "numbers": { "mass": 1.0 }, "friction": friction },
        ],
        "joints": [["sled.1", "motor.1"]],
    });
    let network = assemble(&circuit);
    let names = network.assembly.start_names();
    let initial = names.iter().map(|name| if name == "sled.velocity_m_s" { 0.1 } else { 0.0 });
    let outputs = ["motor.impulse_n_s", "motor.work_j", "sled.position_m", "motor.force_n"];
    let asked = Shooting {
        plans: plan("sled.load_force_n", vec![0.0], vec![0.0]),
        sample_times: vec![0.0, 0.2, 0.4],
        starts: vec![0],
        initial: initial.collect(),
        parameters: vec!["motor.velocity".into()],
        by_start: Some(vec![]),
        outputs: outputs.map(Into::into).to_vec(),
        options: Options { rtol: 1e-9, ..Options::default() },
        threads: 1,
    };
    let shot = network.shoot(&circuit.to_string(), &asked, &mut |_| false).expect("runs");
    let grown = |of: &[f64], k: usize| of[8 + k] - of[4 + k];
    let near = |own: f64, expected: f64, what: &str| {
        assert!((own - expected).abs() < 1e-6 * expected.abs(), "{what}: {own}, {expected}");
    };
    near(grown(&shot.values, 2), 0.1 * 0.2, "distance");
    near(grown(&shot.values, 0) / 0.2, 20.0 + 40.0 * 0.1, "mean force");
    near(grown(&shot.sensitivities, 0) / 0.2, 40.0, "slope");
    near(grown(&shot.values, 1), 24.0 * 0.02, "work");
    // The input takes the place of the number: pulled the other way, all turn.
    let mut session = network.assembly.session(&start(&network), Options::default()).expect("starts");
    let places = ["motor.impulse_n_s", "motor.work_j"]
        .map(|name| session.assembly.columns().iter().position(|column| column == name).expect("a column"));
    let velocity =
        session.inputs().iter().position(|input| input.name == "motor.velocity_m_s").expect("an input");
    session.set(velocity, -0.3).expect("a velocity");
    let mut at = |until: f64| {
        session.go_on(until, &mut circuit::Look::new(&mut |_| false)).expect("goes on");
        places.map(|place| session.read(place))
    };
    let (one, two) = (at(0.3), at(0.5));
    assert!(((two[0] - one[0]) / 0.2 + 32.0).abs() < 1e-3, "{one:?} {two:?}");
    assert!(((two[1] - one[1]) - 32.0 * 0.06).abs() < 1e-3, "{one:?} {two:?}");
}
