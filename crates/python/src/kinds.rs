//! `components`: all kinds of component.

use crate::convert::parse;
use crate::friction::refused;
use circuit::{ComponentKind, Extra, Holds, PortKind, Stroke, formula_kind, kinds};
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
    kinds().into_iter().map(|kind| kind_entry(py, kind)).collect()
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

fn kind_entry<'py>(py: Python<'py>, kind: &ComponentKind) -> PyResult<Bound<'py, PyDict>> {
    let table = |items: &[(&str, Bound<'_, PyAny>)]| {
        let out = PyDict::new(py);
        items.iter().try_for_each(|(key, value)| out.set_item(key, value))?;
        PyResult::Ok(out)
    };
    let any = |value: &str| value.into_pyobject(py).map(Bound::into_any);
    let ports = kind.ports.iter().map(|port| {
        let out = table(&[("name", any(port.name)?)])?;
        let kind = match port.kind {
            PortKind::Gas => "gas",
            PortKind::Axis => "axis",
            PortKind::Pilot => "pilot",
        };
        out.set_item("kind", kind)?;
        let holds = match port.holds {
            Holds::Nothing => "",
            Holds::Volume => "volume",
            Holds::Pressure => "pressure",
            Holds::Set => "set",
            Holds::Motion => "motion",
        };
        out.set_item("holds", holds)?;
        out.set_item("exhaust", port.exhaust)?;
        out.set_item("optional", port.optional)?;
        PyResult::Ok(out)
    });
    let number = |own: &Parameter| {
        let out = table(&[("key", any(own.key)?), ("unit", any(own.unit)?), ("meaning", any(own.meaning)?)])?;
        out.set_item("rule", own.bounds.to_string())?;
        out.set_item("lower", own.bounds.lower)?;
        out.set_item("upper", own.bounds.upper)?;
        out.set_item("open", own.bounds.open)?;
        out.set_item("open_above", own.bounds.open_above)?;
        out.set_item("default", own.default)?;
        PyResult::Ok(out)
    };
    let parameters = kind.parameters.iter().map(|own| {
        let out = number(&own.parameter)?;
        out.set_item("assumed", own.assumed)?;
        out.set_item("follows", own.follows)?;
        out.set_item("unless", own.unless)?;
        out.set_item("within", own.within)?;
        out.set_item("only", own.only)?;
        out.set_item("was", own.was)?;
        PyResult::Ok(out)
    });
    let choices = kind.choices.iter().map(|own| {
        let out = table(&[("name", any(own.name)?), ("meaning", any(own.meaning)?)])?;
        out.set_item("options", own.options)?;
        out.set_item("default", own.options[0])?;
        PyResult::Ok(out)
    });
    let variables = |variables: &'static [(&str, &str, &str)]| {
        let each = variables.iter().map(|&(name, unit, meaning)| {
            table(&[("name", any(name)?), ("unit", any(unit)?), ("meaning", any(meaning)?)])
        });
        each.collect::<PyResult<Vec<_>>>()
    };
    let out = table(&[("kind", any(kind.key)?), ("title", any(kind.title)?), ("doc", any(kind.text)?)])?;
    out.set_item("sources", kind.sources)?;
    out.set_item("ports", ports.collect::<PyResult<Vec<_>>>()?)?;
    out.set_item("parameters", parameters.collect::<PyResult<Vec<_>>>()?)?;
    out.set_item("choices", choices.collect::<PyResult<Vec<_>>>()?)?;
    for key in ["formula", "points"] {
        out.set_item(key, py.None())?;
    }
    if let Extra::Formula(role) = kind.extra {
        let names = role.variables.iter().chain(role.constants).map(|own| {
            table(&[("name", any(own.name)?), ("unit", any(own.unit)?), ("meaning", any(own.meaning)?)])
        });
        let formula = table(&[("output", any(role.output.0)?), ("unit", any(role.output.1)?)])?;
        formula.set_item("names", names.collect::<PyResult<Vec<_>>>()?)?;
        out.set_item("formula", formula)?;
    } else if let Extra::Points(own) = kind.extra {
        let points = PyDict::new(py);
        points.set_item("key", own.key)?;
        points.set_item("optional", own.optional)?;
        points.set_item("columns", own.columns.iter().map(number).collect::<PyResult<Vec<_>>>()?)?;
        points.set_item("most", Extra::MOST_POINTS)?;
        out.set_item("points", points)?;
    }
    out.set_item("open", kind.open)?;
    out.set_item("discrete", kind.discrete)?;
    let friction = if kind.needs_friction { "needed" } else { "optional" };
    out.set_item("friction", if kind.friction { friction } else { "" })?;
    out.set_item("inputs", variables(kind.inputs)?)?;
    out.set_item("outputs", variables(kind.outputs)?)?;
    let symbol = PyDict::new(py);
    symbol.set_item("strokes", strokes(py, kind.symbol.strokes)?)?;
    let when = kind.symbol.when.iter().map(|(option, own)| Ok((option, strokes(py, own)?)));
    symbol.set_item("when", when.collect::<PyResult<Vec<_>>>()?)?;
    symbol.set_item("ports", kind.symbol.ports)?;
    out.set_item("symbol", symbol)?;
    Ok(out)
}
