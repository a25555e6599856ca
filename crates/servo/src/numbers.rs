//! Numbers of a described component.

use crate::refuse;
use circuit::specification::Component;
use circuit::{ComponentKind, Error, KINDS};

/// A number of a component, the given value or the default, and its unit in SI.
pub(crate) fn quantity(own: &Component, key: &str) -> Option<(f64, &'static str)> {
    let kind: &ComponentKind = KINDS.iter().find(|kind| kind.key == own.kind)?;
    let row = kind.parameters.iter().find(|row| row.key == key)?;
    Some((own.numbers.get(key).copied().or(row.default)?, row.unit))
}

/// The same without the unit.
pub(crate) fn number(own: &Component, key: &str) -> Option<f64> {
    quantity(own, key).map(|(value, _)| value)
}

/// The same; an error if there is neither value nor default.
pub(crate) fn given(own: &Component, key: &str) -> Result<f64, Error> {
    match number(own, key) {
        Some(value) => Ok(value),
        None => refuse!("{}.{key} is missing: a controller needs it", own.name),
    }
}
