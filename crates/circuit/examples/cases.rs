//! Cases A and C in a loop, for a profiler: `cargo run --release --example cases -- a 2000`, or `c 20`.

#[path = "../tests/all/support/drive.rs"]
#[allow(dead_code)] // the tests use more
mod drive;

use circuit::{Look, Sampling};
use drive::Drive;

fn main() {
    let spec: drive::Spec = serde_json::from_str(include_str!("case_a.json")).expect("valid");
    let drive = Drive::assemble(&spec, false).expect("assembles");
    let asked: Vec<String> = std::env::args().collect();
    let servo_loop = asked.get(1).is_some_and(|case| case == "c");
    let runs: u32 = asked.get(2).map_or(2000, |s| s.parse().expect("a number of runs"));
    let rate: f64 = asked.get(3).map_or(1000.0, |s| s.parse().expect("a sample rate in Hz"));
    let initial = drive::Initial {
        position_m: if servo_loop { 0.25 } else { 0.05 },
        velocity_m_s: 0.0,
        pressure_a_pa: 3e5,
        pressure_b_pa: 3e5,
        temperature_a_k: 293.15,
        temperature_b_k: 293.15,
        contact_age_s: 0.0,
    };
    let options = ode::Options { rtol: if servo_loop { 1e-3 } else { 1e-4 }, ..Default::default() };
    let omega = std::f64::consts::PI;
    let mut servo = |t: f64, seen: &[f64]| {
        let (target, speed) = (0.25 + 0.1 * (omega * t).sin(), 0.1 * omega * (omega * t).cos());
        Some((8.0 * (target - seen[0]) + 0.25 * (speed - seen[1])).clamp(-1.0, 1.0))
    };
    let mut best = f64::INFINITY;
    for _ in 0..runs {
        let start = std::time::Instant::now();
        let rows = if servo_loop {
            let mut session = drive.session(&initial, options);
            let column = |name: &str| session.assembly.columns().iter().position(|own| own.ends_with(name));
            let columns = ["position_m", "velocity_m_s"].map(|name| column(name).expect("a column")).to_vec();
            let input = session.inputs().iter().position(|own| own.name.ends_with("command"));
            let sampling = Sampling {
                columns,
                input: input.expect("a command"),
                period: 1.0 / rate,
                periods: (10.0 * rate) as usize,
            };
            session.control(&sampling, &mut servo, &mut Look::new(&mut |_| false))
        } else {
            let plan = (&[0.0, 1.0][..], &[0.6, -0.6][..]);
            drive::states(drive.planned(plan, 2.0, &initial, options), (2.0, rate))
        };
        best = best.min(start.elapsed().as_secs_f64());
        std::hint::black_box(rows.expect("runs"));
    }
    println!("{:.1} us a run at best", best * 1e6);
}
