//! Circuits of components: the drive as one of them, and each component against what is known of it.

use crate::support::ROOM;
use crate::support::circuits::{network, run};
use serde_json::{Value, json};
use std::collections::BTreeMap;

fn case_a() -> Value {
    serde_json::from_str(include_str!("../../examples/case_a.json")).expect("a drive")
}

fn cylinder(friction: &Value) -> Value {
    json!({ "name": "cylinder", "kind": "cylinder/rodless", "friction": friction, "numbers": {
        "bore": 0.025, "stroke": 0.5, "dead_volume_a": 1e-5, "dead_volume_b": 1e-5, "moving_mass": 2.0,
        "heat_transfer": 30.0, "end_stop_stiffness": 1e6, "end_stop_damping": 2000.0,
        "end_stop_damping_depth": 1e-4,
    } })
}

#[test]
fn what_the_valve_gives_is_what_the_chamber_takes_and_what_the_supply_loses() {
    let components = json!([
        { "name": "supply", "kind": "reservoir", "numbers": { "pressure": 7e5 } },
        { "name": "valve", "kind": "valve/proportional-5/3",
          "numbers": { "conductance": 2e-8, "critical_pressure_ratio": 0.3 } },
        cylinder(&case_a()["friction"]),
        { "name": "load", "kind": "load", "numbers": { "mass": 0.7, "force": -5.0 } },
    ]);
    let joints = json!([
        ["supply.1", "valve.1"],
        ["valve.4", "cylinder.a"],
        ["valve.2", "cylinder.b"],
        ["cylinder.rod", "load.1"]
    ]);
    let network = network(&components, &joints).expect("assembles");
    let start = [
        ("cylinder.position_m", 0.05),
        ("cylinder.velocity_m_s", 0.0),
        ("cylinder.a.pressure_pa", 3e5),
        ("cylinder.a.temperature_k", ROOM),
        ("cylinder.b.pressure_pa", 3e5),
        ("cylinder.b.temperature_k", ROOM),
    ];
    let (columns, _) = run(&network, &[("valve.command", 0.0, 0.6)], (0.3, 1000.0), &start);
    let (a, out) = (&columns["cylinder.a.mass_flow_kg_s"], &columns["supply.mass_flow_kg_s"]);
    assert!(a.iter().zip(&columns["valve.mass_flow_4_kg_s"]).all(|(a, valve)| (a - valve).abs() < 1e-18));
    assert!(a[100] > 0.0 && a[100] == out[100]);
}

fn fill(kind: &str, numbers: &Value, from: f64, tank: f64) -> (Vec<f64>, [f64; 3]) {
    let components = json!([
        { "name": "supply", "kind": "reservoir", "numbers": { "pressure": from } },
        { "name": "path", "kind": kind, "numbers": numbers },
        { "name": "tank", "kind": "tank", "numbers": { "volume": 1e-3, "wall_area": 1.0, "heat_transfer": 50.0 } },
    ]);
    let network = network(&components, &json!([["supply.1", "path.1"], ["path.2", "tank.1"]]));
    let start = [("tank.pressure_pa", tank), ("tank.temperature_k", ROOM)];
    let (columns, ledger) = run(&network.expect("assembles"), &[], (20.0, 10.0), &start);
    (columns["tank.pressure_pa"].clone(), ledger)
}

#[test]
fn a_check_valve_lets_gas_through_one_way_and_shuts_a_cracking_pressure_apart() {
    let numbers = json!({ "conductance": 1e-8, "critical_pressure_ratio": 0.3, "cracking_pressure": 2e4 });
    let (filled, ledger) = fill("check-valve", &numbers, 7e5, 1e5);
    assert!((filled[filled.len() - 1] - 6.8e5).abs() < 1.0, "{filled:?}");
    assert!(ledger[0].abs() < 1e-12 && ledger[1].abs() < 1e-6 && ledger[2].abs() < 1e-6, "{ledger:?}");
    let (held, _) = fill("check-valve", &numbers, 1e5, 7e5);
    assert!(held.iter().all(|p| *p == held[0]), "{held:?}");
    // Without a spring it is a fitting, as long as the flow goes forward.
    let free = json!({ "conductance": 1e-8, "critical_pressure_ratio": 0.3, "cracking_pressure": 0.0 });
    let fitting = json!({ "conductance": 1e-8, "critical_pressure_ratio": 0.3 });
    let pairs = fill("check-valve", &free, 7e5, 1e5).0.into_iter().zip(fill("fitting", &fitting, 7e5, 1e5).0);
    assert!(pairs.into_iter().all(|(valve, fitting)| (valve / fitting - 1.0).abs() < 1e-6));
}

#[test]
fn meter_out_sets_the_speed_that_the_needle_lets_out() {
    let (needle, bore) = (2e-9, 0.025_f64);
    let components = |throttles: &str| {
        let control = |name: &str| {
            json!({ "name": name, "kind": "flow-control", "choices": { "throttles": throttles },
                    "numbers": { "needle_conductance": needle, "check_conductance": 2e-8 } })
        };
        json!([
            { "name": "supply", "kind": "reservoir", "numbers": { "pressure": 7e5 } },
            { "name": "valve", "kind": "valve/proportional-5/3",
              "numbers": { "conductance": 4e-8, "critical_pressure_ratio": 0.3 } },
            control("fc_a"),
            control("fc_b"),
            cylinder(&case_a()["friction"]),
        ])
    };
    let joints = json!([
        ["supply.1", "valve.1"],
        ["valve.4", "fc_a.1"],
        ["fc_a.2", "cylinder.a"],
        ["valve.2", "fc_b.1"],
        ["fc_b.2", "cylinder.b"],
    ]);
    let start = [
        ("cylinder.position_m", 0.05),
        ("cylinder.velocity_m_s", 0.0),
        ("cylinder.a.pressure_pa", 1.013e5),
        ("cylinder.a.temperature_k", ROOM),
        ("cylinder.b.pressure_pa", 6.5e5),
        ("cylinder.b.temperature_k", ROOM),
        ("valve.4.pressure_pa", 1.013e5),
        ("valve.4.temperature_k", ROOM),
        ("valve.2.pressure_pa", 6.5e5),
        ("valve.2.temperature_k", ROOM),
    ];
    let speed = |throttles: &str| {
        let network = network(&components(throttles), &joints).expect("assembles");
        let (columns, ledger) = run(&network, &[("valve.command", 0.0, 1.0)], (0.8, 1000.0), &start);
        assert!(ledger[0].abs() < 1e-12 && ledger[1].abs() < 1e-6, "{ledger:?}");
        (columns["cylinder.velocity_m_s"][700], columns["cylinder.b.temperature_k"][700])
    };
    // A choked needle takes C rho0 R sqrt(T0 T)/A of volume out of chamber b; the free path gives more than enough.
    let (v, t) = speed("out");
    let area = 0.25 * std::f64::consts::PI * bore * bore;
    let choked = needle * 1.185 * 287.05 * (293.15 * t).sqrt() / area;
    assert!((v / choked - 1.0).abs() < 0.02, "{v} m/s, {choked} m/s");
    assert!(speed("in").0 != v);
}

/// Sonic conductance of two paths in series, from the mass flow that leaves 7 bar through them into the ambient air.
fn in_series(first: &Value, second: &Value) -> f64 {
    let supply = json!({ "name": "supply", "kind": "reservoir", "numbers": { "pressure": 7e5 } });
    let joints = json!([["supply.1", "first.1"], ["first.2", "second.1"], ["second.2", "ambient"]]);
    let network = network(&json!([supply, first, second]), &joints).expect("assembles");
    let start = [("first.2.pressure_pa", 3e5), ("first.2.temperature_k", ROOM)];
    let (columns, ledger) = run(&network, &[], (1.0, 10.0), &start);
    assert!(ledger[0].abs() < 1e-12 && ledger[1].abs() < 1e-6, "{ledger:?}");
    let flow = columns["supply.mass_flow_kg_s"][9];
    assert!((flow / columns["second.mass_flow_kg_s"][9] - 1.0).abs() < 1e-6);
    flow / (7e5 * 1.185)
}

#[test]
fn a_tube_in_series_with_a_valve_follows_the_series_rule() {
    let path =
        |name: &str, kind: &str, numbers: Value| json!({ "name": name, "kind": kind, "numbers": numbers });
    let tube = |name: &str| path(name, "tube", json!({ "length": 1.0, "diameter": 4e-3 }));
    let valve =
        |name: &str| path(name, "fitting", json!({ "conductance": 2e-8, "critical_pressure_ratio": 0.3 }));
    let wide = path("second", "fitting", json!({ "conductance": 1e-5, "critical_pressure_ratio": 0.5 }));
    // 4 mm and 1 m: 1.196 dm3/(s bar) alone, behind a valve of 2 dm3/(s bar) 1.067, before it 1.131.
    for (first, second, expected) in [
        (tube("first"), wide, 1.196e-8),
        (valve("first"), tube("second"), 1.067e-8),
        (tube("first"), valve("second"), 1.131e-8),
    ] {
        let found = in_series(&first, &second);
        assert!((found / expected - 1.0).abs() < 6e-3, "{found:e}, {expected:e}");
    }
}

#[test]
fn a_quick_exhaust_vents_by_its_own_port_and_never_from_the_supply() {
    let vent = |kind: &str, numbers: Value, joints: Value| {
        let tank = json!({ "name": "tank", "kind": "tank", "numbers": { "volume": 1e-3 } });
        let network = network(&json!([tank, { "name": "path", "kind": kind, "numbers": numbers }]), &joints);
        let start = [("tank.pressure_pa", 7e5), ("tank.temperature_k", ROOM)];
        run(&network.expect("assembles"), &[], (0.05, 1000.0), &start)
    };
    let (b, wide) = (json!(0.3), json!(3e-8));
    let quick = json!({ "conductance": 1e-8, "exhaust_conductance": wide, "critical_pressure_ratio": b });
    let fitting = json!({ "conductance": wide, "critical_pressure_ratio": b });
    let (open, ledger) = vent("quick-exhaust", quick, json!([["tank.1", "path.2"], ["path.1", "ambient"]]));
    let (plain, _) = vent("fitting", fitting, json!([["tank.1", "path.1"], ["path.2", "ambient"]]));
    for (quick, plain) in open["tank.pressure_pa"].iter().zip(&plain["tank.pressure_pa"]) {
        assert!((quick / plain - 1.0).abs() < 1e-6, "{quick} {plain}");
    }
    assert!(open["tank.pressure_pa"][50] < 6e5 && ledger[0].abs() < 1e-12 && ledger[1].abs() < 1e-6);

    let numbers = json!({ "conductance": 1e-8, "exhaust_conductance": 3e-8 });
    let components = json!([
        { "name": "supply", "kind": "reservoir", "numbers": { "pressure": 7e5 } },
        { "name": "quick", "kind": "quick-exhaust", "numbers": numbers },
        { "name": "tank", "kind": "tank", "numbers": { "volume": 1e-4 } },
    ]);
    let network = network(&components, &json!([["supply.1", "quick.1"], ["quick.2", "tank.1"]]));
    let start = [("tank.pressure_pa", 1e5), ("tank.temperature_k", ROOM)];
    let (columns, _) = run(&network.expect("assembles"), &[], (1.0, 100.0), &start);
    assert!(columns["quick.exhaust_flow_kg_s"].iter().all(|flow| *flow == 0.0));
    assert!(columns["tank.pressure_pa"][100] > 6.8e5);
}

#[test]
fn a_regulator_droops_with_its_flow_and_relieves_what_is_too_much() {
    let regulator = |relieving: &str| {
        json!({ "name": "reg", "kind": "regulator", "choices": { "relieving": relieving }, "numbers": {
            "set_pressure": 5e5, "conductance": 2e-8, "full_opening_drop": 5e4, "relief_offset": 2e4 } })
    };
    let supply = json!({ "name": "mains", "kind": "reservoir", "numbers": { "pressure": 1.2e6 } });
    let tank = json!({ "name": "tank", "kind": "tank", "numbers": {
        "volume": 1e-3, "wall_area": 1.0, "heat_transfer": 50.0 } });
    let needle = json!({ "name": "needle", "kind": "fitting", "numbers": {
        "conductance": 4e-9, "critical_pressure_ratio": 0.3 } });
    let joints = json!([["mains.1", "reg.1"], ["reg.2", "tank.1", "needle.1"], ["needle.2", "ambient"]]);
    let drawn = network(&json!([supply, regulator("yes"), tank, needle]), &joints).expect("assembles");
    let start = |p: f64| [("tank.pressure_pa", p), ("tank.temperature_k", ROOM)];
    let (columns, ledger) = run(&drawn, &[], (10.0, 10.0), &start(5e5));
    assert!(ledger[0].abs() < 1e-12 && ledger[1].abs() < 1e-6 && ledger[2].abs() < 1e-6, "{ledger:?}");
    // Choked seat, choked needle: C_n p2 = C p1 (p_set - p2)/dp, and so p2.
    let droop = 4e-9 * 5e5 / (2e-8 * 1.2e6 / 5e4 + 4e-9);
    let behind = columns["tank.pressure_pa"][100];
    assert!((behind - (5e5 - droop)).abs() < 0.02 * droop, "{behind}, {droop}");
    let out = columns["mains.mass_flow_kg_s"][100];
    assert!(
        (out / columns["needle.mass_flow_kg_s"][100] - 1.0).abs() < 1e-4
            && columns["reg.relief_flow_kg_s"][100] == 0.0
    );

    let joints = json!([["mains.1", "reg.1"], ["reg.2", "tank.1"]]);
    let last = |relieving: &str, plan: &[(&str, f64, f64)]| {
        let alone = network(&json!([supply, regulator(relieving), tank]), &joints).expect("assembles");
        let (columns, ledger) = run(&alone, plan, (60.0, 1.0), &start(7e5));
        assert!(ledger[0].abs() < 1e-12 && ledger[1].abs() < 1e-6, "{ledger:?}");
        columns["tank.pressure_pa"][60]
    };
    assert!((last("yes", &[]) - 5.2e5).abs() < 1e3 && (last("no", &[]) - 7e5).abs() < 1.0);
    // Set higher while it runs, it fills up to there; what the lag of the seat lets in on top stays.
    let risen = last("no", &[("reg.set_pressure_pa", 1.0, 8e5)]);
    assert!((8e5..8.2e5).contains(&risen), "{risen}");
}

#[test]
fn too_many_states_are_told_with_the_components_that_bring_them() {
    let tube = |name: &str, cells: f64| {
        json!({ "name": name, "kind": "tube/distributed",
                "numbers": { "length": 10.0, "diameter": 4e-3, "cells": cells } })
    };
    let components = json!([tube("short", 60.0), tube("hose", 140.0)]);
    let joints = json!([["short.1", "ambient"], ["short.2", "hose.1"], ["hose.2", "ambient"]]);
    let message = network(&components, &joints).expect_err("too many").to_string();
    // Two states of each cell, one between two cells, two of the joint.
    assert!(message.contains("has 606 states, most of them in hose (422), short (182)"), "{message}");
    assert!(message.contains("at most 512"), "{message}");
}

#[test]
fn what_cannot_be_joined_is_said() {
    let supply =
        |name: &str, p: f64| json!({ "name": name, "kind": "reservoir", "numbers": { "pressure": p } });
    let fitting = json!({ "name": "fitting", "kind": "fitting",
                          "numbers": { "conductance": 1e-8, "critical_pressure_ratio": 0.3 } });
    let tank = |name: &str| json!({ "name": name, "kind": "tank", "numbers": { "volume": 1e-3 } });
    let cases = [
        (json!([fitting]), json!([["fitting.1", "ambient"]]), "port fitting.2 is not joined"),
        (
            json!([supply("a", 7e5), supply("b", 9e5), fitting]),
            json!([["a.1", "b.1", "fitting.1"], ["fitting.2", "ambient"]]),
            "a.1 and b.1 hold the same joint",
        ),
        (
            json!([tank("one"), tank("two")]),
            json!([["one.1", "two.1"]]),
            "one and two share a joint and both have a volume",
        ),
        (json!([supply("a", 7e5), tank("one")]), json!([["one.1", "a.1"]]), "a.1 holds the pressure in one"),
        (
            json!([fitting]),
            json!([["fitting.3", "ambient"], ["fitting.1"]]),
            "has no port \"3\"; it has 1, 2",
        ),
        (json!([fitting]), json!([["hose.3", "ambient"]]), "there is no such component"),
        (json!([fitting]), json!([["fitting.1", "fitting.1"], ["fitting.2"]]), "occurs twice in the joints"),
        (json!([tank("one"), tank("one")]), json!([]), "the name one is taken"),
        (json!([{ "name": "x", "kind": "hose" }]), json!([]), "there is no kind \"hose\""),
        (json!([{ "name": "x", "kind": "tank" }]), json!([["x.1"]]), "x.volume is missing"),
        (
            json!([{ "name": "x", "kind": "tank", "numbers": { "volume": -1.0 } }]),
            json!([["x.1"]]),
            "x.volume = -1 m3 is out of bounds",
        ),
        (
            json!([{ "name": "x", "kind": "tank", "numbers": { "size": 1.0 } }]),
            json!([["x.1"]]),
            "has no parameter \"size\"",
        ),
        (
            json!([{ "name": "x", "kind": "load" }]),
            json!([["x.1"]]),
            "no cylinder or slide moves the joint of x.1",
        ),
        (
            json!([{ "name": "x", "kind": "load" }, { "name": "axis", "kind": "carriage" }]),
            json!([["x.1", "axis.1"]]),
            "axis moves as commanded and cannot have the mass of x: put a force-sensor between them",
        ),
        (
            json!([{ "name": "x", "kind": "load" }, tank("t")]),
            json!([["x.1", "t.1"]]),
            "joins gas to an axis",
        ),
    ];
    for (components, joints, expected) in cases {
        let message = network(&components, &joints).err().map(|error| error.to_string()).unwrap_or_default();
        assert!(message.contains(expected), "{expected}: {message}");
    }
}

/// A carriage that drags a piston between reservoirs of unequal pressure.
fn dragged(more: &[(&str, f64)]) -> (Value, Value) {
    let held =
        |name: &str, p: f64| json!({ "name": name, "kind": "reservoir", "numbers": { "pressure": p } });
    let mut carriage = json!({ "servo_bandwidth": 20.0, "servo_damping_ratio": 0.8 });
    more.iter().for_each(|&(key, value)| carriage[key] = json!(value));
    let components = json!([
        held("a", 3e5),
        held("b", 2e5),
        { "name": "carriage", "kind": "carriage", "numbers": carriage },
        { "name": "sensor", "kind": "force-sensor", "numbers": { "stiffness": 1e6, "damping": 1e3 } },
        { "name": "piston", "kind": "piston", "friction": case_a()["friction"], "numbers": {
            "area_a": 5e-4, "area_b": 4e-4, "stroke": 0.3, "moving_mass": 0.8, "incline": 0.1 } },
    ]);
    let joints = json!([
        ["carriage.1", "sensor.1"],
        ["sensor.2", "piston.rod"],
        ["a.1", "piston.a"],
        ["b.1", "piston.b"]
    ]);
    (components, joints)
}

#[test]
fn a_carriage_drags_a_piston_through_a_force_sensor() {
    let ripple = [("ripple_velocity", 0.01), ("ripple_pitch", 5e-3)];
    for more in [&ripple[..], &[]] {
        let (components, joints) = dragged(more);
        let network = network(&components, &joints).expect("assembles");
        let start = [("carriage", 0.05), ("piston", 0.05)].map(|(name, x)| (format!("{name}.position_m"), x));
        let speeds = ["carriage.velocity_m_s", "piston.velocity_m_s"].map(|name| (name, 0.0));
        let start: Vec<_> = start.iter().map(|(name, x)| (name.as_str(), *x)).chain(speeds).collect();
        // Constant acceleration from 10 ms on.
        let plan = [("carriage.jerk_m_s3", 0.0, 50.0), ("carriage.jerk_m_s3", 0.01, 0.0)];
        let (columns, ledger) = run(&network, &plan, (0.5, 1000.0), &start);
        // The gas does the more part of the work: it has to stand in the books with its sign.
        assert!(ledger[1].abs() < 1e-6 && ledger[2].abs() < 1e-6, "{ledger:?}");
        let at = |name: &str| columns[name][500];
        if more.is_empty() {
            let (t, w) = (0.49, std::f64::consts::TAU * 20.0);
            let commanded = 0.05 + 50.0 * 1e-6 / 6.0 + 0.0025 * t + 0.25 * t * t;
            assert!((commanded - at("carriage.position_m") - 0.5 / (w * w)).abs() < 1e-8, "the lag is a/w^2");
        } else {
            // 2.5 mm/s after 10 ms and 0.5 m/s2 from there on, of which the ripple makes one per cent more and less.
            let speeds = columns["carriage.velocity_m_s"].iter().zip(0_u32..).skip(200);
            let shares = speeds.map(|(v, k)| v / (0.5 * (1e-3 * f64::from(k) - 0.005)) - 1.0);
            let (low, high) = shares.fold((1.0_f64, -1.0_f64), |(low, high), x| (low.min(x), high.max(x)));
            assert!((high - 0.01).abs() < 2e-4 && (low + 0.01).abs() < 2e-4, "{low} {high}");
        }
        let gas = 5e-4 * (3e5 - 101_300.0) - 4e-4 * (2e5 - 101_300.0) - 0.8 * 9.80665 * 0.1_f64.sin();
        let rest = at("sensor.force_n") + gas - at("piston.friction_force_n");
        assert!((rest - 0.8 * at("piston.acceleration_m_s2")).abs() < 1e-9, "{rest}");
    }
}

/// A component of a kind with its defaults, and of what has none something usual.
fn usual(kind: &circuit::ComponentKind) -> Value {
    let needed = kind
        .parameters
        .iter()
        .filter(|own| own.default.is_none() && own.follows.is_empty() && own.within.is_empty());
    let value = |key: &str, unit: &str| match (key, unit) {
        ("rod_diameter", _) => 0.01,
        ("gap_height", _) => 5e-5,
        ("stop_pressure", _) => 6e5,
        ("length" | "link_length", _) => 1.0,
        ("diameter", _) => 4e-3,
        ("critical_pressure_ratio", _) => 0.35,
        (_, "m3/(s Pa)") => 1e-8,
        (_, "Pa abs") => 5e5,
        (_, "Pa") => 5e4,
        (_, "Hz") => 20.0,
        (_, "m3/s") => 1e-3,
        (_, "m3") => 1e-5,
        (_, "m2") => 1e-5,
        (_, "m") => 0.05,
        (_, "kg") => 1.0,
        (_, "s") => 0.005,
        (_, "m/s") => 1.0,
        (_, "N/m") => 500.0,
        (_, "N") => 20.0,
        (_, "N s/m" | "kg/m") => 50.0,
        (_, "kg m2") => 0.01,
        _ => panic!("{key}: a usual value in {unit}"),
    };
    let mut numbers: BTreeMap<_, _> = needed.map(|own| (own.key, value(own.key, own.unit))).collect();
    let has_rod = kind.parameters.iter().any(|own| own.key == "rod_diameter");
    if has_rod && kind.key != "cylinder/rodless" {
        numbers.insert("rod_diameter", 0.01);
    }
    let friction =
        if kind.friction != circuit::FrictionTable::No { case_a()["friction"].clone() } else { Value::Null };
    let formula = if let Some(role) = kind.formula {
        let output = match role.output.0 {
            "mass_flow" => "opening*slope*(p_up - p_down)*(1 + opening*p_down/p_up)",
            "force" => "-k*(x - rest) - c*v + command*k*rest",
            other => panic!("a formula of {other}"),
        };
        let row =
            |key: &str, unit: &str, default: f64| json!({ "key": key, "unit": unit, "default": default });
        let flow = vec![row("slope", "kg/(s Pa)", 1e-8)];
        let force = vec![row("k", "N/m", 300.0), row("rest", "m", 0.02), row("c", "N s/m", 20.0)];
        let parameters = if role.output.0 == "force" { force } else { flow };
        json!({ "name": "usual", "parameters": parameters, "output": output })
    } else {
        Value::Null
    };
    // From the origin to something usual.
    let points = if let Some(circuit::Points { columns, optional: false, .. }) = kind.points {
        json!(
            [0.0, 1.0]
                .map(|share| columns.iter().map(|own| share * value(own.key, own.unit)).collect::<Vec<_>>())
        )
    } else {
        Value::Null
    };
    json!({ "name": "own", "kind": kind.key, "numbers": numbers, "friction": friction, "formula": formula,
            "points": points })
}

/// Every kind of component between volumes: what a new one has to keep is asked here, and nowhere by its name.
#[test]
fn every_component_keeps_mass_and_energy_and_rests_where_nothing_drives_it() {
    // Gravity moves a platform. Tests in Python compare its balances and its motion with multipliers.
    for kind in circuit::KINDS.iter().filter(|kind| !kind.key.starts_with("platform/")) {
        let (mut components, mut joints) = (vec![usual(kind)], Vec::new());
        let mut pressures = Vec::new();
        for (i, port) in kind.ports.iter().enumerate() {
            let (own, tank, path) = (format!("own.{}", port.name), format!("tank_{i}"), format!("path_{i}"));
            if port.kind == circuit::PortKind::Axis && kind.friction == circuit::FrictionTable::No {
                let (mut mover, name) = (cylinder(&case_a()["friction"]), format!("mover_{i}"));
                mover["name"] = json!(name);
                components.push(mover);
                joints.push(json!([format!("{name}.a")]));
                joints.push(json!([format!("{name}.b")]));
                if port.holds == circuit::Holds::Motion {
                    let coupling = json!({ "stiffness": 500.0, "damping": 50.0 });
                    components.push(json!({ "name": "coupling", "kind": "coupling", "numbers": coupling }));
                    joints.push(json!([own, "coupling.1"]));
                    joints.push(json!(["coupling.2", format!("{name}.rod")]));
                } else {
                    joints.push(json!([format!("{name}.rod"), own]));
                }
            } else if port.kind == circuit::PortKind::Axis && kind.friction != circuit::FrictionTable::Needed
            {
                let spring = json!({ "stiffness": 500.0, "rest_position": 0.03 });
                components.push(json!({ "name": "spring", "kind": "spring", "numbers": spring }));
                joints.push(json!(["spring.1", own]));
            }
            if port.kind == circuit::PortKind::Axis {
                continue;
            }
            components.push(
                json!({ "name": tank, "kind": "tank", "numbers": { "volume": 1e-4 * (i + 1) as f64 } }),
            );
            components.push(json!({ "name": path, "kind": "fitting",
                "numbers": { "conductance": 3e-8, "critical_pressure_ratio": 0.4 } }));
            joints.push(json!([own, format!("{path}.1")]));
            joints.push(json!([format!("{path}.2"), format!("{tank}.1")]));
            pressures.push((format!("{tank}.pressure_pa"), 7e5 - 2e5 * i as f64 / kind.ports.len() as f64));
        }
        let network =
            network(&json!(components), &json!(joints)).unwrap_or_else(|e| panic!("{}: {e}", kind.key));
        let states = network.assembly.circuit.state_names();
        for (i, (name, _)) in states.iter().enumerate() {
            let of = |own: &Value| name.starts_with(&format!("{}.", own["name"].as_str().expect("a name")));
            assert!(components.iter().any(of), "{}: {name} is no component's", kind.key);
            assert!(states[..i].iter().all(|(other, _)| other != name), "{}: {name} twice", kind.key);
        }
        let start = |driven: bool| -> Vec<(String, f64)> {
            let each = network.assembly.given_names().into_iter().map(|name| {
                let given = pressures.iter().find(|(own, _)| own == name).filter(|_| driven).map(|(_, p)| *p);
                let usual = match name.rsplit('.').next() {
                    Some("pressure_pa") => 101_300.0,
                    Some("temperature_k") => ROOM,
                    Some("position_m") => 0.02,
                    Some("velocity_m_s") if driven && name.starts_with("mover_0") => 2.0,
                    _ => 0.0,
                };
                (name.to_string(), given.unwrap_or(usual))
            });
            each.collect()
        };
        let inputs = &network.assembly.variables.inputs;
        let commands: Vec<_> = inputs
            .iter()
            .filter(|own| ["own.command", "own.jerk_m_s3"].contains(&&*own.name))
            .map(|own| (&*own.name, 0.02, 1.0))
            .collect();
        let named = start(true);
        let named: Vec<_> = named.iter().map(|(name, value)| (name.as_str(), *value)).collect();
        let (columns, ledger) = run(&network, &commands, (0.3, 1000.0), &named);
        assert!(columns.values().flatten().all(|value| value.is_finite()), "{}", kind.key);
        assert!(
            ledger[0].abs() < 1e-12 && ledger[1].abs() < 1e-6 && ledger[2].abs() < 1e-5,
            "{}: {ledger:?}",
            kind.key
        );
        // What only acts at an end, or at a pressure that does not come about here.
        let seldom = ["end_stop_force_n", "exhaust_flow_kg_s", "relief_flow_kg_s"];
        for (output, ..) in kind.outputs.iter().filter(|(output, ..)| !seldom.contains(output)) {
            let column = &columns[&format!("own.{output}")];
            assert!(column.iter().any(|value| *value != column[0]), "{}: {output} never changes", kind.key);
        }
        // Ambient pressure and temperature everywhere, valves open: nothing moves, but what a spring or a supply drives.
        let driven =
            ["spring", "slide", "piston", "carriage", "cylinder/single-acting", "reservoir", "compressor"];
        if driven.contains(&kind.key) || kind.key.starts_with("force/") {
            continue;
        }
        let named = start(false);
        let named: Vec<_> = named.iter().map(|(name, value)| (name.as_str(), *value)).collect();
        let (columns, _) = run(&network, &commands, (10.0, 1.0), &named);
        for (name, column) in
            columns.iter().filter(|(name, _)| name.ends_with("pressure_pa") || name.ends_with("position_m"))
        {
            let moved = column.iter().map(|value| (value / column[0] - 1.0).abs()).fold(0.0, f64::max);
            assert!(moved < 1e-9, "{}: {name} moves by {moved:e}", kind.key);
        }
    }
}
