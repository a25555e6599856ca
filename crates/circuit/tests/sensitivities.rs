//! Derivatives through the integrator: those of a run by numbers of the description and by its start are
//! those of the discrete solution, and its values are the plain run's to the bit.

mod support;

use circuit::{Drive, Shooting, Shot};
use serde_json::Value;

fn case_a() -> Value {
    serde_json::from_str(include_str!("../examples/case_a.json")).expect("valid")
}

/// Chambers at different pressures, some way into the stroke.
const START: [f64; 6] = [0.06, 0.02, 3.2e5, 295.0, 2.8e5, 290.0];
const OUTPUTS: [&str; 3] = ["position_m", "pressure_a_pa", "velocity_m_s"];

/// A servo's kind of command: it changes every millisecond.
fn asked(seconds: f64, inner: &[f64], parameters: &[&str], with_initial: bool) -> Shooting {
    let n = (seconds * 1000.0).round() as usize;
    let times: Vec<f64> = (0..=n).map(|k| k as f64 / 1000.0).collect();
    let command = |t: &f64| 0.35 * (9.0 * t).sin() + 0.1 * (31.0 * t).cos();
    Shooting {
        commands: times.iter().map(command).collect(),
        sample_times: times.clone(),
        times,
        starts: vec![0],
        initial: START.iter().chain(inner).copied().collect(),
        parameters: parameters.iter().map(ToString::to_string).collect(),
        with_initial: with_initial.into(),
        outputs: OUTPUTS.iter().map(ToString::to_string).collect(),
        options: support::options(1e-6),
        threads: 2,
    }
}

fn shoot(description: &Value, asked: &Shooting) -> Shot {
    let json = description.to_string();
    let drive = Drive::assemble(&serde_json::from_str(&json).expect("fits"), false).expect("assembles");
    let shot = drive.shoot(&json, asked, &mut || false).expect("runs");
    assert_eq!(shot.failures, vec![None; asked.starts.len()]);
    shot
}

/// Central differences of the plain run by the number at `path`, Richardson's extrapolation of two steps.
fn differences(description: &Value, asked: &Shooting, path: &str, step: f64) -> Vec<f64> {
    let pointer = format!("/{}", path.replace('.', "/"));
    let plain = Shooting { parameters: Vec::new(), with_initial: false.into(), ..asked.clone() };
    let at = |change: f64| {
        let mut changed = description.clone();
        let number = changed.pointer_mut(&pointer).expect("a number");
        let scale = number.as_f64().expect("a number");
        *number = (scale + change).into();
        shoot(&changed, &plain).values
    };
    let slope = |h: f64| -> Vec<f64> {
        at(h).iter().zip(at(-h)).map(|(high, low)| (high - low) / (2.0 * h)).collect()
    };
    slope(0.5 * step).iter().zip(slope(step)).map(|(fine, coarse)| (4.0 * fine - coarse) / 3.0).collect()
}

/// How far the derivatives by each of `paths` are from differences, as a share of the largest, at worst.
fn worst(description: &Value, asked: &Shooting, shot: &Shot) -> Vec<f64> {
    let outputs = asked.outputs.len();
    let one = |(direction, path): (usize, &String)| {
        let pointer = format!("/{}", path.replace('.', "/"));
        let size = description.pointer(&pointer).and_then(Value::as_f64).expect("a number");
        let differences = differences(description, asked, path, STEP * size);
        let (mut apart, mut largest) = (vec![0.0_f64; outputs], vec![0.0_f64; outputs]);
        for (i, difference) in differences.iter().enumerate() {
            let exact = shot.sensitivities[i * shot.directions + direction];
            apart[i % outputs] = apart[i % outputs].max((exact - difference).abs());
            largest[i % outputs] = largest[i % outputs].max(exact.abs());
        }
        apart.iter().zip(&largest).map(|(apart, largest)| apart / largest).fold(0.0, f64::max)
    };
    asked.parameters.iter().enumerate().map(one).collect()
}

/// Relative step of the differences: their error, of the fourth order, and that of rounding are alike.
const STEP: f64 = 3e-4;

#[test]
fn derivatives_are_those_of_the_discrete_solution() {
    let description = case_a();
    let paths = [
        "friction.parameters.coulomb",
        "valve.conductance_m3_s_pa",
        "cylinder.dead_volume_a_m3",
        "cylinder.moving_mass_kg",
        "cylinder.bore_m",
    ];
    let asked = asked(0.3, &[1e-6], &paths, true);
    let shot = shoot(&description, &asked);
    let plain = Shooting { parameters: Vec::new(), with_initial: false.into(), ..asked.clone() };
    let values = shoot(&description, &plain);
    assert_eq!(support::bits(&shot.values), support::bits(&values.values));
    assert_eq!(support::bits(&shot.ends), support::bits(&values.ends));
    for (path, worst) in paths.iter().zip(worst(&description, &asked, &shot)) {
        assert!(worst < 1e-6, "{path}: {worst:e}");
    }
}
