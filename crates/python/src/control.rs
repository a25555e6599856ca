//! Circuits under controllers.

use crate::convert::{Table, Teller, parse, to_python, watched};
use crate::network::PyCircuit;
use circuit::{Error, Look};
use control::export::{Language, RESULTS, STATUS, program};
use control::{AnyLaw, EventKind, GAINS, Gain, GainValues, LAWS, Own, OwnLaw, Reference, SIGNALS, Seen};
use numpy::{PyArray1, PyArrayMethods, PyReadonlyArray1};
use ode::Options;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::{IntoPyDict, PyDict, PyTuple};
use servo::specification::{Controller, ReferenceForm, Setup};
use servo::{COLUMNS, Led, Sensors, Servo, controller, run_together};
use std::collections::BTreeMap;

/// Keys of the controllers.
#[pyfunction]
pub fn control_laws() -> Vec<&'static str> {
    LAWS.to_vec()
}

/// Thresholds of controllers, observer and supervisor: name, value, unit, meaning and reason.
#[pyfunction]
pub fn control_thresholds() -> Vec<control::thresholds::Threshold> {
    control::thresholds::thresholds()
}

/// Factors on gains: controller, factor, gain.
#[pyfunction]
pub fn control_factors() -> Vec<(&'static str, &'static str, &'static str)> {
    let each = GAINS.iter().flat_map(|(law, gains)| gains.iter().map(move |own| (*law, own)));
    each.flat_map(|(law, own)| own.factors.iter().map(move |factor| (law, *factor, own.key))).collect()
}

/// Key, unit, value and meaning of a gain, and the rule by which it follows from the drive.
type Ruled = (&'static str, &'static str, f64, &'static str, &'static str);

fn ruled(gains: GainValues<'_>) -> Vec<Ruled> {
    let row =
        |(gain, value): (&'static Gain, &mut f64)| (gain.key, gain.unit, *value, gain.meaning, gain.rule);
    gains.into_iter().map(row).collect()
}

/// Controller model of a drive, and numbers of the controller and its valves. Each has key, unit, value, meaning, and the
/// rule by which it follows from the drive.
#[pyfunction]
pub fn control_tune<'py>(
    py: Python<'py>,
    spec: &str,
    deviation: f64,
) -> PyResult<(Bound<'py, PyDict>, [Vec<Ruled>; 2])> {
    let spec: Controller = parse(spec)?;
    let (mut controller, axis) = controller(&spec, deviation).map_err(to_python)?;
    let (own, model) = (controller.plant, &controller.model);
    let plant = [
        ("natural_frequency_rad_s", own.natural_frequency),
        ("damping_ratio", own.damping_ratio),
        ("speed_m_s", own.speed),
        ("force_rate_n_s", own.force_rate),
        ("lag_s", own.lag),
        ("coulomb_n", own.coulomb),
        ("stroke_m", model.stroke),
    ]
    .into_py_dict(py)?;
    plant.set_item("rest_pressures_pa", model.rest_pressures())?;
    plant.set_item("cylinder", axis.cylinder)?;
    plant.set_item("valves", axis.valves)?;
    plant.set_item("left_out", axis.left_out)?;
    plant.set_item("pressure_decay_1_s", model.pressure_decay())?;
    plant.set_item("least_force_shares", control::least_forces(model, 0.5 * model.stroke))?;
    let of_law = ruled(controller.law.gains());
    Ok((plant, [of_law, ruled(controller.valves.gains())]))
}

/// Causality, name, unit, meaning and start value of a variable of exported code.
type ExportedVariable = (&'static str, &'static str, &'static str, String, f64);
/// Name and text of a source file.
type SourceFile = (String, String);

/// Returns source files of a controller in a language, `"c"`, `"c-single"` or `"st"`: names and texts. Then the variables of the code, in the
/// order of inputs, parameters, outputs. The file headers contain `about`. `name` replaces the usual name.
#[pyfunction]
pub fn control_export(
    spec: &str,
    setup: &str,
    language: &str,
    about: &str,
    name: Option<String>,
) -> PyResult<(Vec<SourceFile>, Vec<ExportedVariable>)> {
    let (spec, setup): (Controller, Setup) = (parse(spec)?, parse(setup)?);
    let (controller, _) = controller(&spec, setup.position.deviation()).map_err(to_python)?;
    let mut program = program(&controller, setup.pressures.is_some()).map_err(PyValueError::new_err)?;
    program.name = name.unwrap_or(program.name);
    let files = match language {
        "c" | "c-single" => {
            let language = if language == "c" { Language::C } else { Language::Single };
            [&program.c(language, about)[..], &[("conformance.txt".into(), program.conformance())]].concat()
        }
        "st" => vec![(format!("{}.st", program.name), program.st(about))],
        _ => return Err(PyValueError::new_err(format!("there is no language \"{language}\""))),
    };
    let inputs = program.inputs.into_iter().map(|own| ("input", own, 0.0));
    let parameters = program.parameters.into_iter().map(|(own, value)| ("parameter", own, value));
    let variables = inputs.chain(parameters).chain(RESULTS.map(|own| ("output", own, 0.0)));
    let variables = variables
        .map(|(causality, (name, unit, meaning), value)| (causality, name, unit, meaning.into(), value));
    let status: Vec<_> = STATUS.iter().map(|(value, meaning)| format!("{value}: {meaning}")).collect();
    let status = ("output", "status", "1", status.join("; "), 0.0);
    Ok((files, variables.chain([status]).collect()))
}

/// Returns position, velocity, acceleration and jerk of a reference at times, shape (n, 4), SI units.
#[pyfunction]
pub fn reference_at<'py>(
    py: Python<'py>,
    motion: &str,
    times: PyReadonlyArray1<'py, f64>,
) -> PyResult<Table<'py>> {
    let reference = parse::<ReferenceForm>(motion)?.0;
    let times = times.as_array();
    let rows = times.iter().flat_map(|&t| reference.at(t).numbers());
    PyArray1::from_iter(py, rows).reshape([times.len(), 4])
}

/// Load of a reference on a drive, and the least time factor at which the load stays within a fraction of each limit.
/// The factor is `None` if slowing does not help.
#[pyfunction]
pub fn control_feasibility<'py>(
    py: Python<'py>,
    spec: &str,
    motion: &str,
    duration: f64,
    share: f64,
) -> PyResult<(Bound<'py, PyDict>, Option<f64>)> {
    let spec: Controller = parse(spec)?;
    let reference = parse::<ReferenceForm>(motion)?.0;
    let (own, _) = controller(&spec, 0.0).map_err(to_python)?;
    let (is, factor) = watched(py, None, |stop| {
        let mut stopped = None;
        let mut ask = |t| {
            stopped = stopped.or_else(|| stop(t).then_some(t));
            stopped.is_some()
        };
        let is = control::demand(&own.model, &reference, duration, 1.0, &mut ask);
        let factor = control::least_factor(&own.model, &reference, duration, share, &mut ask);
        stopped.map_or(Ok((is, factor)), |t| Err(Error::Interrupted { t }))
    })?;
    let shares = [
        ("valve_share", is.opening),
        ("valve_at_s", is.opening_time),
        ("valve_exceeded_s", is.exceeded),
        ("force_share", is.force),
        ("lowest_pressure_pa", is.pressures[0]),
        ("highest_pressure_pa", is.pressures[1]),
    ];
    Ok((shares.into_py_dict(py)?, factor))
}

/// Returns key, unit and meaning of each number that a custom controller can receive.
#[pyfunction]
pub fn control_signals() -> Vec<(&'static str, &'static str, &'static str)> {
    SIGNALS.to_vec()
}

/// Returns the indices of numbers among the signals.
fn places(names: &[String]) -> PyResult<Vec<usize>> {
    let place = |name: &String| {
        let found = SIGNALS.iter().position(|own| own.0 == name);
        found.ok_or_else(|| PyValueError::new_err(format!("there is no signal \"{name}\"")))
    };
    names.iter().map(place).collect()
}

/// Controller that is a Python callable of a tuple of numbers. NaN stands for an exception.
struct Called {
    call: Py<PyAny>,
    places: Vec<usize>,
}

impl OwnLaw for Called {
    fn step(&mut self, seen: &Seen, _reference: &Reference) -> f64 {
        let values = seen.values();
        Python::attach(|py| -> PyResult<f64> {
            let chosen = PyTuple::new(py, self.places.iter().map(|&place| values[place]))?;
            self.call.bind(py).call1((chosen,))?.extract()
        })
        .unwrap_or(f64::NAN)
    }
}

/// Reference of a drive.
#[pyclass(name = "ControlReference")]
pub struct PyReference(Reference);

#[pymethods]
impl PyReference {
    #[new]
    fn new(motion: &str) -> PyResult<Self> {
        Ok(PyReference(parse::<ReferenceForm>(motion)?.0))
    }

    /// Returns position, velocity, acceleration and jerk at a time, SI units.
    fn at(&self, t: f64) -> (f64, f64, f64, f64) {
        self.0.at(t).numbers().into()
    }
}

/// Returns columns of rows, and of the commands of several valves or of one switching valve.
fn columns<'py>(
    py: Python<'py>,
    rows: &[[f64; COLUMNS.len()]],
    under: &Servo,
) -> PyResult<Bound<'py, PyDict>> {
    let out = PyDict::new(py);
    for (i, name) in COLUMNS.into_iter().enumerate() {
        out.set_item(name, PyArray1::from_iter(py, rows.iter().map(|row| row[i])))?;
    }
    let (valves, each) = under.commanded();
    if !each.is_empty() {
        for (i, name) in valves.iter().enumerate() {
            let own = each.iter().skip(i).step_by(valves.len()).copied();
            out.set_item(format!("{name}.command"), PyArray1::from_iter(py, own))?;
        }
    }
    Ok(out)
}

/// Returns key, unit of the value, and meaning of each event of a supervisor.
#[pyfunction]
pub fn control_events() -> Vec<(&'static str, &'static str, &'static str)> {
    EventKind::ALL.to_vec()
}

/// Controller, reference and instrumentation of an axis, each in the form of JSON.
type AxisForm = (String, String, String);

/// Runs axes of a circuit from a start, each under its controller along its reference. Returns for each axis its
/// columns by name, SI units, and `events`: time, key and value of each event of its supervisor. Then these outputs
/// of the circuit at each sample, and the drawn air, kg. `own` is a custom controller of the first axis: a
/// callable of a tuple of the signals that are named with it.
#[pyfunction]
#[pyo3(signature = (circuit, start, axes, outputs, duration, rtol, look = None, own = None))]
#[allow(clippy::too_many_arguments)]
pub fn control_run<'py>(
    py: Python<'py>,
    circuit: &PyCircuit,
    start: BTreeMap<String, f64>,
    axes: Vec<AxisForm>,
    outputs: Vec<String>,
    duration: f64,
    rtol: f64,
    look: Teller<'py>,
    own: Option<(Py<PyAny>, Vec<String>)>,
) -> PyResult<(Vec<Bound<'py, PyDict>>, Table<'py>, f64)> {
    let read = |(spec, motion, setup): &AxisForm| -> PyResult<(Controller, Reference, Setup)> {
        Ok((parse(spec)?, parse::<ReferenceForm>(motion)?.0, parse(setup)?))
    };
    let axes = axes.iter().map(read).collect::<PyResult<Vec<_>>>()?;
    let mut own =
        own.map(|(call, names)| places(&names).map(|places| Called { call, places })).transpose()?;
    let shape = outputs.len();
    let ((rows, others), air, led) = watched(py, look, move |interrupted| {
        let mut session = circuit.network.assembly.session(&start, Options { rtol, ..Options::default() })?;
        session.follow_drawn();
        let mut led = vec![];
        for (spec, reference, setup) in axes {
            let (mut controller, axis) = controller(&spec, setup.position.deviation())?;
            if let Some(own) = own.take() {
                controller.law = AnyLaw::Own(Own::new(own));
            }
            led.push((Servo::new(&mut session, &axis, &setup)?, controller, reference));
        }
        let places = outputs.iter().map(|name| session.assembly.variables.column(name));
        let places = places.collect::<Result<Vec<_>, _>>()?;
        let mut each: Vec<_> = (led.iter_mut())
            .map(|(servo, controller, reference)| Led { servo, controller, reference })
            .collect();
        let look = &mut Look::new(interrupted);
        let rows = run_together(&mut session, &mut each, &places, duration, look)?;
        Ok((rows, session.drawn().unwrap_or(f64::NAN), led))
    })?;
    let mut out = vec![];
    for (rows, (servo, controller, _)) in rows.iter().zip(&led) {
        let own = columns(py, rows, servo)?;
        let events = controller.supervisor.as_ref().map_or(&[][..], |own| &own.log.events);
        let told: Vec<_> = events.iter().map(|own| (own.time, own.kind.key(), own.value)).collect();
        own.set_item("events", told)?;
        out.push(own);
    }
    let others = PyArray1::from_vec(py, others.concat()).reshape([rows[0].len(), shape])?;
    Ok((out, others, air))
}

/// Sensors of an axis, sample by sample.
#[pyclass(name = "ControlSensors")]
pub struct PySensors(Sensors);

#[pymethods]
impl PySensors {
    #[new]
    fn new(setup: &str) -> PyResult<Self> {
        Ok(PySensors(Sensors::new(parse(setup)?)))
    }

    /// Returns the readings of a position, m, and of both pressures, Pa, if there are sensors for them. Arguments are the
    /// number of the sample, its period, s, and the true position, velocity and pressures.
    fn sample(&mut self, tick: u64, period: f64, truth: [f64; 4]) -> (f64, Option<[f64; 2]>) {
        self.0.sample(tick, period, truth)
    }
}
