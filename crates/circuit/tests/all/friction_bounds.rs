//! Every parameter of every friction law is held to its bounds, and one that is needed is asked for.

#[path = "../../../physics/tests/all/support/values.rs"]
#[allow(dead_code)] // physics uses the rest
mod values;

use circuit::{friction_law, specification::Friction};
use physics::friction::LAWS;
use std::collections::BTreeMap;

#[test]
fn values_out_of_bounds_are_refused_by_name_value_and_rule() {
    for law in LAWS {
        let set = values::with(&[]);
        let value =
            |p: &physics::Parameter| Some((p.key.to_string(), set.get(p.key).copied().or(p.default)?));
        let plain: BTreeMap<String, f64> =
            law.parameters.iter().filter_map(value).filter(|(_, value)| value.is_finite()).collect();
        let with = |parameters| Friction { law: law.key.into(), parameters, ..Friction::default() };
        friction_law(&with(plain.clone())).expect("the reference set");
        let told = |key: &str, value: Option<f64>| {
            let mut parameters = plain.clone();
            parameters.remove(key);
            parameters.extend(value.map(|value| (key.to_string(), value)));
            friction_law(&with(parameters)).expect_err(key).to_string()
        };
        for p in law.parameters {
            let low = if p.bounds.open { p.bounds.lower } else { p.bounds.lower - 1.0 };
            let high = if p.bounds.open { p.bounds.upper } else { p.bounds.upper + 1.0 };
            for value in [low, high, f64::NAN].into_iter().filter(|x| !p.bounds.contain(*x)) {
                let message = told(p.key, Some(value));
                let says = format!("friction.{} = {value} {} is out of bounds", p.key, p.unit);
                assert!(message.contains(&says), "{}: {message}", law.key);
                assert!(message.contains(&p.bounds.to_string()), "{}: {message}", law.key);
            }
            if p.default.is_none() {
                let message = told(p.key, None);
                assert!(message.contains(&format!("friction.{} is missing", p.key)), "{message}");
            }
        }
        let message = told("friction_of_nothing", Some(1.0));
        assert!(message.contains("friction.friction_of_nothing is not a parameter"), "{message}");
    }
}
