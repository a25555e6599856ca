//! `components`: all kinds of component.

use crate::convert::parse;
use crate::friction::refused;
use circuit::{
    Choice, ComponentKind, Extra, Holds, KINDS, Port, PortKind, Row, Stroke, Symbol, formula_kind,
};
use physics::Parameter;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyDict;

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
pub fn components(py: Python<'_>) -> PyResult<Vec<Bound<'_, PyDict>>> {
    KINDS.iter().map(|kind| kind_entry(py, kind)).collect()
}

/// Returns the entry, as in `components`, of a kind with a formula (JSON), with `warnings`.
///
/// Raises the ValueError of `formula_law`.
#[pyfunction]
pub fn formula_component<'py>(py: Python<'py>, kind: &str, json: &str) -> PyResult<Bound<'py, PyDict>> {
    let made = formula_kind(kind, &parse(json)?)
        .ok_or_else(|| PyValueError::new_err(format!("no component \"{kind}\" takes a formula")))?;
    let (kind, warnings) = made.map_err(|refusal| refused(&refusal))?;
    let entry = kind_entry(py, kind)?;
    entry.set_item("warnings", warnings)?;
    Ok(entry)
}

type Dict<'py> = Bound<'py, PyDict>;

/// Returns a dict of texts.
fn texts<'py>(py: Python<'py>, items: &[(&str, &str)]) -> PyResult<Dict<'py>> {
    let out = PyDict::new(py);
    items.iter().try_for_each(|(key, value)| out.set_item(key, value))?;
    Ok(out)
}

/// Returns an entry for each of the items.
fn each<'py, T>(items: &[T], entry: impl Fn(&T) -> PyResult<Dict<'py>>) -> PyResult<Vec<Dict<'py>>> {
    items.iter().map(entry).collect()
}

fn port_entry<'py>(py: Python<'py>, port: &Port) -> PyResult<Dict<'py>> {
    let kind = match port.kind {
        PortKind::Gas => "gas",
        PortKind::Axis => "axis",
        PortKind::Pilot => "pilot",
    };
    let holds = match port.holds {
        Holds::Nothing => "",
        Holds::Volume => "volume",
        Holds::Pressure => "pressure",
        Holds::Set => "set",
        Holds::Motion => "motion",
    };
    let out = texts(py, &[("name", port.name), ("kind", kind), ("holds", holds)])?;
    out.set_item("exhaust", port.exhaust)?;
    out.set_item("optional", port.optional)?;
    Ok(out)
}

fn number_entry<'py>(py: Python<'py>, own: &Parameter) -> PyResult<Dict<'py>> {
    let out = texts(py, &[("key", own.key), ("unit", own.unit), ("meaning", own.meaning)])?;
    out.set_item("rule", own.bounds.to_string())?;
    out.set_item("lower", own.bounds.lower)?;
    out.set_item("upper", own.bounds.upper)?;
    out.set_item("open", own.bounds.open)?;
    out.set_item("open_above", own.bounds.open_above)?;
    out.set_item("default", own.default)?;
    Ok(out)
}

fn parameter_entry<'py>(py: Python<'py>, own: &Row) -> PyResult<Dict<'py>> {
    let out = number_entry(py, &own.parameter)?;
    let told = [
        ("assumed", own.assumed),
        ("follows", own.follows),
        ("unless", own.unless),
        ("within", own.within),
        ("only", own.only),
        ("was", own.was),
    ];
    told.iter().try_for_each(|(key, value)| out.set_item(key, value))?;
    Ok(out)
}

fn choice_entry<'py>(py: Python<'py>, own: &Choice) -> PyResult<Dict<'py>> {
    let out = texts(py, &[("name", own.name), ("meaning", own.meaning)])?;
    out.set_item("options", own.options)?;
    out.set_item("default", own.options[0])?;
    Ok(out)
}

/// Adds the formula or the points that a kind takes.
fn add_extra(py: Python<'_>, extra: &Extra, out: &Dict<'_>) -> PyResult<()> {
    match extra {
        Extra::Nothing => Ok(()),
        Extra::Formula(role) => {
            let names =
                role.variables.iter().chain(role.constants).map(|own| {
                    texts(py, &[("name", own.name), ("unit", own.unit), ("meaning", own.meaning)])
                });
            let formula = texts(py, &[("output", role.output.0), ("unit", role.output.1)])?;
            formula.set_item("names", names.collect::<PyResult<Vec<_>>>()?)?;
            out.set_item("formula", formula)
        }
        Extra::Points(own) => {
            let points = PyDict::new(py);
            points.set_item("key", own.key)?;
            points.set_item("optional", own.optional)?;
            points.set_item("columns", each(own.columns, |column| number_entry(py, column))?)?;
            points.set_item("most", Extra::MOST_POINTS)?;
            out.set_item("points", points)
        }
    }
}

fn symbol_entry<'py>(py: Python<'py>, own: &Symbol) -> PyResult<Dict<'py>> {
    let out = PyDict::new(py);
    out.set_item("strokes", strokes(py, own.strokes)?)?;
    let when = own.when.iter().map(|(option, own)| Ok((option, strokes(py, own)?)));
    out.set_item("when", when.collect::<PyResult<Vec<_>>>()?)?;
    out.set_item("ports", own.ports)?;
    Ok(out)
}

fn kind_entry<'py>(py: Python<'py>, kind: &ComponentKind) -> PyResult<Dict<'py>> {
    let variables = |variables: &[(&str, &str, &str)]| {
        each(variables, |&(name, unit, meaning)| {
            texts(py, &[("name", name), ("unit", unit), ("meaning", meaning)])
        })
    };
    let out = texts(py, &[("kind", kind.key), ("title", kind.title), ("doc", kind.text)])?;
    out.set_item("sources", kind.sources)?;
    out.set_item("ports", each(kind.ports, |port| port_entry(py, port))?)?;
    out.set_item("parameters", each(kind.parameters, |row| parameter_entry(py, row))?)?;
    out.set_item("choices", each(kind.choices, |choice| choice_entry(py, choice))?)?;
    for key in ["formula", "points"] {
        out.set_item(key, py.None())?;
    }
    add_extra(py, &kind.extra, &out)?;
    out.set_item("open", kind.open)?;
    out.set_item("discrete", kind.discrete)?;
    let friction = if kind.needs_friction { "needed" } else { "optional" };
    out.set_item("friction", if kind.friction { friction } else { "" })?;
    out.set_item("inputs", variables(kind.inputs)?)?;
    out.set_item("outputs", variables(kind.outputs)?)?;
    out.set_item("symbol", symbol_entry(py, &kind.symbol)?)?;
    Ok(out)
}
