//! What every class returns and raises: errors, runs, tables.

use circuit::{Balance, Error, Kind, Run};
use numpy::{PyArray1, PyArray2};
use ode::{Options, Statistics};
use pyo3::exceptions::{PyKeyboardInterrupt, PyRuntimeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::PyDict;

pub fn to_python(error: Error) -> PyErr {
    match error {
        Error::Specification(message) => PyValueError::new_err(message),
        Error::Stopped(message) => PyRuntimeError::new_err(message),
        Error::Interrupted { t } => PyKeyboardInterrupt::new_err(format!("interrupted at t = {t} s")),
    }
}

pub fn parse<'a, T: serde::Deserialize<'a>>(json: &'a str) -> PyResult<T> {
    serde_json::from_str(json)
        .map_err(|error| PyValueError::new_err(format!("the description does not fit the core: {error}")))
}

/// Runs `work` without the interpreter's lock; `work` is told when the user wants to stop.
pub fn detached<T: Send>(
    py: Python<'_>,
    work: impl Send + FnOnce(&mut dyn FnMut() -> bool) -> Result<T, Error>,
) -> PyResult<T> {
    py.detach(|| {
        let mut interrupted = || Python::attach(|py| py.check_signals().is_err());
        work(&mut interrupted)
    })
    .map_err(to_python)
}

pub fn statistics<'py>(py: Python<'py>, s: &Statistics) -> PyResult<Bound<'py, PyDict>> {
    let out = PyDict::new(py);
    out.set_item("steps", s.steps)?;
    out.set_item("rejected", s.rejected)?;
    out.set_item("right_hand_sides", s.right_hand_sides)?;
    out.set_item("jacobians", s.jacobians)?;
    out.set_item("factorisations", s.factorisations)?;
    out.set_item("events", s.events)?;
    Ok(out)
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

pub fn run_to_dict<'py>(py: Python<'py>, names: &[String], run: Run) -> PyResult<Bound<'py, PyDict>> {
    let columns = PyDict::new(py);
    for (name, column) in names.iter().zip(run.columns) {
        columns.set_item(name, PyArray1::from_vec(py, column))?;
    }
    let out = PyDict::new(py);
    out.set_item("columns", columns)?;
    out.set_item("statistics", statistics(py, &run.statistics)?)?;
    out.set_item("ledger", run.balance.as_ref().map(|balance| ledger(py, balance)).transpose()?)?;
    Ok(out)
}

pub fn options(rtol: f64) -> Options {
    Options { rtol, ..Options::default() }
}

/// Samples in rows.
pub type Table<'py> = Bound<'py, PyArray2<f64>>;
