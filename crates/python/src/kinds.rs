//! `components`: all kinds of component.

use crate::convert::parse;
use crate::friction::refused;
use circuit::{KINDS, formula_kind};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pythonize::pythonize;

/// Returns every kind of component: its ports, parameters, choices, inputs and outputs.
#[pyfunction]
pub fn components(py: Python<'_>) -> PyResult<Bound<'_, PyAny>> {
    Ok(pythonize(py, KINDS)?)
}

/// Returns the entry, as in `components`, of a kind with a formula (JSON), with `warnings`.
///
/// Raises the ValueError of `formula_law`.
#[pyfunction]
pub fn formula_component<'py>(py: Python<'py>, kind: &str, json: &str) -> PyResult<Bound<'py, PyAny>> {
    let made = formula_kind(kind, &parse(json)?)
        .ok_or_else(|| PyValueError::new_err(format!("no component \"{kind}\" takes a formula")))?;
    let (kind, warnings) = made.map_err(|refusal| refused(&refusal))?;
    let entry = pythonize(py, kind)?;
    entry.set_item("warnings", warnings)?;
    Ok(entry)
}
