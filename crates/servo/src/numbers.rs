//! Numbers of a described component.

use crate::refuse;
use circuit::specification::Component;
use circuit::{ComponentKind, Error, KINDS};

/// A number of a component: the given value, or the default.
pub(crate) fn number(own: &Component, key: &str) -> Option<f64> {
    let kind: &ComponentKind = KINDS.iter().find(|kind| kind.key == own.kind)?;
    let row = kind.parameters.iter().find(|row| row.key == key)?;
    own.numbers.get(key).copied().or(row.default)
}

/// The same; an error if there is neither.
pub(crate) fn given(own: &Component, key: &str) -> Result<f64, Error> {
    match number(own, key) {
        Some(value) => Ok(value),
        None => refuse!("{}.{key} is missing: a controller needs it", own.name),
    }
}
