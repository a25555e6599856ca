//! Flow elements and supplies against closed forms.

use crate::support::circuits::{joined, network, run};
use crate::support::{AMBIENT, K, R, ROOM};
use circuit::{Kind, Look};
use ode::Options;
use serde_json::{Value, json};

const RHO_0: f64 = 1.185;

fn one(name: &str, kind: &str, numbers: Value) -> Value {
    json!({ "name": name, "kind": kind, "numbers": numbers })
}

fn supply(pressure: f64) -> Value {
    one("supply", "reservoir", json!({ "pressure": pressure }))
}

fn tank(volume: f64) -> Value {
    // Adiabatic, as the closed forms are.
    one("tank", "tank", json!({ "volume": volume, "heat_transfer": 0.0 }))
}

fn closes(ledger: [f64; 3]) {
    assert!(ledger[0].abs() < 1e-12 && ledger[1].abs() < 1e-6 && ledger[2].abs() < 1e-4, "{ledger:?}");
}

fn near(found: f64, expected: f64, share: f64) {
    assert!((found / expected - 1.0).abs() < share, "{found}, expected {expected}");
}

#[test]
fn a_shut_chamber_leaks_as_the_closed_form_says() {
    // At constant temperature p' = -(c_l R/V) (p^2 - p_a^2), and so (p - p_a)/(p + p_a) falls as exp(-2 p_a c_l R t/V).
    let (height, diameter, length, viscosity, volume) = (2e-5_f64, 0.02, 5e-3, 1.82e-5, 1e-4);
    let gap = std::f64::consts::PI * diameter * height.powi(3) / (24.0 * viscosity * length * R);
    let walls = json!({ "volume": volume, "wall_area": 1.0, "heat_transfer": 1e4 });
    let by_gap = json!({ "gap_height": height, "diameter": diameter, "length": length });
    for numbers in [by_gap, json!({ "coefficient": gap })] {
        let components = json!([one("tank", "tank", walls.clone()), one("leak", "leak", numbers)]);
        let joints = json!([["tank.1", "leak.1"], ["leak.2", "ambient"]]);
        let network = network(&components, &joints).expect("assembles");
        let start = [("tank.pressure_pa", 7e5), ("tank.temperature_k", ROOM)];
        let (columns, ledger) = run(&network, &[], (20.0, 10.0), &start);
        closes(ledger);
        let flow = columns["leak.mass_flow_kg_s"][0];
        near(flow, gap * (7e5_f64.powi(2) - AMBIENT.powi(2)) / ROOM, 1e-9);
        for (t, p) in columns["time_s"].iter().zip(&columns["tank.pressure_pa"]) {
            let ratio = (7e5 - AMBIENT) / (7e5 + AMBIENT) * (-2.0 * AMBIENT * gap * R * t / volume).exp();
            near(*p, AMBIENT * (1.0 + ratio) / (1.0 - ratio), 1e-4);
        }
        assert!(columns["tank.pressure_pa"][200] < 1.5e5);
    }
}

#[test]
fn a_leak_is_given_once() {
    let leak = |numbers| {
        let components = json!([one("leak", "leak", numbers), tank(1e-3)]);
        let made = network(&components, &json!([["tank.1", "leak.1"], ["leak.2", "ambient"]]));
        made.err().map(|error| error.to_string()).unwrap_or_default()
    };
    let message = leak(json!({ "gap_height": 1e-5, "coefficient": 1e-15 }));
    assert!(message.contains("leak.coefficient and leak.gap_height both give"), "{message}");
    let message = leak(json!({ "gap_height": 1e-5 }));
    assert!(message.contains("leak.diameter is missing"), "{message}");
}

#[test]
fn an_orifice_lets_through_what_an_ideal_nozzle_of_its_area_does() {
    let (diameter, share) = (1.5e-3_f64, 0.7);
    let numbers = json!({ "diameter": diameter, "discharge_coefficient": share });
    let components = json!([supply(7e5), one("hole", "orifice", numbers), tank(1.0)]);
    let network =
        network(&components, &json!([["supply.1", "hole.1"], ["hole.2", "tank.1"]])).expect("assembles");
    let start = [("tank.pressure_pa", 1e5), ("tank.temperature_k", ROOM)];
    let (columns, ledger) = run(&network, &[], (0.1, 10.0), &start);
    closes(ledger);
    let area = share * 0.25 * std::f64::consts::PI * diameter * diameter;
    let critical = (2.0 / (K + 1.0)).powf(0.5 * (K + 1.0) / (K - 1.0));
    let flow = columns["hole.mass_flow_kg_s"][0];
    near(flow, area * 7e5 * (K / (R * ROOM)).sqrt() * critical, 1e-12);
    // C = S/5 in dm3/(s bar) and mm2, as catalogues have it.
    near(flow, area * 0.2e-2 * 7e5 * RHO_0, 5e-3);
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
    assert!(message.expect("refused").contains("fc.check_conductance is missing"));
}

#[test]
fn a_soft_start_valve_fills_slowly_first_and_falls_shut_with_its_supply() {
    let (needle, wide, volume, b) = (1e-9, 2e-8, 2e-4, 0.6);
    let numbers = json!({ "needle_conductance": needle, "conductance": wide, "critical_pressure_ratio": b,
                          "opening_share": 0.4, "reset_pressure": 2e5 });
    let joints = json!([["supply.1", "soft.1"], ["soft.2", "tank.1"]]);
    let components = json!([supply(7e5), one("soft", "soft-start", numbers), tank(volume)]);
    let network = network(&components, &joints).expect("assembles");
    let start = [("tank.pressure_pa", AMBIENT), ("tank.temperature_k", ROOM)];
    let plan = [("supply.pressure_pa", 1.0, 1.5e5), ("supply.pressure_pa", 1.5, 7e5)];
    let (columns, ledger) = run(&network, &plan, (2.0, 1000.0), &start);
    closes(ledger);
    // Choked and adiabatic: p' = k R T_s C p1 rho0/V, first with the needle, from 0.4 of the gauge pressure on with all.
    let rate = |c: f64| K * R * ROOM * c * 7e5 * RHO_0 / volume;
    let opens = AMBIENT + 0.4 * (7e5 - AMBIENT);
    let first = (opens - AMBIENT) / rate(needle);
    assert!(first < 0.8);
    for (t, p) in columns["time_s"].iter().zip(&columns["tank.pressure_pa"]) {
        let expected = if *t < first { AMBIENT + rate(needle) * t } else { opens + rate(wide) * (t - first) };
        if expected < b * 7e5 {
            near(*p, expected, 1e-6);
        }
    }
    let (p, flow) = (&columns["tank.pressure_pa"], &columns["soft.mass_flow_kg_s"]);
    assert!(p[999] > 6.9e5);
    // Back through the needle alone, and open again once the supply is back: the tank is full enough.
    near(-flow[1001], needle * p[1001] * RHO_0 * (ROOM / columns["tank.temperature_k"][1001]).sqrt(), 1e-6);
    assert!(p[1499] > 3.5e5 && flow[1501] > 10.0 * needle * 7e5 * RHO_0, "{} {}", p[1499], flow[1501]);
}

#[test]
fn an_electro_pneumatic_regulator_follows_its_command_as_a_second_order_system() {
    let (f, zeta) = (8.0, 0.4_f64);
    let numbers = json!({ "set_pressure": 3e5, "conductance": 2e-8, "full_opening_drop": 1e6,
                          "time_constant": 1e-6, "natural_frequency": f, "damping_ratio": zeta });
    let components = json!([supply(2e6), one("reg", "regulator/electro-pneumatic", numbers), tank(1e3)]);
    let network =
        network(&components, &json!([["supply.1", "reg.1"], ["reg.2", "tank.1"]])).expect("assembles");
    let start = [("tank.pressure_pa", 1e5), ("tank.temperature_k", ROOM)];
    let (columns, ledger) = run(&network, &[("reg.set_pressure_pa", 0.1, 5e5)], (0.5, 1000.0), &start);
    closes(ledger);
    // The seat of a choked regulator into a pressure that does not move shows the set pressure.
    let (w, damped) = (2.0 * std::f64::consts::PI * f, (1.0 - zeta * zeta).sqrt());
    let mut most = 0.0_f64;
    for (t, flow) in columns["time_s"].iter().zip(&columns["reg.mass_flow_kg_s"]) {
        let t = (t - 0.1).max(0.0);
        let swing = (-zeta * w * t).exp() * ((damped * w * t).cos() + zeta / damped * (damped * w * t).sin());
        let found = 1e5 + 1e6 * flow / (2e-8 * 2e6 * RHO_0);
        most = most.max(found);
        near(found, 3e5 + 2e5 * (1.0 - swing), 1e-4);
    }
    let overshoot = (-zeta * std::f64::consts::PI / damped).exp();
    near(most, 5e5 + 2e5 * overshoot, 1e-3);
}

#[test]
fn a_piloted_check_valve_holds_until_its_pilot_opens_it() {
    let numbers = json!({ "conductance": 1e-8, "pilot_ratio": 3.0, "cracking_pressure": 1e4 });
    let components = |pilot: f64| {
        json!([
            one("line", "reservoir", json!({ "pressure": pilot })),
            one("hold", "check-valve/piloted", numbers),
            tank(1e-3)
        ])
    };
    let joints = json!([["hold.1", "ambient"], ["hold.2", "tank.1"], ["hold.12", "line.1"]]);
    let start = [("tank.pressure_pa", 6e5), ("tank.temperature_k", ROOM)];
    let held = network(&components(AMBIENT), &joints).expect("assembles");
    // Shut up to a (p_x - p_amb) = p2 - p1 + p_c, here 1.696 bar of pilot pressure.
    let plan =
        [("line.pressure_pa", 1000.0, AMBIENT + 1.69e5), ("line.pressure_pa", 1001.0, AMBIENT + 1.8e5)];
    let (columns, ledger) = run(&held, &plan, (1002.0, 1.0), &start);
    closes(ledger);
    let p = &columns["tank.pressure_pa"];
    assert!(p[..1002].windows(2).all(|pair| pair[0] == pair[1]), "{:?}", &p[1000..]);
    assert!(p[1002] < 2e5, "{}", p[1002]);
    assert!(columns["line.mass_flow_kg_s"].iter().all(|flow| *flow == 0.0));
    // Forward it is a check valve, whatever the pilot.
    let empty = [("tank.pressure_pa", 0.5e5), ("tank.temperature_k", ROOM)];
    let (columns, _) = run(&held, &[], (10.0, 1.0), &empty);
    near(columns["tank.pressure_pa"][10], AMBIENT - 1e4, 1e-3);
}

#[test]
fn a_pilot_port_brings_no_volume_and_needs_gas() {
    let pilot = one("hold", "check-valve/piloted", json!({ "conductance": 1e-8 }));
    let path =
        |name: &str| one(name, "fitting", json!({ "conductance": 1e-8, "critical_pressure_ratio": 0.3 }));
    let components = json!([pilot, path("one"), path("two"), tank(1e-3), supply(7e5)]);
    let joints = |last: Value| {
        json!([["supply.1", "one.1"], ["hold.12", "one.2", "two.1"], ["two.2", "tank.1"], last, ["hold.2"]])
    };
    let made = network(&components, &joints(json!(["hold.1", "ambient"]))).expect("assembles");
    assert_eq!(made.joint_volumes[0], ("one.2".to_string(), 4e-7));
    let alone = json!([
        ["supply.1", "one.1"],
        ["one.2", "two.1"],
        ["two.2", "tank.1"],
        ["hold.12"],
        ["hold.1", "ambient"],
        ["hold.2"]
    ]);
    let message = network(&components, &alone).err().map(|error| error.to_string()).expect("refused");
    assert!(message.contains("no gas reaches the pilot port hold.12"), "{message}");
}

#[test]
fn a_compressor_keeps_a_tank_between_its_pressures() {
    let (delivery, volume) = (5e-3, 0.01);
    let numbers = json!({ "free_air_delivery": delivery, "start_pressure": 7e5, "stop_pressure": 8e5,
                          "outlet_temperature": 320.0 });
    let draw = one("draw", "fitting", json!({ "conductance": 2e-9, "critical_pressure_ratio": 0.3 }));
    let components = json!([one("comp", "compressor", numbers), draw, tank(volume)]);
    let joints = json!([["comp.1", "tank.1", "draw.1"], ["draw.2", "ambient"]]);
    let network = network(&components, &joints).expect("assembles");
    let start = [("tank.pressure_pa", 7.5e5), ("tank.temperature_k", ROOM)];
    let (columns, ledger) = run(&network, &[], (60.0, 1000.0), &start);
    closes(ledger);
    let (p, flow) = (&columns["tank.pressure_pa"], &columns["comp.mass_flow_kg_s"]);
    let runs = delivery * AMBIENT / (R * ROOM);
    assert!(flow.iter().all(|flow| *flow == 0.0 || (flow / runs - 1.0).abs() < 1e-12));
    let (low, high) = p.iter().fold((f64::MAX, 0.0_f64), |(low, high), p| (low.min(*p), high.max(*p)));
    assert!(low > 6.9999e5 && low < 7.01e5 && high < 8.0001e5 && high > 7.99e5, "{low} {high}");
    assert!(flow.windows(2).filter(|pair| pair[0] != pair[1]).count() >= 4);
    // p' = k R (m_c T_out - m_d T)/V as long as it runs.
    let drawn = columns["draw.mass_flow_kg_s"][0];
    let rate = K * R * (runs * 320.0 - drawn * ROOM) / volume;
    near((p[1] - p[0]) / 1e-3, rate, 1e-3);
}

#[test]
fn what_a_session_draws_is_what_came_in_by_its_accounts() {
    let fitting =
        |name, c: f64| one(name, "fitting", json!({ "conductance": c, "critical_pressure_ratio": 0.3 }));
    let numbers = json!({ "free_air_delivery": 5e-3, "start_pressure": 3e5, "stop_pressure": 4e5 });
    let components = json!([
        supply(6e5),
        one("comp", "compressor", numbers),
        fitting("path", 1e-9),
        fitting("draw", 3e-9),
        tank(1e-3)
    ]);
    let joints =
        json!([["supply.1", "path.1"], ["path.2", "comp.1", "tank.1", "draw.1"], ["draw.2", "ambient"]]);
    let network = network(&components, &joints).expect("assembles");
    let start = [("tank.pressure_pa", 3.5e5), ("tank.temperature_k", ROOM)];
    let start = start.map(|(name, value)| (name.to_string(), value)).into();
    let mut session = network.assembly.session(&start, Options::default()).expect("a session");
    assert!(session.drawn().is_none());
    session.follow_drawn();
    for tick in 1..=2000 {
        session.go_on(f64::from(tick) * 1e-3, &mut Look::new(&mut |_| false)).expect("goes on");
    }
    let channels = session.circuit().channels();
    let accounts = &session.state()[session.circuit().n_states()..];
    let masses = channels.iter().zip(accounts).filter(|(own, _)| own.kind == Kind::Mass);
    let [came, went] = [1.0, -1.0].map(|sign| masses.clone().map(|(_, m)| (sign * m).max(0.0)).sum::<f64>());
    assert!(came > 2e-3 && went > 1e-3, "{came} kg came, {went} kg went");
    near(session.drawn().expect("followed"), came, 1e-6);
}

#[test]
fn a_compressor_at_a_reservoir_changes_nothing() {
    let numbers = json!({ "free_air_delivery": 5e-3, "start_pressure": 7e5, "stop_pressure": 8e5 });
    let path = one("path", "fitting", json!({ "conductance": 1e-8, "critical_pressure_ratio": 0.3 }));
    let components = json!([supply(6e5), one("comp", "compressor", numbers), path, tank(1e-3)]);
    let joints = json!([["supply.1", "comp.1", "path.1"], ["path.2", "tank.1"]]);
    let start = [("tank.pressure_pa", 3e5), ("tank.temperature_k", ROOM)];
    let (_, ledger) = run(&network(&components, &joints).expect("assembles"), &[], (0.5, 10.0), &start);
    closes(ledger);
}

#[test]
fn an_ejector_draws_a_vacuum_and_lets_it_go() {
    let (suction, volume) = (2e-9, 1e-3);
    let numbers = json!({ "conductance": 4e-9, "suction_conductance": suction, "lowest_pressure": 1.5e4,
                          "critical_pressure_ratio": 0.5 });
    let components = json!([supply(6e5), one("ejector", "ejector", numbers), tank(volume)]);
    let network = network(&components, &json!([["supply.1", "ejector.1"], ["ejector.2", "tank.1"]]))
        .expect("assembles");
    let start = [("tank.pressure_pa", AMBIENT), ("tank.temperature_k", ROOM)];
    let (columns, ledger) = run(&network, &[("supply.pressure_pa", 30.0, AMBIENT)], (60.0, 10.0), &start);
    closes(ledger);
    let p = &columns["tank.pressure_pa"];
    // Choked suction, adiabatic.
    let tau = volume / (suction * RHO_0 * R * ROOM);
    let mut compared = 0;
    for (t, p) in columns["time_s"].iter().zip(p) {
        let expected = AMBIENT * (1.0 + 0.5 * (K - 1.0) * t / tau).powf(-2.0 * K / (K - 1.0));
        if expected > 1.5e4 / 0.5 {
            near(*p, expected, 1e-6);
            compared += 1;
        }
    }
    assert!(compared > 30, "{compared}");
    near(p[299], 1.5e4, 1e-3);
    near(p[600], AMBIENT, 1e-3);
    near(columns["ejector.mass_flow_kg_s"][100], 4e-9 * 6e5 * RHO_0, 1e-9);
}

#[test]
fn pressures_that_contradict_each_other_are_refused() {
    let cases = [
        (
            "compressor",
            json!({ "free_air_delivery": 1e-3, "start_pressure": 8e5, "stop_pressure": 7e5 }),
            "x.start_pressure = 8 bar abs must be below x.stop_pressure",
        ),
        (
            "soft-start",
            json!({ "needle_conductance": 2e-8, "conductance": 1e-8 }),
            "x.needle_conductance = 2 dm3/(s bar) is above x.conductance",
        ),
    ];
    for (kind, numbers, expected) in cases {
        let made = network(&json!([one("x", kind, numbers)]), &json!([]));
        let message = made.err().map(|error| error.to_string()).expect("refused");
        assert!(message.contains(expected), "{message}");
    }
}

/// Restrictions between gas at 7 bar and at another pressure: valve, tube, which may be turned round, and a hole at will.
fn in_a_row(with_hole: bool, behind: f64, junctions: &str, turned: bool) -> impl Fn(&str) -> f64 {
    let valve = one("valve", "fitting", json!({ "conductance": 2e-8, "critical_pressure_ratio": 0.3 }));
    let tube = one("tube", "tube", json!({ "length": 1.0, "diameter": 4e-3 }));
    let low = one("low", "reservoir", json!({ "pressure": behind }));
    let mut components = vec![supply(7e5), low, valve, tube];
    let [near, far] = if turned { ["tube.2", "tube.1"] } else { ["tube.1", "tube.2"] };
    let mut joints = vec![json!(["supply.1", "valve.1"]), json!(["valve.2", near])];
    if with_hole {
        components.push(one("hole", "orifice", json!({ "diameter": 4e-3 })));
        joints.extend([json!([far, "hole.1"]), json!(["hole.2", "low.1"])]);
    } else {
        joints.push(json!([far, "low.1"]));
    }
    // Something that has states.
    components.push(tank(1e-3));
    components.push(one("leak", "leak", json!({ "coefficient": 1e-20 })));
    joints.extend([json!(["tank.1", "leak.1"]), json!(["leak.2", "ambient"])]);
    let network = joined(&json!(components), &json!(joints), junctions).expect("assembles");
    assert_eq!(network.joint_volumes.is_empty(), junctions == "series");
    let names = network.assembly.given_names().into_iter().map(String::from).collect::<Vec<_>>();
    let start = names.iter().map(|name| (&name[..], if name.ends_with("_k") { ROOM } else { 4e5 }));
    let (columns, ledger) = run(&network, &[], (1.0, 10.0), &start.collect::<Vec<_>>());
    closes(ledger);
    move |of: &str| columns[&format!("{of}.mass_flow_kg_s")][10]
}

#[test]
fn restrictions_in_a_row_are_merged_by_the_series_rule_on_request() {
    for (with_hole, behind, within) in [
        // Choked at the end, the rule is exact for two.
        (false, 1e5, 1e-7),
        (true, 1e5, 0.01),
        (false, 6e5, 6e-3),
        (true, 6e5, 0.01),
        // Back, through the tube first.
        (false, 8e5, 6e-3),
        (false, 5e6, 1e-7),
    ] {
        let apart = in_a_row(with_hole, behind, "volume", false)("valve");
        let merged = in_a_row(with_hole, behind, "series", false);
        near(merged("valve"), apart, within);
        let turned = in_a_row(with_hole, behind, "series", true);
        assert_eq!(
            [merged("tube"), turned("tube"), turned("valve")],
            [1.0, -1.0, 1.0].map(|sign| sign * merged("valve"))
        );
    }
    // The valve comes first from the left, the tube from the right.
    near(in_a_row(false, 1e5, "series", false)("valve") / (7e5 * RHO_0), 1.067e-8, 5e-4);
    near(in_a_row(false, 5e6, "series", false)("valve") / (5e6 * RHO_0), -1.131e-8, 5e-4);
}

#[test]
fn what_merged_tubes_have_of_volume_between_them_goes_to_both_ends() {
    let tube =
        |name: &str| one(name, "tube", json!({ "length": 1.0, "diameter": 4e-3, "heat_transfer": 0.0 }));
    let mut full = tank(1e-5);
    full["name"] = json!("full");
    let components = json!([full, tube("one"), tube("two"), tank(1e-5)]);
    let joints = json!([["full.1", "one.1"], ["one.2", "two.1"], ["two.2", "tank.1"]]);
    let settles = |junctions: &str| {
        let network = joined(&components, &joints, junctions).expect("assembles");
        let value = |name: &str| match name {
            "full.pressure_pa" => 7e5,
            name if name.ends_with("_k") => ROOM,
            _ => 1e5,
        };
        let names = network.assembly.given_names().into_iter().map(String::from).collect::<Vec<_>>();
        let start = names.iter().map(|name| (&name[..], value(name)));
        let (columns, ledger) = run(&network, &[], (20.0, 1.0), &start.collect::<Vec<_>>());
        closes(ledger);
        columns["tank.pressure_pa"][20]
    };
    // Pressures settle to their mean by volume: energy is kept.
    let half = 0.125 * std::f64::consts::PI * 4e-3 * 4e-3;
    let mean = |full: f64, joint: f64| 1e5 + 6e5 * full / (2e-5 + 4.0 * half + joint);
    near(settles("volume"), mean(1e-5 + half, 1e-7), 1e-6);
    near(settles("series"), mean(1e-5 + 2.0 * half, 0.0), 1e-6);
}

#[test]
fn what_the_series_rule_does_not_hold_for_is_left_apart() {
    let hole = |name: &str, more: Value| {
        let mut numbers = json!({ "conductance": 2e-8, "critical_pressure_ratio": 0.3 });
        numbers.as_object_mut().expect("numbers").extend(more.as_object().expect("numbers").clone());
        one(name, "fitting", numbers)
    };
    let volumes = |index: f64, piloted: bool| {
        let mut components = vec![supply(7e5), hole("one", json!({})), tank(1e-3)];
        components.push(hole("two", json!({ "subsonic_index": index })));
        let mut between = vec!["one.2", "two.1"];
        let mut joints = vec![json!(["supply.1", "one.1"]), json!(["two.2", "tank.1"])];
        if piloted {
            let numbers = json!({ "conductance": 1e-8, "critical_pressure_ratio": 0.3, "pilot_ratio": 3.0 });
            components.push(one("held", "check-valve/piloted", numbers));
            joints.extend([json!(["tank.1", "held.1"]), json!(["held.2", "ambient"])]);
            joints.remove(1);
            joints.insert(1, json!(["two.2", "tank.1", "held.1"]));
            joints.remove(2);
            between.push("held.12");
        }
        joints.push(json!(between));
        let network = joined(&json!(components), &json!(joints), "series").expect("assembles");
        network.joint_volumes.len()
    };
    assert_eq!([volumes(0.5, false), volumes(0.55, false), volumes(0.5, true)], [0, 1, 1]);
}
