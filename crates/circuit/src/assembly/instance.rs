//! A component from its description, checked.

use super::friction::contact;
use super::joints::one_of;
use crate::component::{Choice, FrictionTable, Given, Instance, KINDS, Kind, Row, check};
use crate::ground::{Error, Lifted, check_bounds, refuse};
use crate::specification::Component;

/// A component with its numbers, checked.
pub(super) fn instance(spec: &Component) -> Result<Instance<f64>, Error> {
    let name = &spec.name;
    let Some(kind) = KINDS.iter().position(|kind| kind.key == spec.kind) else {
        let kinds = one_of(KINDS.iter().map(|kind| kind.key));
        return refuse!("{name}: there is no kind \"{}\" of component; kinds: {kinds}", spec.kind);
    };
    let extra = Given::of(KINDS[kind], spec)?;
    let table = extra.kind(KINDS[kind]);
    let known = |key: &String| table.parameters.iter().any(|parameter| parameter.key == key);
    if let Some(key) = spec.numbers.keys().find(|key| !known(key)) {
        let keys = one_of(table.parameters.iter().map(|parameter| parameter.key));
        return refuse!("{name}: a {} has no parameter \"{key}\"; it has {keys}", table.key);
    }
    let choices = table.choices.iter().map(|own| choice(spec, own)).collect::<Result<Vec<_>, _>>()?;
    let numbers = table.parameters.iter().map(|row| number(spec, table, &choices, row));
    let numbers = numbers.collect::<Result<_, _>>()?;
    if let Some(key) = spec.choices.keys().find(|key| !table.choices.iter().any(|own| own.name == *key)) {
        return refuse!("{name}: a {} has no choice \"{key}\"", table.key);
    }
    let friction = match &spec.friction {
        Some(_) if table.friction == FrictionTable::No => {
            return refuse!("{name}: a {} takes no friction", table.key);
        }
        Some(friction) => Some(contact(&Lifted::plain(friction))?),
        None => None,
    };
    let free = vec![false; table.parameters.len()];
    let instance = Instance { name: name.clone(), kind, table, extra, numbers, free, choices, friction };
    check(&instance)?;
    Ok(instance)
}

/// The selected option of a choice: the first one by default.
fn choice(spec: &Component, own: &Choice) -> Result<usize, Error> {
    let Some(option) = spec.choices.get(own.name) else { return Ok(0) };
    match own.options.iter().position(|known| known == option) {
        Some(place) => Ok(place),
        None => refuse!(
            "{}.{} = \"{option}\": choose of {}",
            spec.name,
            own.name,
            one_of(own.options.iter().copied())
        ),
    }
}

/// The value of a parameter, if it is given or has a default.
fn number(spec: &Component, table: &Kind, choices: &[usize], row: &Row) -> Result<Option<f64>, Error> {
    // A separate table, such as a cushion, exists if any of its numbers exists.
    let is_of_table = |own: &Row| own.within == row.within && spec.numbers.contains_key(own.key);
    if !row.within.is_empty() && !table.parameters.iter().any(is_of_table) {
        return Ok(None);
    }
    let is_spared = || match row.unless.split_once(" = ") {
        Some((of, option)) => {
            let mut each = table.choices.iter().zip(choices);
            each.any(|(choice, place)| choice.name == of && choice.options[*place] == option)
        }
        None => {
            let is_given = spec.points.is_some() && table.points.is_some_and(|own| own.key == row.unless);
            is_given || spec.numbers.contains_key(row.unless)
        }
    };
    let name = &spec.name;
    match spec.numbers.get(row.key).copied().or(row.default) {
        Some(value) => {
            check_bounds(&format!("{name}.{}", row.key), value, row.unit, &row.bounds).map(|()| Some(value))
        }
        None if row.follows.is_empty() && !is_spared() => refuse!("{name}.{} is missing", row.key),
        None => Ok(None),
    }
}
