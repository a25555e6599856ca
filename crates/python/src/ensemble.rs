//! `Ensemble`: many members of one circuit, run side by side and reduced while they run.

use crate::convert::{Teller, to_python, watched};
use crate::network::{ShortNames, called};
use ensemble::{Column, Ensemble, EnsembleRequest, Kernel, Outcome, Plan, Reduction, Statistic};
use numpy::{
    PyArray1, PyArrayMethods, PyReadonlyArray1, PyReadonlyArray2, PyReadonlyArrayDyn, PyUntypedArrayMethods,
};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::sync::Arc;

/// Members of one circuit that differ in the numbers called `vary`.
///
/// `json` is its description in SI, `names` as of a `Circuit`. Numbers are those of components ("left.bore",
/// "left.friction.parameters.coulomb"), "ambient.pressure_pa" and "ambient.temperature_k". An unknown name, a repeated
/// name, or a name of a number that cannot vary raises a ValueError. The circuit is assembled here, once. Members only
/// set their numbers.
#[pyclass(name = "Ensemble", frozen)]
pub struct PyEnsemble {
    ensemble: Ensemble,
}

/// The dict `_core.Output` from Python: a reduction of each member.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
struct Output {
    column: String,
    what: String,
    #[pyo3(default)]
    value: Option<f64>,
    #[pyo3(default)]
    above: bool,
}

/// The dict `_core.Request` from Python.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
struct Request<'py> {
    values: PyReadonlyArray2<'py, f64>,
    plans: Vec<(String, Vec<f64>, PyReadonlyArrayDyn<'py, f64>)>,
    duration: PyReadonlyArray1<'py, f64>,
    initial: PyReadonlyArray2<'py, f64>,
    outputs: Vec<Output>,
    rtol: f64,
    #[pyo3(default = 0.0)]
    contact_age_s: f64,
    #[pyo3(default = 1)]
    threads: usize,
    #[pyo3(default)]
    budget: Option<u64>,
    #[pyo3(default)]
    kernel: Option<String>,
}

fn refuse<T>(message: String) -> PyResult<T> {
    Err(PyValueError::new_err(message))
}

/// Returns the kernel by its name in Python.
fn kernel(name: &str) -> PyResult<Kernel> {
    match name {
        "scalar" => Ok(Kernel::Scalar),
        "four" => Ok(Kernel::Base),
        "eight" => Ok(Kernel::Eight),
        other => refuse(format!("there is no kernel \"{other}\"; there are scalar, four, eight")),
    }
}

/// Returns a plan in the form of the core; its values are one row for all members, or one for each.
fn plan<'a>(
    (input, times, values): &(String, Vec<f64>, PyReadonlyArrayDyn<'_, f64>),
    members: usize,
) -> PyResult<Plan<'a>> {
    let row = values.shape().last().copied().unwrap_or(0);
    let is_table = values.ndim() == 2;
    if row != times.len() || values.ndim() > 2 || (is_table && ![1, members].contains(&values.shape()[0])) {
        let of = format!("({},) or ({members}, {})", times.len(), times.len());
        return refuse(format!("the values of {input} have shape {:?}: it must be {of}", values.shape()));
    }
    let values = Column::new(values.as_array().iter().copied().collect::<Vec<_>>(), row);
    Ok(Plan { input: input.clone(), times: times.clone(), values })
}

impl PyEnsemble {
    fn output(&self, asked: &Output) -> PyResult<Reduction> {
        let column = self.ensemble.members.template.variables.column(&asked.column).map_err(to_python)?;
        let value = || match asked.value {
            Some(value) if value.is_finite() => Ok(value),
            _ => refuse(format!("{} of {} needs a finite value", asked.what, asked.column)),
        };
        let what = match &*asked.what {
            "final" => Statistic::Final,
            "max" => Statistic::Max,
            "min" => Statistic::Min,
            "mean" => Statistic::Mean,
            "integral" => Statistic::Integral,
            "time_when" => Statistic::When { value: value()?, above: asked.above },
            "rate_when" => Statistic::Rate { value: value()?, above: asked.above },
            "samples" => Statistic::Samples { rate: value()? },
            other => {
                return refuse(format!(
                    "there is no reduction \"{other}\"; there are final, max, min, mean, integral, time_when, rate_when, samples"
                ));
            }
        };
        Ok(Reduction { column, what })
    }
}

#[pymethods]
impl PyEnsemble {
    #[new]
    #[pyo3(signature = (json, vary, names=None))]
    fn new(json: &str, vary: Vec<String>, names: Option<ShortNames>) -> PyResult<Self> {
        let ensemble = Ensemble::called(json, &vary, Arc::new(called(names)));
        Ok(PyEnsemble { ensemble: ensemble.map_err(to_python)? })
    }

    /// Returns the names of the numbers in which members differ: the columns of `values`.
    #[getter]
    fn names(&self) -> Vec<String> {
        self.ensemble.members.names.to_vec()
    }

    /// Returns the names of the inputs that a plan may set.
    #[getter]
    fn inputs(&self) -> Vec<String> {
        self.ensemble.members.template.variables.inputs.iter().map(|input| input.name.clone()).collect()
    }

    /// Returns the names of the columns that outputs can use.
    #[getter]
    fn columns(&self) -> Vec<String> {
        self.ensemble.members.template.columns().to_vec()
    }

    /// Returns the names of the start values: the columns of `initial`.
    #[getter]
    fn start_names(&self) -> Vec<&str> {
        self.ensemble.members.template.given_names()
    }

    /// Runs all members. The stub describes the fields of `asked` and the result.
    ///
    /// Shapes: n members, k names. `values` (n, k). Each of `plans` is (input, times (m,), values (m,) or (n,
    /// m)). The times are in s, increasing, and start at 0. `duration` (1,) or (n,), s. `initial` (1, s) or
    /// (n, s). `look` receives the number of finished members about fifty times a second. An exception in it
    /// or a signal ends the run. `kernel` selects how members run, with equal bits: "scalar" one after the
    /// other, "four" or "eight" (AVX-512) side by side. The default is the fastest.
    ///
    /// The k-th of the returned "outputs" is an array (n,), or (n, samples) for samples, in the column's
    /// unit. An integral has the unit times s. The times above and below a value are in s: 0 if true at the
    /// start, NaN if never true. The array "status" (n,) uint8 is 0 for done, 1 for a failed run, 2 for inconsistent
    /// numbers. Members with status 1 or 2 have outputs NaN, and "reasons" has the cause by member. The numbers of a
    /// member depend only on the row of that member, not on neighbours, threads or order. A value outside its bounds
    /// raises a ValueError that names member and number, before any member runs.
    #[pyo3(signature = (asked, look=None))]
    fn run<'py>(
        &self,
        py: Python<'py>,
        asked: Request<'py>,
        look: Teller<'py>,
    ) -> PyResult<Bound<'py, PyDict>> {
        let outputs = asked.outputs.iter().map(|output| self.output(output)).collect::<PyResult<Vec<_>>>()?;
        let (members, k) = (asked.values.shape()[0], self.ensemble.members.names.len());
        if asked.values.shape()[1] != k {
            let names = self.ensemble.members.names.join(", ");
            return refuse(format!(
                "values has {} columns: it must have {k}, one for each of {names}",
                asked.values.shape()[1]
            ));
        }
        let all = |array: &PyReadonlyArray2<'py, f64>| array.as_array().iter().copied().collect::<Vec<_>>();
        // A large design is not copied.
        let copied;
        let values = match asked.values.as_slice() {
            Ok(values) => values,
            Err(_) => {
                copied = all(&asked.values);
                &copied
            }
        };
        let request = EnsembleRequest {
            members,
            values,
            plans: asked.plans.iter().map(|own| plan(own, members)).collect::<PyResult<_>>()?,
            duration: Column::new(asked.duration.as_array().to_vec(), 1),
            initial: Column::new(all(&asked.initial), asked.initial.shape()[1]),
            contact_age: asked.contact_age_s,
            outputs,
            rtol: asked.rtol,
            budget: asked.budget,
            threads: asked.threads,
            kernel: asked.kernel.as_deref().map(kernel).transpose()?,
        };
        let outcome = watched(py, look, |interrupted| self.ensemble.run(&request, interrupted))?;
        outcome_to_dict(py, outcome, &request)
    }
}

/// Returns the results of a request as arrays by name.
fn outcome_to_dict<'py>(
    py: Python<'py>,
    outcome: Outcome,
    asked: &EnsembleRequest,
) -> PyResult<Bound<'py, PyDict>> {
    let out = PyDict::new(py);
    let columns = outcome.columns.into_iter().zip(&asked.outputs).map(|(column, output)| {
        let width = column.len() / asked.members.max(1);
        let column = PyArray1::from_vec(py, column);
        match output.what {
            Statistic::Samples { .. } => Ok(column.reshape([asked.members, width])?.into_any()),
            _ => Ok(column.into_any()),
        }
    });
    out.set_item("outputs", columns.collect::<PyResult<Vec<_>>>()?)?;
    out.set_item("status", PyArray1::from_vec(py, outcome.status))?;
    let reasons = PyDict::new(py);
    for (member, reason) in outcome.reasons {
        reasons.set_item(member, reason)?;
    }
    out.set_item("reasons", reasons)?;
    out.set_item("attempts", outcome.attempts)?;
    Ok(out)
}
