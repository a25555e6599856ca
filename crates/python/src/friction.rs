//! Friction laws: the list, custom laws, steady sliding.

use crate::convert::{Table, parse, to_python, watched};
use circuit::{friction_law, own_law, specification, steady_sensitivity};
use math::Dual;
use numpy::{PyArray1, PyArrayMethods, PyReadonlyArray1};
use physics::friction::formula::Text;
use physics::friction::{At, Growth, Heating, LAWS, Levels, Wear};
use physics::written::Refusal;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use pythonize::pythonize;

/// Returns every friction law that a description can name.
#[pyfunction]
pub fn friction_laws(py: Python<'_>) -> PyResult<Bound<'_, PyAny>> {
    Ok(pythonize(py, LAWS)?)
}

/// Returns the entry, as in `friction_laws`, of a custom law (JSON), with `warnings`.
///
/// Raises ValueError(what, key, formula, line, column, text, caret, remedy). Without a line, the error has no
/// place in a formula.
#[pyfunction]
pub fn formula_law<'py>(py: Python<'py>, json: &str) -> PyResult<Bound<'py, PyAny>> {
    let text: Text = parse(json)?;
    let own = own_law(&text).map_err(|refusal| refused(&refusal))?;
    let law = pythonize(py, &own.meta)?;
    law.set_item("warnings", &own.warnings)?;
    law.set_item("levels", own.has_levels())?;
    Ok(law)
}

/// Returns an error in a formula as a ValueError of eight fields.
pub fn refused(refusal: &Refusal) -> PyErr {
    let Refusal { key, formula, problem } = refusal;
    let (line, column, text, caret) = problem.shown(formula).unwrap_or_default();
    let (what, remedy) = (problem.what.clone(), problem.remedy.clone());
    PyValueError::new_err((what, key.clone(), formula.clone(), line, column, text, caret, remedy))
}

type Values = std::collections::BTreeMap<String, f64>;

/// Returns the steady sliding friction of a law, N, at each velocity, m/s, for given gauge pressures, Pa, and
/// position, m. `dependences` are the tables of the description's friction.
#[pyfunction]
#[pyo3(signature = (law, parameters, velocity, gauge_a_pa=0.0, gauge_b_pa=0.0, pressure=None, dependences=None, position_m=0.0))]
#[allow(clippy::too_many_arguments)] // The seam: named in Python.
pub fn steady_friction<'py>(
    py: Python<'py>,
    law: &str,
    parameters: Values,
    velocity: PyReadonlyArray1<'py, f64>,
    gauge_a_pa: f64,
    gauge_b_pa: f64,
    pressure: Option<Values>,
    dependences: Option<&Bound<'py, PyAny>>,
    position_m: f64,
) -> PyResult<Bound<'py, PyArray1<f64>>> {
    let mut spec: specification::Friction = parse(&friction_json(py, law, dependences)?)?;
    spec.parameters = parameters;
    spec.pressure = pressure.or(spec.pressure);
    let friction = friction_law(&spec).map_err(to_python)?;
    let force = |v: f64| {
        let place = At { v, x: position_m, ..At::at_rest() };
        friction.steady(&place.pressed(gauge_a_pa, gauge_b_pa))
    };
    Ok(PyArray1::from_iter(py, velocity.as_array().iter().map(|&v| force(v))))
}

/// Returns the effect of heating and wear on friction: the factor on Fc and Fs, and the factor on Fv.
/// `above_k` is the temperature of the contact above the reference of the law's parameters.
#[pyfunction]
pub fn seal_factors(
    levels_per_k: f64,
    viscous_per_k: f64,
    above_k: f64,
    run_in: f64,
    run_in_distance_m: f64,
    slid_m: f64,
) -> (f64, f64) {
    let heating = heated(viscous_per_k, levels_per_k, 0.0, 1.0);
    let wear = Wear { run_in, run_in_distance: run_in_distance_m, rate: 0.0, slid: 0.0 };
    let levels = wear.apply(&heating.apply(&Levels::new(1.0, 1.0, 1.0), above_k), slid_m);
    (levels.coulomb, levels.viscous)
}

/// Returns the temperature rise of a contact above its surroundings, K, after constant friction heat, W, for
/// a duration, s.
#[pyfunction]
pub fn seal_warming(resistance_k_w: f64, time_s: f64, warming_k: f64, heat_w: f64, duration_s: f64) -> f64 {
    heated(0.0, 0.0, resistance_k_w, time_s).after(warming_k, heat_w, duration_s)
}

fn heated(viscous: f64, levels: f64, resistance: f64, time: f64) -> Heating<f64> {
    Heating { reference: 0.0, viscous, levels, resistance, time, ambient: 0.0 }
}

/// Returns the friction of a description as JSON. Parameters are left out because they may be infinite.
fn friction_json(py: Python<'_>, law: &str, dependences: Option<&Bound<'_, PyAny>>) -> PyResult<String> {
    let tables = PyDict::new(py);
    if let Some(dependences) = dependences {
        tables.call_method1("update", (dependences,))?;
    }
    tables.set_item("law", law)?;
    tables.set_item("parameters", PyDict::new(py))?;
    py.import("json")?.call_method1("dumps", (tables,))?.extract()
}

/// Returns the steady sliding friction of a law, N, at each place, and its derivatives by numbers of the
/// description, shape (places, names).
#[pyfunction]
#[pyo3(signature = (law, parameters, names, velocity, gauge_a_pa, gauge_b_pa, position_m, dependences=None))]
#[allow(clippy::too_many_arguments)] // The seam: named in Python.
pub fn steady_friction_sensitivity<'py>(
    py: Python<'py>,
    law: &str,
    parameters: Values,
    names: Vec<String>,
    velocity: PyReadonlyArray1<'py, f64>,
    gauge_a_pa: PyReadonlyArray1<'py, f64>,
    gauge_b_pa: PyReadonlyArray1<'py, f64>,
    position_m: PyReadonlyArray1<'py, f64>,
    dependences: Option<&Bound<'py, PyAny>>,
) -> PyResult<(Bound<'py, PyArray1<f64>>, Table<'py>)> {
    let n = velocity.as_array().len();
    for (name, array) in
        [("gauge_a_pa", &gauge_a_pa), ("gauge_b_pa", &gauge_b_pa), ("position_m", &position_m)]
    {
        let found = array.as_array().len();
        if found != n {
            return Err(PyValueError::new_err(format!("{name} has {found} values, velocity has {n}")));
        }
    }
    let json = friction_json(py, law, dependences)?;
    let conditions = gauge_a_pa.as_array().into_owned().into_iter().zip(gauge_b_pa.as_array().into_owned());
    let places = velocity.as_array().into_owned().into_iter().zip(position_m.as_array().into_owned());
    let places: Vec<At<f64>> = places
        .zip(conditions)
        .map(|((v, x), (gauge_a, gauge_b))| At { v, x, ..At::at_rest() }.pressed(gauge_a, gauge_b))
        .collect();
    let (forces, derivatives) =
        watched(py, None, |_| steady_sensitivity(&json, &parameters, &names, &places))?;
    let table = PyArray1::from_vec(py, derivatives).reshape([n, names.len()])?;
    Ok((PyArray1::from_vec(py, forces), table))
}

/// Returns the growth of friction with age (`saturating`, `log`, `hyperbolic`) for an increment of 1. The
/// result has a row for each age, s, and the derivatives by age, time and exponent: shape (ages, 4).
#[pyfunction]
pub fn dwell_growth<'py>(
    py: Python<'py>,
    growth: &str,
    age: PyReadonlyArray1<'py, f64>,
    time: f64,
    exponent: f64,
) -> PyResult<Table<'py>> {
    let growth = Growth::ALL
        .into_iter()
        .find(|known| known.key() == growth)
        .ok_or_else(|| PyValueError::new_err(format!("there is no growth {growth:?}")))?;
    let [time, exponent] = [(time, 1), (exponent, 2)].map(|(value, i)| Dual::<f64, 3>::variable(value, i));
    let ages = age.as_array();
    let rows = ages.iter().flat_map(|&age| {
        let psi = growth.at(Dual::variable(age, 0) / time, exponent);
        [psi.re, psi.eps[0], psi.eps[1], psi.eps[2]]
    });
    PyArray1::from_iter(py, rows).reshape([ages.len(), 4])
}
