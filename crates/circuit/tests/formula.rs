//! A law of the user's own, written as formulas, is the law: `lugre` so written gives the trajectory of the
//! built-in law bit for bit, alone and with all that can act on a law, as scalars and as lanes.

mod support;

use circuit::{Drive, specification};
use serde_json::{Value, json};
use support::*;

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
fn run(spec: &specification::Drive) -> (Vec<Vec<u64>>, ode::Statistics) {
    let drive = Drive::assemble(spec, true).expect("a drive");
    let (times, commands) = ([0.0, 0.5, 0.9, 1.4], [0.6, -0.4, 0.05, -1.0]);
    let initial = at_rest(0.2, 3e5);
    let run = drive.simulate(&times, &commands, (2.0, 1e3), &initial, options(1e-6), &mut || false);
    let run = run.expect("a run");
    (run.columns.iter().map(|column| bits(column)).collect(), run.statistics)
}

#[test]
fn lugre_as_formulas_is_lugre_bit_for_bit() {
    for friction in [reference().friction, without_fade(everything("lugre"))] {
        let mut spec = specification::Drive { friction, ..reference() };
        let (built_in, work) = run(&spec);
        spec.friction = own(&spec.friction);
        let (formulas, own_work) = run(&spec);
        assert!(built_in == formulas, "every column at every sample");
        assert_eq!(format!("{work:?}"), format!("{own_work:?}"), "with the same work");
    }
}
