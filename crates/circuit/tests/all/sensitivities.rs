//! Derivatives through the integrator: those of a run by numbers of the description and by its start are
//! those of the discrete solution, and its values are the plain run's to the bit.

use crate::support::drive::{Drive, plan};
use circuit::{Circuit, Shooting, Shot};
use math::{Dual, Real};
use ode::{NoOutput, Stepper};
use serde_json::Value;

fn case_a() -> Value {
    serde_json::from_str(include_str!("../../examples/case_a.json")).expect("valid")
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
        plans: plan("command", times.clone(), times.iter().map(command).collect()),
        sample_times: times.clone(),
        starts: vec![0],
        initial: START.iter().chain(inner).copied().collect(),
        parameters: parameters.iter().map(ToString::to_string).collect(),
        by_start: (!with_initial).then(Vec::new),
        outputs: OUTPUTS.iter().map(ToString::to_string).collect(),
        // So fine that a different choice of steps in the runs of the differences does not show.
        options: crate::support::options(1e-10),
        threads: 2,
    }
}

fn shoot(description: &Value, asked: &Shooting) -> Shot {
    let json = description.to_string();
    let drive = Drive::assemble(&serde_json::from_str(&json).expect("fits"), false).expect("assembles");
    let shot = drive.shoot(&json, asked, &mut |_| false).expect("runs");
    assert_eq!(shot.failures, vec![None; asked.starts.len()]);
    shot
}

/// Central differences of the plain run by the number at `path`, Richardson's extrapolation of two steps.
fn differences(description: &Value, asked: &Shooting, path: &str, step: f64) -> Vec<f64> {
    let pointer = format!("/{}", path.replace('.', "/"));
    let plain = Shooting { parameters: Vec::new(), by_start: Some(vec![]), ..asked.clone() };
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

/// Relative steps of the differences. Those by numbers of little effect need a long one against the noise of
/// kinks that a step runs over, those by others a short one.
const STEPS: [f64; 3] = [3e-4, 3e-3, 3e-2];

/// Holds every derivative against differences: they agree to `bound` of the largest of each output.
fn check_derivatives(description: &Value, asked: &Shooting, shot: &Shot, bound: f64) {
    let outputs = asked.outputs.len();
    for (direction, path) in asked.parameters.iter().enumerate() {
        let pointer = format!("/{}", path.replace('.', "/"));
        let size = description.pointer(&pointer).and_then(Value::as_f64).expect("a number");
        let apart = STEPS.map(|step| {
            let differences = differences(description, asked, path, step * size);
            let (mut apart, mut largest) = (vec![0.0_f64; outputs], vec![0.0_f64; outputs]);
            for (i, difference) in differences.iter().enumerate() {
                let exact = shot.sensitivities[i * shot.directions + direction];
                apart[i % outputs] = apart[i % outputs].max((exact - difference).abs());
                largest[i % outputs] = largest[i % outputs].max(exact.abs());
            }
            assert!(largest.iter().all(|&size| size > 0.0), "{path} matters");
            apart.iter().zip(&largest).map(|(apart, largest)| apart / largest).fold(0.0, f64::max)
        });
        assert!(apart.iter().any(|&apart| apart < bound), "{path}: {apart:?}");
    }
}

/// Case A with the friction of a table.
fn with_friction(friction: Value) -> Value {
    let mut description = case_a();
    description["friction"] = friction;
    description
}

/// All derivatives against differences; the values against the plain run.
fn check(description: &Value, asked: &Shooting, bound: f64) {
    let shot = shoot(description, asked);
    let plain = Shooting { parameters: Vec::new(), by_start: Some(vec![]), ..asked.clone() };
    let values = shoot(description, &plain);
    assert_eq!(crate::support::bits(&shot.values), crate::support::bits(&values.values));
    assert_eq!(crate::support::bits(&shot.ends), crate::support::bits(&values.ends));
    check_derivatives(description, asked, &shot, bound);
}

#[test]
fn by_every_kind_of_number() {
    let mut description = case_a();
    description["cylinder"]["leakage_m3_s_pa"] = 1e-10.into();
    description["load"]["force_n"] = 1.0.into();
    let paths = [
        "friction.parameters.coulomb",
        "friction.parameters.breakaway",
        "friction.parameters.stribeck_velocity",
        "friction.parameters.viscous",
        "friction.parameters.bristle_stiffness",
        "friction.parameters.bristle_damping",
        "valve.conductance_m3_s_pa",
        "valve.critical_pressure_ratio",
        "cylinder.bore_m",
        "cylinder.dead_volume_a_m3",
        "cylinder.dead_volume_b_m3",
        "cylinder.heat_transfer_w_m2_k",
        "cylinder.wall_temperature_k",
        "cylinder.leakage_m3_s_pa",
        "cylinder.moving_mass_kg",
        "load.force_n",
        "supply.pressure_pa",
        "ambient.pressure_pa",
    ];
    check(&description, &asked(0.3, &[1e-6], &paths, false), 1e-5);
}

#[test]
fn by_everything_that_acts_on_elasto_plastic_bristles() {
    let mut friction = serde_json::json!({
        "law": "elasto-plastic",
        "parameters": {
            "coulomb": 30.0, "breakaway": 45.0, "stribeck_velocity": 0.02, "viscous": 40.0,
            "bristle_stiffness": 1e5, "bristle_damping": 300.0, "breakaway_share": 0.8,
        },
        "pressure": { "coulomb_a": 2e-5, "coulomb_b": 1e-5, "breakaway_a": 2e-5, "breakaway_b": 1e-5 },
        "dwell": { "growth": "log", "increment_n": 2.0, "time_s": 0.05, "distance_m": 5e-5 },
        "position": {
            "harmonics": [{ "period_m": 0.1, "amplitude": 0.05, "phase_rad": 0.4 }],
            "slope_per_m": 0.2, "reference_m": 0.25,
        },
        "direction": { "positive": 1.1, "negative": 0.95 },
        "side_load": { "force_n": 20.0, "coefficient": 0.1 },
    });
    let paths = [
        "friction.parameters.coulomb",
        "friction.parameters.breakaway_share",
        "friction.pressure.coulomb_a",
        "friction.pressure.breakaway_b",
        "friction.dwell.increment_n",
        "friction.dwell.time_s",
        "friction.dwell.distance_m",
        "friction.position.harmonics.0.amplitude",
        "friction.position.slope_per_m",
        "friction.direction.positive",
        "friction.side_load.coefficient",
    ];
    check(&with_friction(friction.clone()), &asked(0.3, &[1e-6, 0.5], &paths, false), 2e-5);
    friction["relaxation"] = serde_json::json!({ "share": 0.3, "time_s": 0.3, "distance_m": 2e-4 });
    // Nine states: more than those whose matrix is inverted. Renewed dashpots leave through kinks that no step
    // ends on: there the derivatives are of lower order than the values.
    let paths =
        ["friction.parameters.bristle_stiffness", "friction.relaxation.share", "valve.conductance_m3_s_pa"];
    check(&with_friction(friction), &asked(0.3, &[1e-6, 1e-7, 0.5], &paths, false), 1e-4);
}

#[test]
fn through_stick_and_slip() {
    let mut description = with_friction(serde_json::json!({
        "law": "stribeck",
        "parameters": { "coulomb": 30.0, "breakaway": 45.0, "stribeck_velocity": 0.02, "viscous": 40.0 },
        "pressure": { "coulomb_a": 2e-5, "coulomb_b": 1e-5, "breakaway_a": 2e-5, "breakaway_b": 1e-5 },
    }));
    description["cylinder"]["heat_transfer_w_m2_k"] = 60.0.into();
    let paths = [
        "friction.parameters.coulomb",
        "friction.parameters.breakaway",
        "friction.parameters.viscous",
        "friction.pressure.breakaway_a",
        "valve.conductance_m3_s_pa",
        "cylinder.moving_mass_kg",
    ];
    let asked = Shooting {
        initial: [START[0], 0.0].iter().chain(&START[2..]).copied().collect(),
        ..asked(0.6, &[], &paths, false)
    };
    let shot = shoot(&description, &asked);
    let stands = |row: &[f64]| row[2] == 0.0;
    let rows: Vec<&[f64]> = shot.values.chunks_exact(3).collect();
    let switches = rows.windows(2).filter(|pair| stands(pair[0]) != stands(pair[1])).count();
    assert!(switches >= 3, "{switches} switches between stick and slip");
    check(&description, &asked, 1e-7);
}

#[test]
fn by_exponents_whose_value_has_a_form_of_its_own() {
    // 2 is a square and 0.5 a root while they are fixed: free, they are powers.
    let mut description = case_a();
    description["friction"]["parameters"]["stribeck_exponent"] = 2.0.into();
    let paths = ["friction.parameters.stribeck_exponent", "valve.subsonic_index"];
    let asked = asked(0.3, &[1e-6], &paths, false);
    let shot = shoot(&description, &asked);
    check_derivatives(&description, &asked, &shot, 1e-6);
}

#[test]
fn by_the_start() {
    let description = case_a();
    let asked = asked(0.2, &[1e-6], &["cylinder.dead_volume_a_m3"], true);
    let shot = shoot(&description, &asked);
    let plain = Shooting { parameters: Vec::new(), by_start: Some(vec![]), ..asked.clone() };
    for (i, size) in [0.1, 0.1, 1e5, 300.0, 1e5, 300.0, 1e-4].into_iter().enumerate() {
        let end = |change: f64| {
            let mut changed = plain.clone();
            changed.initial[i] += change;
            shoot(&description, &changed).ends
        };
        let slope = |h: f64| -> Vec<f64> {
            end(h).iter().zip(end(-h)).map(|(high, low)| (high - low) / (2.0 * h)).collect()
        };
        let step = 1e-4 * size;
        let (fine, coarse) = (slope(0.5 * step), slope(step));
        for (k, unit) in [0.1, 0.1, 1e5, 300.0, 1e5, 300.0, 1e-4].into_iter().enumerate() {
            let difference = (4.0 * fine[k] - coarse[k]) / 3.0;
            let exact = shot.end_sensitivities[k * shot.directions + 1 + i];
            let apart = (exact - difference).abs() * size / unit;
            assert!(apart < 1e-7, "end {k} by start {i}: {exact} {difference}");
        }
    }
}

#[test]
fn segments_are_runs_of_their_own_whatever_the_threads() {
    let description = case_a();
    let mut whole = asked(0.3, &[1e-6], &["friction.parameters.coulomb", "cylinder.bore_m"], true);
    whole.starts = vec![0, 100, 180];
    whole.initial = whole.initial.repeat(3);
    whole.initial[7] = 0.1;
    let shots = [1, 2, 5].map(|threads| shoot(&description, &Shooting { threads, ..whole.clone() }));
    for shot in &shots[1..] {
        assert_eq!(crate::support::bits(&shot.values), crate::support::bits(&shots[0].values));
        assert_eq!(crate::support::bits(&shot.sensitivities), crate::support::bits(&shots[0].sensitivities));
        assert_eq!(
            crate::support::bits(&shot.end_sensitivities),
            crate::support::bits(&shots[0].end_sensitivities)
        );
    }
    let alone = Shooting {
        sample_times: whole.sample_times[100..=180].to_vec(),
        starts: vec![0],
        initial: whole.initial[7..14].to_vec(),
        ..whole.clone()
    };
    let alone = shoot(&description, &alone);
    let row = OUTPUTS.len() * shots[0].directions;
    assert_eq!(
        crate::support::bits(&alone.sensitivities[..80 * row]),
        crate::support::bits(&shots[0].sensitivities[100 * row..180 * row])
    );
    assert_eq!(crate::support::bits(&alone.ends), crate::support::bits(&shots[0].ends[7..14]));
}

/// A mass on a spring with Coulomb friction, 0.4 m from where the spring is slack: half swing n, around
/// c_n = +-Fc/k from x_n, takes pi sqrt(m/k) and 2 Fc/k of the amplitude:
///
///   x(t) = c_n + (x_n - c_n) cos(omega t - n pi),   c_n = (-1)^n Fc/k,   x_n = (-1)^n (A - 2 n Fc/k)
#[test]
fn reversals_and_the_last_stop_move_with_the_parameters() {
    type Sensitive = Dual<f64, 8>;
    let (mass, stiffness, fc, amplitude): (f64, f64, f64, f64) = (2.0, 1000.0, 30.0, 0.4);
    let free = |value: f64, direction: usize| Sensitive::variable(value, direction);
    let (m, k) = (free(mass, 0), free(stiffness, 1));
    let gas = physics::IdealGas::new(Sensitive::c(1.4), Sensitive::c(287.05));
    let mut circuit = Circuit::<Sensitive>::new(&gas, Sensitive::c(1e5), Sensitive::c(293.15));
    let law = crate::support::law("coulomb", &[("coulomb", fc)]).lifted(&mut |parameter| {
        if parameter.key == "coulomb" { free(fc, 2) } else { Sensitive::c(0.0) }
    });
    let axis = circuit.axis(m, Sensitive::c(0.0), Sensitive::c(0.0), Some(law.into()));
    circuit.spring(axis, k, Sensitive::c(0.0));
    let mut circuit = circuit.build(false);
    let y = circuit.initial(&[], &[(axis, free(amplitude, 3), Sensitive::c(0.0))]);
    let mut stepper = Stepper::new(circuit, 0.0, &y, crate::support::options(1e-11));
    let omega = (stiffness / mass).sqrt();
    for t in [0.05, 0.2, 0.4, 0.7, 0.93] {
        stepper.advance(t, 100_000, &mut NoOutput);
        let n = (omega * t / std::f64::consts::PI).floor();
        let (sign, phase) = ((-1.0_f64).powf(n), omega * t - n * std::f64::consts::PI);
        let offset = sign * (amplitude - 2.0 * n * fc / stiffness) - sign * fc / stiffness;
        // By m and k: through the phase, and k through Fc/k.
        let by_phase = -offset * phase.sin();
        let by_shift = sign * (1.0 - phase.cos()) - sign * 2.0 * n * phase.cos();
        let by_amplitude = sign * phase.cos();
        let exact = [
            by_phase * -omega * t / (2.0 * mass),
            by_phase * omega * t / (2.0 * stiffness) - by_shift * fc / (stiffness * stiffness),
            by_shift / stiffness,
            by_amplitude,
        ];
        let x = stepper.state()[0];
        let value = sign * fc / stiffness + offset * phase.cos();
        assert!((x.re - value).abs() < 1e-8, "{t}: {} {value}", x.re);
        for (found, exact) in x.eps.iter().zip(exact) {
            assert!((found - exact).abs() < 1e-6 * (1.0 + exact.abs()), "{t}: {found} {exact}");
        }
    }
    // 0.02 m on the far side it rests: nothing but Fc, k and A says where.
    stepper.advance(3.0, 100_000, &mut NoOutput);
    let [x, v] = [stepper.state()[0], stepper.state()[1]];
    assert_eq!((v.re, v.eps), (0.0, [0.0; 8]));
    let exact = [0.0, -14.0 * fc / (stiffness * stiffness), 14.0 / stiffness, -1.0];
    for (found, exact) in x.eps.iter().zip(exact) {
        assert!((found - exact).abs() < 1e-6, "at rest: {found} {exact}");
    }
}

#[test]
fn what_cannot_be_free_is_refused() {
    let json = case_a().to_string();
    let drive = Drive::assemble(&serde_json::from_str(&json).expect("fits"), false).expect("assembles");
    for (path, message) in [
        ("cylinder.bor_m", "a cylinder/rodless has no parameter \"bor\"; it has bore, "),
        ("cylinder.kind", "a cylinder/rodless has no parameter \"kind\""),
        ("friction.parameters.stiffness", "friction.stiffness is not a parameter of \"lugre\""),
        ("gas.gas_constant_j_kg_k", "\"gas.gas_constant_j_kg_k\" is a number of the gas and cannot be free"),
    ] {
        let asked = asked(0.1, &[0.0], &[path], false);
        let refused = drive.shoot(&json, &asked, &mut |_| false).expect_err("refused").to_string();
        assert!(refused.starts_with(message), "{refused}");
    }
    let mut late = asked(0.1, &[0.0], &[], false);
    late.starts = vec![0, 100];
    let refused = drive.shoot(&json, &late, &mut |_| false).expect_err("refused").to_string();
    assert_eq!(refused, "starts must be increasing samples from 0 to below 100");
}

#[test]
fn one_derivative_has_the_bits_of_many() {
    let paths = [
        "friction.parameters.coulomb",
        "valve.conductance_m3_s_pa",
        "cylinder.moving_mass_kg",
        "supply.pressure_pa",
        "cylinder.bore_m",
    ];
    let dry = serde_json::json!({
        "law": "stribeck",
        "parameters": { "coulomb": 30.0, "breakaway": 45.0, "stribeck_velocity": 0.02, "viscous": 40.0 },
    });
    for (description, inner) in [(case_a(), &[1e-6][..]), (with_friction(dry), &[])] {
        let run = |paths: &[&str]| {
            let asked = asked(0.25, inner, paths, false);
            let options = crate::support::options(1e-6);
            shoot(&description, &Shooting { options, ..asked })
        };
        let many = run(&paths);
        for (k, path) in paths.iter().enumerate() {
            let one = run(&[path]);
            assert_eq!(crate::support::bits(&one.values), crate::support::bits(&many.values));
            let among_many: Vec<f64> = many.sensitivities.chunks(paths.len()).map(|all| all[k]).collect();
            assert_eq!(crate::support::bits(&one.sensitivities), crate::support::bits(&among_many));
        }
    }
}
