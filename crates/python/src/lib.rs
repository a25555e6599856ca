//! The interface to Python: conversion and error mapping only.

mod control;
mod convert;
mod ensemble;
mod friction;
mod kinds;
mod network;
mod platform;
mod session;
mod shooting;
mod signals;

use convert::Table;
use numpy::{PyArray1, PyArrayMethods, PyReadonlyArray1};
use physics::IdealGas;
use physics::constants as c;
use physics::flow::{Iso6358, LINEAR_ABOVE, choked_factor};
use pyo3::prelude::*;
use std::collections::BTreeMap;

/// Returns the flow through a component relative to its choked flow, at a ratio of downstream to upstream
/// pressure.
#[pyfunction]
fn flow_ratio(pressure_ratio: f64, critical_pressure_ratio: f64, subsonic_index: f64) -> f64 {
    let (b, m) = (critical_pressure_ratio, subsonic_index);
    Iso6358::for_gas(1.0, b, m, LINEAR_ABOVE, m == 0.5, &IdealGas::air(), true).phi(pressure_ratio)
}

/// Returns psi(k) in m_dot = A p psi / sqrt(R T): choked flow of an ideal gas through a nozzle.
#[pyfunction]
fn choked_flow_factor(heat_capacity_ratio: f64) -> f64 {
    choked_factor(heat_capacity_ratio)
}

/// Returns the open fraction of each edge of a proportional 5/3 valve at each command, shape (n, 4). The edges are
/// supply to a, a to exhaust, supply to b, and b to exhaust.
#[pyfunction]
fn valve_openings<'py>(py: Python<'py>, command: PyReadonlyArray1<'py, f64>) -> PyResult<Table<'py>> {
    let commands = command.as_array();
    let edges = commands.iter().flat_map(|u| circuit::valve_openings(*u));
    PyArray1::from_iter(py, edges).reshape([commands.len(), 4])
}

/// Returns the physical and standard constants of the core, by name, in SI.
#[pyfunction]
fn constants() -> BTreeMap<&'static str, f64> {
    BTreeMap::from([
        ("STANDARD_GRAVITY_M_S2", c::STANDARD_GRAVITY),
        ("ANR_DENSITY_KG_M3", c::RHO_0),
        ("ANR_TEMPERATURE_K", c::T_0),
        ("ANR_PRESSURE_PA", c::P_0),
        ("AIR_HEAT_CAPACITY_RATIO", c::AIR_HEAT_CAPACITY_RATIO),
        ("AIR_GAS_CONSTANT_J_KG_K", c::AIR_GAS_CONSTANT),
        ("LEAK_CRITICAL_RATIO", physics::flow::LEAK_RATIO),
        ("IMPACT_ENERGY_J_M2", circuit::IMPACT_ENERGY_J_M2),
    ])
}

#[pymodule]
fn _core(m: &Bound<'_, PyModule>) -> PyResult<()> {
    m.add_class::<ensemble::PyEnsemble>()?;
    m.add_class::<network::PyCircuit>()?;
    m.add_class::<network::PyMembers>()?;
    m.add_class::<platform::PyPlatform>()?;
    m.add_class::<session::PySession>()?;
    m.add_function(wrap_pyfunction!(session::close_step, m)?)?;
    m.add_function(wrap_pyfunction!(signals::turning_points, m)?)?;
    m.add_function(wrap_pyfunction!(signals::bin_means, m)?)?;
    m.add_function(wrap_pyfunction!(kinds::components, m)?)?;
    m.add_function(wrap_pyfunction!(kinds::formula_component, m)?)?;
    m.add_function(wrap_pyfunction!(friction::friction_laws, m)?)?;
    m.add_function(wrap_pyfunction!(friction::formula_law, m)?)?;
    m.add_function(wrap_pyfunction!(friction::dwell_growth, m)?)?;
    m.add_function(wrap_pyfunction!(friction::seal_factors, m)?)?;
    m.add_function(wrap_pyfunction!(friction::seal_warming, m)?)?;
    m.add_function(wrap_pyfunction!(friction::steady_friction, m)?)?;
    m.add_function(wrap_pyfunction!(friction::steady_friction_sensitivity, m)?)?;
    m.add_function(wrap_pyfunction!(control::control_events, m)?)?;
    m.add_function(wrap_pyfunction!(control::control_export, m)?)?;
    m.add_function(wrap_pyfunction!(control::control_laws, m)?)?;
    m.add_function(wrap_pyfunction!(control::control_factors, m)?)?;
    m.add_function(wrap_pyfunction!(control::control_thresholds, m)?)?;
    m.add_function(wrap_pyfunction!(control::control_run, m)?)?;
    m.add_function(wrap_pyfunction!(control::control_signals, m)?)?;
    m.add_function(wrap_pyfunction!(control::control_feasibility, m)?)?;
    m.add_function(wrap_pyfunction!(control::control_tune, m)?)?;
    m.add_class::<control::PySensors>()?;
    m.add_class::<control::PyReference>()?;
    m.add_function(wrap_pyfunction!(control::reference_at, m)?)?;
    m.add_function(wrap_pyfunction!(flow_ratio, m)?)?;
    m.add_function(wrap_pyfunction!(choked_flow_factor, m)?)?;
    m.add_function(wrap_pyfunction!(valve_openings, m)?)?;
    m.add_function(wrap_pyfunction!(constants, m)?)?;
    Ok(())
}
