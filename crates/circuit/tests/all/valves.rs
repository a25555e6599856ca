//! Valves that take time: dead times, travels, pulses, spools.

use crate::support::ROOM;
use crate::support::circuits::{network, run};
use circuit::Look;
use ode::Options;
use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::f64::consts::PI;

const CONDUCTANCE: f64 = 2e-8;

fn supply() -> Value {
    json!({ "name": "supply", "kind": "reservoir", "numbers": { "pressure": 7e5 } })
}

fn tank(name: &str, volume: f64) -> Value {
    json!({ "name": name, "kind": "tank", "numbers": { "volume": volume } })
}

/// A valve between the supply and a tank that it fills.
fn filling(valve: Value, volume: f64) -> circuit::Network {
    let mut valve = valve;
    valve["name"] = json!("valve");
    valve["numbers"]["conductance"] = json!(CONDUCTANCE);
    valve["numbers"]["critical_pressure_ratio"] = json!(0.3);
    let components = json!([supply(), valve, tank("tank", volume)]);
    network(&components, &json!([["supply.1", "valve.1"], ["valve.2", "tank.1"]])).expect("assembles")
}

fn filled(
    valve: Value,
    volume: f64,
    plan: &[(&str, f64, f64)],
    sampling: (f64, f64),
) -> BTreeMap<String, Vec<f64>> {
    let start = [("tank.pressure_pa", 101_300.0), ("tank.temperature_k", ROOM)];
    run(&filling(valve, volume), plan, sampling, &start).0
}

fn mass(columns: &BTreeMap<String, Vec<f64>>, volume: f64, sample: usize) -> f64 {
    columns["tank.pressure_pa"][sample] * volume / (287.05 * columns["tank.temperature_k"][sample])
}

const VALVE: &str = "valve.command";

#[test]
fn a_valve_that_is_told_again_where_it_goes_does_not_begin_anew() {
    // Told every 1 ms: its dead time is 3 ms, its travel 2 ms. Once to fill a tank, then to shut it.
    let (volume, times) = (1e-3, json!({ "time_on": 4e-3, "time_off": 4e-3, "travel_share": 0.5 }));
    let flow = |plan: &[(&str, f64, f64)]| {
        let valve = json!({ "kind": "valve/switching-2/2", "numbers": times });
        let columns = filled(valve, volume, plan, (0.04, 1e3));
        (0..columns["time_s"].len()).map(|sample| mass(&columns, volume, sample)).collect::<Vec<_>>()
    };
    let once = flow(&[(VALVE, 0.0, 1.0), (VALVE, 0.02, 0.0)]);
    let again: Vec<_> = (0..40).map(|k| (VALVE, 1e-3 * f64::from(k), f64::from(u8::from(k < 20)))).collect();
    let again = flow(&again);
    assert!(once[20] > 1.2 * once[0] && once[40] < 1.01 * once[27], "{} {} {}", once[0], once[20], once[40]);
    for (one, other) in once.iter().zip(&again) {
        assert!((one - other).abs() < 1e-6 * one, "{one} {other}");
    }
}

#[test]
fn pulses_let_through_what_their_width_and_the_times_of_the_valve_say() {
    // Period 20 ms, 2 ms on, 3 ms off: a share of 0.5 is open for 0.55 of a period. The flow is choked all along.
    let (volume, period, n) = (0.1, 0.02, 25.0);
    let choked = CONDUCTANCE * 1.185 * 7e5;
    let gained = |model: &str, share: f64| {
        let valve = json!({ "kind": "valve/switching-2/2", "choices": { "pwm_model": model },
            "numbers": { "time_on": 2e-3, "time_off": 3e-3, "pwm_frequency": 1.0 / period } });
        // Nearly to the end of a period: the valve has travelled back.
        let columns = filled(valve, volume, &[(VALVE, 0.0, share)], ((n - 0.01) * period, 1.0 / period));
        let samples = columns["time_s"].len();
        (mass(&columns, volume, samples - 1) - mass(&columns, volume, 0)) / (choked * period)
    };
    let exact = gained("exact", 0.5);
    assert!((exact / (0.55 * n) - 1.0).abs() < 1e-9, "{exact}");
    let averaged = gained("averaged", 0.5);
    assert!((averaged / (0.55 * (n - 0.01)) - 1.0).abs() < 1e-8, "{averaged}");
    // Shorter than the dead time on: the armature does not move. Pauses shorter than the dead time off: neither.
    assert_eq!(gained("exact", 0.08), 0.0);
    assert_eq!(gained("averaged", 0.08), 0.0);
    let pauses = gained("exact", 0.9);
    assert!((pauses - (n - 0.01 - 0.1)).abs() < 1e-8, "{pauses}"); // but the first time on
    assert!((gained("averaged", 0.9) - (n - 0.01)).abs() < 1e-8);
}

#[test]
fn pulses_that_never_open_the_valve_are_refused() {
    let valve = json!({ "name": "valve", "kind": "valve/switching-2/2", "numbers": { "conductance": CONDUCTANCE,
        "critical_pressure_ratio": 0.3, "time_on": 0.02, "time_off": 0.02, "pwm_frequency": 100.0 } });
    let joints = json!([["supply.1", "valve.1"], ["valve.2", "tank.1"]]);
    let message =
        network(&json!([supply(), valve, tank("tank", 1e-3)]), &joints).err().map(|e| e.to_string());
    assert!(message.is_some_and(|message| message.contains("the valve never opens")));
}

#[test]
fn an_armature_stands_for_the_dead_time_travels_steadily_and_turns_where_it_is() {
    // To the middle of the travel 10 ms, of which the travel takes 4: it moves from 8 to 12 ms after a command.
    let valve = |off: f64| {
        json!({ "kind": "valve/switching-2/2",
            "numbers": { "time_on": 0.01, "time_off": off, "travel_share": 0.4 } })
    };
    let position = |t: f64, plan: &[(&str, f64, f64)]| {
        let columns = filled(valve(0.01), 1e-3, plan, (0.04, 10_000.0));
        columns["valve.position"][(t * 10_000.0).round() as usize]
    };
    let once = [(VALVE, 0.0, 0.0), (VALVE, 0.001, 1.0)];
    for (t, x) in [(0.009, 0.0), (0.01, 0.25), (0.012, 0.75), (0.013, 1.0), (0.04, 1.0)] {
        assert!((position(t, &once) - x).abs() < 1e-9, "{t}: {x} {}", position(t, &once));
    }
    // Off, with a dead time of 1.6 ms and a travel of 0.8: it has come half way when it turns.
    let back = [once[0], once[1], (VALVE, 0.0094, 0.0)];
    let columns = filled(valve(0.002), 1e-3, &back, (0.04, 10_000.0));
    for (sample, expected) in [(100, 0.25), (110, 0.5), (112, 0.25), (114, 0.0), (400, 0.0)] {
        let x = columns["valve.position"][sample];
        assert!((x - expected).abs() < 1e-9, "{sample}: {expected} {x}");
    }
    // Shut is shut, and off within the dead time is no command at all.
    assert_eq!(columns["valve.mass_flow_kg_s"][120], 0.0);
    let columns = filled(valve(0.02), 1e-3, &[(VALVE, 0.0, 1.0), (VALVE, 0.007, 0.0)], (0.04, 1000.0));
    assert!(columns["valve.position"].iter().all(|x| *x == 0.0));
}

#[test]
fn no_two_edges_of_a_port_are_open_at_once() {
    // A shut work port of a small volume: what the supply gives while the valve travels fills that and no exhaust.
    let valve = json!({ "kind": "valve/switching-3/2", "numbers": { "time_on": 0.01, "time_off": 0.01 } });
    let plan = [(VALVE, 0.0, 1.0), (VALVE, 0.02, 0.0)];
    let columns = filled(valve, 1e-6, &plan, (0.04, 20_000.0));
    let (x, out) = (&columns["valve.position"], &columns["valve.mass_flow_2_kg_s"]);
    assert!(x.iter().any(|x| *x == 1.0 || (*x - 1.0).abs() < 1e-12));
    for (x, out) in x.iter().zip(out) {
        assert!((*x > 0.5 && *out >= 0.0) || (*x < 0.5 && *out <= 0.0) || out.abs() < 1e-13, "{x} {out}");
    }
    assert!(out.iter().any(|out| *out > 0.0) && out.iter().any(|out| *out < 0.0));
}

/// Pressures at the work ports of a valve with five ports, shut, once it stands at a command.
fn blocked(kind: &str, numbers: Value, choices: Value, command: f64) -> [f64; 2] {
    let mut valve = json!({ "name": "valve", "kind": kind, "numbers": numbers, "choices": choices });
    valve["numbers"]["conductance"] = json!(CONDUCTANCE);
    valve["numbers"]["critical_pressure_ratio"] = json!(0.3);
    let components = json!([supply(), valve, tank("a", 1e-6), tank("b", 1e-6)]);
    let joints = json!([["supply.1", "valve.1"], ["valve.4", "a.1"], ["valve.2", "b.1"]]);
    let network = network(&components, &joints).expect("assembles");
    let at = |name: &'static str| [(name, 4e5)];
    let start = [at("a.pressure_pa"), at("b.pressure_pa")].concat();
    let start: Vec<_> =
        start.into_iter().chain([("a.temperature_k", ROOM), ("b.temperature_k", ROOM)]).collect();
    let (columns, _) = run(&network, &[(VALVE, 0.0, command)], (3.0, 10.0), &start);
    ["a.pressure_pa", "b.pressure_pa"].map(|name| *columns[name].last().expect("a sample"))
}

#[test]
fn four_equal_leaks_hold_both_ports_and_set_the_pressure_gain() {
    // Both ports at 0.7572 of the supply whatever the leak; the gain is 4.7488 bar over the leak (components.md 4.2).
    for leak in [0.005, 0.02] {
        let gain = |u: f64| {
            let numbers = json!({ "leakage": leak });
            blocked("valve/proportional-5/3", numbers, json!({}), u)
        };
        let [a, b] = gain(0.0);
        assert!((a / 7e5 - 0.7572).abs() < 5e-5 && (b - a).abs() < 1.0, "{a} {b}");
        let u = 1e-3 * leak;
        let [a, b] = gain(u);
        assert!(((a - b) / u * leak / 4.7488e5 - 1.0).abs() < 2e-3, "{}", (a - b) / u * leak);
    }
}

#[test]
fn the_centre_of_a_valve_holds_vents_or_fills_both_ports() {
    let times = || json!({ "time_on": 0.01, "time_off": 0.01 });
    let centre =
        |centre: &str, u: f64| blocked("valve/switching-5/3", times(), json!({ "centre": centre }), u);
    let (vented, full) = (101_300.0, 7e5);
    for (kind, [a, b]) in [("closed", [4e5; 2]), ("exhaust", [vented; 2]), ("pressure", [full; 2])] {
        let [p, q] = centre(kind, 0.0);
        assert!((p - a).abs() < 1.0 && (q - b).abs() < 1.0, "{kind}: {p} {q}");
        let [p, q] = centre(kind, 1.0);
        assert!((p - full).abs() < 1.0 && (q - vented).abs() < 1.0, "{kind}, 1: {p} {q}");
        let [p, q] = centre(kind, -1.0);
        assert!((p - vented).abs() < 1.0 && (q - full).abs() < 1.0, "{kind}, -1: {p} {q}");
    }
    let [p, q] = blocked("valve/switching-5/2", times(), json!({}), 0.0);
    assert!((p - vented).abs() < 1.0 && (q - full).abs() < 1.0, "{p} {q}");
}

#[test]
fn an_impulse_valve_keeps_its_position_and_ends_the_travel_that_has_begun() {
    // To the middle of the travel 10 ms, of which the travel takes 4; back 20 ms, with a travel of 8.
    let valve = json!({ "name": "valve", "kind": "valve/impulse-5/2", "numbers": { "conductance": CONDUCTANCE,
        "critical_pressure_ratio": 0.3, "time_on": 0.01, "time_off": 0.02, "travel_share": 0.4 } });
    let components = json!([supply(), valve, tank("a", 1e-4), tank("b", 1e-4)]);
    let joints = json!([["supply.1", "valve.1"], ["valve.4", "a.1"], ["valve.2", "b.1"]]);
    let network = network(&components, &joints).expect("assembles");
    let from = |position: f64, plan: &[(&str, f64, f64)], duration: f64| {
        let start = [
            ("a.pressure_pa", 101_300.0),
            ("a.temperature_k", ROOM),
            ("b.pressure_pa", 101_300.0),
            ("b.temperature_k", ROOM),
            ("valve.position", position),
        ];
        run(&network, plan, (duration, 1000.0), &start).0
    };
    let at = |columns: &BTreeMap<String, Vec<f64>>, ms: usize, x: f64| {
        let position = columns["valve.position"][ms];
        assert!((position - x).abs() < 1e-9, "{ms} ms: {position}, expected {x}");
    };
    // A pulse of 9 ms starts it at 8 ms; at 9 ms, a quarter gone, the pulse ends and it goes on, and stays.
    let pulse = [(VALVE, 0.0, 1.0), (VALVE, 0.009, 0.0)];
    let columns = from(0.0, &pulse, 0.2);
    for (ms, x) in [(8, 0.0), (9, 0.25), (10, 0.5), (12, 1.0), (200, 1.0)] {
        at(&columns, ms, x);
    }
    let last =
        |columns: &BTreeMap<String, Vec<f64>>, name: &str| columns[name].last().copied().unwrap_or(f64::NAN);
    assert!(last(&columns, "a.pressure_pa") > 6e5 && last(&columns, "b.pressure_pa") < 1.02e5);
    // One of 7 ms is shorter than the dead time.
    at(&from(0.0, &[(VALVE, 0.0, 1.0), (VALVE, 0.007, 0.0)], 0.05), 50, 0.0);
    // Without any command it keeps the position that it starts in.
    let columns = from(1.0, &[], 0.2);
    assert!(columns["valve.position"].iter().all(|x| *x == 1.0));
    assert!(last(&columns, "a.pressure_pa") > 6e5 && last(&columns, "b.pressure_pa") < 1.02e5);
    let columns = from(0.0, &[], 0.2);
    assert!(last(&columns, "a.pressure_pa") < 1.02e5 && last(&columns, "b.pressure_pa") > 6e5);
    // The other coil: 16 ms of dead time, then back in 8.
    let columns = from(1.0, &[(VALVE, 0.0, -1.0), (VALVE, 0.017, 0.0)], 0.05);
    for (ms, x) in [(16, 1.0), (18, 0.75), (20, 0.5), (24, 0.0), (50, 0.0)] {
        at(&columns, ms, x);
    }
    // Its position is one of two.
    let start: BTreeMap<String, f64> = (network.assembly.given_names().into_iter())
        .map(|name| (name.to_string(), if name == "valve.position" { 0.5 } else { 3e5 }))
        .collect();
    let refused = network.assembly.session(&start, Options::default()).err().map(|error| error.to_string());
    assert!(refused.is_some_and(|message| message.contains("valve.position = 0.5 must be 0 or 1")));
}

#[test]
fn a_spool_is_of_second_order_behind_its_dead_time_and_its_play() {
    let (f, zeta, delay) = (90.0, 0.6, 0.002);
    let w = 2.0 * PI * f;
    let spool = |more: Value| {
        let mut valve = json!({ "kind": "valve/proportional-3/2",
            "numbers": { "frequency": f, "damping_ratio": zeta, "delay": delay } });
        for (key, value) in more.as_object().expect("numbers") {
            valve["numbers"][key] = value.clone();
        }
        valve
    };
    let step = [(VALVE, 0.0, 0.2), (VALVE, 0.01, 0.7)];
    let x = |more: Value, plan: &[(&str, f64, f64)]| {
        filled(spool(more), 1e-3, plan, (0.06, 2000.0))["valve.position"].clone()
    };
    let damped = w * f64::sqrt(1.0 - zeta * zeta);
    for (k, x) in x(json!({}), &step).iter().enumerate() {
        // It begins at rest: the command at 0 s also acts after the dead time.
        let after = |command_s: f64| {
            let t = (k as f64 / 2000.0 - command_s - delay).max(0.0);
            let swing = (damped * t).cos() + zeta * w / damped * (damped * t).sin();
            1.0 - (-zeta * w * t).exp() * swing
        };
        let expected = 0.2 * after(0.0) + 0.5 * after(0.01);
        assert!((x - expected).abs() < 1e-7, "{k}: {x} {expected}");
    }
    // A top speed of 1 in 50 ms: the middle of the way is gone at it.
    let slow = x(json!({ "stroke_time": 0.05 }), &step);
    assert!(((slow[64] - slow[60]) / (4.0 / 2000.0) - 20.0).abs() < 1e-3, "{}", slow[64] - slow[60]);
    // A play of 0.1: on the way up it stands 0.05 below the command, back by less than 0.1 does not move it.
    let plan = [step[0], step[1], (VALVE, 0.03, 0.61), (VALVE, 0.045, 0.4)];
    let played = x(json!({ "hysteresis": 0.1, "frequency": 0.0 }), &plan);
    for (k, expected) in [
        (0, 0.0),
        (3, 0.0),
        (5, 0.15),
        (23, 0.15),
        (25, 0.65),
        (80, 0.65),
        (93, 0.65),
        (95, 0.45),
        (110, 0.45),
    ] {
        assert!((played[k] - expected).abs() < 1e-12, "{k}: {}", played[k]);
    }
    // Overlap: the edge is shut up to it, and open at full command.
    let overlap = |u: f64| {
        let valve = json!({ "kind": "valve/proportional-3/2", "numbers": { "overlap": 0.1 } });
        filled(valve, 1e-3, &[(VALVE, 0.0, u)], (0.001, 1000.0))["valve.mass_flow_2_kg_s"][0]
    };
    assert_eq!(overlap(0.09), 0.0);
    assert!((overlap(0.55) / overlap(1.0) - 0.5).abs() < 1e-12);
}

#[test]
fn a_session_saved_within_a_dead_time_and_a_pulse_goes_on_with_its_bits() {
    let valve = json!({ "kind": "valve/switching-2/2",
        "numbers": { "time_on": 2e-3, "time_off": 3e-3, "pwm_frequency": 50.0 } });
    let network = filling(valve, 1e-3);
    let start: BTreeMap<_, _> =
        [("tank.pressure_pa".to_string(), 1e5), ("tank.temperature_k".to_string(), ROOM)].into();
    let session = || network.assembly.session(&start, Options::default()).expect("a session");
    let input = session().inputs().iter().position(|own| own.name == VALVE).expect("an input");
    let mut whole = session();
    whole.set(input, 0.4).expect("a share");
    let mut saved = None;
    for t in [0.0211, 0.0293, 0.1] {
        whole.go_on(t, &mut Look::new(&mut |_| false)).expect("goes on");
        saved.get_or_insert_with(|| whole.save().expect("bytes"));
    }
    let mut other = session();
    other.restore(&saved.expect("bytes")).expect("restores");
    other.go_on(0.0293, &mut Look::new(&mut |_| false)).expect("goes on");
    other.go_on(0.1, &mut Look::new(&mut |_| false)).expect("goes on");
    assert_eq!(whole.state(), other.state());
    assert!(whole.set(input, 1.2).is_err());
    assert!(whole.linearise(&[input]).is_err_and(|error| error.to_string().contains("switches")));
}

/// A valve between the supply and a tank at `p` Pa, with its exhaust.
fn proportional(valve: &Value, p: f64) -> impl Fn(f64) -> f64 + use<> {
    let mut valve = valve.clone();
    (valve["name"], valve["kind"]) = (json!("valve"), json!("valve/proportional-3/2"));
    let components = json!([supply(), valve, tank("tank", 1.0)]);
    let joints = json!([["supply.1", "valve.1"], ["valve.2", "tank.1"], ["valve.3", "ambient"]]);
    let network = network(&components, &joints).expect("assembles");
    move |command| {
        let start = [("tank.pressure_pa", p), ("tank.temperature_k", ROOM)];
        run(&network, &[(VALVE, 0.0, command)], (1e-4, 1e4), &start).0["valve.mass_flow_2_kg_s"][0]
    }
}

fn points(shape: &str, points: Value) -> Value {
    json!({ "choices": { "flow_shape": shape }, "points": points,
            "numbers": { "critical_pressure_ratio": 0.3 } })
}

/// -1: out by 2.4, 0: shut, 1: in by 2.7 dm3/(s bar).
fn two_ways(shape: &str) -> Value {
    points(
        shape,
        json!([[-1.0, 0.0, 0.0, 2.4e-8, 0.0], [0.0, 0.0, 0.0, 0.0, 0.0], [1.0, 2.7e-8, 0.0, 0.0, 0.0]]),
    )
}

fn same(found: f64, expected: f64, share: f64) {
    assert!((found - expected).abs() <= share * expected.abs(), "{found:e}, not {expected:e}");
}

#[test]
fn a_flow_table_gives_the_flow_of_each_edge_over_the_opening() {
    // Choked: C rho_0 p_1 at the reference temperature, 7 bar before the edge.
    let choked = |conductance: f64| conductance * 1.185 * 7e5;
    let into = proportional(&two_ways("smooth"), 101_300.0);
    let out = proportional(&two_ways("smooth"), 7e5);
    same(into(1.0), choked(2.7e-8), 1e-12);
    same(into(0.5), choked(1.35e-8), 1e-12);
    // 3 t^2 - 2 t^3 of the way between shut and open.
    same(into(0.25), choked(0.156_25 * 2.7e-8), 1e-12);
    same(out(-1.0), -choked(2.4e-8), 1e-12);
    same(out(-0.25), -choked(0.156_25 * 2.4e-8), 1e-12);
    assert_eq!(into(0.0), 0.0);
    assert!(into(-1.0).abs() < 1e-12, "the tank is at ambient pressure: {:e}", into(-1.0));
    let straight = proportional(&two_ways("straight"), 101_300.0);
    same(straight(0.25), choked(0.25 * 2.7e-8), 1e-12);
}

#[test]
fn a_flow_table_on_the_lines_of_an_edge_is_that_edge() {
    let numbers = json!({ "conductance": 2.7e-8, "exhaust_conductance": 2.4e-8, "critical_pressure_ratio": 0.3,
                          "exhaust_critical_pressure_ratio": 0.3 });
    for p in [3e5, 6.5e5] {
        let linear = proportional(&json!({ "numbers": numbers }), p);
        let table = proportional(&two_ways("straight"), p);
        for i in -10..=10 {
            let u = f64::from(i) / 10.0;
            same(table(u), linear(u), 1e-12);
        }
    }
}

#[test]
fn a_flow_table_passes_its_points_smoothly_without_overshoot() {
    let measured = [[-1.0, 0.0], [-0.2, 0.0], [0.1, 2e-9], [0.3, 1.7e-8], [0.6, 2e-8], [1.0, 2.2e-8]];
    let rows: Vec<[f64; 5]> = measured.iter().map(|[x, c]| [*x, *c, 0.0, 0.0, 0.0]).collect();
    let flow = proportional(&points("smooth", json!(rows)), 101_300.0);
    for [x, c] in measured {
        same(flow(x), c * 1.185 * 7e5, 1e-12);
    }
    let samples: Vec<f64> = (0..=200).map(|i| flow(-1.0 + 0.01 * f64::from(i))).collect();
    assert!(samples.windows(2).all(|pair| pair[1] >= pair[0]));
    for [x, _] in &measured[1..5] {
        let h = 1e-5;
        let (before, after) = ((flow(*x) - flow(x - h)) / h, (flow(x + h) - flow(*x)) / h);
        let largest = 2.2e-8 * 1.185 * 7e5 / 0.2;
        assert!((after - before).abs() < 1e-3 * largest, "{x}: {before} {after}");
    }
}

#[test]
fn a_flow_table_may_give_the_critical_pressure_ratio_of_an_edge() {
    let with =
        |ratio: f64| points("smooth", json!([[0.0, 0.0, ratio, 0.0, 0.0], [1.0, 2e-8, ratio, 0.0, 0.0]]));
    let edge = |ratio: f64| json!({ "numbers": { "conductance": 2e-8, "critical_pressure_ratio": ratio } });
    // Subsonic: the ratio counts.
    let of = |valve: &Value| proportional(valve, 6e5)(1.0);
    same(of(&with(0.15)), of(&edge(0.15)), 1e-12);
    same(of(&with(0.0)), of(&edge(0.3)), 1e-12);
    assert!(of(&edge(0.3)) > 1.01 * of(&edge(0.15)));
    let over = points("straight", json!([[0.0, 2e-8, 0.1, 0.0, 0.0], [1.0, 2e-8, 0.5, 0.0, 0.0]]));
    same(proportional(&over, 6e5)(0.5), of(&edge(0.3)), 1e-12);
}

#[test]
fn a_flow_table_of_a_5_3_valve_names_its_paths() {
    // Columns: opening, then conductance and ratio of 1-4, 4-5, 1-2 and 2-3.
    let row = |x: f64, [to_4, from_4, to_2, from_2]: [f64; 4]| {
        json!([x, to_4, 0.0, from_4, 0.0, to_2, 0.0, from_2, 0.0])
    };
    let table = json!([
        row(-1.0, [0.0, 1e-8, 2e-8, 0.0]),
        row(0.0, [0.0, 0.0, 0.0, 0.0]),
        row(1.0, [3e-8, 0.0, 0.0, 4e-8])
    ]);
    let valve = json!({ "name": "valve", "kind": "valve/proportional-5/3", "points": table,
                        "numbers": { "critical_pressure_ratio": 0.3 } });
    let components = json!([supply(), valve, tank("four", 1.0), tank("two", 1.0)]);
    let joints = json!([
        ["supply.1", "valve.1"],
        ["valve.4", "four.1"],
        ["valve.2", "two.1"],
        ["valve.5", "ambient"],
        ["valve.3", "ambient"]
    ]);
    let network = network(&components, &joints).expect("assembles");
    let start: Vec<(&str, f64)> = vec![
        ("four.pressure_pa", 3e5),
        ("four.temperature_k", ROOM),
        ("two.pressure_pa", 3e5),
        ("two.temperature_k", ROOM),
    ];
    let flows = |command: f64| {
        let columns = run(&network, &[(VALVE, 0.0, command)], (1e-4, 1e4), &start).0;
        ["valve.mass_flow_4_kg_s", "valve.mass_flow_2_kg_s"].map(|name| columns[name][0])
    };
    // Into the tanks choked by 7 bar, out of them by 3 bar: 1.013 bar is less than 0.3 of neither; so phi counts.
    let phi = (1.0 - ((101_300.0 / 3e5 - 0.3) / 0.7_f64).powi(2)).sqrt();
    let into = (1.0 - ((3.0 / 7.0 - 0.3) / 0.7_f64).powi(2)).sqrt();
    let expected = |to: f64, from: f64| [to * 1.185 * 7e5 * into, -from * 1.185 * 3e5 * phi];
    let ([in_4, out_2], [in_2, out_4]) = (expected(3e-8, 4e-8), expected(2e-8, 1e-8));
    for (found, wanted) in [(flows(1.0), [in_4, out_2]), (flows(-1.0), [out_4, in_2])] {
        same(found[0], wanted[0], 1e-12);
        same(found[1], wanted[1], 1e-12);
    }
}

#[test]
fn a_flow_table_is_the_only_word_on_the_edges() {
    let message = |more: Value, table: Value| {
        let mut numbers = json!({ "critical_pressure_ratio": 0.3 });
        for (key, value) in more.as_object().expect("numbers") {
            numbers[key] = value.clone();
        }
        let valve =
            json!({ "name": "v", "kind": "valve/proportional-3/2", "numbers": numbers, "points": table });
        let joints = json!([["v.1", "ambient"], ["v.2", "tank.1"], ["v.3", "ambient"]]);
        let found = network(&json!([valve, tank("tank", 1e-3)]), &joints);
        found.err().map(|error| error.to_string()).expect("refused")
    };
    let good = json!([[0.0, 0.0, 0.0, 0.0, 0.0], [1.0, 1e-8, 0.0, 0.0, 0.0]]);
    let shut = json!([[0.0, 0.0, 0.2, 0.0, 0.0], [1.0, 0.0, 0.0, 0.0, 0.3]]);
    for (found, said) in [
        (
            message(json!({ "conductance": 1e-8 }), good.clone()),
            "v.conductance and v.flow_table both set this value",
        ),
        (message(json!({ "overlap": 0.1 }), good.clone()), "v.overlap and v.flow_table both set this value"),
        (message(json!({}), shut), "v.flow_table opens no edge"),
        (
            message(json!({}), json!([[0.0, 0.0, 0.0, 0.0, 0.0], [2.0, 1e-8, 0.0, 0.0, 0.0]])),
            "v.flow_table: opening = 2",
        ),
        (message(json!({}), json!([[0.0, 0.0, 1.0, 0.0, 0.0], [1.0, 1e-8, 0.0, 0.0, 0.0]])), "out of bounds"),
        (message(json!({}), Value::Null), "v.conductance is missing"),
    ] {
        assert!(found.contains(said), "{found}");
    }
}
