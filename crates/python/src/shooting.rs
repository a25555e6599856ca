//! Request for running segments of a record, and the result.

use crate::convert::Numbers;
use circuit::{InputPlan, Shooting, Shot};
use numpy::{PyArray1, PyArrayMethods, PyReadonlyArray2};
use ode::Options;
use pyo3::prelude::*;
use pyo3::types::PyDict;

/// Whether to differentiate by the starts, or the start values, or groups of them, to differentiate by.
#[derive(FromPyObject)]
enum WithInitial {
    All(bool),
    Of(Vec<usize>),
    Together(Vec<Vec<usize>>),
}

/// The dict `_core.Shooting` from Python.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub struct Asked<'py> {
    times: Numbers<'py>,
    commands: Numbers<'py>,
    #[pyo3(default)]
    others: Vec<(String, Vec<f64>, Vec<f64>)>,
    sample_times: Numbers<'py>,
    starts: Vec<usize>,
    initial: PyReadonlyArray2<'py, f64>,
    #[pyo3(default)]
    parameters: Vec<String>,
    #[pyo3(default = WithInitial::All(false))]
    with_initial: WithInitial,
    outputs: Vec<String>,
    rtol: f64,
    #[pyo3(default = 1)]
    threads: usize,
}

impl Asked<'_> {
    /// Returns the request, with the commands of this input, if any.
    pub fn under(self, command: Option<&str>) -> Shooting {
        let plan = |(input, times, values)| InputPlan { input, times, values };
        let command = command.map(|input| (input.into(), self.times.into(), self.commands.into()));
        Shooting {
            plans: command.into_iter().chain(self.others).map(plan).collect(),
            sample_times: self.sample_times.into(),
            starts: self.starts,
            initial: self.initial.as_array().iter().copied().collect(),
            parameters: self.parameters,
            by_start: match self.with_initial {
                WithInitial::All(all) => (!all).then(Vec::new),
                WithInitial::Of(places) => Some(places.into_iter().map(|place| vec![place]).collect()),
                WithInitial::Together(groups) => Some(groups),
            },
            outputs: self.outputs,
            options: Options { rtol: self.rtol, ..Options::default() },
            threads: self.threads,
        }
    }
}

/// Returns the result of a shot as arrays by name.
pub fn shot_to_dict<'py>(py: Python<'py>, asked: &Shooting, shot: Shot) -> PyResult<Bound<'py, PyDict>> {
    let Shot { values, sensitivities, ends, end_sensitivities, failures, directions } = shot;
    let (samples, outputs) = (asked.sample_times.len(), asked.outputs.len());
    let segments = asked.starts.len();
    let states = asked.initial.len() / segments;
    let array = |values: Vec<f64>| PyArray1::from_vec(py, values);
    let out = PyDict::new(py);
    out.set_item("values", array(values).reshape([samples, outputs])?)?;
    out.set_item("sensitivities", array(sensitivities).reshape([samples, outputs, directions])?)?;
    out.set_item("ends", array(ends).reshape([segments, states])?)?;
    out.set_item("end_sensitivities", array(end_sensitivities).reshape([segments, states, directions])?)?;
    out.set_item("failures", failures)?;
    Ok(out)
}
