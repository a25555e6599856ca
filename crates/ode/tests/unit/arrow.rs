//! Private functions of `linear/arrow.rs`.

use super::*;

/// Checks W times its inverse, with all entries that the shape may have.
#[test]
fn it_is_the_inverse() {
    let mut j = [[0.0; SMALL]; SMALL];
    j[X][V] = 1.0;
    let mut next = 0.37_f64;
    let mut fill = |i: usize, columns: &[usize]| {
        for &k in columns {
            next = (next * 997.0).fract();
            j[i][k] = 20.0 * next - 10.0;
        }
    };
    fill(1, &[0, 1, 3, 5, 6]);
    fill(2, &[0, 1, 2, 3]);
    fill(3, &[0, 1, 2, 3]);
    fill(4, &[0, 1, 4, 5]);
    fill(5, &[0, 1, 4, 5]);
    fill(6, &[0, 1, 3, 5, 6]);
    let mut columns = [[0.0; SMALL]; SMALL];
    let h_gamma = 0.017;
    invert(&j, h_gamma, &mut columns);
    for (l, column) in columns.iter().enumerate() {
        for (i, row) in j.iter().enumerate() {
            let product: f64 = column[i] / h_gamma - (0..SMALL).map(|k| row[k] * column[k]).sum::<f64>();
            let unit = f64::from(u8::from(i == l));
            assert!((product - unit).abs() < 1e-12, "{i}, {l}: {product}");
        }
    }
}

/// Bristles in steady sliding at v, with friction g(v) + viscous v. The slope of this curve decides,
/// independent of the initial response of the bristles.
#[test]
fn friction_that_falls_with_the_speed_lets_an_error_grow() {
    let (mass, stiffness, damping, viscous, v, g) = (2.0, 1e5, 300.0, 40.0, 0.003, 42.0);
    let growth = |slope: f64| {
        let mut j = [[0.0; SMALL]; SMALL];
        (j[Z][V], j[Z][Z]) = (slope * v / g, -stiffness * v / g);
        j[V][V] = -(damping * j[Z][V] + viscous) / mass;
        j[V][Z] = -(stiffness + damping * j[Z][Z]) / mass;
        super::growth(&j)
    };
    assert!(growth(-41.0) > 0.0 && growth(-39.0) < 0.0, "{} {}", growth(-41.0), growth(-39.0));
    let mut dry = [[0.0; SMALL]; SMALL];
    for (slope, grows) in [(-41.0, true), (-39.0, false)] {
        dry[V][V] = -(slope + viscous) / mass;
        assert_eq!(super::growth(&dry) > 0.0, grows);
    }
}
