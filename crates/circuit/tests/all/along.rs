//! Along a record that the equations themselves made, forces, friction and pressure rates are those of the run:
//! mass times acceleration is force less friction in sliding, pressure rates are the slopes of the pressures,
//! and temperatures are found again whatever they are taken for at the start.

use crate::support::drive::Drive;
use crate::support::*;
use circuit::{ALONG, Record};

#[test]
fn a_run_agrees_with_its_own_equations() {
    let mut spec = reference_stribeck();
    spec.load.mass_kg = 1.0;
    let drive = Drive::assemble(&spec, false).expect("assembles");
    let times = [0.0, 0.15];
    let commands = [0.5, -0.5];
    let run = drive
        .simulate(&times, &commands, (0.3, 10_000.0), &at_rest(0.1, 3e5), options(1e-9), &mut |_| false)
        .expect("runs");
    let names = drive.columns();
    let of = |name: &str| &run.columns[names.iter().position(|own| own == name).expect(name)];
    let openings = openings(of("command"));
    let record = record(of, &openings);
    let rows = drive.driven().expect("a piston").along(&record).expect("a record of the drive");
    let column = |name: &str| ALONG.iter().position(|own| *own == name).expect("a column");
    let at = |name: &str, i: usize| rows[i * ALONG.len() + column(name)];
    let mass = spec.cylinder.moving_mass_kg + 1.0;
    for i in 1..record.times.len() - 1 {
        for side in ["a", "b"] {
            let name = format!("temperature_{side}_k");
            let (found, truth) = (at(&name, i), of(&name)[i]);
            assert!((found - truth).abs() < 1.0, "{side}, sample {i}: {found} K and {truth} K");
        }
        if of("velocity_m_s")[i].abs() < 1e-3 || openings[i - 1] != openings[i + 1] {
            continue;
        }
        let inertia = mass * of("acceleration_m_s2")[i];
        let left = at("force_n", i) - at("friction_n", i);
        assert!((inertia - left).abs() < 1e-6 * (1.0 + left.abs()), "sample {i}: {inertia} N and {left} N");
        for side in ["a", "b"] {
            let p = of(&format!("pressure_{side}_pa"));
            let slope = (p[i + 1] - p[i - 1]) / (record.times[i + 1] - record.times[i - 1]);
            let rate = at(&format!("pressure_rate_{side}_pa_s"), i);
            assert!((slope - rate).abs() < 0.01 * rate.abs() + 3e4, "{side}, sample {i}: {slope} and {rate}");
        }
    }
    // What the temperatures are taken for at the start is forgotten.
    let last = record.times.len() - 1;
    let warm = drive
        .driven()
        .expect("a piston")
        .along(&Record { temperature: [ROOM + 20.0, ROOM + 20.0], ..record })
        .expect("a record of the drive");
    for side in ["temperature_a_k", "temperature_b_k"] {
        let left = warm[last * ALONG.len() + column(side)] - at(side, last);
        assert!(left > 0.0 && left < 10.0, "{side}: {left} K of 20 K");
    }
}
