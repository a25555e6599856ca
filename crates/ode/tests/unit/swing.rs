//! Private functions of `swing.rs`.

use super::{FREE_SWINGS, LEAST_SHARE, LOOSE_RTOL, Swing};

/// Returns the fraction after this many half swings. Each is weaker by this ratio, and is followed by a
/// rest and a small tremble.
fn share(swings: f64, ratio: f64, rest: f64, rtol: f64) -> f64 {
    let (mut swing, mut v0) = (Swing::new(0, 0.5, rtol), 0.0);
    for k in 0..=swings as i32 {
        let peak = (-ratio).powi(k);
        let missed = if k % 3 == 0 { 1.0 } else { 0.9 };
        let course = [(0.3, 0.5), (0.3, missed), (0.3, 1e-3), (rest, 0.0), (0.01, -1e-9), (0.01, 1e-9)];
        for (h, v) in course {
            swing.step(h, v0, v * peak);
            v0 = v * peak;
        }
    }
    swing.share()
}

#[test]
fn what_bounces_on_is_solved_more_accurately_and_what_rests_or_loses_its_energy_is_not() {
    let (many, loose) = (4.0 * FREE_SWINGS, LOOSE_RTOL);
    assert!((share(many, 1.0, 0.0, loose) - 0.5).abs() < 1e-12);
    assert_eq!(share(100.0 * many, 1.0, 0.0, loose), LEAST_SHARE);
    for (swings, ratio, rest, rtol) in [
        (FREE_SWINGS, 1.0, 0.0, loose),
        (many, 1.0, 0.0, 0.2 * loose),
        (many, 1.0, 10.0, loose),
        (many, 0.9, 0.0, loose),
    ] {
        assert_eq!(share(swings, ratio, rest, rtol), 1.0);
    }
}
