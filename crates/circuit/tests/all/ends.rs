//! Cylinders with a spring, a cushion or something to run into at their end, against what is known of it.

use crate::support::ROOM;
use crate::support::circuits::{network, run};
use serde_json::{Value, json};

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

/// A cylinder without a rod whose ends breathe through wide fittings, with numbers beside those that it has.
fn breathing(numbers: &[(&str, f64)], wide: [f64; 2]) -> (Value, Value) {
    let mut own = json!({ "bore": 0.04, "stroke": 0.2, "dead_volume_a": 1e-6, "dead_volume_b": 1e-6,
                          "moving_mass": 2.0, "heat_transfer": 0.0 });
    numbers.iter().for_each(|(key, value)| own[*key] = json!(value));
    let fitting = |name: &str, conductance: f64| {
        json!({ "name": name, "kind": "fitting",
                "numbers": { "conductance": conductance, "critical_pressure_ratio": 0.3 } })
    };
    let cylinder =
        json!({ "name": "own", "kind": "cylinder/rodless", "friction": friction(), "numbers": own });
    let joints =
        json!([["own.a", "out_a.1"], ["own.b", "out_b.1"], ["out_a.2", "ambient"], ["out_b.2", "ambient"]]);
    (json!([cylinder, fitting("out_a", wide[0]), fitting("out_b", wide[1])]), joints)
}

fn start(x: f64, v: f64, a: f64, b: f64) -> Vec<(&'static str, f64)> {
    vec![
        ("own.position_m", x),
        ("own.velocity_m_s", v),
        ("own.a.pressure_pa", a),
        ("own.a.temperature_k", ROOM),
        ("own.b.pressure_pa", b),
        ("own.b.temperature_k", ROOM),
    ]
}

fn closes(ledger: [f64; 3]) {
    assert!(ledger[0].abs() < 1e-12 && ledger[1].abs() < 1e-6 && ledger[2].abs() < 1e-5, "{ledger:?}");
}

#[test]
fn a_cushion_with_its_needle_shut_takes_the_energy_of_an_adiabate() {
    let numbers = [
        ("cushion_b_length", 0.0201),
        ("cushion_b_plunger_diameter", 0.02),
        ("cushion_b_needle_conductance", 0.0),
        ("cushion_b_check_conductance", 0.0),
        ("cushion_b_port_volume", 1e-5),
    ];
    let (components, joints) = breathing(&numbers, [1e-3, 1e-3]);
    let network = network(&components, &joints).expect("assembles");
    // 20 mm before the end, where the transition of 0.2 mm is over.
    let (columns, ledger) = run(&network, &[], (0.005, 200_000.0), &start(0.18, 3.2, 101_300.0, 6e5));
    closes(ledger);
    let (p, v) = (&columns["own.b.pressure_pa"], &columns["own.velocity_m_s"]);
    let after = (0..p.len()).find(|&i| p[i] > 15e5).expect("15 bar");
    let share = (15e5 - p[after - 1]) / (p[after] - p[after - 1]);
    let at = |column: &[f64]| column[after - 1] + share * (column[after] - column[after - 1]);
    let taken = 0.5 * 2.0 * (3.2 * 3.2 - at(v) * at(v));
    let way = at(&columns["own.position_m"]) - 0.18;
    assert!((taken - 7.94).abs() < 0.02 && (way - 0.0101).abs() < 5e-5, "{taken} J on {way} m");
    assert!((columns["own.b.port_pressure_pa"][200] - 101_300.0).abs() < 100.0);
}

#[test]
fn a_cushion_brakes_the_more_the_narrower_its_needle_is_at_either_end() {
    let braked = |end: &str, needle: f64| {
        let key = |key: &str| format!("cushion_{end}_{key}");
        let each = [
            ("length", 0.02),
            ("plunger_diameter", 0.02),
            ("needle_conductance", needle),
            ("port_volume", 2e-6),
        ];
        let each: Vec<(String, f64)> = each.iter().map(|(own, value)| (key(own), *value)).collect();
        let each: Vec<(&str, f64)> = each.iter().map(|(own, value)| (own.as_str(), *value)).collect();
        let (components, joints) = breathing(&each, [1e-8; 2]);
        let network = network(&components, &joints).expect("assembles");
        // Driven by what is left of 6 bar, against what is left of 2 bar.
        let from = if end == "b" { start(0.1, 1.0, 6e5, 2e5) } else { start(0.1, -1.0, 2e5, 6e5) };
        let (columns, ledger) = run(&network, &[], (0.4, 10_000.0), &from);
        closes(ledger);
        let away = |x: &f64| if end == "b" { 0.2 - x } else { *x };
        let x: Vec<f64> = columns["own.position_m"].iter().map(away).collect();
        let met = x.iter().position(|s| *s < 0.0).unwrap_or(x.len() - 1);
        let highest =
            columns[&format!("own.{end}.pressure_pa")].iter().fold(0.0, |most: f64, p| most.max(*p));
        (columns["own.velocity_m_s"][met].abs(), highest, x)
    };
    let each = [1e-8, 3e-9, 1e-9].map(|needle| braked("b", needle));
    assert!(
        each[0].0 > each[1].0 && each[1].0 > each[2].0 && each[2].0 < 0.5 * each[0].0,
        "{:?}",
        each.map(|e| e.0)
    );
    assert!(each[0].1 < each[1].1 && each[1].1 < each[2].1);
    let mirrored = braked("a", 3e-9).2;
    assert!(mirrored.iter().zip(&braked("b", 3e-9).2).all(|(a, b)| (a - b).abs() < 1e-7));
    // Through the check valve it leaves the end faster than through the needle alone.
    let leaves = |check: f64| {
        let numbers = [
            ("cushion_b_length", 0.02),
            ("cushion_b_plunger_diameter", 0.02),
            ("cushion_b_needle_conductance", 1e-10),
            ("cushion_b_check_conductance", check),
            ("cushion_b_port_volume", 2e-6),
        ];
        let (mut components, mut joints) = breathing(&numbers, [1e-8; 2]);
        components[2] = json!({ "name": "supply", "kind": "reservoir", "numbers": { "pressure": 7e5 } });
        joints = json!([joints[0], ["own.b", "inlet.1"], ["inlet.2", "supply.1"], joints[2]]);
        let inlet = json!({ "name": "inlet", "kind": "fitting",
                            "numbers": { "conductance": 1e-8, "critical_pressure_ratio": 0.3 } });
        components.as_array_mut().expect("components").push(inlet);
        let network = network(&components, &joints).expect("assembles");
        let (columns, ledger) = run(&network, &[], (0.1, 1000.0), &start(0.2, 0.0, 101_300.0, 101_300.0));
        closes(ledger);
        columns["own.position_m"][100]
    };
    assert!(leaves(1e-8) < leaves(0.0) - 1e-3, "{} {}", leaves(1e-8), leaves(0.0));
}

#[test]
fn an_impossible_cushion_is_refused() {
    let message = |numbers: &[(&str, f64)]| {
        let (components, joints) = breathing(numbers, [1e-8; 2]);
        network(&components, &joints).err().map(|error| error.to_string()).unwrap_or_default()
    };
    let whole = |length: f64, diameter: f64| {
        message(&[
            ("cushion_a_length", length),
            ("cushion_a_plunger_diameter", diameter),
            ("cushion_a_needle_conductance", 1e-9),
            ("cushion_a_port_volume", 1e-6),
        ])
    };
    assert_eq!(message(&[("cushion_a_length", 0.02)]), "own.cushion_a_plunger_diameter is missing");
    assert!(whole(0.02, 0.05).contains("own.cushion_a_plunger_diameter = 50 mm must be less than the bore"));
    assert!(whole(0.3, 0.02).contains("own.cushion_a_length = 300 mm must be less than the stroke"));
    assert_eq!(whole(0.02, 0.02), "");
    let both = |a: f64, b: f64| {
        let each = [("a", a), ("b", b)].map(|(end, length)| {
            [
                ("length", length),
                ("plunger_diameter", 0.02),
                ("needle_conductance", 1e-9),
                ("port_volume", 1e-6),
            ]
            .map(|(key, value)| (format!("cushion_{end}_{key}"), value))
        });
        message(&each.as_flattened().iter().map(|(key, value)| (key.as_str(), *value)).collect::<Vec<_>>())
    };
    assert_eq!(both(0.1, 0.1), "", "a stroke of 200 mm");
    let overlap =
        "own.cushion_b_length = 110 mm overlaps own.cushion_a_length = 100 mm: together they must not be";
    assert!(both(0.1, 0.11).contains(overlap), "{}", both(0.1, 0.11));
}

#[test]
fn what_a_piston_never_runs_into_is_refused() {
    let message = |kind: &str, position: f64, play: Option<f64>| {
        let (mut components, mut joints) = breathing(&[], [1e-8; 2]);
        let needs = if kind == "bumper" {
            json!({ "position": position, "rated_force": 100.0, "rated_depth": 1e-3 })
        } else {
            json!({ "position": position, "stroke": 0.01, "damping": 100.0 })
        };
        let each = components.as_array_mut().expect("components");
        each.push(json!({ "name": "end", "kind": kind, "numbers": needs }));
        let of = joints.as_array_mut().expect("joints");
        if let Some(play) = play {
            each.push(slide("mass", 2.0));
            each.push(
                json!({ "name": "link", "kind": "coupling", "numbers": { "stiffness": 1e6, "play": play } }),
            );
            of.extend([json!(["own.rod", "link.1"]), json!(["link.2", "mass.1", "end.1"])]);
        } else {
            of.push(json!(["own.rod", "end.1"]));
        }
        network(&components, &joints).err().map(|error| error.to_string()).unwrap_or_default()
    };
    for kind in ["bumper", "shock-absorber"] {
        for inside in [0.0, 0.15, 0.2] {
            assert_eq!(message(kind, inside, None), "");
        }
        for (outside, told) in [(-0.01, "-10"), (0.21, "210")] {
            let said = message(kind, outside, None);
            let what = format!("end.position = {told} mm is outside the stroke of own, 0 to 200 mm");
            assert!(said.starts_with(&what), "{said}");
        }
        assert_eq!(message(kind, 0.205, Some(0.02)), "", "within the play of the coupling");
        assert!(message(kind, 0.211, Some(0.02)).contains("outside the stroke of own"));
    }
}

fn slide(name: &str, mass: f64) -> Value {
    json!({ "name": name, "kind": "slide", "numbers": { "mass": mass } })
}

/// A free slide of 2 kg that runs from x = 0 into something at 10 mm, or mirrored.
fn runs_into(
    kind: &str,
    side: &str,
    numbers: &Value,
    v: f64,
) -> std::collections::BTreeMap<String, Vec<f64>> {
    let (mut numbers, sign) = (numbers.clone(), if side == "b" { 1.0 } else { -1.0 });
    numbers["position"] = json!(0.01 * sign);
    let components = json!([
        slide("mass", 2.0),
        { "name": "end", "kind": kind, "numbers": numbers, "choices": { "side": side } },
    ]);
    let network = network(&components, &json!([["mass.1", "end.1"]])).expect("assembles");
    let start = [("mass.position_m", 0.0), ("mass.velocity_m_s", sign * v)];
    let (mut columns, ledger) = run(&network, &[], (0.1, 10_000.0), &start);
    assert!(ledger[1].abs() < 1e-6, "{ledger:?}");
    columns.values_mut().flatten().for_each(|value| *value *= sign);
    columns
}

#[test]
fn a_bumper_gives_back_the_share_of_the_speed_that_is_said() {
    for (side, e, exponent) in [("b", 0.2, 1.5), ("a", 0.5, 1.5), ("b", 0.9, 1.0)] {
        let numbers = json!({ "rated_force": 500.0, "rated_depth": 2e-3, "restitution": e,
                              "exponent": exponent, "impact_speed": 0.5 });
        let columns = runs_into("bumper", side, &numbers, 0.5);
        let (v, force) = (&columns["mass.velocity_m_s"], &columns["end.force_n"]);
        assert!((v[1000] + e * 0.5).abs() < 1e-5, "{e}: {}", v[1000]);
        assert!(force.iter().all(|force| *force >= 0.0) && force.iter().any(|force| *force > 100.0));
    }
}

#[test]
fn a_shock_absorber_brakes_by_the_way_that_it_is_pushed_in() {
    let (c, m, first) = (100.0, 2.0, 1e-4);
    for (side, end) in [("b", c), ("a", 3.0 * c)] {
        let numbers =
            json!({ "stroke": 0.05, "damping": c, "end_damping": end, "preload": 0.0, "stiffness": 0.0 });
        let columns = runs_into("shock-absorber", side, &numbers, 1.0);
        let (x, v) = (columns["mass.position_m"][500], columns["mass.velocity_m_s"][500]);
        let s = x - 0.01;
        // int c ds, where the first 0.1 mm count half.
        let taken = c * (s - 0.5 * first) + (end - c) * (0.5 * s * s - first * first / 6.0) / 0.05;
        assert!(s > 0.01 && (v - (-taken / m).exp()).abs() < 1e-6, "{side}: {s} m, {v} m/s");
    }
    // Its spring gives back what it has taken, its oil nothing: k s^2/2 + F_0 s from the deepest point on.
    let numbers = json!({ "stroke": 0.05, "damping": 100.0, "preload": 20.0, "stiffness": 1000.0 });
    let columns = runs_into("shock-absorber", "b", &numbers, 1.0);
    let deepest = columns["mass.position_m"].iter().fold(0.0, |most: f64, x| most.max(x - 0.01));
    let given = 500.0 * deepest * deepest + 20.0 * (deepest - 0.5 * first);
    let v = columns["mass.velocity_m_s"][1000];
    assert!(v < 0.0 && (0.5 * m * v * v / given - 1.0).abs() < 1e-4, "{v} m/s, {given} J");
}

#[test]
fn coupled_masses_swing_by_their_reduced_mass_and_fly_free_within_the_play() {
    let (k, m) = (5e4_f64, [2.0, 3.0]);
    let coupled = |m: [f64; 2], play: f64| {
        let components = json!([
            slide("one", m[0]),
            slide("two", m[1]),
            { "name": "own", "kind": "coupling", "numbers": { "stiffness": k, "play": play } },
        ]);
        let joints = json!([["one.1", "own.1"], ["two.1", "own.2"]]);
        let network = network(&components, &joints).expect("assembles");
        let start = [
            ("one.position_m", 0.0),
            ("one.velocity_m_s", 1.0),
            ("two.position_m", 0.0),
            ("two.velocity_m_s", 0.0),
        ];
        let (columns, ledger) = run(&network, &[], (0.1, 10_000.0), &start);
        assert!(ledger[1].abs() < 1e-6, "{ledger:?}");
        columns
    };
    let w = (k * (1.0 / m[0] + 1.0 / m[1])).sqrt();
    let columns = coupled(m, 0.0);
    let apart = |i: usize| columns["one.position_m"][i] - columns["two.position_m"][i];
    assert!([37, 500, 1000].into_iter().all(|i| (apart(i) - (w * 1e-4 * i as f64).sin() / w).abs() < 1e-8));
    assert!((1..40).all(|i| (columns["own.force_n"][i] - k * apart(i)).abs() < 1e-6 && apart(i) > 0.0));
    // Equal masses and 20 mm of play: 10 ms of flight, half a swing in which they exchange their speeds, 20 ms of flight.
    let columns = coupled([2.0, 2.0], 0.02);
    let half = std::f64::consts::PI / (2.0 * k / 2.0).sqrt();
    let v = |name: &str, t: f64| columns[&format!("{name}.velocity_m_s")][(t * 1e4) as usize];
    assert!(v("two", 0.0098) == 0.0 && v("one", 0.0098) == 1.0);
    assert!((v("two", 0.011 + half) - 1.0).abs() < 1e-6 && v("one", 0.011 + half).abs() < 1e-6);
    assert!((v("two", 0.029 + half) - 1.0).abs() < 1e-6 && (v("one", 0.031 + 2.0 * half) - 1.0).abs() < 1e-6);
}

#[test]
fn a_tandem_cylinder_pushes_with_the_areas_of_both_pistons() {
    let numbers = json!({ "bore": 0.04, "rod_diameter": 0.016, "stroke": 0.1, "dead_volume_a": 5e-6,
        "dead_volume_b": 5e-6, "dead_volume_a2": 5e-6, "dead_volume_b2": 5e-6, "moving_mass": 1.0 });
    let fitting = |name: &str| json!({ "name": name, "kind": "fitting", "numbers": { "conductance": 2e-9, "critical_pressure_ratio": 0.3 } });
    let stand = |driven: [&str; 2], others: [&str; 2], gauge: f64| {
        let components = json!([
            { "name": "supply", "kind": "reservoir", "numbers": { "pressure": 101_300.0 + gauge } },
            fitting("in_1"), fitting("in_2"), fitting("out_1"), fitting("out_2"),
            { "name": "own", "kind": "cylinder/tandem", "friction": friction(), "numbers": numbers },
            { "name": "spring", "kind": "spring", "numbers": { "stiffness": 5e3, "rest_position": 0.05 } },
        ]);
        let joints = json!([
            ["supply.1", "in_1.1", "in_2.1"],
            ["in_1.2", format!("own.{}", driven[0])],
            ["in_2.2", format!("own.{}", driven[1])],
            ["out_1.1", format!("own.{}", others[0])],
            ["out_2.1", format!("own.{}", others[1])],
            ["out_1.2", "ambient"],
            ["out_2.2", "ambient"],
            ["own.rod", "spring.1"],
        ]);
        let network = network(&components, &joints).expect("assembles");
        assert!(network.warnings.is_empty(), "{:?}", network.warnings);
        let names: Vec<String> = network.assembly.given_names().into_iter().map(String::from).collect();
        let value = |name: &str| match name.rsplit('.').next() {
            Some("pressure_pa") => 101_300.0,
            Some("temperature_k") => ROOM,
            Some("position_m") => 0.05,
            _ => 0.0,
        };
        let start: Vec<(&str, f64)> = names.iter().map(|name| (name.as_str(), value(name))).collect();
        let (columns, ledger) = run(&network, &[], (3.0, 100.0), &start);
        closes(ledger);
        columns["own.position_m"][300]
    };
    let area = |rod: f64| 0.25 * std::f64::consts::PI * (0.04_f64.powi(2) - rod * rod);
    let (full, ring) = (area(0.0), area(0.016));
    for (driven, others, areas, sign) in
        [(["a", "a2"], ["b", "b2"], full + ring, 1.0), (["b", "b2"], ["a", "a2"], 2.0 * ring, -1.0)]
    {
        let x = stand(driven, others, 5e4);
        assert!((x - 0.05 - sign * 5e4 * areas / 5e3).abs() < 2e-5, "{driven:?}: {x}");
    }
}

#[test]
fn a_wall_that_stores_heat_and_the_gas_cool_as_two_stores_do() {
    let (capacity, inside, outside, volume) = (1000.0, 5.0 * 0.2, 10.0 * 0.3, 1e-2);
    let components = json!([{ "name": "tank", "kind": "tank", "numbers": { "volume": volume, "wall_area": 0.2,
        "heat_transfer": 5.0, "wall_temperature": 350.0, "wall_capacity": capacity, "wall_outer_area": 0.3 } }]);
    let network = network(&components, &json!([["tank.1"]])).expect("assembles");
    let filled = [("tank.pressure_pa", 7e5), ("tank.temperature_k", ROOM)];
    let (columns, ledger) = run(&network, &[], (1000.0, 0.1), &filled);
    closes(ledger);
    // C_g T' = a (W - T), C W' = -a (W - T) - b W over the room: two exponentials, of 7 and 330 s.
    let gas = 7e5 * volume / (287.05 * ROOM) * 287.05 / 0.4;
    let (p, q) = (inside / gas + (inside + outside) / capacity, inside * outside / (gas * capacity));
    let root = (0.25 * p * p - q).sqrt();
    let (slow, fast) = (0.5 * p - root, 0.5 * p + root);
    let w0 = 350.0 - ROOM;
    // T(0) = 0, T'(0) = a w0/C_g.
    let amplitude = inside * w0 / gas / (fast - slow);
    for i in [1_u32, 10, 50, 100] {
        let t = 10.0 * f64::from(i);
        let (e, f) = ((-slow * t).exp(), (-fast * t).exp());
        let above = amplitude * (e - f);
        let wall = above + gas / inside * amplitude * (fast * f - slow * e);
        let found =
            [columns["tank.temperature_k"][i as usize], columns["tank.wall_temperature_k"][i as usize]];
        assert!(
            (found[0] - ROOM - above).abs() < 1e-5 && (found[1] - ROOM - wall).abs() < 1e-5,
            "{t}: {found:?}"
        );
    }
    // The wall of a cylinder takes up what its gas gives.
    let (mut components, joints) =
        breathing(&[("wall_capacity", 20.0), ("wall_outer_area", 0.0)], [1e-13; 2]);
    components[0]["numbers"]["heat_transfer"] = json!(100.0);
    let network = crate::support::circuits::network(&components, &joints).expect("assembles");
    let (columns, ledger) = run(&network, &[], (3.0, 100.0), &start(0.1, 3.0, 101_300.0, 101_300.0));
    closes(ledger);
    let warmer = columns["own.wall_temperature_k"][300] - ROOM;
    assert!(warmer > 0.05 && warmer < 9.0 / 20.0, "{warmer} K");
}

#[test]
fn accounts_have_the_names_of_components() {
    let (components, joints) = breathing(&[("leakage", 1e-10)], [1e-8; 2]);
    let network = network(&components, &joints).expect("assembles");
    let from = start(0.1, 1.0, 6e5, 2e5).into_iter().map(|(name, value)| (name.to_string(), value)).collect();
    let run = network.simulate(&[], (0.05, 1000.0), &from, ode::Options::default(), &mut |_| false);
    let accounts = run.expect("runs").balance.expect("a ledger").accounts;
    for name in
        ["own: friction heat", "own: wall heat", "own: throttling", "out_a: throttling", "out_b: mixing"]
    {
        assert_eq!(accounts.iter().filter(|(own, ..)| own == name).count(), 1, "{name} in {accounts:?}");
    }
}

#[test]
fn an_end_stop_is_laid_out_for_the_pressure_of_the_start() {
    // Shut, in the air: there is no supply.
    let shut = |cushioned: bool| {
        let mut numbers = json!({ "bore": 0.032, "rod_diameter": 0.006, "stroke": 0.2, "dead_volume_a": 3e-5,
                                  "dead_volume_b": 3e-5, "moving_mass": 0.2 });
        let cushion = json!({ "cushion_b_length": 0.012, "cushion_b_plunger_diameter": 8e-3,
                              "cushion_b_needle_conductance": 5e-10, "cushion_b_port_volume": 1e-6 });
        if cushioned {
            let own = numbers.as_object_mut().expect("numbers");
            own.extend(cushion.as_object().expect("numbers").clone());
        }
        let own = json!({ "name": "own", "kind": "cylinder/through-rod", "friction": friction(), "numbers": numbers });
        network(&json!([own]), &json!([["own.a"], ["own.b"]])).expect("assembles")
    };
    let from = |network: &circuit::Network, a: f64, b: f64| -> std::collections::BTreeMap<String, f64> {
        let value = |name: &str| match name {
            "own.position_m" => 0.06,
            "own.velocity_m_s" => 0.0,
            "own.a.pressure_pa" => a,
            name if name.ends_with("pressure_pa") => b,
            _ => ROOM,
        };
        network.assembly.given_names().into_iter().map(|name| (name.to_string(), value(name))).collect()
    };
    let area = 0.25 * std::f64::consts::PI * (0.032 * 0.032 - 0.006 * 0.006);
    for cushioned in [false, true] {
        let network = shut(cushioned);
        let stops = |start: f64| {
            network.end_stops(start).map(|(_, stop, taken)| (stop, taken)).next().expect("stops")
        };
        let ((plain, taken), (stop, more)) = (stops(101_300.0), stops(8e5));
        let (force, depth) = ((8e5 - 101_300.0) * area, taken.depth);
        let rise = 2.0 * force * (0.2 + depth) / (depth * depth);
        assert!(((stop.stiffness - plain.stiffness) / rise - 1.0).abs() < 1e-9, "{} {rise}", stop.stiffness);
        // What it takes up is what it is said to: k d^2/2 = M v^2/2 + F d.
        let taken_up = 0.5 * more.mass * more.speed * more.speed + more.force * depth;
        assert!((0.5 * stop.stiffness * depth * depth / taken_up - 1.0).abs() < 1e-9);
        let ratio = |stop: &physics::mechanics::EndStop<f64>| stop.damping * stop.damping / stop.stiffness;
        assert!((ratio(&stop) / ratio(&plain) - 1.0).abs() < 1e-9);
        // Below the pressure around nothing changes, bit for bit.
        assert_eq!(stops(9e4).0.stiffness.to_bits(), plain.stiffness.to_bits());

        for (a, b) in [(8e5, 3e4), (2e6, 1e5), (6.5e5, 3.5e4)] {
            let start = from(&network, a, b);
            let run = network.simulate(&[], (0.2, 1e4), &start, ode::Options::default(), &mut |_| false);
            let impact = run.expect("holds").impacts[0];
            assert!(
                impact.at_b && impact.depth < depth && !impact.through,
                "{cushioned}, {a}: {}",
                impact.depth
            );
        }
        // A session that is put back has the stops of its start, not of that of the session that takes it up.
        let options = ode::Options::default;
        let mut high = network.assembly.session(&from(&network, 8e5, 3e4), options()).expect("starts");
        let mut low = network.assembly.session(&from(&network, 9e4, 9e4), options()).expect("starts");
        let go = |session: &mut circuit::Session, until: f64| {
            session.go_on(until, &mut circuit::Look::new(&mut |_| false)).expect("goes on");
        };
        go(&mut high, 5e-3);
        low.restore(&high.save().expect("saved")).expect("restored");
        for session in [&mut high, &mut low] {
            go(session, 0.1);
        }
        assert_eq!(high.state(), low.state());
    }
}
