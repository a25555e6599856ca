//! Flow through a restriction by ISO 6358: choked below the critical ratio, elliptic above it, zero
//! without a pressure difference, from high to low pressure in both directions, and as large as
//! manufacturers print it.

use math::{Dual, Real};
use physics::IdealGas;
use physics::constants::{RHO_0, T_0};
use physics::flow::{Iso6358, in_series};

fn air() -> IdealGas<f64> {
    IdealGas::new(1.4, 287.05)
}

fn restriction(c: f64, b: f64, m: f64, linear_above: f64) -> Iso6358<f64> {
    Iso6358::for_gas(c, b, m, linear_above, m == 0.5, &air(), true)
}

/// kg/s from (p1 Pa, T1 K) to (p2, T2), fully open.
fn flow(law: &Iso6358<f64>, (p1, t1): (f64, f64), (p2, t2): (f64, f64)) -> f64 {
    law.mass_flow(1.0, p1, 1.0 / t1.sqrt(), p2, 1.0 / t2.sqrt()).0
}

/// phi and its slope.
fn phi(law: &Iso6358<f64>, r: f64) -> (f64, f64) {
    let phi = law.phi(Dual::<f64, 1>::variable(r, 0));
    (phi.re, phi.eps[0])
}

#[test]
fn a_catalogue_prints_what_the_law_gives() {
    // SMC, 5-port solenoid valves SY, 20 degC, 0.6 to 0.5 MPa gauge (0.1 MPa ambient): C, b, l/min ANR.
    let catalogue = [(1.1, 0.28, 276.0), (2.8, 0.37, 746.0), (4.5, 0.28, 1130.0), (10.0, 0.29, 2527.0)];
    let litres = |law: &Iso6358<f64>, p1: f64, p2: f64| flow(law, (p1, T_0), (p2, T_0)) / RHO_0 * 6e4;
    for (c, b, printed) in catalogue {
        let law = restriction(c * 1e-8, b, 0.5, 0.999);
        let q = litres(&law, 7e5, 6e5);
        assert!((q - printed).abs() < 0.5, "C {c}, b {b}: {q} l/min, printed {printed}");
    }
    // SMC's worked example: C = 2, b = 0.3, 0.4 to 0.3 MPa gauge: 420 l/min of at most 600.
    let law = restriction(2e-8, 0.3, 0.5, 0.999);
    assert!((litres(&law, 5e5, 4e5) - 420.0).abs() < 0.5);
    assert!((litres(&law, 5e5, 1e5) - 600.0).abs() < 1e-9);
}

#[test]
fn choked_flow_depends_on_the_upstream_side_alone() {
    let law = restriction(2e-8, 0.3, 0.5, 0.999);
    // C p1 rho0 sqrt(T0/T1) with p1 = 7 bar, T1 = 4 T0, by hand.
    let by_hand = 2e-8 * 7e5 * 1.185 / 2.0;
    for p2 in [1.0, 1e5, 0.29 * 7e5] {
        for t2 in [200.0, 400.0] {
            let m_dot = flow(&law, (7e5, 4.0 * T_0), (p2, t2));
            assert!((m_dot / by_hand - 1.0).abs() < 1e-15, "p2 = {p2}: {m_dot} {by_hand}");
        }
    }
    assert!(flow(&law, (7e5, T_0), (0.31 * 7e5, T_0)) < flow(&law, (7e5, T_0), (0.0, T_0)));
}

#[test]
fn subsonic_flow_is_an_ellipse() {
    // (r, phi) for b = 0.28: a quarter of an ellipse with half axes 0.72 and 1.
    let law = restriction(1e-8, 0.28, 0.5, 0.9999);
    for angle in [0.2, 0.7, 1.2, 1.5] {
        let (s, c) = f64::sin_cos(angle);
        assert!((phi(&law, 0.28 + 0.72 * s).0 - c).abs() < 1e-14);
    }
    // A subsonic index of 1 makes a parabola of it.
    let law = restriction(1e-8, 0.28, 1.0, 0.9999);
    assert!((phi(&law, 0.28 + 0.72 * 0.6).0 - 0.64).abs() < 1e-15);
}

#[test]
fn the_flow_is_odd_in_its_ends() {
    for m in [0.5, 0.47, 0.6] {
        let law = restriction(2e-8, 0.3, m, 0.999);
        for p1 in [1e5, 3e5, 6.9999e5, 7.0001e5, 7.1e5] {
            let (one, two) = ((p1, 260.0), (7e5, 310.0));
            let (forth, back) = (flow(&law, one, two), flow(&law, two, one));
            assert_eq!(forth.to_bits(), (-back).to_bits());
            assert_eq!(forth > 0.0, p1 > 7e5, "from high to low pressure");
        }
        assert_eq!(flow(&law, (7e5, 260.0), (7e5, 310.0)), 0.0);
    }
}

#[test]
fn value_and_slope_are_continuous_where_the_pieces_meet() {
    for (b, m, beta) in [(0.3, 0.5, 0.999), (0.1, 0.5, 0.99), (0.45, 0.6, 0.9999)] {
        let law = restriction(1e-8, b, m, beta);
        let step = 1e-9;
        let (below, above) = (phi(&law, b), phi(&law, b + step));
        assert_eq!(below, (1.0, 0.0));
        assert!((above.0 - 1.0).abs() < 1e-15 && above.1.abs() < 1e-7, "at b: {above:?}");
        let (below, above) = (phi(&law, beta), phi(&law, beta * (1.0 + 1e-14)));
        assert!((below.0 - above.0).abs() < 1e-10, "at beta: {below:?} {above:?}");
        assert!(phi(&law, 1.0).0 == 0.0);
        // Falls all the way: no piece turns the flow round.
        let grid: Vec<f64> = (0..=2000).map(|i| phi(&law, f64::from(i) / 2000.0).0).collect();
        assert!(grid.windows(2).all(|w| w[1] <= w[0]));
        assert!((0..=2000).all(|i| phi(&law, f64::from(i) / 2000.0).1.is_finite()));
    }
}

#[test]
fn a_general_index_of_one_half_is_the_square_root() {
    let special = restriction(2e-8, 0.3, 0.5, 0.999);
    let general = Iso6358 { elliptic: false, ..special.clone() };
    for i in 0..=1000 {
        let r = f64::from(i) / 1000.0;
        let (one, two) = (phi(&special, r), phi(&general, r));
        assert!((one.0 - two.0).abs() < 1e-15, "{r}: {one:?} {two:?}");
        assert!((one.1 - two.1).abs() <= 1e-13 * one.1.abs(), "{r}: {one:?} {two:?}");
    }
}

#[test]
fn derivatives_are_those_of_the_values() {
    let law = restriction(2e-8, 0.3, 0.5, 0.999);
    let general = Iso6358 { elliptic: false, ..restriction(2e-8, 0.3, 0.46, 0.999) };
    for law in [law, general] {
        for (p1, p2) in [(7e5, 1e5), (7e5, 5e5), (7e5, 6.9996e5), (2e5, 7e5), (5e5, 7e5)] {
            let point = [1.0, p1, 0.058, p2, 0.062];
            for i in 0..5 {
                let at = |change: f64| {
                    let mut q = point;
                    q[i] *= 1.0 + change;
                    law.mass_flow(q[0], q[1], q[2], q[3], q[4]).0
                };
                let h = 1e-6;
                let difference = (at(h) - at(-h)) / (2.0 * h * point[i]);
                let mut q = point.map(Dual::<f64, 1>::c);
                q[i] = Dual::variable(point[i], 0);
                let dual = law.mass_flow(q[0], q[1], q[2], q[3], q[4]).0.eps[0];
                let scale = at(0.0).abs() / point[i];
                assert!((dual - difference).abs() < 1e-5 * dual.abs() + 1e-8 * scale, "{p1} {p2} {i}");
            }
        }
    }
}

/// Choked mass flow of an ideal gas through a nozzle of 1 m2 from (p, T): textbook form.
fn nozzle(gas: &IdealGas<f64>, p: f64, t: f64) -> f64 {
    let k = gas.heat_capacity_ratio;
    p * (k / (gas.gas_constant * t)).sqrt() * (2.0 / (k + 1.0)).powf((k + 1.0) / (2.0 * (k - 1.0)))
}

#[test]
fn another_gas_flows_as_through_a_nozzle() {
    let choked = |gas: &IdealGas<f64>| {
        let law = Iso6358::for_gas(2e-8, 0.3, 0.5, 0.999, true, gas, false);
        flow(&law, (7e5, 350.0), (1e5, 300.0))
    };
    let (helium, argon, steam) =
        (IdealGas::new(5.0 / 3.0, 2077.0), IdealGas::new(5.0 / 3.0, 208.1), IdealGas::new(1.3, 461.5));
    for (one, two) in [(&helium, &argon), (&helium, &steam), (&steam, &air())] {
        let expected = nozzle(one, 7e5, 350.0) / nozzle(two, 7e5, 350.0);
        assert!((choked(one) / choked(two) / expected - 1.0).abs() < 1e-13);
    }
    // The standard's air is humid: 1.185 kg/m3 against 100 kPa/(R T0) of dry air, 0.3 %.
    let humid = flow(&restriction(2e-8, 0.3, 0.5, 0.999), (7e5, 350.0), (1e5, 300.0));
    let ratio = choked(&air()) / humid;
    assert!((ratio - 1e5 / (287.05 * T_0) / RHO_0).abs() < 1e-13 && (ratio - 1.0).abs() < 0.003);
}

/// C in dm3/(s bar) and b of a tube, by diameter, mm, and length, m, as the circuit's `tube` has them.
fn tube(d: f64, length: f64) -> [f64; 2] {
    let d = 1e-3 * d;
    let c = 0.029 * d * d / (length / d.powf(1.25) + 510.0).sqrt();
    [1e8 * c, 474.0 * c / (d * d)]
}

/// Flow through two paths as a share of p1, at p2/p1 = r, from the pressure between them: that at which both pass the same.
fn through([c1, b1]: [f64; 2], [c2, b2]: [f64; 2], r: f64) -> f64 {
    let phi = |b: f64, r: f64| (1.0 - ((r - b).max(0.0) / (1.0 - b)).powi(2)).sqrt();
    let (mut low, mut high) = (r, 1.0);
    for _ in 0..200 {
        let middle = 0.5 * (low + high);
        let into = c1 * phi(b1, middle);
        let out = c2 * middle * phi(b2, r / middle);
        if into > out { low = middle } else { high = middle }
    }
    c1 * phi(b1, low)
}

#[test]
fn paths_in_series_choke_as_the_pressure_between_them_says() {
    let (mut first, mut second) = (0, 0);
    for c2 in [0.1, 0.5, 1.0, 1.7, 20.0] {
        for b1 in [0.02, 0.2, 0.35, 0.528, 0.9] {
            for b2 in [0.02, 0.3, 0.528, 0.9] {
                let [c, b] = in_series([1.0, b1], [c2, b2]);
                let exact = through([1.0, b1], [c2, b2], 1e-3);
                assert!((c / exact - 1.0).abs() < 1e-12, "{c2} {b1} {b2}: {c} {exact}");
                assert!(b > 0.0 && b < 1.0, "{c2} {b1} {b2}: {b}");
                let count = if c < 1.0 { &mut second } else { &mut first };
                *count += 1;
            }
        }
    }
    assert!(first > 10 && second > 10);
}

#[test]
fn a_valve_and_a_tube_pass_what_the_pressure_between_them_says() {
    let valve = [2.0, 0.3];
    for (length, at_6_of_7) in [(0.5, 4.5e-3), (1.0, 2.9e-3)] {
        let tube = tube(4.0, length);
        for [one, two] in [[valve, tube], [tube, valve]] {
            let [c, b] = in_series(one, two);
            let error = |r: f64| {
                let q = (r - b).max(0.0) / (1.0 - b);
                c * (1.0 - q * q).sqrt() / through(one, two, r) - 1.0
            };
            let worst = (0..99).map(|k| error(0.01 * f64::from(k)).abs()).fold(0.0, f64::max);
            assert!(worst < 0.0105, "{length} m: {worst}");
            assert!(error(6.0 / 7.0).abs() < 6e-3);
            if one == valve {
                assert!((error(6.0 / 7.0).abs() - at_6_of_7).abs() < 2e-4, "{}", error(6.0 / 7.0));
            }
        }
    }
    // Filling goes through the valve first, venting through the tube.
    let one = tube(4.0, 1.0);
    let (fill, vent) = (in_series(valve, one)[0], in_series(one, valve)[0]);
    assert!((fill - 1.067).abs() < 5e-4 && (vent - 1.131).abs() < 5e-4, "{fill} {vent}");
}
