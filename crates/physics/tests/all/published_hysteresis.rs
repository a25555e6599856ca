//! Laws along a given motion, against what their authors publish and what follows from it in closed form: Dahl and
//! Bouc-Wen loops that do not depend on the rate, the frictional lag of LuGre, the frictional memory of Armstrong.
//! Sources: [dahl1968], [wen1976], [canudas1995] (numbers of its table: sigma0 = 1e5 N/m, sigma1 = sqrt(1e5) N s/m,
//! sigma2 = 0.4 N s/m, Fc = 1 N, Fs = 1.5 N, vs = 1 mm/s), [armstrong1994].

use crate::support::*;
use physics::friction::{At, Contact};

fn contact(key: &str, values: &[(&'static str, f64)]) -> Contact<f64> {
    Contact::from(law(registered(key), &with(values)))
}

/// (x, v, F) along v(t) from x = 0 and slack bristles, at the ends of `steps` Runge-Kutta steps of `dt`.
fn along(contact: &Contact<f64>, dt: f64, steps: usize, v: impl Fn(f64) -> f64) -> Vec<[f64; 3]> {
    let mut p = Point::at_rest(contact);
    let n = p.inner.len();
    let rates = |p: &Point, z: &[f64], v: f64| {
        evaluate(contact, &Point { v, mode: v.signum(), inner: z.to_vec(), ..p.clone() })
    };
    let mut x = 0.0;
    let mut rows = Vec::new();
    for k in 0..steps {
        let t = k as f64 * dt;
        // At its end a step sees the velocity from the left, so that a jump may lie between two steps.
        let (start, middle, end) = (v(t), v(t + 0.5 * dt), v(t + dt * (1.0 - 1e-12)));
        let step = |rate: &[f64], h: f64| -> Vec<f64> { (0..n).map(|i| p.inner[i] + h * rate[i]).collect() };
        let k1 = rates(&p, &p.inner, start).1;
        let k2 = rates(&p, &step(&k1, 0.5 * dt), middle).1;
        let k3 = rates(&p, &step(&k2, 0.5 * dt), middle).1;
        let k4 = rates(&p, &step(&k3, dt), end).1;
        let mean: Vec<f64> = (0..n).map(|i| (k1[i] + 2.0 * (k2[i] + k3[i]) + k4[i]) / 6.0).collect();
        p.inner = step(&mean, dt);
        x += dt * (start + 4.0 * middle + end) / 6.0;
        rows.push([x, end, rates(&p, &p.inner, end).0]);
    }
    rows
}

/// The greatest difference of the force from a closed form in x, N.
fn apart(rows: &[[f64; 3]], closed: impl Fn(f64) -> f64) -> f64 {
    rows.iter().map(|[x, _, force]| (force - closed(*x)).abs()).fold(0.0, f64::max)
}

const FC: f64 = 30.0;
const SIGMA_0: f64 = 1e5;

#[test]
fn dahl_from_rest_is_an_exponential_or_a_hyperbola_of_the_path() {
    // dF/dx = sigma0 (1 - F/Fc)^i from F = 0, with s = sigma0 x/Fc: Fc (1 - e^-s) for i = 1, Fc s/(1 + s) for i = 2.
    for speed in [1e-3, 0.1] {
        let run = |exponent: f64| {
            let dahl = contact("dahl", &[("viscous", 0.0), ("dahl_exponent", exponent)]);
            along(&dahl, 1e-6 / speed, 2000, |_| speed)
        };
        assert!(apart(&run(1.0), |x| FC * (1.0 - (-SIGMA_0 * x / FC).exp())) < 1e-9);
        assert!(apart(&run(2.0), |x| FC * SIGMA_0 * x / (FC + SIGMA_0 * x)) < 1e-9);
    }
}

#[test]
fn dahl_loops_are_the_same_at_any_rate() {
    // Between x = +-X the upper branch is Fc - (Fc + Fm) exp(-sigma0 (x + X)/Fc), so that its end Fm = Fc tanh(sigma0 X/Fc),
    // and a cycle turns 4 Fc (X - Fm/sigma0) into heat.
    let dahl = contact("dahl", &[("viscous", 0.0)]);
    let amplitude = 2e-4;
    let top = FC * (SIGMA_0 * amplitude / FC).tanh();
    for frequency in [0.5, 5.0, 50.0] {
        const CYCLE: usize = 4000;
        let (w, dt) = (std::f64::consts::TAU * frequency, 1.0 / frequency / CYCLE as f64);
        let rows = along(&dahl, dt, 12 * CYCLE, |t| amplitude * w * (w * t).cos());
        let last = &rows[11 * CYCLE - 1..];
        let upper: Vec<[f64; 3]> = last.iter().filter(|row| row[1] > 1e-9 * w).copied().collect();
        let branch = |x: f64| FC - (FC + top) * (-SIGMA_0 * (x + amplitude) / FC).exp();
        let off = apart(&upper, branch);
        assert!(off < 1e-6, "{frequency} Hz: {off} N off the closed form");
        let heat: f64 = last.windows(2).map(|r| 0.5 * (r[0][2] + r[1][2]) * (r[1][0] - r[0][0])).sum();
        let by_hand = 4.0 * FC * (amplitude - top / SIGMA_0);
        assert!((heat / by_hand - 1.0).abs() < 1e-5, "{frequency} Hz: {heat} J, by hand {by_hand} J");
    }
}

#[test]
fn bouc_wen_loops_have_their_closed_forms() {
    // n = 1, with f = F/Fc, s = sigma0 x/Fc, c = 2 b - 1. Loading: df/ds = 1 - f. Unloading: df/ds = 1 + c f for falling s,
    // so from f0 it follows [(1 + c f0) exp(-c s) - 1]/c and is slack after ln(1 + c f0)/c.
    let (shape, amplitude, speed) = (0.8, 2e-4, 1e-2);
    let c = 2.0 * shape - 1.0;
    let rise = |s: f64| 1.0 - (-s).exp();
    let dt = amplitude / speed / 1000.0;
    let there_and_back = |t: f64| if t < 1000.0 * dt { speed } else { -speed };
    let bouc_wen = contact("bouc-wen", &[("viscous", 0.0), ("loop_shape", shape)]);
    let rows = along(&bouc_wen, dt, 3000, there_and_back);
    assert!(apart(&rows[..1000], |x| FC * rise(SIGMA_0 * x / FC)) < 1e-9);
    let end = rise(SIGMA_0 * amplitude / FC);
    let slack = (1.0 + c * end).ln() / c;
    let falling = |x: f64| {
        let s = SIGMA_0 * (amplitude - x) / FC;
        FC * if s < slack { ((1.0 + c * end) * (-c * s).exp() - 1.0) / c } else { -rise(s - slack) }
    };
    let off = apart(&rows[1000..], falling);
    assert!(off < 1e-6, "{off} N");
}

#[test]
fn bouc_wen_of_exponent_2_rises_as_a_hyperbolic_tangent_and_unloads_straight() {
    // df/ds = 1 - f^2; with b = 1/2 unloading has the stiffness sigma0.
    let values = [("viscous", 0.0), ("bouc_wen_exponent", 2.0), ("loop_shape", 0.5)];
    let bouc_wen = contact("bouc-wen", &values);
    let rows = along(&bouc_wen, 1e-4, 1000, |_| 5e-3);
    assert!(apart(&rows, |x| FC * (SIGMA_0 * x / FC).tanh()) < 1e-9);
    let mut p = Point { v: -5e-3, inner: vec![2.9e-4], ..Point::at_rest(&bouc_wen) };
    for z in [2.9e-4, 1e-4, 1e-6] {
        p.inner[0] = z;
        assert!((evaluate(&bouc_wen, &p).1[0] / p.v - 1.0).abs() < 1e-12);
    }
}

/// LuGre with the numbers of [canudas1995].
fn lugre() -> Contact<f64> {
    let values = [
        ("coulomb", 1.0),
        ("breakaway", 1.5),
        ("stribeck_velocity", 1e-3),
        ("viscous", 0.4),
        ("bristle_damping", 1e5_f64.sqrt()),
    ];
    contact("lugre", &values)
}

#[test]
fn friction_lags_behind_the_velocity_and_the_loop_widens_with_frequency() {
    // The velocity varies without turning round; friction is higher while it grows than while it falls, the more the
    // faster it varies.
    let lugre = lugre();
    let widths: Vec<f64> = [1.0, 10.0, 25.0]
        .into_iter()
        .map(|w| {
            const CYCLE: usize = 20_000;
            let dt = std::f64::consts::TAU / w / CYCLE as f64;
            let rows = along(&lugre, dt, 2 * CYCLE, |t| 1.5e-3 - 1.4e-3 * (w * t).cos());
            let last = &rows[CYCLE..];
            let (growing, falling) = last.split_at(CYCLE / 2);
            // At the same velocity, away from the ends: mirrored in time.
            let pairs = growing.iter().zip(falling.iter().rev().skip(1)).skip(100).take(CYCLE / 2 - 200);
            let widths: Vec<f64> = pairs
                .map(|(up, down)| {
                    assert!((up[1] - down[1]).abs() < 1e-6, "{up:?} {down:?}");
                    up[2] - down[2]
                })
                .collect();
            widths.iter().sum::<f64>() / widths.len() as f64
        })
        .collect();
    println!("mean widths {widths:?} N");
    assert!(widths[0] > 0.0 && widths[1] > 2.0 * widths[0] && widths[2] > 1.2 * widths[1], "{widths:?}");
}

#[test]
fn a_small_change_of_velocity_is_followed_after_a_relaxation_length() {
    // LuGre linearised in steady sliding at v0: tau d(dz)/dt = -dz + g' dv/sigma0 with tau = g/(sigma0 v0). So after a small
    // step dv the force jumps by (Fv + sigma1 g'/(sigma0 tau)) dv and goes on to (Fv + g') dv.
    let lugre = lugre();
    let (v0, dv) = (5e-4_f64, 1e-8);
    let g = |v: f64| 1.0 + 0.5 * (-(v / 1e-3).powi(2)).exp();
    let slope = -2.0 * v0 / 1e-6 * 0.5 * (-(v0 / 1e-3).powi(2)).exp();
    let tau = g(v0) / 1e5 / v0;
    let mut p = Point { v: v0 + dv, inner: vec![g(v0) / 1e5], ..Point::at_rest(&lugre) };
    let before = g(v0) + 0.4 * v0;
    let jump = evaluate(&lugre, &p).0 - before;
    let by_hand = (0.4 + 1e5_f64.sqrt() * slope / 1e5 / tau) * dv;
    assert!((jump / by_hand - 1.0).abs() < 1e-4, "{jump} {by_hand}");
    let dt = tau / 1000.0;
    for _ in 0..1000 {
        implicit(&lugre, &mut p, dt, 0.5, &mut |_, _| {});
    }
    // After tau the deflection has gone 1 - 1/e of its way.
    let way = (p.inner[0] - g(v0) / 1e5) / (slope * dv / 1e5);
    assert!((way - (1.0 - (-1.0_f64).exp())).abs() < 1e-4, "{way}");
}

#[test]
fn armstrong_remembers_the_velocity_for_its_memory_time() {
    // From 2 mm/s to 50 mm/s at once: u = v2 + (v1 - v2) exp(-t/tau), and friction falls as Fc + (Fs - Fc)/[1 + (u/vs)^2].
    let armstrong = contact("armstrong", &[]);
    let (v1, v2, tau, vs) = (2e-3, 50e-3, 0.02, 0.02);
    let mut p = Point { v: v2, mode: 1.0, inner: vec![0.0, v1, 0.0, 0.0], ..Point::at_rest(&armstrong) };
    let dt = 1e-5;
    for k in 0..=10_000 {
        let t = f64::from(k) * dt;
        let u: f64 = v2 + (v1 - v2) * (-t / tau).exp();
        let by_hand = 30.0 + 15.0 / (1.0 + (u / vs).powi(2)) + 40.0 * v2;
        let force = evaluate(&armstrong, &p).0;
        assert!((force - by_hand).abs() < 1e-4, "{t} s: {force} {by_hand}");
        implicit(&armstrong, &mut p, dt, 0.5, &mut |_, _| {});
    }
}

#[test]
fn armstrong_keeps_its_force_at_the_arrival_and_recovers_with_the_stop() {
    // Slip at u for long, of which 0.2 of Fs - Fc was lost before: E = 0.8 (Fs - Fc)/[1 + (u/vs)^2] goes on in stick.
    let armstrong = contact("armstrong", &[("recovery_time", 3.0)]);
    for u in [0.0, 5e-3, 0.02, 0.3] {
        let mut inner = vec![0.0, u, 0.0, 0.2];
        let at = At::at_rest();
        let arrival = 15.0 * 0.8 / (1.0 + (u / 0.02_f64).powi(2));
        assert_eq!(armstrong.next_mode(1.0, &at, &mut inner), 0.0);
        for stood in [0.0, 0.5, 3.0, 1e3] {
            let by_hand = 30.0 + arrival + (15.0 - arrival) * stood / (stood + 3.0);
            for spring in [0.0, 10.0, -10.0] {
                (inner[0], inner[2]) = (spring / 1e5, stood);
                let left = armstrong.event(&at, &inner, 0.0);
                assert!((left - (by_hand - spring.abs())).abs() < 1e-12, "{u} m/s, {stood} s: {left} N");
            }
            // It breaks away towards its deflection, with the level that it stood at, and no further rise.
            let mut slips = inner.clone();
            assert_eq!(armstrong.next_mode(0.0, &at, &mut slips), -1.0);
            let p = Point {
                v: -1e-12,
                mode: -1.0,
                inner: vec![0.0, 0.0, slips[2], slips[3]],
                ..Point::at_rest(&armstrong)
            };
            let (force, rates) = evaluate(&armstrong, &p);
            assert!((force + by_hand).abs() < 1e-9, "{u} m/s, {stood} s: {force} N, by hand {by_hand} N");
            assert_eq!(rates[2..], [0.0, 0.0]);
        }
    }
}
