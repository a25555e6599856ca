//! `Tank`: a fixed volume on a line, for shooting only.

use crate::convert::{Teller, parse, to_python, watched};
use crate::shooting::{Asked, shot_to_dict};
use circuit::{Shooting, Tank, specification};
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

    /// As `Drive.shoot`. A command is the opening fraction of the line. A start has pressure and temperature.
    #[pyo3(signature = (asked, look=None))]
    fn shoot<'py>(
        &self,
        py: Python<'py>,
        asked: Asked<'py>,
        look: Teller<'py>,
    ) -> PyResult<Bound<'py, PyDict>> {
        let asked = Shooting::from(asked);
        let shot = watched(py, look, |interrupted| self.tank.shoot(&self.json, &asked, interrupted))?;
        shot_to_dict(py, &asked, shot, self.tank.start_names())
    }
}
