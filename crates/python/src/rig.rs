//! `Rig`: motions of a friction rig.

use crate::convert::{Numbers, Teller, options, parse, run_to_dict, to_python, watched};
use circuit::{Motion, Rig, Start, specification};
use pyo3::prelude::*;
use pyo3::types::PyDict;

/// A friction rig, assembled from its description in SI (JSON).
#[pyclass(name = "Rig", frozen)]
pub struct PyRig {
    rig: Rig,
}

/// Where a run of a rig begins: a position, or the final state of an earlier run.
#[derive(FromPyObject)]
enum From {
    Position(f64),
    State(Vec<f64>),
}

#[pymethods]
impl PyRig {
    #[new]
    #[pyo3(signature = (json, ledger=false))]
    fn new(json: &str, ledger: bool) -> PyResult<Self> {
        let spec: specification::Rig = parse(json)?;
        Ok(PyRig { rig: Rig::assemble(&spec, ledger).map_err(to_python)? })
    }

    /// Runs a motion of piecewise constant jerk.
    #[pyo3(signature = (durations, jerks, sample_times, initial, rtol, released=false, shut=false, look=None))]
    #[allow(clippy::too_many_arguments)] // The seam: named in Python, checked there.
    fn run<'py>(
        &self,
        py: Python<'py>,
        durations: Numbers<'py>,
        jerks: Numbers<'py>,
        sample_times: Numbers<'py>,
        initial: From,
        rtol: f64,
        released: bool,
        shut: bool,
        look: Teller<'py>,
    ) -> PyResult<Bound<'py, PyDict>> {
        let [durations, jerks, sample_times] = [durations, jerks, sample_times].map(Vec::from);
        let motion = Motion { durations: &durations, jerks: &jerks, released, shut };
        let from = match &initial {
            From::Position(position) => Start::Rest(*position),
            From::State(state) => Start::State(state),
        };
        let states = self.rig.n_states();
        let options = options(rtol, durations.iter().sum(), durations.len(), states, None);
        let (run, end) = watched(py, look, |interrupted| {
            self.rig.run(&motion, &sample_times, from, options, interrupted)
        })?;
        let out = run_to_dict(py, self.rig.columns(), run)?;
        out.set_item("final", end.state)?;
        out.set_item("commanded_position_m", end.commanded)?;
        Ok(out)
    }
}
