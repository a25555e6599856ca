//! Assemblies: circuits of public parts, with names for what they contain.

mod drive;
mod rig;

pub use drive::{Drive, Servo};
pub use rig::{End, Motion, Rig, Start};

use crate::run::Error;
use crate::specification;
use physics::friction::{AnyLaw, LAWS, SealLips};

/// The friction law of a description, with its dependence on pressure; unknown names list the choices.
pub fn friction_law(spec: &specification::Friction) -> Result<(AnyLaw<f64>, Option<SealLips<f64>>), Error> {
    let refuse = |message: String| Err(Error::Specification(message));
    let Some(meta) = LAWS.iter().find(|meta| meta.key == spec.law) else {
        let names: Vec<&str> = LAWS.iter().map(|meta| meta.key).collect();
        return refuse(format!(
            "friction.law = \"{}\" is unknown; choose one of {}",
            spec.law,
            names.join(", ")
        ));
    };
    for key in spec.parameters.keys() {
        if !meta.parameters.iter().any(|parameter| parameter.key == key) {
            let names: Vec<&str> = meta.parameters.iter().map(|parameter| parameter.key).collect();
            return refuse(format!(
                "friction.{key} is no parameter of \"{}\"; it has {}",
                meta.key,
                names.join(", ")
            ));
        }
    }
    for parameter in meta.parameters {
        match spec.parameters.get(parameter.key).copied().or(parameter.default) {
            None => {
                return refuse(format!(
                    "friction.{} is missing: {} [{}]",
                    parameter.key,
                    parameter.meaning.trim(),
                    parameter.unit
                ));
            }
            Some(value) if !parameter.bounds.contain(value) => {
                return refuse(format!(
                    "friction.{} = {value} {} is out of bounds: it must be {}",
                    parameter.key, parameter.unit, parameter.bounds
                ));
            }
            Some(_) => {}
        }
    }
    let value = |key: &str| spec.parameters.get(key);
    if let (Some(fc), Some(fs)) = (value("coulomb"), value("breakaway"))
        && fs < fc
    {
        return refuse(format!("friction.breakaway = {fs} N must not be below friction.coulomb = {fc} N"));
    }
    let law = AnyLaw::build(meta.key, &mut |parameter| {
        spec.parameters.get(parameter.key).copied().or(parameter.default).expect("checked above")
    })
    .expect("the name is registered");
    let lips = spec.pressure.as_ref().map(|p| SealLips {
        coulomb_a: p.coulomb_a,
        coulomb_b: p.coulomb_b,
        breakaway_a: p.breakaway_a,
        breakaway_b: p.breakaway_b,
    });
    Ok((law, lips))
}
