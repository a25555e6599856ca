//! A description of friction that cannot be meant is refused with one message: what, its value, the rule.

use crate::support::everything;
use circuit::{friction_law, specification};
use serde_json::{Value, json};

/// The message for the reference friction with one table replaced.
fn refused(law: &str, table: &str, value: Value) -> String {
    let mut spec = json!({
        "law": law,
        "parameters": { "coulomb": 30.0, "breakaway": 45.0, "stribeck_velocity": 0.02 },
    });
    if law != "stribeck" {
        spec["parameters"]["bristle_stiffness"] = 1e5.into();
        spec["parameters"]["bristle_damping"] = 0.0.into();
    }
    spec[table] = value;
    match serde_json::from_value::<specification::Friction>(spec) {
        Ok(spec) => friction_law(&spec).expect_err("refused").to_string(),
        Err(error) => error.to_string(),
    }
}

fn dwell(changes: Value) -> Value {
    let mut table = json!({ "growth": "log", "increment_n": 1.5, "time_s": 1.0, "distance_m": 2e-5 });
    for (key, value) in changes.as_object().expect("a table") {
        table[key] = value.clone();
    }
    table
}

#[test]
fn each_message_says_what_and_why() {
    let relaxation = json!({ "share": 0.3, "time_s": 5.0, "distance_m": 2e-4 });
    let wave = |amplitude: f64| json!({ "period_m": 0.1, "amplitude": amplitude });
    let cases = [
        ("elastoplastic", "dwell", Value::Null, "choose one of coulomb, stribeck, lugre, elasto-plastic"),
        (
            "stribeck",
            "relaxation",
            relaxation.clone(),
            "law \"stribeck\" has none; choose one of lugre, elasto-plastic",
        ),
        (
            "lugre",
            "relaxation",
            json!({ "share": 1.0, "time_s": 5.0, "distance_m": 2e-4 }),
            "friction.relaxation.share = 1 - is out of bounds: it must be between 0 and 1",
        ),
        ("lugre", "dwell", dwell(json!({ "growth": "linear" })), "unknown variant `linear`"),
        (
            "lugre",
            "dwell",
            dwell(json!({ "increment_n": -1.0 })),
            "friction.dwell.increment = -1 N is out of bounds: it must be not less than 0",
        ),
        ("lugre", "dwell", dwell(json!({ "time_s": 0.0 })), "friction.dwell.time = 0 s"),
        ("lugre", "dwell", dwell(json!({ "exponent": 2.5 })), "friction.dwell.exponent = 2.5"),
        ("lugre", "dwell", dwell(json!({ "distance_m": 0.0 })), "friction.dwell.distance = 0 m"),
        ("lugre", "dwell", dwell(json!({ "distance": 1.0 })), "friction.dwell.distance is not a parameter"),
        ("coulomb", "position", json!({}), "friction.breakaway is not a parameter of \"coulomb\""),
        ("stribeck", "position", json!({ "harmonics": [wave(0.6), wave(-0.4)] }), "add up to 1"),
        ("stribeck", "position", json!({ "harmonics": vec![wave(0.1); 5] }), "at most 4"),
        (
            "stribeck",
            "position",
            json!({ "harmonics": [{ "period_m": 0.0, "amplitude": 0.1 }] }),
            "friction.position.harmonics.period = 0 m",
        ),
        (
            "stribeck",
            "direction",
            json!({ "positive": 0.0, "negative": 1.0 }),
            "friction.direction.positive = 0 -",
        ),
        (
            "stribeck",
            "side_load",
            json!({ "force_n": 1.0, "coefficient": -0.1 }),
            "friction.side_load.coefficient = -0.1 -",
        ),
    ];
    for (law, table, value, expected) in cases {
        let message = refused(law, table, value);
        assert!(message.contains(expected), "{law} {table}: {message}");
    }
}

#[test]
fn what_can_be_meant_is_taken() {
    for law in ["stribeck", "lugre", "elasto-plastic"] {
        let contact = friction_law(&everything(law)).expect("taken");
        let names: Vec<&str> = contact.states().iter().map(|state| state.name).collect();
        assert_eq!(names.last(), Some(&"contact_age_s"));
        assert_eq!(names.len(), if law == "stribeck" { 1 } else { 3 });
        assert!(contact.sources().contains(&"dieterich1979"));
    }
}
