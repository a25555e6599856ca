//! `Drive`: simulation, balances along a record, shooting.

use crate::convert::{Table, Teller, detached, options, parse, run_to_dict, statistics, to_python, watched};
use crate::session::PySession;
use crate::shooting::{Asked, shot_to_dict};
use circuit::{ALONG, Drive, Record, Restart, Servo, Shooting, specification};
use numpy::{PyArray1, PyArrayMethods, PyReadonlyArray1, PyReadonlyArray2};
use ode::Options;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyDict;

/// A drive, assembled from its description in SI (JSON).
#[pyclass(name = "Drive", frozen)]
pub struct PyDrive {
    json: String,
    spec: specification::Drive,
    drive: Drive,
}

#[pymethods]
impl PyDrive {
    #[new]
    fn new(json: String) -> PyResult<Self> {
        let spec: specification::Drive = parse(&json)?;
        let drive = Drive::assemble(&spec, false).map_err(to_python)?;
        Ok(PyDrive { json, spec, drive })
    }

    /// Simulates a piecewise constant command.
    #[pyo3(signature = (times, commands, duration, sample_rate, initial, rtol, ledger=false, budget=None, look=None, arrays=true))]
    #[allow(clippy::too_many_arguments)] // The seam: named in Python, checked there.
    fn simulate<'py>(
        &self,
        py: Python<'py>,
        times: Vec<f64>,
        commands: Vec<f64>,
        duration: f64,
        sample_rate: f64,
        initial: &Bound<'py, PyDict>,
        rtol: f64,
        ledger: bool,
        budget: Option<u64>,
        look: Teller<'py>,
        arrays: bool,
    ) -> PyResult<Bound<'py, PyDict>> {
        let initial = initial_state(initial)?;
        let with_ledger;
        let drive = if ledger {
            with_ledger = Drive::assemble(&self.spec, true).map_err(to_python)?;
            &with_ledger
        } else {
            &self.drive
        };
        let options = options(rtol, duration, commands.len(), drive.n_states(), budget);
        let run = watched(py, look, |interrupted| {
            drive.simulate(&times, &commands, (duration, sample_rate), &initial, options, interrupted)
        })?;
        let warnings: Vec<String> =
            drive.warnings().iter().cloned().chain(drive.impact_warnings(&run.impacts)).collect();
        let out = run_to_dict(py, drive.columns(), run, arrays)?;
        out.set_item("warnings", warnings)?;
        out.set_item("citations", drive.citations())?;
        Ok(out)
    }

    /// Returns a session of the drive at a start state, with a closed valve.
    fn start(&self, initial: &Bound<'_, PyDict>, rtol: f64) -> PyResult<PySession> {
        let options = Options { rtol, ..Options::default() };
        let session = self.drive.session(&initial_state(initial)?, options);
        Ok(PySession::new(session.of_description(&self.json)))
    }

    /// Runs the same simulation and returns only the integrated states, shape (samples, states).
    #[allow(clippy::too_many_arguments)]
    fn states<'py>(
        &self,
        py: Python<'py>,
        times: Vec<f64>,
        commands: Vec<f64>,
        duration: f64,
        sample_rate: f64,
        initial: &Bound<'py, PyDict>,
        rtol: f64,
    ) -> PyResult<Table<'py>> {
        let initial = initial_state(initial)?;
        let rows = detached(py, |interrupted| {
            let (sampling, options) = (
                (duration, sample_rate),
                options(rtol, duration, commands.len(), self.drive.n_states(), None),
            );
            self.drive.states(&times, &commands, sampling, &initial, options, interrupted)
        })?;
        self.table(py, rows)
    }

    /// Returns pressure, Pa, and temperature, K, in chambers a and b (four columns) for states as `states`
    /// returns them.
    fn chambers<'py>(&self, py: Python<'py>, states: PyReadonlyArray2<'py, f64>) -> PyResult<Table<'py>> {
        let states = states.as_array();
        let n = self.drive.n_states();
        if states.ncols() != n {
            let message = format!("states have {} columns; this drive has {n} states", states.ncols());
            return Err(PyValueError::new_err(message));
        }
        let gas = self.drive.chambers(states.rows().into_iter().map(|row| row.to_vec()));
        PyArray1::from_vec(py, gas).reshape([states.nrows(), 4])
    }

    /// Forces, steady friction and pressure rates along a measured record: columns by name. `openings` has
    /// a row for each sample: supply to a, a to exhaust, supply to b, b to exhaust.
    #[allow(clippy::too_many_arguments)]
    fn along<'py>(
        &self,
        py: Python<'py>,
        times: PyReadonlyArray1<'py, f64>,
        position: PyReadonlyArray1<'py, f64>,
        velocity: PyReadonlyArray1<'py, f64>,
        pressure_a: PyReadonlyArray1<'py, f64>,
        pressure_b: PyReadonlyArray1<'py, f64>,
        openings: PyReadonlyArray2<'py, f64>,
        temperatures: [f64; 2],
    ) -> PyResult<Bound<'py, PyDict>> {
        let shares: Vec<[f64; 4]> =
            openings.as_array().rows().into_iter().map(|row| std::array::from_fn(|i| row[i])).collect();
        let record = Record {
            times: times.as_slice()?,
            position: position.as_slice()?,
            velocity: velocity.as_slice()?,
            pressure: [pressure_a.as_slice()?, pressure_b.as_slice()?],
            openings: &shares,
            temperature: temperatures,
        };
        let n = record.times.len();
        if [record.position, record.velocity, record.pressure[0], record.pressure[1]]
            .iter()
            .any(|column| column.len() != n)
            || shares.len() != n
            || openings.as_array().ncols() != 4
        {
            return Err(PyValueError::new_err(
                "the columns of a record have one length, openings four columns",
            ));
        }
        let rows = py.detach(|| self.drive.along(&record)).map_err(to_python)?;
        let out = PyDict::new(py);
        for (i, name) in ALONG.iter().enumerate() {
            let column = rows.iter().skip(i).step_by(ALONG.len()).copied().collect();
            out.set_item(*name, PyArray1::from_vec(py, column))?;
        }
        Ok(out)
    }

    /// Simulates a command, and resets the state to a measured one at each restart (rows of t, position,
    /// velocity, pressure a and b). Returns columns by name, and the runs that failed.
    #[allow(clippy::too_many_arguments)]
    fn restarted<'py>(
        &self,
        py: Python<'py>,
        times: Vec<f64>,
        commands: Vec<f64>,
        duration: f64,
        sample_rate: f64,
        restarts: PyReadonlyArray2<'py, f64>,
        temperatures: [f64; 2],
        rtol: f64,
    ) -> PyResult<(Bound<'py, PyDict>, Vec<String>)> {
        if restarts.as_array().ncols() != 5 || restarts.as_array().nrows() == 0 {
            return Err(PyValueError::new_err("restarts have five columns and at least one row"));
        }
        let restarts: Vec<Restart> = restarts
            .as_array()
            .rows()
            .into_iter()
            .map(|r| Restart { t: r[0], position: r[1], velocity: r[2], pressure: [r[3], r[4]] })
            .collect();
        let (columns, failures) = detached(py, |interrupted| {
            let plan = (&times[..], &commands[..]);
            self.drive.restarted(
                plan,
                (duration, sample_rate),
                &restarts,
                temperatures,
                options(rtol, duration, commands.len(), self.drive.n_states(), None),
                interrupted,
            )
        })?;
        let out = PyDict::new(py);
        for (name, column) in self.drive.columns().iter().zip(columns) {
            out.set_item(name, PyArray1::from_vec(py, column))?;
        }
        Ok((out, failures))
    }

    /// A sampled servo loop tracking a sine around mid stroke.
    #[allow(clippy::too_many_arguments)]
    fn servo<'py>(
        &self,
        py: Python<'py>,
        kp: f64,
        kd: f64,
        amplitude_m: f64,
        frequency_hz: f64,
        duration_s: f64,
        sample_rate_hz: f64,
        initial: &Bound<'py, PyDict>,
        rtol: f64,
    ) -> PyResult<Bound<'py, PyDict>> {
        let initial = initial_state(initial)?;
        let middle = 0.5 * self.spec.cylinder.stroke_m;
        let servo = Servo { kp, kd, middle, amplitude: amplitude_m, frequency: frequency_hz };
        let (rows, commands, work) = detached(py, |interrupted| {
            let samples = (duration_s * sample_rate_hz) as usize;
            let options = options(rtol, duration_s, samples, self.drive.n_states(), None);
            self.drive.servo(&servo, (duration_s, sample_rate_hz), &initial, options, interrupted)
        })?;
        let out = PyDict::new(py);
        out.set_item("states", self.table(py, rows)?)?;
        out.set_item("commands", PyArray1::from_vec(py, commands))?;
        out.set_item("statistics", statistics(py, &work)?)?;
        Ok(out)
    }

    /// Names of the numbers from which a segment of `shoot` starts.
    #[getter]
    fn start_names(&self) -> Vec<String> {
        self.drive.start_names()
    }

    /// Runs segments of a record, each from its own start. The outputs and end states have exact derivatives
    /// by numbers of the description and, optionally, by the starts.
    #[pyo3(signature = (asked, look=None))]
    fn shoot<'py>(
        &self,
        py: Python<'py>,
        asked: Asked<'py>,
        look: Teller<'py>,
    ) -> PyResult<Bound<'py, PyDict>> {
        let asked = Shooting::from(asked);
        let shot = watched(py, look, |interrupted| self.drive.shoot(&self.json, &asked, interrupted))?;
        shot_to_dict(py, &asked, shot, self.drive.start_names())
    }

    /// Stiffness, N/m, damping, N s/m, and damping depth, m, of the end stops, as described or derived from
    /// the drive.
    #[getter]
    fn end_stop(&self) -> (f64, f64, f64) {
        let (stop, _) = self.drive.end_stop();
        (stop.stiffness, stop.damping, stop.damping_depth)
    }

    /// Design load of derived end stops: mass, kg, speed, m/s, and force, N, within a depth, m.
    #[getter]
    fn end_stop_takes(&self) -> (f64, f64, f64, f64) {
        let (_, taken) = self.drive.end_stop();
        (taken.mass, taken.speed, taken.force, taken.depth)
    }

    /// Returns warnings about this description.
    #[getter]
    fn warnings(&self) -> Vec<String> {
        self.drive.warnings().to_vec()
    }

    /// Returns the keys in references.bib of the laws and methods in use.
    #[getter]
    fn citations(&self) -> Vec<&'static str> {
        self.drive.citations().to_vec()
    }
}

impl PyDrive {
    /// Returns rows of states as an array of shape (samples, states).
    fn table<'py>(&self, py: Python<'py>, rows: Vec<f64>) -> PyResult<Table<'py>> {
        let n = self.drive.n_states();
        let samples = rows.len() / n;
        PyArray1::from_vec(py, rows).reshape([samples, n])
    }
}

fn initial_state(initial: &Bound<'_, PyDict>) -> PyResult<specification::Initial> {
    let value = |key: &str| -> PyResult<f64> {
        match initial.get_item(key)? {
            Some(value) => value.extract(),
            None => Err(PyValueError::new_err(format!("initial.{key} is missing"))),
        }
    };
    Ok(specification::Initial {
        position_m: value("position_m")?,
        velocity_m_s: initial.get_item("velocity_m_s")?.map_or(Ok(0.0), |v| v.extract())?,
        pressure_a_pa: value("pressure_a_pa")?,
        pressure_b_pa: value("pressure_b_pa")?,
        temperature_a_k: value("temperature_a_k")?,
        temperature_b_k: value("temperature_b_k")?,
        contact_age_s: initial.get_item("contact_age_s")?.map_or(Ok(0.0), |age| age.extract())?,
    })
}
