//! A law of the user's own, written as formulas, is the law: `lugre` so written gives the trajectory of the
//! built-in law bit for bit, alone and with all that can act on a law, as scalars and as lanes.

use crate::support::drive::{self, Drive};
use crate::support::*;
use circuit::{Circuit, own_law, specification, steady_sensitivity};
use math::{Lane, Lanes};
use ode::{NoOutput, Paused, Stepper};
use physics::friction::At;
use serde_json::{Value, json};

/// The built-in law as a user writes it.
fn lugre() -> Value {
    let above = |key: &str, unit: &str| json!({ "key": key, "unit": unit, "bounds": { "above": 0.0 } });
    let not_negative = |key: &str| json!({ "key": key, "unit": "N s/m", "bounds": { "at_least": 0.0 } });
    json!({
        "name": "own-lugre",
        "parameters": [
            above("coulomb", "N"), above("breakaway", "N"), above("stribeck_velocity", "m/s"),
            not_negative("viscous"), above("bristle_stiffness", "N/m"), not_negative("bristle_damping"),
        ],
        "levels": { "coulomb": "coulomb", "breakaway": "breakaway", "viscous": "viscous" },
        "states": [{
            "key": "z", "name": "bristle_deflection_m", "unit": "m", "scale": 1e-3,
            "rate": "v - abs(v)*elastic/g",
        }],
        "lets": [
            ["elastic", "bristle_stiffness*z"],
            ["g", "coulomb + (breakaway - coulomb)*exp(-(v/stribeck_velocity)^2)"],
        ],
        "force": "elastic + bristle_damping*z_rate + viscous*v",
        "energy": "0.5*bristle_stiffness*z*z",
        "odd": true,
    })
}

#[test]
fn no_state_of_a_law_has_the_name_of_another_column() {
    let mut friction = everything("lugre");
    let warming = json!({ "reference_k": 293.0, "time_s": 60.0 });
    friction.temperature = Some(serde_json::from_value(warming).expect("a table"));
    friction.wear = Some(serde_json::from_value(json!({ "run_in_distance_m": 100.0 })).expect("a table"));
    let drive = Drive::assemble(&drive::Spec { friction, ..reference() }, false).expect("assembles");
    let (own, others) = (lugre()["states"][0]["name"].clone(), drive.columns().iter());
    let others: Vec<&String> = others.filter(|&name| own != json!(name)).collect();
    assert_eq!(others.len(), 13 + 4, "{others:?}");
    for name in others {
        let mut law = lugre();
        law["states"][0]["name"] = json!(name);
        let refused = own_law(&serde_json::from_value(law).expect("fits")).expect_err(name);
        assert_eq!(refused.key, "states.z.name");
    }
}

/// The friction of a description with its law as formulas; what the law does not know is left out.
fn own(friction: &specification::Friction) -> specification::Friction {
    let mut own = friction.clone();
    own.law = "own-lugre".into();
    own.formula = Some(serde_json::from_value(lugre()).expect("a law"));
    own.parameters.retain(|key, _| !matches!(key.as_str(), "damping_fade_velocity" | "stribeck_exponent"));
    own
}

fn without_fade(mut friction: specification::Friction) -> specification::Friction {
    friction.parameters.remove("damping_fade_velocity");
    friction
}

/// Two seconds of strokes to and fro.
fn run(spec: &drive::Spec) -> (Vec<Vec<u64>>, ode::Statistics) {
    let drive = Drive::assemble(spec, true).expect("a drive");
    let (times, commands) = ([0.0, 0.5, 0.9, 1.4], [0.6, -0.4, 0.05, -1.0]);
    let initial = at_rest(0.2, 3e5);
    let run = drive.simulate(&times, &commands, (2.0, 1e3), &initial, options(1e-6), &mut |_| false);
    let run = run.expect("a run");
    (run.columns.iter().map(|column| bits(column)).collect(), run.statistics)
}

#[test]
fn lugre_as_formulas_is_lugre_bit_for_bit() {
    for friction in [reference().friction, without_fade(everything("lugre"))] {
        let mut spec = drive::Spec { friction, ..reference() };
        // A leak past the piston, so that the drive of the built-in law is evaluated by nodes, too.
        spec.cylinder.leakage_m3_s_pa = 1e-12;
        let (built_in, work) = run(&spec);
        spec.friction = own(&spec.friction);
        let (formulas, own_work) = run(&spec);
        assert!(built_in == formulas, "every column at every sample");
        assert_eq!(format!("{work:?}"), format!("{own_work:?}"), "with the same work");
    }
}

/// The law as formulas, with other numbers for each lane.
fn four(spec: &drive::Spec) -> Vec<Drive> {
    let vary = |factor: f64| {
        let mut spec = spec.clone();
        spec.friction.parameters.values_mut().for_each(|value| *value *= factor);
        Drive::assemble(&spec, false).expect("a drive")
    };
    [1.0, 1.1, 0.9, 1.3].map(vary).into_iter().collect()
}

#[test]
fn lanes_of_formulas_are_their_scalars_bit_for_bit() {
    let friction = own(&without_fade(everything("lugre")));
    let drives = four(&drive::Spec { friction, ..reference() });
    let each: Vec<_> = drives.iter().map(|drive| drive.start(&at_rest(0.2, 3e5), 0.5)).collect();
    let lanes = Circuit::<Lanes<4>>::gather(&each.iter().map(|(circuit, _)| circuit).collect::<Vec<_>>());
    let y: Vec<Lanes<4>> = (0..each[0].1.len()).map(|i| Lane::from_lanes(|l| each[l].1[i])).collect();
    let mut stepper = Stepper::new(lanes, 0.0, &y, options(1e-6));
    assert_eq!(stepper.advance(0.7, 100_000, &mut NoOutput), Paused::Arrived);
    for (l, (circuit, y)) in each.iter().enumerate() {
        let alone = crate::support::run(circuit, y, 0.7, 1e-6);
        let own: Vec<f64> = stepper.state().iter().map(|y| y.get(l)).collect();
        assert_eq!(bits(&own), bits(alone.state()), "lane {l}");
        let steps = [stepper.statistics(l), alone.statistics(0)].map(|work| (work.steps, work.rejected));
        assert_eq!(steps[0], steps[1], "lane {l}");
    }
}

/// Steady sliding is found without a formula of it, with its derivatives by all parameters: those of the
/// built-in law, which has one.
#[test]
fn steady_sliding_settles_where_lugre_slides() {
    let friction = without_fade(everything("lugre"));
    let names: Vec<String> = ["coulomb", "breakaway", "stribeck_velocity", "viscous", "bristle_stiffness"]
        .map(|key| format!("friction.parameters.{key}"))
        .to_vec();
    let places: Vec<At<f64>> =
        [-0.5, -1e-3, 1e-4, 0.02, 0.3].map(|v| At { v, x: 0.1, ..At::at_rest() }.pressed(2e5, 1e5)).to_vec();
    let found = |spec: &specification::Friction, formula: Value| {
        let json = json!({ "law": spec.law, "parameters": {}, "formula": formula });
        steady_sensitivity(&json.to_string(), &spec.parameters, &names, &places).expect("forces")
    };
    let (built_in, slopes) = found(&friction, Value::Null);
    let (formulas, own_slopes) = found(&own(&friction), lugre());
    for (a, b) in built_in.iter().zip(&formulas).chain(slopes.iter().zip(&own_slopes)) {
        assert!((a - b).abs() <= 1e-12 * a.abs().max(1e-9), "{a} {b}");
    }
}
