//! `Tank`: a fixed volume on a line, by shooting alone.

use crate::convert::{Numbers, Teller, parse, to_python, watched};
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
        Ok(PyTank { json, tank: Tank::assemble(&spec).map_err(to_python)? })
    }

    /// As `Drive.shoot`; a command is the share of the line's opening, a start pressure and temperature.
    #[pyo3(signature = (times, commands, sample_times, starts, initial, parameters, with_initial, outputs, rtol, threads=2, look=None))]
    #[allow(clippy::too_many_arguments)] // The seam: named in Python, checked there.
    fn shoot<'py>(
        &self,
        py: Python<'py>,
        times: Numbers<'py>,
        commands: Numbers<'py>,
        sample_times: Numbers<'py>,
        starts: Vec<usize>,
        initial: PyReadonlyArray2<'py, f64>,
        parameters: Vec<String>,
        with_initial: WithInitial,
        outputs: Vec<String>,
        rtol: f64,
        threads: usize,
        look: Teller<'py>,
    ) -> PyResult<Bound<'py, PyDict>> {
        let asked = Shooting {
            times: times.into(),
            commands: commands.into(),
            sample_times: sample_times.into(),
            starts,
            initial: initial.as_array().iter().copied().collect(),
            parameters,
            with_initial: with_initial.into(),
            outputs,
            options: Options { rtol, ..Options::default() },
            threads,
        };
        let shot = watched(py, look, |interrupted| self.tank.shoot(&self.json, &asked, interrupted))?;
        shot_to_dict(py, &asked, shot, self.tank.start_names())
    }
}
