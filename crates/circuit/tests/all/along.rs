//! Along a record that the equations themselves made, forces, friction and pressure rates are those of the run:
//! mass times acceleration is force less friction in sliding, pressure rates are the slopes of the pressures,
//! and temperatures are found again whatever they are taken for at the start. A run that is put back to its own
//! states is the same run.

use crate::support::drive::Drive;
use crate::support::*;
use circuit::{ALONG, Record, Restart};

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

#[test]
fn a_run_put_back_to_its_own_states_is_the_same_run() {
    // Bristles: what nobody measures has to go on over a restart.
    let drive = Drive::assemble(&reference(), false).expect("assembles");
    let plan = (&[0.0, 0.15][..], &[0.5, -0.5][..]);
    let state = |t, position, velocity, a, b| Restart { t, position, velocity, pressure: [a, b] };
    let start = state(0.0, 0.1, 0.0, 3e5, 3e5);
    let mut never = |_| false;
    let mut run = |restarts: &[Restart]| {
        let sampling = (0.3, 1000.0);
        drive
            .driven()
            .expect("a piston")
            .restarted(plan, sampling, restarts, [ROOM, ROOM], options(1e-9), &mut never)
            .expect("runs")
            .0
    };
    let whole = run(&[start]);
    let at = |name: &str, i: usize| whole[drive.columns().iter().position(|own| own == name).unwrap()][i];
    let own = |i: usize| {
        let of = |name| at(name, i);
        state(of("time_s"), of("position_m"), of("velocity_m_s"), of("pressure_a_pa"), of("pressure_b_pa"))
    };
    let parts = run(&[start, own(70), own(151), own(200)]);
    for (name, (one, other)) in drive.columns().iter().zip(whole.iter().zip(&parts)) {
        if name == "position_m" || name == "pressure_a_pa" || name == "friction_force_n" {
            let size = one.iter().fold(0.0_f64, |most, value| most.max(value.abs()));
            for (i, (a, b)) in one.iter().zip(other).enumerate() {
                assert!((a - b).abs() < 1e-5 * size, "{name}, sample {i}: {a} and {b}");
            }
        }
    }
}

#[test]
fn a_piston_that_rests_under_pressure_stays_where_it_was_measured() {
    // 0.8 bar on 4.9 cm2 are 39 N of 45 N: bristles that were straight at the start would bend by 0.4 mm.
    let drive = Drive::assemble(&reference(), false).expect("assembles");
    let start = Restart { t: 0.0, position: 0.1, velocity: 0.0, pressure: [3.8e5, 3e5] };
    let plan = (&[0.0][..], &[0.0][..]);
    let run = drive.driven().expect("a piston").restarted(
        plan,
        (0.1, 100.0),
        &[start],
        [ROOM; 2],
        options(1e-9),
        &mut |_| false,
    );
    let (columns, failures) = run.expect("runs");
    assert!(failures.is_empty());
    let moved = columns[1].last().expect("samples") - 0.1;
    assert!(moved.abs() < 5e-6, "{moved} m");
}
