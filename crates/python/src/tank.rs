//! `Tank`: a fixed volume on a line, by shooting alone.

use crate::convert::{detached, parse};
use crate::drive::{WithInitial, shot_to_dict};
use circuit::{Shooting, Tank, specification};
use numpy::PyReadonlyArray2;
use ode::Options;
use pyo3::prelude::*;
use pyo3::types::PyDict;

/// A tank, assembled from its description in SI (JSON).
#[pyclass(name = "Tank", frozen)]
pub struct PyTank {
    json: String,
    tank: Tank,
}

#[pymethods]
impl PyTank {
    #[new]
    fn new(json: String) -> PyResult<Self> {
        let spec: specification::Tank = parse(&json)?;
        Ok(PyTank { json, tank: Tank::assemble(&spec) })
    }

    /// As `Drive.shoot`; a command is the share of the line's opening, a start pressure and temperature.
    #[pyo3(signature = (times, commands, sample_times, starts, initial, parameters, with_initial, outputs, rtol, threads=2))]
    #[allow(clippy::too_many_arguments)] // The seam: named in Python, checked there.
    fn shoot<'py>(
        &self,
        py: Python<'py>,
        times: Vec<f64>,
        commands: Vec<f64>,
        sample_times: Vec<f64>,
        starts: Vec<usize>,
        initial: PyReadonlyArray2<'py, f64>,
        parameters: Vec<String>,
        with_initial: WithInitial,
        outputs: Vec<String>,
        rtol: f64,
        threads: usize,
    ) -> PyResult<Bound<'py, PyDict>> {
        let initial = initial.as_array().iter().copied().collect();
        let options = Options { rtol, ..Options::default() };
        let with_initial = with_initial.into();
        let asked = Shooting {
            times,
            commands,
            sample_times,
            starts,
            initial,
            parameters,
            with_initial,
            outputs,
            options,
            threads,
        };
        let shot = detached(py, |interrupted| self.tank.shoot(&self.json, &asked, interrupted))?;
        shot_to_dict(py, &asked, shot, self.tank.start_names())
    }
}
