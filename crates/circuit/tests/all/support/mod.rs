//! What the contracts of circuits share: gas, restrictions, runs with samples, descriptions to vary.

#![allow(dead_code, unused_imports)] // every contract uses its own part

pub mod circuits;
pub mod drive;
pub mod pins;

use circuit::{Circuit, Net, Record, specification};
use ode::{NoOutput, Options, Output, Paused, Stepper, System};
use physics::flow::Iso6358;
use physics::friction::{AnyLaw, Choices, LAWS, Meta};
use physics::mechanics::EndStop;
use physics::{IdealGas, Parameter};

pub use pins::pinned;

pub const K: f64 = 1.4;
pub const R: f64 = 287.05;
pub const ROOM: f64 = 293.15;
pub const AMBIENT: f64 = 101_300.0;
pub const G: f64 = 9.806_65;

pub fn air() -> IdealGas<f64> {
    IdealGas::new(K, R)
}

pub fn empty() -> Circuit<f64> {
    Circuit::new(&air(), AMBIENT, ROOM)
}

/// A restriction of sonic conductance `c` m3/(s Pa) and critical ratio 0.3.
pub fn orifice(c: f64) -> Iso6358<f64> {
    Iso6358::for_gas(c, 0.3, 0.5, 0.999, true, &air(), true)
}

pub fn stop() -> EndStop<f64> {
    EndStop { stiffness: 1e6, damping: 2000.0, damping_depth: 1e-4 }
}

/// A law's entry in the registry.
pub fn registered(key: &str) -> &'static Meta {
    LAWS.iter().find(|meta| meta.key == key).expect("registered")
}

/// A law of the registry with the values given and the defaults.
pub fn law(key: &str, values: &[(&str, f64)]) -> AnyLaw<f64> {
    let meta = registered(key);
    for (name, _) in values {
        assert!(meta.parameters.iter().any(|p| p.key == *name), "{key} has no {name}");
    }
    let value = |name: &str| values.iter().find(|(key, _)| *key == name).map(|(_, value)| *value);
    let mut value = |p: &Parameter| value(p.key).or(p.default).expect("a value");
    AnyLaw::build(key, &mut value, &Choices::default()).expect("registered")
}

pub fn stribeck() -> AnyLaw<f64> {
    law("stribeck", &[("coulomb", 30.0), ("breakaway", 45.0), ("stribeck_velocity", 0.02), ("viscous", 40.0)])
}

pub fn options(rtol: f64) -> Options {
    Options { rtol, ..Options::default() }
}

/// The states at given times.
#[derive(Clone, Default)]
pub struct Trace {
    pub times: Vec<f64>,
    pub states: Vec<Vec<f64>>,
}

impl Output<f64, Circuit<f64>> for Trace {
    fn due(&self, _lane: usize) -> f64 {
        self.times.get(self.states.len()).copied().unwrap_or(f64::INFINITY)
    }
    fn sample(&mut self, _lane: usize, _t: f64, y: &[f64], _system: &Circuit<f64>) {
        self.states.push(y.to_vec());
    }
}

impl Trace {
    pub fn at(times: Vec<f64>) -> Self {
        Trace { times, states: Vec::new() }
    }

    /// 0, step, 2 step, .. up to `end`.
    pub fn every(step: f64, end: f64) -> Self {
        Trace::at((0..=(end / step).round() as u32).map(|k| f64::from(k) * step).collect())
    }

    /// The samples due at the very end of a run.
    pub fn finish(&mut self, stepper: &Stepper<f64, Circuit<f64>>) {
        while self.states.len() < self.times.len() {
            self.states.push(stepper.state().to_vec());
        }
    }
}

/// Advances a run; a failure, or more work than any contract needs, ends the test.
pub fn advance(
    stepper: &mut Stepper<f64, Circuit<f64>>,
    until: f64,
    output: &mut impl Output<f64, Circuit<f64>>,
) {
    let paused = stepper.advance(until, 200_000, output);
    assert_eq!(stepper.failure(0), None);
    assert_eq!(paused, Paused::Arrived);
}

/// Runs a circuit with constant inputs to `end`.
pub fn run(circuit: &Circuit<f64>, y: &[f64], end: f64, rtol: f64) -> Stepper<f64, Circuit<f64>> {
    let mut stepper = Stepper::new(circuit.clone(), 0.0, y, options(rtol));
    advance(&mut stepper, end, &mut NoOutput);
    stepper
}

/// Pressures, temperatures, forces at state `y`.
pub fn nodes(circuit: &Circuit<f64>, y: &[f64]) -> Net<f64> {
    let mut net = circuit.work::<f64>();
    circuit.observe(y, &mut net);
    net
}

/// The nodes where a run is.
pub fn now(stepper: &Stepper<f64, Circuit<f64>>) -> Net<f64> {
    nodes(stepper.system(), stepper.state())
}

pub fn bits(y: &[f64]) -> Vec<u64> {
    y.iter().map(|x| x.to_bits()).collect()
}

pub fn assert_close(what: &str, a: f64, b: f64, relative: f64) {
    assert!((a / b - 1.0).abs() < relative, "{what}: {a} against {b}, apart by {:e}", a / b - 1.0);
}

/// The reference drive: rodless, 25 mm bore, 0.5 m stroke, lugre.
pub fn reference() -> drive::Spec {
    serde_json::from_str(include_str!("../../../examples/case_a.json")).expect("valid")
}

/// The same with exact sticking.
pub fn reference_stribeck() -> drive::Spec {
    let mut spec = reference();
    spec.friction.law = "stribeck".into();
    for name in ["bristle_stiffness", "bristle_damping"] {
        spec.friction.parameters.remove(name);
    }
    spec
}

/// Friction with all that can act on a law; relaxation where it has bristles.
pub fn everything(law: &str) -> specification::Friction {
    let meta = registered(law);
    let mut parameters = serde_json::json!({
        "coulomb": 30.0, "breakaway": 45.0, "stribeck_velocity": 0.02, "viscous": 40.0,
        "bristle_stiffness": 1e5, "bristle_damping": 300.0, "damping_fade_velocity": 0.5,
        "dead_zone": 1e-4, "memory_time": 0.02, "recovery_time": 1.0,
        "attraction": 2000.0, "direct_effect": 0.1, "evolution_effect": 0.03, "distance": 5e-5,
        "reference_velocity": 1e-3, "film_velocity": 0.05, "film_growth_time": 0.03, "film_decay_time": 0.2,
        "film_rest_time": 20.0, "fluid_lead_time": 5e-3,
    });
    let known = |key: &String| meta.parameters.iter().any(|p| p.key == key);
    parameters.as_object_mut().expect("a table").retain(|key, _| known(key));
    let relaxation = serde_json::json!({ "share": 0.3, "time_s": 0.3, "distance_m": 2e-4 });
    let table = serde_json::json!({
        "law": law,
        "parameters": parameters,
        "pressure": { "coulomb_a": 2e-5, "coulomb_b": 1e-5, "breakaway_a": 2e-5, "breakaway_b": 1e-5 },
        "dwell": {
            "growth": "log", "increment_n": 2.0, "time_s": 0.05, "distance_m": 5e-5,
            "pressure_a": 1e-6, "pressure_b": 2e-6,
        },
        "relaxation": if meta.bristles { relaxation } else { serde_json::Value::Null },
        "position": {
            "harmonics": [{ "period_m": 0.1, "amplitude": 0.05, "phase_rad": 0.4 }],
            "slope_per_m": 0.2, "reference_m": 0.25,
        },
        "direction": { "positive": 1.1, "negative": 0.95 },
        "side_load": { "force_n": 20.0, "coefficient": 0.1 },
    });
    serde_json::from_value(table).expect("a description")
}

/// At rest at `x` m with `p` Pa in both chambers, at room temperature.
pub fn at_rest(x: f64, p: f64) -> drive::Initial {
    drive::Initial {
        position_m: x,
        velocity_m_s: 0.0,
        pressure_a_pa: p,
        pressure_b_pa: p,
        temperature_a_k: ROOM,
        temperature_b_k: ROOM,
        contact_age_s: 0.0,
    }
}

/// How far commands open each edge of the valve.
pub fn openings(commands: &[f64]) -> Vec<[f64; 4]> {
    commands.iter().map(|&u| if u > 0.0 { [u, 0.0, 0.0, u] } else { [0.0, -u, -u, 0.0] }).collect()
}

/// A record of a drive in a warm room, from its columns by name.
pub fn record<'a>(of: impl Fn(&str) -> &'a Vec<f64>, openings: &'a [[f64; 4]]) -> Record<'a> {
    Record {
        times: of("time_s"),
        position: of("position_m"),
        velocity: of("velocity_m_s"),
        pressure: [of("pressure_a_pa"), of("pressure_b_pa")],
        openings,
        temperature: [ROOM, ROOM],
    }
}
