//! Circuits under controllers.

use crate::convert::{Table, Teller, parse, to_python, watched};
use crate::network::PyCircuit;
use circuit::Look;
use control::{AnyLaw, Gain, LAWS, Reference};
use numpy::{PyArray1, PyArrayMethods, PyReadonlyArray1};
use ode::Options;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use servo::specification::{Controller, Motion, Setup};
use servo::{COLUMNS, Encoder, Loop, controller};
use std::collections::BTreeMap;

/// Words of the laws of control.
#[pyfunction]
pub fn control_laws() -> Vec<&'static str> {
    LAWS.to_vec()
}

/// Key, unit, value, meaning of a gain, and the rule that it follows from the drive by.
type Ruled = (&'static str, &'static str, f64, &'static str, &'static str);

/// What a drive is to a law, and the law's gains: key, unit, value, meaning, and the rule that it follows from the drive by.
#[pyfunction]
pub fn control_tune<'py>(
    py: Python<'py>,
    spec: &str,
    deviation: f64,
) -> PyResult<(Bound<'py, PyDict>, Vec<Ruled>)> {
    let spec: Controller = parse(spec)?;
    let (mut controller, axis) = controller(&spec, deviation).map_err(to_python)?;
    let plant = PyDict::new(py);
    let own = controller.plant;
    for (name, value) in [
        ("natural_frequency_rad_s", own.natural_frequency),
        ("damping_ratio", own.damping_ratio),
        ("speed_m_s", own.speed),
        ("force_rate_n_s", own.force_rate),
        ("lag_s", own.lag),
        ("coulomb_n", own.coulomb),
        ("stroke_m", controller.model.stroke),
    ] {
        plant.set_item(name, value)?;
    }
    plant.set_item("cylinder", axis.cylinder)?;
    plant.set_item("valve", axis.valve)?;
    plant.set_item("left_out", axis.left_out)?;
    let law: &mut AnyLaw = &mut controller.law;
    let gains = law.gains().map(|(gain, value)| {
        let Gain { key, unit, meaning, rule, .. } = *gain;
        (key, unit, *value, meaning, rule)
    });
    Ok((plant, gains.collect()))
}

/// Position, velocity, acceleration and jerk of a reference at times, shape (n, 4), SI units.
#[pyfunction]
pub fn reference_at<'py>(
    py: Python<'py>,
    motion: &str,
    times: PyReadonlyArray1<'py, f64>,
) -> PyResult<Table<'py>> {
    let reference = Reference::from(&parse::<Motion>(motion)?);
    let times = times.as_array();
    let rows = times.iter().flat_map(|&t| {
        let at = reference.at(t);
        [at.position, at.velocity, at.acceleration, at.jerk]
    });
    PyArray1::from_iter(py, rows).reshape([times.len(), 4])
}

/// Runs a circuit from a start under a controller along a reference: columns by name, SI units.
#[pyfunction]
#[pyo3(signature = (circuit, start, spec, motion, setup, duration, rtol, look = None))]
#[allow(clippy::too_many_arguments)]
pub fn control_run<'py>(
    py: Python<'py>,
    circuit: &PyCircuit,
    start: BTreeMap<String, f64>,
    spec: &str,
    motion: &str,
    setup: &str,
    duration: f64,
    rtol: f64,
    look: Teller<'py>,
) -> PyResult<Bound<'py, PyDict>> {
    let (spec, setup): (Controller, Setup) = (parse(spec)?, parse(setup)?);
    let reference = Reference::from(&parse::<Motion>(motion)?);
    let network = circuit.network();
    let rows = watched(py, look, move |interrupted| {
        let (mut controller, axis) = controller(&spec, Encoder::from(setup.position).deviation())?;
        let mut session = network.session(&start, Options { rtol, ..Options::default() })?;
        let mut under = Loop::new(&mut session, &axis, &setup)?;
        under.run(&mut controller, &reference, duration, &mut Look::new(interrupted))
    })?;
    let out = PyDict::new(py);
    for (i, name) in COLUMNS.into_iter().enumerate() {
        out.set_item(name, PyArray1::from_iter(py, rows.iter().map(|row| row[i])))?;
    }
    Ok(out)
}
