//! Every golden case, the servo loop, derivatives, lanes and reductions give the bits that they gave: see
//! `support/pins.rs`. The sweep, two drives on a tank, lanes and the rig are pinned where they are tested.

use crate::support::drive::{self, Drive, plan};
use crate::support::*;
use circuit::{ALONG, Look, Network, Sampling, Shooting};
use ode::Options;
use serde_json::Value;

const GOLDEN: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../tests/golden");

fn read<T: serde::de::DeserializeOwned>(case: &Value, key: &str) -> T {
    serde_json::from_value(case[key].clone()).unwrap_or_else(|error| panic!("{key}: {error}"))
}

/// The golden cases by name.
fn cases() -> Vec<(String, Value)> {
    let files = std::fs::read_dir(GOLDEN).expect("golden cases").map(|entry| entry.expect("a file").path());
    let mut cases: Vec<_> = files
        .filter(|path| path.extension().is_some_and(|end| end == "json"))
        .map(|path| {
            let text = std::fs::read_to_string(&path).expect("a text");
            let name = path.file_stem().expect("a name").to_string_lossy().into_owned();
            (name, serde_json::from_str(&text).expect("JSON"))
        })
        .collect();
    cases.sort_by(|one, other| one.0.cmp(&other.0));
    cases
}

#[test]
fn pins_are_what_they_are_called() {
    let abc = "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad";
    assert_eq!(pins::sha256(b"abc"), abc);
    let long = "cdc76e5c9914fb9281a1c7e284d73e67f1809a48a497200e046d39ccc7112cd0";
    assert_eq!(pins::sha256(&[b'a'; 1_000_000]), long);
}

#[test]
fn golden_cases() {
    for (name, case) in cases() {
        let drive = Drive::assemble(&read(&case, "drive"), false).expect("assembles");
        let (duration, initial): (f64, drive::Initial) = (read(&case, "duration_s"), read(&case, "initial"));
        let mut never = |_| false;
        let mut states = |rtol: f64| {
            if case["servo"].is_object() {
                let gain = |key: &str| read(&case["servo"], key);
                let [kp, kd, amplitude]: [f64; 3] = ["kp", "kd", "amplitude_m"].map(gain);
                let omega: f64 = 2.0 * std::f64::consts::PI * gain("frequency_hz");
                let mut servo = |t: f64, seen: &[f64]| {
                    let target = 0.25 + amplitude * math::elementary::sin(omega * t);
                    let speed = amplitude * omega * math::elementary::cos(omega * t);
                    Some((kp * (target - seen[0]) + kd * (speed - seen[1])).clamp(-1.0, 1.0))
                };
                let mut session = drive.session(&initial, options(rtol));
                let names = ["position_m", "velocity_m_s", "pressure_a_pa", "pressure_b_pa"];
                let column =
                    |name: &str| session.assembly.columns().iter().position(|own| own.ends_with(name));
                let columns = names.map(|name| column(name).expect("a column")).to_vec();
                let input = session.inputs().iter().position(|own| own.name.ends_with("command"));
                let input = input.expect("a command");
                let period = 1.0 / gain("sample_rate_hz");
                let sampling =
                    Sampling { columns, input, period, periods: (duration / period).round() as usize };
                session.control(&sampling, &mut servo, &mut Look::new(&mut never)).expect("runs")
            } else {
                let (times, commands): (Vec<f64>, Vec<f64>) =
                    read::<Vec<(f64, f64)>>(&case, "commands").into_iter().unzip();
                let sampling = (duration, read(&case, "sample_rate_hz"));
                let session = drive.planned((&times, &commands), duration, &initial, options(rtol));
                drive::states(session, sampling).expect("runs")
            }
        };
        let values: Vec<f64> = [1e-3, 1e-6].into_iter().flat_map(&mut states).collect();
        pinned(&format!("golden/{name}"), values);
    }
}

/// Values and derivatives by the description and by the start, with a command every 10 ms.
#[test]
fn multiple_shooting() {
    for law in ["lugre", "stribeck", "gms", "elasto-plastic"] {
        let spec = drive::Spec { friction: everything(law), ..reference() };
        let mut json: Value = serde_json::from_str(include_str!("../../examples/case_a.json")).expect("JSON");
        json["friction"] = serde_json::json!({
            "law": law,
            "parameters": spec.friction.parameters,
        });
        json["cylinder"]["leakage_m3_s_pa"] = 1e-10.into();
        let json = json.to_string();
        let drive = Drive::assemble(&serde_json::from_str(&json).expect("fits"), false).expect("assembles");
        let n = drive.start_names().len();
        let mut initial = vec![0.06, 0.02, 3.2e5, 295.0, 2.8e5, 290.0];
        initial.resize(n, 0.0);
        let times: Vec<f64> = (0..50).map(|k| 0.01 * f64::from(k)).collect();
        let asked = Shooting {
            plans: plan(
                "command",
                times.clone(),
                (0..50).map(|k| 0.4 * math::elementary::sin(0.3 * f64::from(k))).collect(),
            ),
            sample_times: times.clone(),
            starts: vec![0, 25],
            initial: initial.repeat(2),
            parameters: ["cylinder.moving_mass_kg", "supply.pressure_pa", "cylinder.leakage_m3_s_pa"]
                .map(String::from)
                .to_vec(),
            by_start: None,
            outputs: drive.columns().to_vec(),
            options: options(1e-6),
            threads: 1,
        };
        let shot = drive.shoot(&json, &asked, &mut |_| false).expect("runs");
        let all = [shot.values, shot.sensitivities, shot.ends, shot.end_sensitivities].concat();
        pinned(&format!("shoot/{law}"), all);
    }
}

/// A tank that is filled through its line, shut and filled again.
#[test]
fn tank() {
    let json = serde_json::json!({
        "gas": { "heat_capacity_ratio": K, "gas_constant_j_kg_k": crate::support::R },
        "ambient": { "pressure_pa": AMBIENT, "temperature_k": ROOM },
        "components": [
            { "name": "volume", "kind": "tank", "numbers": {
                "volume": 2e-3, "wall_area": 1.0, "heat_transfer": 0.5, "wall_temperature": ROOM } },
            { "name": "line", "kind": "fitting",
              "numbers": { "conductance": 5e-9, "critical_pressure_ratio": 0.4 } },
            { "name": "other_side", "kind": "reservoir", "numbers": { "pressure": 7e5, "temperature": ROOM } },
            { "name": "leak", "kind": "fitting",
              "numbers": { "conductance": 1e-11, "critical_pressure_ratio": 0.2 } },
        ],
        "joints": [["other_side.1", "line.1"], ["volume.1", "line.2", "leak.1"], ["leak.2", "ambient"]],
    })
    .to_string();
    let times: Vec<f64> = (0..100).map(|k| 0.05 * f64::from(k)).collect();
    let asked = Shooting {
        plans: plan("line.opening", vec![0.0, 1.5, 3.0], vec![1.0, 0.0, 0.5]),
        sample_times: times,
        starts: vec![0],
        initial: vec![1.2e5, ROOM],
        parameters: vec!["line.conductance".into(), "volume.volume".into()],
        by_start: None,
        outputs: vec!["volume.pressure_pa".into(), "volume.mass_flow_kg_s".into()],
        options: options(1e-6),
        threads: 1,
    };
    let tank = Network::assemble(&serde_json::from_str(&json).expect("fits"), false).expect("assembles");
    let shot = tank.shoot(&json, &asked, &mut |_| false).expect("runs");
    pinned("tank", [shot.values, shot.sensitivities, shot.ends, shot.end_sensitivities].concat());
}

/// The equations along a record.
#[test]
fn along_a_record() {
    let drive = Drive::assemble(&reference_stribeck(), true).expect("assembles");
    let plan = (&[0.0, 0.15][..], &[0.5, -0.5][..]);
    let tight = Options { max_attempts: 100_000, ..options(1e-6) };
    let mut never = |_| false;
    let run = drive.simulate(plan.0, plan.1, (0.3, 1000.0), &at_rest(0.1, 3e5), tight, &mut never);
    let columns = run.expect("runs").columns;
    let of = |name: &str| &columns[drive.columns().iter().position(|own| own == name).expect(name)];
    let openings = openings(of("command"));
    let record = record(of, &openings);
    let rows = drive.driven().expect("a piston").along(&record).expect("a record of the drive");
    assert_eq!(rows.len(), ALONG.len() * openings.len());
    pinned("along", [columns.concat(), rows].concat());
}
