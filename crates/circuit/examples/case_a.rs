//! Case A in a loop, for a profiler: `cargo run --release --example case_a`.

use circuit::{Drive, specification};

fn main() {
    let spec: specification::Drive = serde_json::from_str(include_str!("case_a.json")).expect("valid");
    let drive = Drive::assemble(&spec, false).expect("assembles");
    let initial = specification::Initial {
        position_m: 0.05,
        velocity_m_s: 0.0,
        pressure_a_pa: 3e5,
        pressure_b_pa: 3e5,
        temperature_a_k: 293.15,
        temperature_b_k: 293.15,
    };
    let options = ode::Options { rtol: 3e-5, ..Default::default() };
    let rate: f64 = std::env::args().nth(1).map_or(1000.0, |s| s.parse().unwrap());
    let (mut best, mut attempts) = (f64::INFINITY, 0);
    for _ in 0..2000 {
        let start = std::time::Instant::now();
        let run = drive
            .simulate(&[0.0, 1.0], &[0.6, -0.6], (2.0, rate), &initial, options, &mut || false)
            .expect("runs");
        best = best.min(start.elapsed().as_secs_f64());
        attempts = run.statistics.steps + run.statistics.rejected;
    }
    println!(
        "{:.1} us a run at best, {attempts} attempts, {:.0} ns an attempt",
        best * 1e6,
        best * 1e9 / attempts as f64
    );
}
