//! Curves through points, against numbers by hand: published slopes, values, slope and integral of one another,
//! constant beyond the ends, the same curve from the other side.

use physics::curve::{Curve, monotone_slopes};

/// Unequal widths, a rise that flattens, a level piece, a fall.
const POINTS: [[f64; 2]; 5] = [[0.0, 1.0], [1.0, 3.0], [3.0, 4.0], [4.0, 4.0], [6.0, 2.0]];

fn near(got: f64, by_hand: f64) {
    assert!((got - by_hand).abs() < 1e-13, "{got}, by hand {by_hand}");
}

#[test]
fn slopes_are_those_of_fritsch_and_butland() {
    // At x = 1: secants 2 and 1/2 over widths 1 and 2, (3 + 3)/(5/2 + 4/(1/2)) by scipy's PchipInterpolator.
    let by_hand = [0.0, 9.0 / (5.0 / 2.0 + 4.0 * 2.0), 0.0, 0.0, 0.0];
    monotone_slopes(&POINTS).into_iter().zip(by_hand).for_each(|(got, own)| near(got, own));
}

#[test]
fn values_and_integrals_are_those_by_hand() {
    let (smooth, straight) = (Curve::smooth(&POINTS), Curve::straight(&POINTS));
    for [x, y] in POINTS {
        near(smooth.value(x), y);
        near(straight.value(x), y);
    }
    // Middle of a piece: (y0 + y1)/2 + h (d0 - d1)/8. Its integral: h (y0 + y1)/2 + h^2 (d0 - d1)/12.
    let slope = 6.0 / 7.0;
    near(smooth.value(0.5), 2.0 - slope / 8.0);
    near(smooth.value(2.0), 3.5 + slope / 4.0);
    near(smooth.integral(1.0), 2.0 - slope / 12.0);
    near(smooth.integral(6.0), 2.0 - slope / 12.0 + 7.0 + slope / 3.0 + 4.0 + 6.0);
    near(straight.value(2.5), 3.75);
    near(straight.slope(2.5), 0.5);
    near(straight.integral(6.0), 19.0);
    for curve in [smooth, straight] {
        assert_eq!([curve.value(-2.0), curve.value(9.0)], [1.0, 2.0]);
        assert_eq!([curve.slope(-2.0), curve.slope(9.0)], [0.0; 2]);
        near(curve.integral(-2.0), -2.0);
        near(curve.integral(9.0) - curve.integral(6.0), 6.0);
        assert_eq!(curve.largest(), 4.0);
        assert_eq!(curve.places().collect::<Vec<f64>>(), POINTS.map(|[x, _]| x));
    }
}

#[test]
fn slope_integral_and_mirror_belong_to_the_values() {
    let mirrored: Vec<[f64; 2]> = POINTS.iter().rev().map(|[x, y]| [-x, *y]).collect();
    for of in [Curve::smooth, Curve::straight] {
        let (curve, other, h) = (of(&POINTS), of(&mirrored), 1e-6);
        for k in 0..700 {
            let x = -0.5045 + 0.01 * f64::from(k);
            let rise = (curve.value(x + h) - curve.value(x - h)) / (2.0 * h);
            assert!((curve.slope(x) - rise).abs() < 1e-8, "{x}: {} {rise}", curve.slope(x));
            let area = (curve.integral(x + h) - curve.integral(x - h)) / (2.0 * h);
            assert!((curve.value(x) - area).abs() < 1e-7, "{x}: {} {area}", curve.value(x));
            near(other.value(-x), curve.value(x));
            near(other.slope(-x), -curve.slope(x));
        }
    }
}
