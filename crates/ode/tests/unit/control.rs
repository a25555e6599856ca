//! Private functions of `control.rs`.

#[test]
fn cube_root_is_good_to_a_millionth() {
    for i in -120..200 {
        let x = 10_f64.powf(f64::from(i) * 0.1);
        let y = super::inverse_cube_root(x);
        assert!((y * x.cbrt() - 1.0).abs() < 1e-6, "{x}: {y}");
    }
}

#[test]
fn fifth_root_is_good_to_a_millionth() {
    for i in -120..200 {
        let x = 10_f64.powf(f64::from(i) * 0.1);
        let y: f64 = super::inverse_fifth_root(x);
        assert!((y * x.powf(0.2) - 1.0).abs() < 1e-6, "{x}: {y}");
    }
}
