//! Cases A and C in a loop, for a profiler: `cargo run --release --example cases -- a 2000`, or `c 20`.

#[path = "../tests/all/support/drive.rs"]
#[allow(dead_code)] // the tests use more
mod drive;

use circuit::{Driven, Servo};
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
    let servo = Servo { kp: 8.0, kd: 0.25, middle: 0.25, amplitude: 0.1, frequency: 0.5 };
    let mut best = f64::INFINITY;
    for _ in 0..runs {
        let start = std::time::Instant::now();
        let rows = if servo_loop {
            Driven::servo(&servo, drive.session(&initial, options), (10.0, rate), &mut |_| false)
                .map(|run| run.0)
        } else {
            let plan = (&[0.0, 1.0][..], &[0.6, -0.6][..]);
            Driven::states(drive.planned(plan, 2.0, &initial, options), (2.0, rate), &mut |_| false)
        };
        best = best.min(start.elapsed().as_secs_f64());
        std::hint::black_box(rows.expect("runs"));
    }
    println!("{:.1} us a run at best", best * 1e6);
}
