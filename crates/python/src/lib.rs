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
use physics::flow::{Iso6358, LINEAR_ABOVE, choked_factor};
use physics::{IdealGas, constants as c};
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
mod _core {
    #[pymodule_export]
    use super::control::{
        PyReference, PySensors, control_events, control_export, control_factors, control_feasibility,
        control_laws, control_run, control_signals, control_thresholds, control_tune, reference_at,
    };
    #[pymodule_export]
    use super::ensemble::PyEnsemble;
    #[pymodule_export]
    use super::friction::{
        dwell_growth, formula_law, friction_laws, seal_factors, seal_warming, steady_friction,
        steady_friction_sensitivity,
    };
    #[pymodule_export]
    use super::kinds::{components, formula_component};
    #[pymodule_export]
    use super::network::{PyCircuit, PyMembers};
    #[pymodule_export]
    use super::platform::PyPlatform;
    #[pymodule_export]
    use super::session::{PySession, close_step};
    #[pymodule_export]
    use super::signals::{bin_means, turning_points};
    #[pymodule_export]
    use super::{choked_flow_factor, constants, flow_ratio, valve_openings};
}
