//! The seam to Python: conversion and error mapping, nothing else.

use circuit::{
    ALONG, Balance, ByStart, Drive, Error, Kind, Motion, Record, Restart, Rig, Run, Servo, Shooting, Shot,
    Start, friction_law, own_law, specification, steady_sensitivity,
};
use numpy::{PyArray1, PyArray2, PyArrayMethods, PyReadonlyArray1, PyReadonlyArray2};
use ode::{Options, Statistics};
use physics::IdealGas;
use physics::flow::{Iso6358, LINEAR_ABOVE, choked_factor};
use physics::friction::{At, LAWS, Meta};
use pyo3::exceptions::{PyKeyboardInterrupt, PyRuntimeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList};

fn to_python(error: Error) -> PyErr {
    match error {
        Error::Specification(message) => PyValueError::new_err(message),
        Error::Stopped(message) => PyRuntimeError::new_err(message),
        Error::Interrupted { t } => PyKeyboardInterrupt::new_err(format!("interrupted at t = {t} s")),
    }
}

fn parse<'a, T: serde::Deserialize<'a>>(json: &'a str) -> PyResult<T> {
    serde_json::from_str(json)
        .map_err(|error| PyValueError::new_err(format!("the description does not fit the core: {error}")))
}

/// Runs `work` without the interpreter's lock; `work` is told when the user wants to stop.
fn detached<T: Send>(
    py: Python<'_>,
    work: impl Send + FnOnce(&mut dyn FnMut() -> bool) -> Result<T, Error>,
) -> PyResult<T> {
    py.detach(|| {
        let mut interrupted = || Python::attach(|py| py.check_signals().is_err());
        work(&mut interrupted)
    })
    .map_err(to_python)
}

fn statistics<'py>(py: Python<'py>, s: &Statistics) -> PyResult<Bound<'py, PyDict>> {
    let out = PyDict::new(py);
    out.set_item("steps", s.steps)?;
    out.set_item("rejected", s.rejected)?;
    out.set_item("right_hand_sides", s.right_hand_sides)?;
    out.set_item("jacobians", s.jacobians)?;
    out.set_item("factorisations", s.factorisations)?;
    out.set_item("events", s.events)?;
    Ok(out)
}

fn ledger<'py>(py: Python<'py>, balance: &Balance) -> PyResult<Bound<'py, PyDict>> {
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

fn run_to_dict<'py>(py: Python<'py>, names: &[String], run: Run) -> PyResult<Bound<'py, PyDict>> {
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

fn options(rtol: f64) -> Options {
    Options { rtol, ..Options::default() }
}

/// Samples in rows.
type Table<'py> = Bound<'py, PyArray2<f64>>;

/// A drive, assembled from its description in SI (JSON).
#[pyclass(name = "Drive", frozen)]
struct PyDrive {
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
    #[pyo3(signature = (times, commands, duration, sample_rate, initial, rtol, ledger=false))]
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
    ) -> PyResult<Bound<'py, PyDict>> {
        let initial = initial_state(initial)?;
        let with_ledger;
        let drive = if ledger {
            with_ledger = Drive::assemble(&self.spec, true).map_err(to_python)?;
            &with_ledger
        } else {
            &self.drive
        };
        let run = detached(py, |interrupted| {
            drive.simulate(&times, &commands, (duration, sample_rate), &initial, options(rtol), interrupted)
        })?;
        let out = run_to_dict(py, drive.columns(), run)?;
        out.set_item("warnings", drive.warnings())?;
        out.set_item("citations", drive.citations())?;
        Ok(out)
    }

    /// The same run, but only its states as they are integrated, shape (samples, states).
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
            let sampling = (duration, sample_rate);
            self.drive.states(&times, &commands, sampling, &initial, options(rtol), interrupted)
        })?;
        self.table(py, rows)
    }

    /// Pressure Pa and temperature K in chambers a and b (four columns) at states as `states` gives them.
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
        let rows = py.detach(|| self.drive.along(&record));
        let out = PyDict::new(py);
        for (i, name) in ALONG.iter().enumerate() {
            let column = rows.iter().skip(i).step_by(ALONG.len()).copied().collect();
            out.set_item(*name, PyArray1::from_vec(py, column))?;
        }
        Ok(out)
    }

    /// Simulates a command, put back at each of the restarts (rows of t, position, velocity, pressure a and b)
    /// to a measured state: columns by name, and what could not go on.
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
                options(rtol),
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
            self.drive.servo(&servo, (duration_s, sample_rate_hz), &initial, options(rtol), interrupted)
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

    /// Runs segments of a record, each from a start of its own, with exact derivatives of the outputs and
    /// of the ends by numbers of the description and, if asked, by the starts.
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
        let asked = Shooting {
            times,
            commands,
            sample_times,
            starts,
            initial: initial.as_array().iter().copied().collect(),
            parameters,
            with_initial: match with_initial {
                WithInitial::All(all) => all.into(),
                WithInitial::Of(places) => ByStart::Of(places),
            },
            outputs,
            options: options(rtol),
            threads,
        };
        let shot = detached(py, |interrupted| self.drive.shoot(&self.json, &asked, interrupted))?;
        let Shot { values, sensitivities, ends, end_sensitivities, failures, directions } = shot;
        let (samples, outputs) = (asked.sample_times.len(), asked.outputs.len());
        let (segments, states) = (asked.starts.len(), self.drive.start_names().len());
        let array = |values: Vec<f64>| PyArray1::from_vec(py, values);
        let out = PyDict::new(py);
        out.set_item("values", array(values).reshape([samples, outputs])?)?;
        out.set_item("sensitivities", array(sensitivities).reshape([samples, outputs, directions])?)?;
        out.set_item("ends", array(ends).reshape([segments, states])?)?;
        out.set_item("end_sensitivities", array(end_sensitivities).reshape([segments, states, directions])?)?;
        out.set_item("failures", failures)?;
        out.set_item("start_names", self.drive.start_names())?;
        Ok(out)
    }

    /// What the user should know about this description.
    #[getter]
    fn warnings(&self) -> Vec<String> {
        self.drive.warnings().to_vec()
    }

    /// Keys in references.bib of the laws and methods used.
    #[getter]
    fn citations(&self) -> Vec<&'static str> {
        self.drive.citations().to_vec()
    }
}

impl PyDrive {
    /// Rows of states as an array of shape (samples, states).
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

/// Whether to differentiate by the starts, or by which of their numbers.
#[derive(FromPyObject)]
enum WithInitial {
    All(bool),
    Of(Vec<usize>),
}

/// A friction rig, assembled from its description in SI (JSON).
#[pyclass(name = "Rig", frozen)]
struct PyRig {
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
    #[pyo3(signature = (durations, jerks, sample_times, initial, rtol, released=false, shut=false))]
    #[allow(clippy::too_many_arguments)] // The seam: named in Python, checked there.
    fn run<'py>(
        &self,
        py: Python<'py>,
        durations: Vec<f64>,
        jerks: Vec<f64>,
        sample_times: Vec<f64>,
        initial: From,
        rtol: f64,
        released: bool,
        shut: bool,
    ) -> PyResult<Bound<'py, PyDict>> {
        let motion = Motion { durations: &durations, jerks: &jerks, released, shut };
        let from = match &initial {
            From::Position(position) => Start::Rest(*position),
            From::State(state) => Start::State(state),
        };
        let (run, end) = detached(py, |interrupted| {
            self.rig.run(&motion, &sample_times, from, options(rtol), interrupted)
        })?;
        let out = run_to_dict(py, self.rig.columns(), run)?;
        out.set_item("final", end.state)?;
        out.set_item("commanded_position_m", end.commanded)?;
        Ok(out)
    }
}

/// Every friction law that a description can name.
#[pyfunction]
fn friction_laws(py: Python<'_>) -> PyResult<Bound<'_, PyList>> {
    let laws = PyList::empty(py);
    for meta in LAWS {
        laws.append(law_entry(py, meta)?)?;
    }
    Ok(laws)
}

fn law_entry<'py>(py: Python<'py>, meta: &Meta) -> PyResult<Bound<'py, PyDict>> {
    let law = PyDict::new(py);
    law.set_item("name", meta.key)?;
    law.set_item("title", meta.title)?;
    law.set_item("source", meta.source)?;
    law.set_item("states", meta.states.iter().map(|state| state.name).collect::<Vec<_>>())?;
    law.set_item("bristles", meta.bristles)?;
    law.set_item("elements", meta.elements)?;
    law.set_item("evolves", meta.evolves)?;
    let parameters = PyList::empty(py);
    for p in meta.parameters {
        let parameter = PyDict::new(py);
        parameter.set_item("key", p.key)?;
        parameter.set_item("unit", p.unit)?;
        parameter.set_item("lower", p.bounds.lower)?;
        parameter.set_item("upper", p.bounds.upper)?;
        parameter.set_item("open", p.bounds.open)?;
        parameter.set_item("open_above", p.bounds.open_above)?;
        parameter.set_item("default", p.default)?;
        parameter.set_item("meaning", p.meaning.trim())?;
        parameters.append(parameter)?;
    }
    law.set_item("parameters", parameters)?;
    Ok(law)
}

/// The entry, as of `friction_laws`, of a law of one's own (JSON), with `warnings`.
///
/// Raises ValueError(what, key, formula, line, column, text, caret, remedy); no line: not a place in a formula.
#[pyfunction]
fn formula_law<'py>(py: Python<'py>, json: &str) -> PyResult<Bound<'py, PyDict>> {
    let spec: specification::Formula = parse(json)?;
    let own = own_law(&spec).map_err(|refusal| {
        let problem = &refusal.problem;
        let (line, column, text, caret) = problem.shown(&refusal.formula).unwrap_or_default();
        let what = problem.what.clone();
        let remedy = problem.remedy.clone();
        PyValueError::new_err((what, refusal.key, refusal.formula, line, column, text, caret, remedy))
    })?;
    let law = law_entry(py, &own.meta)?;
    law.set_item("warnings", &own.warnings)?;
    law.set_item("levels", own.has_levels())?;
    Ok(law)
}

type Values = std::collections::BTreeMap<String, f64>;

/// Steady sliding friction of a law, N, at each velocity m/s, at given gauge pressures Pa and position m;
/// `dependences` are tables of the description's friction, as it has them.
#[pyfunction]
#[pyo3(signature = (law, parameters, velocity, gauge_a_pa=0.0, gauge_b_pa=0.0, pressure=None, dependences=None, position_m=0.0))]
#[allow(clippy::too_many_arguments)] // The seam: named in Python.
fn steady_friction<'py>(
    py: Python<'py>,
    law: &str,
    parameters: Values,
    velocity: PyReadonlyArray1<'py, f64>,
    gauge_a_pa: f64,
    gauge_b_pa: f64,
    pressure: Option<Values>,
    dependences: Option<&Bound<'py, PyAny>>,
    position_m: f64,
) -> PyResult<Bound<'py, PyArray1<f64>>> {
    let mut spec: specification::Friction = parse(&friction_json(py, law, dependences)?)?;
    spec.parameters = parameters;
    if let Some(pressure) = pressure {
        let coefficient = |key: &str| pressure.get(key).copied().unwrap_or(0.0);
        spec.pressure = Some(specification::SealPressure {
            coulomb_a: coefficient("coulomb_a"),
            coulomb_b: coefficient("coulomb_b"),
            breakaway_a: coefficient("breakaway_a"),
            breakaway_b: coefficient("breakaway_b"),
        });
    }
    let friction = friction_law(&spec).map_err(to_python)?;
    let force = |v: f64| {
        let place = At { v, x: position_m, ..At::at_rest() };
        friction.steady(&place.pressed(gauge_a_pa, gauge_b_pa))
    };
    Ok(PyArray1::from_iter(py, velocity.as_array().iter().map(|&v| force(v))))
}

/// The friction of a description as JSON, without its parameters: they may be infinite.
fn friction_json(py: Python<'_>, law: &str, dependences: Option<&Bound<'_, PyAny>>) -> PyResult<String> {
    let tables = PyDict::new(py);
    if let Some(dependences) = dependences {
        tables.call_method1("update", (dependences,))?;
    }
    tables.set_item("law", law)?;
    tables.set_item("parameters", PyDict::new(py))?;
    py.import("json")?.call_method1("dumps", (tables,))?.extract()
}

/// Steady sliding friction of a law, N, at each place, and its derivatives by numbers of the description,
/// shape (places, names).
#[pyfunction]
#[pyo3(signature = (law, parameters, names, velocity, gauge_a_pa, gauge_b_pa, position_m, dependences=None))]
#[allow(clippy::too_many_arguments)] // The seam: named in Python.
fn steady_friction_sensitivity<'py>(
    py: Python<'py>,
    law: &str,
    parameters: Values,
    names: Vec<String>,
    velocity: PyReadonlyArray1<'py, f64>,
    gauge_a_pa: PyReadonlyArray1<'py, f64>,
    gauge_b_pa: PyReadonlyArray1<'py, f64>,
    position_m: PyReadonlyArray1<'py, f64>,
    dependences: Option<&Bound<'py, PyAny>>,
) -> PyResult<(Bound<'py, PyArray1<f64>>, Table<'py>)> {
    let n = velocity.as_array().len();
    for (name, array) in
        [("gauge_a_pa", &gauge_a_pa), ("gauge_b_pa", &gauge_b_pa), ("position_m", &position_m)]
    {
        let found = array.as_array().len();
        if found != n {
            return Err(PyValueError::new_err(format!("{name} has {found} values, velocity has {n}")));
        }
    }
    let json = friction_json(py, law, dependences)?;
    let conditions = gauge_a_pa.as_array().into_owned().into_iter().zip(gauge_b_pa.as_array().into_owned());
    let places = velocity.as_array().into_owned().into_iter().zip(position_m.as_array().into_owned());
    let places: Vec<At<f64>> = places
        .zip(conditions)
        .map(|((v, x), (gauge_a, gauge_b))| At { v, x, ..At::at_rest() }.pressed(gauge_a, gauge_b))
        .collect();
    let (forces, derivatives) = detached(py, |_| steady_sensitivity(&json, &parameters, &names, &places))?;
    let table = PyArray1::from_vec(py, derivatives).reshape([n, names.len()])?;
    Ok((PyArray1::from_vec(py, forces), table))
}

/// Flow through a component over its choked flow, at the ratio of downstream to upstream pressure.
#[pyfunction]
fn flow_ratio(pressure_ratio: f64, critical_pressure_ratio: f64, subsonic_index: f64) -> f64 {
    let (b, m) = (critical_pressure_ratio, subsonic_index);
    Iso6358::for_gas(1.0, b, m, LINEAR_ABOVE, m == 0.5, &IdealGas::air(), true).phi(pressure_ratio)
}

/// psi(k) in m_dot = A p psi / sqrt(R T): choked flow of an ideal gas through a nozzle.
#[pyfunction]
fn choked_flow_factor(heat_capacity_ratio: f64) -> f64 {
    choked_factor(heat_capacity_ratio)
}

#[pymodule]
fn _core(m: &Bound<'_, PyModule>) -> PyResult<()> {
    m.add_class::<PyDrive>()?;
    m.add_class::<PyRig>()?;
    m.add_function(wrap_pyfunction!(friction_laws, m)?)?;
    m.add_function(wrap_pyfunction!(formula_law, m)?)?;
    m.add_function(wrap_pyfunction!(steady_friction, m)?)?;
    m.add_function(wrap_pyfunction!(steady_friction_sensitivity, m)?)?;
    m.add_function(wrap_pyfunction!(flow_ratio, m)?)?;
    m.add_function(wrap_pyfunction!(choked_flow_factor, m)?)?;
    Ok(())
}
