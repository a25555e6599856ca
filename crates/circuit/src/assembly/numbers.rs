//! Numbers of a circuit by name, and derivatives by them.

use super::friction::contact;
use super::gas::gas;
use super::network::Network;
use super::shoot::{All, Shooting, Shot};
use super::variables::Assembly;
use super::wiring::wire;
use crate::component::Instance;
use crate::ground::{DIRECTIONS, Error, Lifted, Sensitive, refuse, seeds, unfit};
use crate::specification;
use math::{Deps, Dual, Lane, Over};
use serde_json::Value;

/// Splits a name into its component and the rest: "left.friction.parameters.coulomb".
pub(super) fn split<'a>(each: &[Instance<f64>], name: &'a str) -> Result<(usize, &'a str), Error> {
    let rest = |own: &Instance<f64>| name.strip_prefix(&own.name).and_then(|rest| rest.strip_prefix('.'));
    let found = each.iter().enumerate().find_map(|(i, own)| Some((i, rest(own)?)));
    found.ok_or_else(|| Error::Specification(format!("\"{name}\" belongs to no component of this circuit")))
}

/// Returns the index of a number among those of its component, if it has a value.
pub(super) fn place(own: &Instance<f64>, key: &str) -> Result<usize, Error> {
    let rows = own.table.parameters;
    let Some(place) = rows.iter().position(|row| row.key == key) else {
        let keys: Vec<&str> = rows.iter().map(|row| row.key).collect();
        return refuse!("a {} has no parameter \"{key}\"; it has {}", own.table.key, keys.join(", "));
    };
    if own.numbers[place].is_none() {
        return refuse!(
            "{}.{key} is not given{}: give it a value first",
            own.name,
            if rows[place].follows.is_empty() {
                String::new()
            } else {
                format!(" and follows {}", rows[place].follows)
            },
        );
    }
    Ok(place)
}

/// Returns the component with numbers that carry derivatives.
fn lift<P: Lane>(
    own: &Instance<f64>,
    lifted: &Lifted<specification::Component>,
) -> Result<Instance<P>, Error> {
    let rows = own.table.parameters.iter().zip(&own.numbers);
    let given = |key: &str| lifted.value.numbers.contains_key(key);
    let numbers = rows.map(|(row, value)| {
        let number = |component: &specification::Component| component.numbers[row.key];
        value.map(|value| if given(row.key) { lifted.number(number) } else { P::c(value) })
    });
    let free = own
        .table
        .parameters
        .iter()
        .map(|row| given(row.key) && lifted.is_free(|component| component.numbers[row.key]));
    let friction = lifted.optional(|component| component.friction.as_ref());
    Ok(Instance {
        name: own.name.clone(),
        kind: own.kind,
        table: own.table,
        extra: own.extra.lift(),
        numbers: numbers.collect(),
        free: free.collect(),
        choices: own.choices.clone(),
        friction: friction.map(|friction| contact(&friction)).transpose()?,
    })
}

/// Returns a circuit made by `of`, from numbers with derivatives.
fn assemble<P: Lane>(of: &Network, lifted: &Lifted<specification::Circuit>) -> Result<Assembly<P>, Error>
where
    Deps: Over<P>,
{
    let number = |f: fn(&specification::Circuit) -> f64| -> P { lifted.number(f) };
    let gas = gas(&lifted.table(|spec| &spec.gas));
    let ambient = [number(|s| s.ambient.pressure_pa), number(|s| s.ambient.temperature_k)];
    let each =
        of.each.iter().enumerate().map(|(i, own)| lift(own, &lifted.table(|spec| &spec.components[i])));
    let each = each.collect::<Result<Vec<_>, Error>>()?;
    let like = &of.assembly;
    let without_ledger = Some(&*like.circuit).filter(|circuit| circuit.channels().is_empty());
    Ok(wire(&gas, ambient, (&each, &of.joints), false, without_ledger)?.named_like(like))
}

impl Network {
    /// Returns the description with a value for each differentiated number, and its path.
    fn paths(&self, json: &str, names: &[String]) -> Result<(String, Vec<String>), Error> {
        let mut table: Value = serde_json::from_str(json).map_err(unfit)?;
        let path = |name: &String| {
            if name.starts_with("ambient.") || name.starts_with("gas.") {
                return Ok(name.clone());
            }
            let (component, key) = split(&self.each, name)?;
            let (i, own) = (component.to_string(), &self.each[component]);
            if key.starts_with("friction.") {
                return Ok(format!("components.{i}.{key}"));
            }
            let place = place(own, key)?;
            if own.table.discrete.contains(&key) {
                return refuse!(
                    "{name} acts on the schedule or on the number of cells: a run has no derivative by it"
                );
            }
            if let Some(component) = table["components"][component].as_object_mut() {
                let numbers = component.entry("numbers").or_insert_with(|| serde_json::json!({}));
                if numbers[key].is_null() {
                    numbers[key] = own.numbers[place].into();
                }
            }
            Ok(format!("components.{i}.numbers.{key}"))
        };
        let paths = names.iter().map(path).collect::<Result<Vec<_>, Error>>()?;
        Ok((table.to_string(), paths))
    }

    /// Runs the segments of `asked` with exact derivatives by numbers of components, such as "left.bore". The result
    /// does not depend on the number of threads. `json` is the description of this circuit.
    pub fn shoot(
        &self,
        json: &str,
        asked: &Shooting,
        interrupted: &mut dyn FnMut(f64) -> bool,
    ) -> Result<Shot, Error> {
        let plain = &self.assembly;
        let all = All::of(asked, plain)?;
        if all.directions == 0 {
            return all.run(std::slice::from_ref(plain), interrupted);
        }
        let (json, paths) = self.paths(json, &asked.parameters)?;
        let seeds = seeds::<specification::Circuit>(&json, "", &paths)?;
        if all.directions == 1 && plain.circuit.serves_all() {
            let own = assemble::<Dual<f64, 1>>(self, &Lifted::new(&seeds, 0));
            // Refusals are for numbers of any kind.
            if let Some(own) = own.ok().filter(|own| own.circuit.serves_all()) {
                return all.run(&[own], interrupted);
            }
        }
        let passes = (0..all.directions).step_by(DIRECTIONS);
        let passes = passes.map(|first| assemble::<Sensitive>(self, &Lifted::new(&seeds, first)));
        all.run(&passes.collect::<Result<Vec<_>, _>>()?, interrupted)
    }
}
