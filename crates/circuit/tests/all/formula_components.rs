//! Components whose equation is a formula: one that repeats a component of the core is that component, and what cannot
//! be used is refused.

use crate::support::circuits::{network, run};
use crate::support::{ROOM, assert_close};
use circuit::Network;
use ode::Options;
use serde_json::{Value, json};
use std::collections::BTreeMap;

/// ISO 6358 as a user writes it.
fn iso6358() -> Value {
    json!({
        "name": "iso-6358",
        "source": "iso6358-2013",
        "parameters": [
            { "key": "conductance", "unit": "m3/(s Pa)", "bounds": { "above": 0.0 } },
            { "key": "critical_pressure_ratio", "unit": "-", "bounds": { "above": 0.0, "below": 1.0 } },
            { "key": "linear_above", "unit": "-", "bounds": { "above": 0.0, "below": 1.0 }, "default": 0.999 },
        ],
        "lets": [
            ["r", "p_down/p_up"],
            ["bracket", "1 - (max(min(r, linear_above) - critical_pressure_ratio, 0)/(1 - critical_pressure_ratio))^2"],
            ["phi", "sqrt(max(bracket, 1e-9))*if(r > linear_above, (1 - r)/(1 - linear_above), 1)"],
        ],
        "output": "conductance*p_up*rho_0*sqrt(t_0/t_up)*phi",
    })
}

fn with(formula: &Value, key: &str, value: Value) -> Value {
    let mut formula = formula.clone();
    formula[key] = value;
    formula
}

fn path(formula: &Value, numbers: Value, choices: Value) -> Value {
    json!({ "name": "path", "kind": "restriction/formula", "formula": formula, "numbers": numbers,
            "choices": choices })
}

fn fitting() -> Value {
    json!({ "conductance": 1e-8, "critical_pressure_ratio": 0.3 })
}

/// A reservoir at 7 bar, a path, a tank.
fn filling(path: Value) -> Result<Network, circuit::Error> {
    let components = json!([
        { "name": "supply", "kind": "reservoir", "numbers": { "pressure": 7e5 } },
        path,
        { "name": "tank", "kind": "tank", "numbers": { "volume": 1e-3, "wall_area": 0.1, "heat_transfer": 50.0 } },
    ]);
    network(&components, &json!([["supply.1", "path.1"], ["path.2", "tank.1"]]))
}

type Columns = BTreeMap<String, Vec<f64>>;

fn fill(path: Value, tank: f64, plan: &[(&str, f64, f64)]) -> Columns {
    let start = [("tank.pressure_pa", tank), ("tank.temperature_k", ROOM)];
    let (columns, ledger) = run(&filling(path).expect("assembles"), plan, (2.0, 100.0), &start);
    assert!(ledger[0].abs() < 1e-12 && ledger[1].abs() < 1e-6 && ledger[2].abs() < 1e-5, "{ledger:?}");
    columns
}

fn refused(path: Value) -> String {
    filling(path).expect_err("refused").to_string()
}

fn assert_same(one: &Columns, other: &Columns, relative: f64) {
    for (name, own) in one {
        let size = own.iter().fold(0.0_f64, |size, value| size.max(value.abs()));
        for (i, (a, b)) in own.iter().zip(&other[name]).enumerate() {
            assert!((a - b).abs() <= relative * size, "{name}, sample {i}: {a} and {b}");
        }
    }
}

/// Into the tank and, from a higher pressure, back: the formula is that of the higher pressure.
#[test]
fn iso_6358_as_a_formula_is_a_fitting_both_ways() {
    for tank in [1.013e5, 9e5] {
        let built_in = json!({ "name": "path", "kind": "fitting", "numbers": fitting() });
        let own = path(&iso6358(), fitting(), json!({}));
        let [built_in, own] = [fill(built_in, tank, &[]), fill(own, tank, &[])];
        assert_same(&built_in, &own, 1e-9);
        assert_eq!(own["path.mass_flow_kg_s"][1] < 0.0, tank > 7e5);
    }
}

#[test]
fn its_linear_part_is_that_of_the_fitting() {
    let linear = |path: Value| {
        let start = [("tank.pressure_pa", 4e5), ("tank.temperature_k", 300.0)];
        let start = start.iter().map(|(name, value)| (name.to_string(), *value)).collect();
        let network = filling(path).expect("assembles");
        let session = network.assembly.session(&start, Options::default()).expect("starts");
        let found = session.linearise(&[0]).expect("linear");
        [found.a, found.b, found.c, found.d].concat()
    };
    let built_in = linear(json!({ "name": "path", "kind": "fitting", "numbers": fitting() }));
    let own = linear(path(&iso6358(), fitting(), json!({})));
    assert_eq!(built_in.len(), own.len());
    assert!(built_in.iter().any(|slope| *slope != 0.0));
    built_in.iter().zip(&own).for_each(|(a, b)| assert!((a - b).abs() <= 1e-9 * a.abs(), "{a} and {b}"));
}

#[test]
fn a_command_opens_it_and_backward_may_be_shut() {
    let opened = with(&iso6358(), "output", json!("opening*conductance*p_up*rho_0*sqrt(t_0/t_up)*phi"));
    let columns = fill(path(&opened, fitting(), json!({})), 1e5, &[("path.command", 0.5, 0.5)]);
    let flow = &columns["path.mass_flow_kg_s"];
    assert!(flow[..50].iter().all(|flow| *flow == 0.0));
    assert_close("half open", flow[60], 0.5 * 1e-8 * 7e5 * 1.185, 1e-4); // choked, from ROOM
    let one_way = |tank| fill(path(&iso6358(), fitting(), json!({ "backward": "shut" })), tank, &[]);
    assert!(one_way(9e5)["path.mass_flow_kg_s"].iter().all(|flow| *flow == 0.0));
    assert!(one_way(2e5)["path.mass_flow_kg_s"][0] > 0.0);
}

/// A path that opens from a difference of pressures on leaves that difference.
#[test]
fn a_dead_zone_of_pressure_stays() {
    let cracking = with(&iso6358(), "output", json!("coefficient*max(p_up - p_down - cracking, 0)"));
    let keys = json!([
        { "key": "coefficient", "unit": "kg/(s Pa)", "bounds": { "above": 0.0 } },
        { "key": "cracking", "unit": "Pa", "bounds": { "at_least": 0.0 } },
    ]);
    let formula = with(&with(&cracking, "parameters", keys), "lets", json!([]));
    let numbers = json!({ "coefficient": 1e-5, "cracking": 5e4 });
    for (tank, left) in [(1e5, 6.5e5), (9e5, 7.5e5)] {
        let end = fill(path(&formula, numbers.clone(), json!({})), tank, &[])["tank.pressure_pa"][200];
        assert_close("where it stays", end, left, 1e-3);
    }
}

#[test]
fn what_a_flow_cannot_be_is_refused() {
    let own = |output: &str| path(&with(&iso6358(), "output", json!(output)), fitting(), json!({}));
    let asked = [
        ("conductance*p_up*phi", "the formula gives m3/s; kg/s is needed"),
        ("conductance*p_up*rho_0*(p_up + t_up)", "+ needs the same unit on both sides, not Pa and K"),
        ("conductance*rho_0*p_up*p_up/(p_up - p_down)", "this divisor can be zero"),
        ("conductance*rho_0*p_up", "at equal pressures: it must be 0 there"),
        ("conductance*rho_0*(p_down - p_up)", "gas would flow from the lower pressure to the higher"),
        ("conductance*rho_0*p_upp", "the name 'p_upp' is unknown"),
    ];
    for (output, expected) in asked {
        let message = refused(own(output));
        assert!(message.contains(expected), "{output}: {message}");
    }
    // A slope without end at equal pressures stops every integrator.
    let steep = with(&iso6358(), "output", json!("conductance*rho_0*p_up*pow(max(1 - r, 1e-30), 0.01)"));
    let message = refused(path(&steep, fitting(), json!({})));
    assert!(message.contains("at equal pressures"), "{message}");
    let taken = json!([{ "key": "backward", "unit": "-" }]);
    let message = refused(path(&with(&iso6358(), "parameters", taken), json!({}), json!({})));
    assert!(message.contains("\"backward\" is a key of every restriction/formula"), "{message}");
    let message = refused(json!({ "name": "path", "kind": "restriction/formula" }));
    assert!(message.contains("path.formula is missing"), "{message}");
    let message =
        refused(path(&iso6358(), json!({ "conductance": -1.0, "critical_pressure_ratio": 0.3 }), json!({})));
    assert!(message.contains("path.conductance = -1 m3/(s Pa) is out of bounds"), "{message}");
}

/// A slide of 1 kg, and a force on it.
fn sliding(force: Value) -> Result<Network, circuit::Error> {
    let components = json!([{ "name": "slide", "kind": "slide", "numbers": { "mass": 1.0 } }, force]);
    network(&components, &json!([["slide.1", "own.1"]]))
}

fn slide(force: Value, x: f64, v: f64, plan: &[(&str, f64, f64)]) -> (Columns, [f64; 3]) {
    let start = [("slide.position_m", x), ("slide.velocity_m_s", v)];
    run(&sliding(force).expect("assembles"), plan, (1.0, 100.0), &start)
}

fn force(output: &str, parameters: Value, numbers: Value) -> Value {
    let formula = json!({ "name": "own-force", "parameters": parameters, "output": output });
    json!({ "name": "own", "kind": "force/formula", "formula": formula, "numbers": numbers })
}

#[test]
fn a_spring_as_a_formula_is_a_spring() {
    let keys = json!([
        { "key": "stiffness", "unit": "N/m", "bounds": { "at_least": 0.0 } },
        { "key": "rest_position", "unit": "m", "default": 0.02 },
    ]);
    let own = force("-stiffness*(x - rest_position)", keys, json!({ "stiffness": 500.0 }));
    let spring = json!({ "stiffness": 500.0, "rest_position": 0.02 });
    let built_in = json!({ "name": "own", "kind": "spring", "numbers": spring });
    let (built_in, _) = slide(built_in, 0.1, 0.3, &[]);
    let (own, ledger) = slide(own, 0.1, 0.3, &[]);
    let pairs: Columns = built_in.into_iter().filter(|(name, _)| name.starts_with("slide")).collect();
    assert_same(&pairs, &own, 1e-9);
    assert!(ledger[1].abs() < 1e-6, "{ledger:?}");
    assert!(
        own["own.force_n"]
            .iter()
            .zip(&own["slide.position_m"])
            .all(|(f, x)| (f + 500.0 * (x - 0.02)).abs() < 1e-9)
    );
}

/// F = c v |v| takes the speed to v0/(1 + c v0 t/m); a force in a dead zone and under a command does nothing else.
#[test]
fn forces_that_brake_and_push() {
    let keys = json!([{ "key": "drag", "unit": "kg/m", "bounds": { "above": 0.0 } }]);
    let (columns, ledger) = slide(force("-drag*v*abs(v)", keys, json!({ "drag": 2.0 })), 0.0, 3.0, &[]);
    assert_close("speed", columns["slide.velocity_m_s"][100], 3.0 / 7.0, 1e-6);
    assert!(ledger[1].abs() < 1e-6, "{ledger:?}");
    let keys = json!([
        { "key": "wall", "unit": "m" },
        { "key": "stiffness", "unit": "N/m", "bounds": { "above": 0.0 } },
    ]);
    let numbers = json!({ "wall": 0.05, "stiffness": 400.0 });
    let (columns, ledger) = slide(force("-stiffness*max(x - wall, 0)", keys, numbers), 0.0, 0.2, &[]);
    assert!(ledger[1].abs() < 1e-6, "{ledger:?}");
    assert_eq!(columns["own.force_n"][20], 0.0);
    assert_close("deepest", columns["slide.position_m"].iter().fold(0.0, |a: f64, b| a.max(*b)), 0.06, 1e-4);
    assert_close("comes back", columns["slide.velocity_m_s"][100], -0.2, 1e-6);
    let keys = json!([{ "key": "largest", "unit": "N", "bounds": { "above": 0.0 } }]);
    let plan = [("own.command", 0.5, -0.5)];
    let (columns, ledger) = slide(force("largest*command", keys, json!({ "largest": 4.0 })), 0.0, 0.0, &plan);
    assert!(ledger[1].abs() < 1e-6, "{ledger:?}");
    assert_eq!(columns["slide.velocity_m_s"][50], 0.0);
    assert_close("pushed", columns["slide.velocity_m_s"][100], -1.0, 1e-9);
}

#[test]
fn what_a_force_cannot_be_is_refused() {
    let keys = json!([{ "key": "size", "unit": "N", "bounds": { "above": 0.0 } }]);
    let asked = [
        ("size*sign(v)", "the force jumps by"),
        ("size*x", "the formula gives J; N is needed"),
        ("size/x", "this divisor can be zero"),
        ("size*exp(x)", "exp needs a pure number, not m"),
        ("size", "force is constant: it uses none of x, v, command"),
        ("size*p_up", "the name 'p_up' is unknown"),
    ];
    for (output, expected) in asked {
        let message =
            sliding(force(output, keys.clone(), json!({ "size": 1.0 }))).expect_err(output).to_string();
        assert!(message.contains(expected), "{output}: {message}");
        assert!(message.starts_with("own"), "{message}");
    }
    let spring =
        json!({ "name": "own", "kind": "spring", "formula": iso6358(), "numbers": { "stiffness": 1.0 } });
    let message = sliding(spring).expect_err("no formula").to_string();
    assert!(message.contains("own: a spring has no formula"), "{message}");
}
