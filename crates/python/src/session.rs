//! `Session`: a running drive.

use crate::convert::{Numbers, Table, Teller, run_to_dict, to_python, watched};
use circuit::{Look, Mechanics, Prescribed, Sampling, Session, close};
use numpy::{PyArray1, PyArrayMethods};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyDict, PyTuple};
use pythonize::pythonize;

/// A running drive, made by `Drive.start`.
#[pyclass(name = "Session")]
pub struct PySession {
    session: Session,
    /// Its axis at a prescribed velocity, from the first trial on.
    axis: Option<Box<Prescribed>>,
}

impl PySession {
    pub fn new(session: Session) -> Self {
        PySession { session, axis: None }
    }

    fn input(&self, name: &str) -> PyResult<usize> {
        self.session.assembly.variables.input(name).map_err(to_python)
    }

    fn prescribed(&mut self) -> PyResult<(&Session, &mut Prescribed)> {
        if self.axis.is_none() {
            self.axis = Prescribed::of(&self.session).map(Box::new);
        }
        let none = || PyValueError::new_err("no axis of this session has a prescribed velocity");
        Ok((&self.session, self.axis.as_deref_mut().ok_or_else(none)?))
    }

    /// Returns the session, to change it. The next trial takes the change over.
    fn changed(&mut self) -> &mut Session {
        if let Some(axis) = &mut self.axis {
            axis.renew();
        }
        &mut self.session
    }

    fn columns_of(&self, names: &[String]) -> PyResult<Vec<usize>> {
        let places = names.iter().map(|name| self.session.assembly.variables.column(name));
        places.collect::<Result<_, _>>().map_err(to_python)
    }
}

#[pymethods]
impl PySession {
    /// Returns the present time, s.
    #[getter]
    fn time(&self) -> f64 {
        self.session.time()
    }

    /// Returns the reason why the session cannot continue, if any.
    #[getter]
    fn failed(&self) -> Option<&str> {
        self.session.failed()
    }

    #[getter]
    fn statistics<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        Ok(pythonize(py, &self.session.statistics())?)
    }

    /// Returns name, unit, bounds as text and meaning of each input.
    #[getter]
    fn inputs(&self) -> Vec<(&str, &'static str, String, &'static str)> {
        let inputs = self.session.inputs().iter();
        inputs.map(|own| (&*own.name, own.unit, own.bounds.to_string(), own.meaning)).collect()
    }

    /// Returns the names of the outputs.
    #[getter]
    fn columns(&self) -> Vec<String> {
        self.session.assembly.columns().to_vec()
    }

    /// Returns name and unit of each state.
    #[getter]
    fn states(&self) -> Vec<(String, &'static str)> {
        self.session.circuit().state_names().to_vec()
    }

    /// Sets an input from now on.
    fn set(&mut self, name: &str, value: f64) -> PyResult<()> {
        let input = self.input(name)?;
        self.changed().set(input, value).map_err(to_python)
    }

    /// Sets an input at future times.
    fn schedule(&mut self, name: &str, times: Vec<f64>, values: Vec<f64>) -> PyResult<()> {
        let input = self.input(name)?;
        self.changed().schedule(input, &times, &values).map_err(to_python)
    }

    /// Continues until a time, s.
    #[pyo3(signature = (until, look=None))]
    fn advance(&mut self, py: Python<'_>, until: f64, look: Teller<'_>) -> PyResult<()> {
        let session = self.changed();
        watched(py, look, |interrupted| session.go_on(until, &mut Look::new(interrupted)))
    }

    /// Does the same, and returns some columns at times on the way.
    #[pyo3(signature = (until, times, columns, look=None))]
    fn record<'py>(
        &mut self,
        py: Python<'py>,
        until: f64,
        times: Numbers<'py>,
        columns: Vec<String>,
        look: Teller<'py>,
    ) -> PyResult<Bound<'py, PyDict>> {
        let places = self.columns_of(&columns)?;
        let (session, times) = (self.changed(), times.into());
        let run = watched(py, look, |interrupted| {
            session.record(until, times, &places, &mut Look::new(interrupted))
        })?;
        run_to_dict(py, &columns, run)
    }

    /// Runs a controller for a number of periods, s. The controller is a callable of the time and the columns that
    /// returns the input. `address` is that of the same function in machine code, or 0. Returns a row of the columns and
    /// the input for each sample, and the exception of the controller that ended the run.
    #[pyo3(signature = (controller, address, period, periods, columns, command, look=None))]
    #[allow(clippy::too_many_arguments)] // The seam: named in Python, checked there.
    fn control<'py>(
        &mut self,
        py: Python<'py>,
        controller: Py<PyAny>,
        address: usize,
        period: f64,
        periods: usize,
        columns: Vec<String>,
        command: &str,
        look: Teller<'py>,
    ) -> PyResult<(Table<'py>, Option<Py<PyAny>>)> {
        let columns = self.columns_of(&columns)?;
        let width = columns.len() + 1;
        let sampling = Sampling { columns, input: self.input(command)?, period, periods };
        let session = self.changed();
        let mut command: Command = if address != 0 {
            let compiled = compiled(address);
            Box::new(move |time, seen| Ok(compiled(time, seen.as_ptr())))
        } else {
            Box::new(move |time, seen| {
                Python::attach(|py| {
                    let read = PyTuple::new(py, std::iter::once(&time).chain(seen).collect::<Vec<_>>())?;
                    controller.bind(py).call1(read)?.extract()
                })
            })
        };
        let mut raised: Option<PyErr> = None;
        let rows = watched(py, look, |interrupted| {
            let mut asked =
                |time: f64, seen: &[f64]| command(time, seen).map_err(|own| raised = Some(own)).ok();
            session.control(&sampling, &mut asked, &mut Look::new(interrupted))
        });
        let rows = rows?;
        let samples = rows.len() / width;
        let rows = PyArray1::from_vec(py, rows).reshape([samples, width])?;
        Ok((rows, raised.map(|own| own.into_value(py).into_any())))
    }

    /// Returns the present values of the states.
    #[getter]
    fn state(&self) -> Vec<f64> {
        self.session.state()[..self.session.circuit().state_names().len()].to_vec()
    }

    /// Returns a column, or an input, at the present state.
    fn read(&mut self, name: &str) -> PyResult<f64> {
        match self.session.assembly.variables.column(name) {
            Ok(column) => Ok(self.session.read(column)),
            Err(_) => Ok(self.session.input(self.input(name)?)),
        }
    }

    fn save<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyBytes>> {
        Ok(PyBytes::new(py, &self.session.save().map_err(to_python)?))
    }

    fn restore(&mut self, saved: &[u8]) -> PyResult<()> {
        self.changed().restore(saved).map_err(to_python)
    }

    /// Tries a step to a time, s, at a constant velocity of the prescribed axis, m/s. Returns the mean force, N.
    fn try_velocity(&mut self, velocity: f64, until: f64) -> PyResult<f64> {
        let (session, axis) = self.prescribed()?;
        axis.step(session, velocity, until).map_err(to_python)
    }

    /// Returns the mean force of such a step, N, and its derivative by the velocity, N s/m.
    fn velocity_slope(&mut self, velocity: f64, until: f64) -> PyResult<[f64; 2]> {
        let (session, axis) = self.prescribed()?;
        session.drive_slope(axis, velocity, until).map_err(to_python)
    }

    /// Continues from the end of the last trial.
    fn accept(&mut self) {
        if let Some(axis) = &mut self.axis {
            axis.accept(&mut self.session);
        }
    }

    /// Returns A, B, C and D by name, with the state, its rates and the outputs at the point of
    /// linearisation.
    fn linearise<'py>(&self, py: Python<'py>, inputs: Vec<String>) -> PyResult<Bound<'py, PyDict>> {
        let places = inputs.iter().map(|name| self.input(name)).collect::<PyResult<Vec<_>>>()?;
        let linear = self.session.linearise(&places).map_err(to_python)?;
        let (states, inputs, outputs) = (linear.state.len(), places.len(), linear.outputs.len());
        let out = PyDict::new(py);
        let array = |values: Vec<f64>| PyArray1::from_vec(py, values);
        out.set_item("a", array(linear.a).reshape([states, states])?)?;
        out.set_item("b", array(linear.b).reshape([states, inputs])?)?;
        out.set_item("c", array(linear.c).reshape([outputs, states])?)?;
        out.set_item("d", array(linear.d).reshape([outputs, inputs])?)?;
        out.set_item("columns", linear.columns)?;
        out.set_item("state", array(linear.state))?;
        out.set_item("rates", array(linear.rates))?;
        out.set_item("outputs", array(linear.outputs))?;
        Ok(out)
    }
}

/// A controller: time, s, and the columns that it reads.
type Command = Box<dyn Send + FnMut(f64, &[f64]) -> PyResult<f64>>;
/// A controller in machine code: time, s, and the columns that it reads.
type Compiled = extern "C" fn(f64, *const f64) -> f64;

/// Returns the function at an address. The caller states that there is one, as with every address that it passes.
#[allow(unsafe_code)]
fn compiled(address: usize) -> Compiled {
    unsafe { std::mem::transmute::<usize, Compiled>(address) }
}

/// Velocities, m/s, mean forces, N, their derivatives, N s/m, and the number of trials of a step.
type Closed = (Vec<f64>, Vec<f64>, Vec<f64>, usize);

/// Finds the step to a time, s, of a mechanism under sessions with a prescribed axis, from velocities and derivatives of
/// the forces. `mechanics`: positions at the beginning, positions at the end under some forces, these forces, and the
/// accelerations by the forces, row by row. `known` are the forces of the last trial, if it was made at these velocities.
/// The sessions can accept the step.
#[pyfunction]
#[pyo3(signature = (sessions, until, mechanics, velocities, slopes, known=Vec::new()))]
pub fn close_step(
    mut sessions: Vec<PyRefMut<'_, PySession>>,
    until: f64,
    mechanics: [Vec<f64>; 4],
    mut velocities: Vec<f64>,
    mut slopes: Vec<f64>,
    known: Vec<f64>,
) -> PyResult<Closed> {
    let n = sessions.len();
    let [begin, end, forces, mobility] = &mechanics;
    let lengths = [begin.len(), end.len(), forces.len(), velocities.len(), slopes.len()];
    if lengths.iter().any(|length| *length != n) || mobility.len() != n * n || ![0, n].contains(&known.len())
    {
        return Err(PyValueError::new_err("there is one number for each session"));
    }
    let mut axes = sessions.iter_mut().map(|own| own.prescribed()).collect::<PyResult<Vec<_>>>()?;
    let mechanics = Mechanics { begin, end, forces, mobility };
    let closed = close(&mut axes, until, &mechanics, &mut velocities, &mut slopes, known);
    let (forces, trials) = closed.map_err(to_python)?;
    Ok((velocities, forces, slopes, trials))
}
