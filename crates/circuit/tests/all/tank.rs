//! A fixed volume: its discharge and the derivatives of that against closed forms.

use crate::support::drive::plan;
use circuit::{Network, Shooting, Shot};
use ode::Options;
use physics::constants::{RHO_0, T_0};

const P_A: f64 = 1e5;
const T_A: f64 = 293.15;
const R: f64 = 287.05;

/// A discharge from 8 bar into a vacuum, so that the flow is choked to the end.
fn json(heat: f64) -> String {
    format!(
        r#"{{"gas": {{"heat_capacity_ratio": 1.4, "gas_constant_j_kg_k": {R}}},
             "ambient": {{"pressure_pa": {P_A}, "temperature_k": {T_A}}},
             "components": [
                 {{"name": "volume", "kind": "tank", "numbers": {{"volume": 2e-3, "wall_area": 1.0, "heat_transfer": {heat}}}}},
                 {{"name": "line", "kind": "fitting", "numbers": {{"conductance": 5e-9, "critical_pressure_ratio": 0.4}}}},
                 {{"name": "other_side", "kind": "reservoir", "numbers": {{"pressure": 1.0}}}}
             ],
             "joints": [["other_side.1", "line.1"], ["volume.1", "line.2"]]}}"#
    )
}

fn pressures(heat: f64, parameters: &[&str]) -> (Vec<f64>, Shot) {
    let json = json(heat);
    let times: Vec<f64> = (0..=40).map(|i| 0.05 * f64::from(i)).collect();
    let asked = Shooting {
        plans: plan("line.opening", vec![0.0], vec![1.0]),
        sample_times: times.clone(),
        starts: vec![0],
        initial: vec![8e5, T_A],
        parameters: parameters.iter().map(ToString::to_string).collect(),
        by_start: None,
        outputs: vec!["volume.pressure_pa".into()],
        options: Options { rtol: 1e-9, ..Options::default() },
        threads: 1,
    };
    let tank = Network::assemble(&serde_json::from_str(&json).unwrap(), false).unwrap();
    (times, tank.shoot(&json, &asked, &mut |_| false).unwrap())
}

/// tau = V / (C rho0 R sqrt(T0 T)), rho0 and T0 of the standard reference atmosphere.
fn tau() -> f64 {
    2e-3 / (5e-9 * RHO_0 * R * (T_0 * T_A).sqrt())
}

#[test]
fn choked_discharge_follows_the_closed_forms() {
    let k = 1.4;
    let (times, adiabatic) = pressures(0.0, &[]);
    let (_, isothermal) = pressures(1e7, &[]);
    for (i, t) in times.iter().enumerate() {
        let expected = 8e5 * (1.0 + (k - 1.0) / 2.0 * t / tau()).powf(-2.0 * k / (k - 1.0));
        assert!((adiabatic.values[i] / expected - 1.0).abs() < 1e-6, "{t}: {}", adiabatic.values[i]);
        let expected = 8e5 * (-t / tau()).exp();
        assert!((isothermal.values[i] / expected - 1.0).abs() < 1e-6, "{t}: {}", isothermal.values[i]);
    }
}

#[test]
fn derivatives_are_those_of_the_closed_form() {
    let (times, shot) = pressures(0.0, &["line.conductance"]);
    let k: f64 = 1.4;
    for (i, t) in times.iter().enumerate() {
        // By the logarithm of C: the time counts in tau, which goes with 1/C.
        let s = 1.0 + (k - 1.0) / 2.0 * t / tau();
        let expected = -8e5 * k * (t / tau()) * s.powf(-2.0 * k / (k - 1.0) - 1.0);
        let found = shot.sensitivities[3 * i] * 5e-9;
        assert!((found - expected).abs() < 1e-6 * 8e5, "{t}: {found} {expected}");
        // By the start: pressures scale with it.
        let found = shot.sensitivities[3 * i + 1];
        assert!((found - shot.values[i] / 8e5).abs() < 1e-3, "{t}: {found}");
    }
}
