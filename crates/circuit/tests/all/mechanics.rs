//! What moves beside a piston, against what is known of it: magnets, locks, mechanisms, forces from tables.

use crate::support::ROOM;
use crate::support::circuits::{network, run};
use serde_json::{Value, json};
use std::f64::consts::PI;

type Columns = std::collections::BTreeMap<String, Vec<f64>>;

fn slide(name: &str, mass: f64) -> Value {
    json!({ "name": name, "kind": "slide", "numbers": { "mass": mass } })
}

/// Holding force, N, and pole pitch, m, and the energy up to where they decouple, J.
const HOLDS: f64 = 363.0;
const PITCH: f64 = 0.01;
const DECOUPLES: f64 = HOLDS * PITCH / PI;

fn magnet(damping: f64) -> Value {
    json!({ "name": "magnet", "kind": "magnetic-coupling",
            "numbers": { "holding_force": HOLDS, "pole_pitch": PITCH, "damping": damping } })
}

/// Two masses with magnets between them; the first starts at a speed.
fn coupled(masses: [f64; 2], v: f64, spring: Option<f64>, duration: f64) -> Columns {
    let mut components = vec![slide("one", masses[0]), slide("two", masses[1]), magnet(0.0)];
    let mut joints = json!([["one.1", "magnet.1"], ["two.1", "magnet.2"]]);
    if let Some(stiffness) = spring {
        let numbers = json!({ "stiffness": stiffness, "rest_position": 0.0 });
        components.push(json!({ "name": "spring", "kind": "spring", "numbers": numbers }));
        joints = json!([["one.1", "magnet.1", "spring.1"], ["two.1", "magnet.2"]]);
    }
    let network = network(&json!(components), &joints).expect("assembles");
    let start = [
        ("one.position_m", 0.0),
        ("one.velocity_m_s", v),
        ("two.position_m", 0.0),
        ("two.velocity_m_s", 0.0),
    ];
    let (columns, ledger) = run(&network, &[], (duration, 10_000.0), &start);
    assert!(ledger[1].abs() < 1e-6 && ledger[2].abs() < 1e-5, "{ledger:?}");
    columns
}

#[test]
fn magnets_swing_couple_and_let_go_by_their_energy() {
    let masses = [2.0, 3.0];
    let reduced: f64 = 2.0 * 3.0 / 5.0;
    let w = (PI * HOLDS / (PITCH * reduced)).sqrt();
    let columns = coupled(masses, 1e-3, None, 0.05);
    let apart = |columns: &Columns, i: usize| columns["one.position_m"][i] - columns["two.position_m"][i];
    for i in [20, 111, 500] {
        let swing = 1e-3 / w * (w * 1e-4 * i as f64).sin();
        assert!((apart(&columns, i) - swing).abs() < 1e-9, "{i}: {} {swing}", apart(&columns, i));
    }
    let limit = (2.0 * DECOUPLES / reduced).sqrt();
    for sign in [1.0, -1.0] {
        let held = coupled(masses, sign * 0.999 * limit, None, 0.1);
        assert!(
            (0..=1000).all(|i| apart(&held, i).abs() < 0.5 * PITCH && held["magnet.decoupled"][i] == 0.0)
        );
        assert!(held["magnet.force_n"].iter().all(|force| force.abs() < HOLDS));
        let away = coupled(masses, sign * 1.01 * limit, None, 0.1);
        let rate = away["one.velocity_m_s"][1000] - away["two.velocity_m_s"][1000];
        let left = sign * limit * (1.01_f64.powi(2) - 1.0).sqrt();
        assert!((rate / left - 1.0).abs() < 1e-5, "{rate} {left}");
        assert!(away["magnet.decoupled"][1000] == 1.0 && away["magnet.force_n"][1000] == 0.0);
    }
}

#[test]
fn magnets_take_hold_again_where_they_come_near() {
    let (m, v) = (2.0, 1.2_f64);
    let columns = coupled([m, 1e9], v, Some(100.0), 1.0);
    let (x, decoupled) = (&columns["one.position_m"], &columns["magnet.decoupled"]);
    let changes: Vec<usize> = (1..x.len()).filter(|&i| decoupled[i] != decoupled[i - 1]).collect();
    let &[away, back] = &changes[..] else { panic!("it decouples at {changes:?}") };
    assert!(x[away] > 0.5 * PITCH && x[away - 1] <= 0.5 * PITCH);
    assert!(x[back] < 0.25 * PITCH && x[back - 1] >= 0.25 * PITCH);
    // What they lose is their energy from a quarter to half of the pitch.
    let centre = (back..x.len()).find(|&i| x[i] < 0.0).expect("it comes back");
    let share = x[centre - 1] / (x[centre - 1] - x[centre]);
    let v_of = &columns["one.velocity_m_s"];
    let found = v_of[centre - 1] + share * (v_of[centre] - v_of[centre - 1]);
    let lost = DECOUPLES * (0.25 * PI).cos();
    let expected = -(v * v - 2.0 * lost / m).sqrt();
    assert!((found / expected - 1.0).abs() < 1e-4, "{found} {expected}");
}

#[test]
fn a_held_carriage_lets_go_of_the_piston_at_the_pressure_of_the_data_sheet() {
    // CY1B25H: 363 N on a bore of 25 mm, 7.39 bar.
    let components = json!([
        { "name": "supply", "kind": "reservoir", "numbers": { "pressure": 1e6 } },
        { "name": "inlet", "kind": "fitting", "numbers": { "conductance": 3e-11, "critical_pressure_ratio": 0.3 } },
        { "name": "vent", "kind": "fitting", "numbers": { "conductance": 1e-8, "critical_pressure_ratio": 0.3 } },
        { "name": "own", "kind": "cylinder/rodless", "friction": { "law": "coulomb", "parameters": { "coulomb": 1e-3 } },
          "numbers": { "bore": 0.025, "stroke": 0.2, "dead_volume_a": 1e-5, "dead_volume_b": 1e-5, "moving_mass": 0.5 } },
        magnet(200.0),
        slide("carriage", 1e9),
    ]);
    let joints = json!([
        ["supply.1", "inlet.1"],
        ["inlet.2", "own.a"],
        ["own.b", "vent.1"],
        ["vent.2", "ambient"],
        ["own.rod", "magnet.1"],
        ["carriage.1", "magnet.2"],
    ]);
    let network = network(&components, &joints).expect("assembles");
    let start = [
        ("own.position_m", 0.1),
        ("own.velocity_m_s", 0.0),
        ("own.a.pressure_pa", 7.8e5),
        ("own.a.temperature_k", ROOM),
        ("own.b.pressure_pa", 101_300.0),
        ("own.b.temperature_k", ROOM),
        ("carriage.position_m", 0.1),
        ("carriage.velocity_m_s", 0.0),
    ];
    let (columns, ledger) = run(&network, &[], (4.0, 1000.0), &start);
    assert!(ledger[0].abs() < 1e-12 && ledger[1].abs() < 1e-6, "{ledger:?}");
    let decoupled = &columns["magnet.decoupled"];
    let at = decoupled.iter().position(|mode| *mode == 1.0).expect("it decouples") - 1;
    let gauge = columns["own.a.pressure_pa"][at] - columns["own.b.pressure_pa"][at];
    let carries = HOLDS / (0.25 * PI * 0.025 * 0.025);
    assert!(at > 1000 && (gauge / carries - 1.0).abs() < 2e-3, "{at}: {gauge} {carries}");
}

/// Holding force, N, stiffness, N/m, and times, s, of a lock.
const GRIP: f64 = 800.0;
const STIFF: f64 = 1e7;
const TIMES: [f64; 2] = [0.06, 0.04];

/// A slide of 20 kg in a lock, with a spring of no force, under commands of the lock.
fn locked(grip: f64, incline: f64, v: f64, commands: &[(&str, f64, f64)], duration: f64) -> Columns {
    let mut mass = slide("mass", 20.0);
    mass["numbers"]["incline"] = json!(incline);
    let lock = json!({ "name": "lock", "kind": "rod-lock", "numbers": {
        "holding_force": grip, "stiffness": STIFF, "time_on": TIMES[0], "time_off": TIMES[1] } });
    let network = network(&json!([mass, lock]), &json!([["mass.1", "lock.1"]])).expect("assembles");
    let start = [("mass.position_m", 0.0), ("mass.velocity_m_s", v)];
    let (columns, ledger) = run(&network, commands, (duration, 1000.0), &start);
    assert!(ledger[1].abs() < 1e-6, "{ledger:?}");
    columns
}

#[test]
fn a_lock_stops_a_moving_mass_on_the_way_that_its_force_needs() {
    for v in [1.0, -1.0_f64] {
        let columns = locked(GRIP, 0.0, v, &[("lock.command", 0.0, 0.0), ("lock.command", 0.1, 1.0)], 0.5);
        // The force rises over a fifth of the time on, about its middle, then it is constant.
        let (rise, begin) = (0.2 * TIMES[0], 0.1 + 0.9 * TIMES[0]);
        let brake = GRIP / 20.0;
        let slower = v.abs() - 0.5 * brake * rise;
        let way = begin + v.abs() * rise - brake * rise * rise / 6.0 + 0.5 * slower * slower / brake;
        // What the grip holds at rest it gives back.
        let stands = v * (way - GRIP / STIFF);
        let x = columns["mass.position_m"][500];
        assert!((x - stands).abs() < 2e-6, "{x} {stands}");
        assert!(columns["mass.velocity_m_s"][150] == v && columns["lock.force_n"][500].abs() < 1e-3);
        let most = columns["lock.force_n"].iter().fold(0.0, |most: f64, force| most.max(force * v));
        assert!((most / GRIP - 1.0).abs() < 1e-9, "{most}");
    }
}

#[test]
fn a_lock_that_is_shut_at_the_start_holds_until_it_opens() {
    let weight = 20.0 * 9.80665;
    let up = 0.5 * PI;
    let columns = locked(GRIP, up, 0.0, &[("lock.command", 0.0, 1.0), ("lock.command", 5.0, 0.0)], 5.1);
    let x = &columns["mass.position_m"];
    // As deep as the grip gives way, for seconds; it falls freely once the jaws carry less.
    assert!((x[4999] + weight / STIFF).abs() < 1e-10 && (x[4999] - x[1000]).abs() < 1e-12, "{}", x[4999]);
    assert!((columns["lock.force_n"][4999] + weight).abs() < 1e-3);
    assert!((columns["mass.acceleration_m_s2"][5060] + 9.80665).abs() < 1e-6);
    // Too heavy for it, it slides with what the grip does not carry.
    let heavy = locked(100.0, -up, 0.0, &[("lock.command", 0.0, 0.0), ("lock.command", 0.1, 1.0)], 0.3);
    assert!((heavy["mass.acceleration_m_s2"][299] - (9.80665 - 100.0 / 20.0)).abs() < 1e-9);
}

/// A free slide of 2 kg that starts at x = 0 with something on it.
fn on_a_slide(what: &Value, v: f64, duration: f64) -> Columns {
    let mut own = what.clone();
    own["name"] = json!("own");
    let network =
        network(&json!([slide("mass", 2.0), own]), &json!([["mass.1", "own.1"]])).expect("assembles");
    let start = [("mass.position_m", 0.0), ("mass.velocity_m_s", v)];
    let (columns, ledger) = run(&network, &[], (duration, 1000.0), &start);
    assert!(ledger[1].abs() < 1e-6, "{ledger:?}");
    columns
}

fn force(over: &str, shape: &str, points: &[[f64; 2]]) -> Value {
    json!({ "kind": format!("force/{over}"), "choices": { "shape": shape }, "points": points })
}

#[test]
fn a_force_over_the_position_gives_the_energy_of_its_integral() {
    let points = [[0.1, -2.0], [0.3, 6.0]];
    for (shape, integral) in [
        // From F_0 to F_1 by t, or by 3 t^2 - 2 t^3.
        ("straight", (|t| 0.5 * t * t) as fn(f64) -> f64),
        ("smooth", |t| t * t * t * (1.0 - 0.5 * t)),
    ] {
        let columns = on_a_slide(&force("position", shape, &points), 1.0, 0.5);
        for i in [50, 150, 250, 500] {
            let (x, v) = (columns["mass.position_m"][i], columns["mass.velocity_m_s"][i]);
            let t = ((x - 0.1) / 0.2).clamp(0.0, 1.0);
            let within = 0.2 * (-2.0 * t + 8.0 * integral(t));
            let work = -2.0 * x.min(0.1) + within + 6.0 * (x - 0.3).max(0.0);
            assert!((v * v - 1.0 - work).abs() < 1e-7, "{shape}, {i}: {v} at {x}");
        }
    }
}

#[test]
fn a_force_over_the_velocity_damps_and_one_over_time_gives_its_impulse() {
    let columns = on_a_slide(&force("velocity", "straight", &[[-2.0, 10.0], [2.0, -10.0]]), 1.0, 1.0);
    // m v' = -c v with c = 5 N s/m.
    for i in [10, 400, 1000] {
        let (v, t) = (columns["mass.velocity_m_s"][i], 1e-3 * i as f64);
        assert!((v - (-2.5 * t).exp()).abs() < 1e-7, "{t}: {v}");
    }
    // A tent of 10 N and 0.2 s, and one of 1 ms after seconds of rest.
    let points = [[0.1, 0.0], [0.2, 10.0], [0.3, 0.0], [5.0, 0.0], [5.0005, -2e3], [5.001, 0.0]];
    let columns = on_a_slide(&force("time", "straight", &points), 0.0, 6.0);
    let v = |i: usize| columns["mass.velocity_m_s"][i];
    assert!(v(99) == 0.0 && (v(200) - 0.25).abs() < 1e-9 && (v(300) - 0.5).abs() < 1e-9, "{}", v(200));
    assert!((v(5000) - 0.5).abs() < 1e-9 && v(6000).abs() < 1e-8, "{}", v(6000));
    assert!((columns["mass.position_m"][300] - 0.05).abs() < 1e-9);
}

#[test]
fn a_mass_that_the_position_determines_keeps_its_energy() {
    let (own, v0) = (2.0, 1.0);
    let toggle =
        json!({ "kind": "inertia/toggle", "numbers": { "mass": 3.0, "link_length": 0.3, "centre": 0.05 } });
    let lever = json!({ "kind": "inertia/lever",
                        "numbers": { "moment_of_inertia": 0.02, "distance": 0.1, "centre": 0.05 } });
    let table = json!({ "kind": "inertia/table", "points": [[0.05, 1.0], [0.15, 5.0]] });
    let of_toggle = |x: f64| 12.0 * (x - 0.05).powi(2) / (0.09 - (x - 0.05).powi(2));
    // J (d atan(s/h)/ds)^2
    let of_lever = |x: f64| 0.02 * (0.1 / (0.01 + (x - 0.05).powi(2))).powi(2);
    let of_table = |x: f64| {
        let t = ((x - 0.05) / 0.1).clamp(0.0, 1.0);
        1.0 + 4.0 * t * t * (3.0 - 2.0 * t)
    };
    let cases: [(&Value, &dyn Fn(f64) -> f64); 3] =
        [(&toggle, &of_toggle), (&lever, &of_lever), (&table, &of_table)];
    for (what, m) in cases {
        let columns = on_a_slide(what, v0, 0.2);
        for i in [40, 100, 200] {
            let (x, v) = (columns["mass.position_m"][i], columns["mass.velocity_m_s"][i]);
            let expected = v0 * ((own + m(0.0)) / (own + m(x))).sqrt();
            assert!((v - expected).abs() < 1e-7, "{what}, {i}: {v} {expected} at {x}");
        }
    }
    // A lever without anything on its pin but a light slide turns steadily.
    let mut light = slide("mass", 1e-9);
    light["numbers"]["incline"] = json!(0.0);
    let mut own = lever;
    own["name"] = json!("own");
    let network = network(&json!([light, own]), &json!([["mass.1", "own.1"]])).expect("assembles");
    let start = [("mass.position_m", -0.05), ("mass.velocity_m_s", 1.0)];
    let (columns, _) = run(&network, &[], (0.3, 1000.0), &start);
    // From -45 deg, at v cos^2(phi)/h = 5 rad/s.
    for i in [100, 300] {
        let phi = -0.25 * PI + 5.0 * 1e-3 * f64::from(i);
        let x = columns["mass.position_m"][i as usize];
        assert!((x - 0.05 - 0.1 * phi.tan()).abs() < 1e-6, "{i}: {x}");
    }
}

#[test]
fn points_that_do_not_rise_or_are_missing_are_refused() {
    let message = |points: Value| {
        let what = json!({ "name": "own", "kind": "inertia/table", "points": points });
        let all = json!([slide("mass", 2.0), what]);
        network(&all, &json!([["mass.1", "own.1"]])).err().map(|error| error.to_string()).unwrap_or_default()
    };
    for (points, said) in [
        (Value::Null, "own.points is missing"),
        (json!([[0.0, 1.0]]), "own.points has 1 points: 2 to 50"),
        (json!([[0.0, 1.0], [0.0, 2.0]]), "position = 0 m comes after 0 m"),
        (json!([[0.0, 1.0], [0.1, -2.0]]), "mass = -2 kg is out of bounds"),
        (json!([[0.0, 1.0], [0.1]]), "a point has 2 numbers, not 1"),
    ] {
        assert!(message(points).contains(said), "{said}");
    }
}

#[test]
fn what_moves_as_commanded_takes_no_mass_along() {
    let lever = json!({ "name": "lever", "kind": "inertia/lever",
                        "numbers": { "moment_of_inertia": 0.02, "distance": 0.1, "centre": 0.05 } });
    let components = json!([{ "name": "axis", "kind": "carriage" }, lever]);
    let refused = network(&components, &json!([["axis.1", "lever.1"]])).expect_err("refused").to_string();
    assert!(refused.contains("axis moves as commanded and cannot have the mass of lever"), "{refused}");
}

#[test]
fn an_impact_has_the_energy_of_what_moves_along() {
    let table = json!([[0.0, 1.0], [0.2, 3.0]]);
    let components = json!([
        { "name": "own", "kind": "cylinder/rodless", "friction": { "law": "coulomb", "parameters": { "coulomb": 1e-3 } },
          "numbers": { "bore": 0.025, "stroke": 0.2, "dead_volume_a": 1e-4, "dead_volume_b": 1e-4, "moving_mass": 2.0 } },
        { "name": "along", "kind": "inertia/table", "points": table },
        { "name": "stiff", "kind": "coupling", "numbers": { "stiffness": 1e7 } },
        slide("near", 4.0),
        { "name": "loose", "kind": "coupling", "numbers": { "stiffness": 1e7, "play": 1e-3 } },
        slide("far", 8.0),
    ]);
    let joints = json!([
        ["own.rod", "along.1", "stiff.1"],
        ["stiff.2", "near.1", "loose.1"],
        ["loose.2", "far.1"],
        ["own.a"],
        ["own.b"]
    ]);
    let network = network(&components, &joints).expect("assembles");
    let value = |name: &str| match name.rsplit('.').next() {
        Some("pressure_pa") => 101_300.0,
        Some("temperature_k") => ROOM,
        Some("position_m") => 0.19,
        _ => 1.0,
    };
    let start =
        network.assembly.given_names().into_iter().map(|name| (name.to_string(), value(name))).collect();
    let run = network.simulate(&[], (0.05, 1000.0), &start, ode::Options::default(), &mut |_| false);
    let impact = run.expect("runs").impacts[0];
    let (v, mass) = (impact.speed, 2.0 * impact.energy / impact.speed.powi(2));
    let moved = 2.0 + 3.0 + 4.0 + 8.0 / (v * v); // the last one keeps 1 m/s within the play
    assert!(v > 0.9 && (mass - moved).abs() < 2e-3, "{mass} kg at {v} m/s, not {moved} kg");
}
