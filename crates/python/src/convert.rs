//! Results and errors of all classes: errors, runs, tables.

use circuit::specification::FromJson;
use circuit::{Balance, Error, Impact, Kind, Run, budget};
use numpy::{PyArray1, PyArray2, PyReadonlyArray1};
use ode::Options;
use pyo3::exceptions::{PyKeyboardInterrupt, PyRuntimeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use pythonize::pythonize;

pub fn to_python(error: Error) -> PyErr {
    match error {
        Error::Specification(message) => PyValueError::new_err(message),
        Error::Stopped(message) => PyRuntimeError::new_err(message),
        Error::Interrupted { t } => PyKeyboardInterrupt::new_err(format!("interrupted at t = {t} s")),
    }
}

pub fn parse<T: FromJson>(json: &str) -> PyResult<T> {
    T::from_json(json)
        .map_err(|error| PyValueError::new_err(format!("the core cannot read the description: {error}")))
}

/// Numbers in a row. An array is copied as a whole. Copied one by one, a million numbers would hold the
/// interpreter's lock for a second.
#[derive(FromPyObject)]
pub enum Numbers<'py> {
    Array(PyReadonlyArray1<'py, f64>),
    Sequence(Vec<f64>),
}

impl From<Numbers<'_>> for Vec<f64> {
    fn from(numbers: Numbers<'_>) -> Self {
        match numbers {
            Numbers::Array(array) => array.as_array().to_vec(),
            Numbers::Sequence(values) => values,
        }
    }
}

/// A Python callable that regularly receives the simulated time. An exception in it ends the run.
pub type Teller<'py> = Option<Bound<'py, PyAny>>;

/// Runs `work` without the interpreter's lock. `work` learns when the user wants to stop.
pub fn watched<T: Send>(
    py: Python<'_>,
    look: Teller<'_>,
    work: impl Send + FnOnce(&mut dyn FnMut(f64) -> bool) -> Result<T, Error>,
) -> PyResult<T> {
    let look = look.map(Bound::unbind);
    let (result, raised) = py.detach(|| {
        let mut raised = None;
        let mut interrupted = |t: f64| {
            Python::attach(|py| {
                raised = look.as_ref().and_then(|look| look.call1(py, (t,)).err());
                raised.is_some() || py.check_signals().is_err()
            })
        };
        (work(&mut interrupted), raised)
    });
    match raised {
        Some(error) => Err(error),
        None => result.map_err(to_python),
    }
}

pub fn ledger<'py>(py: Python<'py>, balance: &Balance) -> PyResult<Bound<'py, PyDict>> {
    let out = PyDict::new(py);
    out.set_item("mass_error", balance.mass_error)?;
    out.set_item("energy_error", balance.energy_error)?;
    out.set_item("entropy_error", balance.entropy_error)?;
    out.set_item("least_entropy_production_j_k", balance.least_production)?;
    out.set_item("energy_turnover_j", balance.turnover)?;
    let accounts = PyDict::new(py);
    for (name, kind, total) in &balance.accounts {
        let unit = match kind {
            Kind::Mass => "kg",
            Kind::Energy => "J",
            Kind::EntropyIn | Kind::EntropyOfGas | Kind::EntropyOfSolid => "J/K",
        };
        accounts.set_item(format!("{name} [{unit}]"), total)?;
    }
    out.set_item("accounts", accounts)?;
    Ok(out)
}

fn impact<'py>(py: Python<'py>, impact: &Impact) -> PyResult<Bound<'py, PyDict>> {
    let out = PyDict::new(py);
    out.set_item("time_s", impact.time)?;
    out.set_item("end", if impact.at_b { "b" } else { "a" })?;
    out.set_item("speed_m_s", impact.speed)?;
    out.set_item("energy_j", impact.energy)?;
    out.set_item("depth_m", impact.depth)?;
    out.set_item("peak_force_n", impact.force)?;
    out.set_item("met_cover", impact.through)?;
    Ok(out)
}

/// Returns a run as a dict.
pub fn run_to_dict<'py>(py: Python<'py>, names: &[String], run: Run) -> PyResult<Bound<'py, PyDict>> {
    let columns = PyDict::new(py);
    for (name, column) in names.iter().zip(run.columns) {
        columns.set_item(name, PyArray1::from_vec(py, column))?;
    }
    let out = PyDict::new(py);
    out.set_item("columns", columns)?;
    out.set_item("statistics", pythonize(py, &run.statistics)?)?;
    let impacts = run.impacts.iter().map(|one| impact(py, one)).collect::<PyResult<Vec<_>>>()?;
    out.set_item("impacts", impacts)?;
    out.set_item("ledger", run.balance.as_ref().map(|balance| ledger(py, balance)).transpose()?)?;
    Ok(out)
}

/// Options of a run of `duration` s with this many commands. Without a given budget, the default applies.
pub fn options(rtol: f64, duration: f64, commands: usize, states: usize, given: Option<u64>) -> Options {
    let max_attempts = given.unwrap_or_else(|| budget(duration, commands, states));
    Options { rtol, max_attempts, ..Options::default() }
}

/// Samples in rows.
pub type Table<'py> = Bound<'py, PyArray2<f64>>;
