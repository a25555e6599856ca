//! `components`: all kinds of component.

use crate::convert::parse;
use crate::friction::refused;
use circuit::{ComponentKind, KINDS, Stroke, Symbol, formula_kind};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use pythonize::pythonize;

/// The strokes of a symbol, each a word and its points and numbers.
fn strokes<'py>(py: Python<'py>, strokes: &[Stroke]) -> PyResult<Vec<Bound<'py, PyAny>>> {
    let mut out = Vec::new();
    add_strokes(py, strokes, ([0.0, 0.0], false), &mut out)?;
    Ok(out)
}

/// Adds the strokes, moved by an offset and optionally mirrored before.
fn add_strokes<'py>(
    py: Python<'py>,
    strokes: &[Stroke],
    (by, mirrored): ([f64; 2], bool),
    out: &mut Vec<Bound<'py, PyAny>>,
) -> PyResult<()> {
    let place = |[x, y]: [f64; 2]| [by[0] + if mirrored { -x } else { x }, by[1] + y];
    let places = |points: &[[f64; 2]]| points.iter().copied().map(place).collect::<Vec<_>>();
    for stroke in strokes {
        out.push(match *stroke {
            Stroke::Line(points) => ("line", places(points)).into_pyobject(py)?.into_any(),
            Stroke::Dashed(points) => ("dashed", places(points)).into_pyobject(py)?.into_any(),
            Stroke::Arc(centre, radius, [from, to]) => {
                let angles = if mirrored { [180.0 - to, 180.0 - from] } else { [from, to] };
                ("arc", place(centre), radius, angles).into_pyobject(py)?.into_any()
            }
            Stroke::Dot(centre, radius) => ("dot", place(centre), radius).into_pyobject(py)?.into_any(),
            Stroke::Triangle(corners) => ("triangle", places(&corners)).into_pyobject(py)?.into_any(),
            Stroke::Head(corners) => ("head", places(&corners)).into_pyobject(py)?.into_any(),
            Stroke::Text(at, text) => ("text", place(at), text).into_pyobject(py)?.into_any(),
            Stroke::Moved(own, at, flipped) => {
                add_strokes(py, own, (place(at), mirrored != flipped), out)?;
                continue;
            }
        });
    }
    Ok(())
}

/// Returns every kind of component: its ports, parameters, choices, inputs and outputs.
#[pyfunction]
pub fn components(py: Python<'_>) -> PyResult<Vec<Bound<'_, PyAny>>> {
    KINDS.iter().map(|kind| kind_entry(py, kind)).collect()
}

/// Returns the entry, as in `components`, of a kind with a formula (JSON), with `warnings`.
///
/// Raises the ValueError of `formula_law`.
#[pyfunction]
pub fn formula_component<'py>(py: Python<'py>, kind: &str, json: &str) -> PyResult<Bound<'py, PyAny>> {
    let made = formula_kind(kind, &parse(json)?)
        .ok_or_else(|| PyValueError::new_err(format!("no component \"{kind}\" takes a formula")))?;
    let (kind, warnings) = made.map_err(|refusal| refused(&refusal))?;
    let entry = kind_entry(py, kind)?;
    entry.set_item("warnings", warnings)?;
    Ok(entry)
}

fn kind_entry<'py>(py: Python<'py>, kind: &ComponentKind) -> PyResult<Bound<'py, PyAny>> {
    let Symbol { strokes: always, when, ports } = kind.symbol;
    let symbol = PyDict::new(py);
    symbol.set_item("strokes", strokes(py, always)?)?;
    let when = when.iter().map(|(option, own)| Ok((option, strokes(py, own)?)));
    symbol.set_item("when", when.collect::<PyResult<Vec<_>>>()?)?;
    symbol.set_item("ports", ports)?;
    let out = pythonize(py, kind)?;
    out.set_item("symbol", symbol)?;
    Ok(out)
}
