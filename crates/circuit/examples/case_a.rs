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
        contact_age_s: 0.0,
    };
    let options = ode::Options { rtol: 1e-4, ..Default::default() };
    let rate: f64 = std::env::args().nth(1).map_or(1000.0, |s| s.parse().expect("a sample rate in Hz"));
    let mut best = f64::INFINITY;
    for _ in 0..2000 {
        let start = std::time::Instant::now();
        let sampling = (2.0, rate);
        let rows = drive.states(&[0.0, 1.0], &[0.6, -0.6], sampling, &initial, options, &mut |_| false);
        best = best.min(start.elapsed().as_secs_f64());
        std::hint::black_box(rows.expect("runs"));
    }
    println!("{:.1} us a run at best", best * 1e6);
}
