//! What every friction law promises, for every law in the registry: finite everywhere, derivatives
//! that belong to its values, lanes equal to scalars, odd in the direction of motion, a Stribeck
//! curve in steady sliding, seal lips that add up, and no energy from nothing.

use math::{Dual, Lanes, Real};
use physics::friction::{AnyLaw, At, LAWS, Levels, Meta, SealLips};
use std::collections::BTreeMap;

/// A value for each name of a parameter; a law takes those that it lists.
type Set = BTreeMap<&'static str, f64>;

const BASE: [(&str, f64); 8] = [
    ("coulomb", 30.0),
    ("breakaway", 45.0),
    ("stribeck_velocity", 0.02),
    ("stribeck_exponent", 2.0),
    ("viscous", 40.0),
    ("bristle_stiffness", 1e5),
    ("bristle_damping", 300.0),
    ("damping_fade_velocity", f64::INFINITY),
];

fn with(changes: &[(&'static str, f64)]) -> Set {
    BASE.into_iter().chain(changes.iter().copied()).collect()
}

/// The reference set, one with a general exponent, one that fades, and one where nothing is round.
fn sets() -> [Set; 4] {
    [
        with(&[]),
        with(&[("stribeck_exponent", 0.7), ("viscous", 0.0)]),
        with(&[("damping_fade_velocity", 0.1), ("breakaway", 30.0)]),
        with(&[
            ("coulomb", 3.7),
            ("breakaway", 9.1),
            ("stribeck_velocity", 0.0031),
            ("stribeck_exponent", 1.3),
            ("viscous", 11.3),
            ("bristle_stiffness", 7.7e4),
        ]),
    ]
}

fn law(meta: &Meta, set: &Set) -> AnyLaw<f64> {
    let law = AnyLaw::build(meta.key, &mut |p| {
        let value = set.get(p.key).copied().or(p.default);
        let value = value.unwrap_or_else(|| panic!("a value for the new parameter {}", p.key));
        assert!(p.bounds.contain(value) || value.is_infinite(), "{}", p.key);
        value
    });
    law.expect("registered")
}

fn each_law(mut test: impl FnMut(&Meta, &Set, AnyLaw<f64>)) {
    for meta in LAWS {
        for set in &sets() {
            test(meta, set, law(meta, set));
        }
    }
}

/// One evaluation: velocity, applied force, bristles, mode.
#[derive(Clone, Debug)]
struct Point {
    v: f64,
    applied: f64,
    z: Vec<f64>,
    mode: f64,
}

fn lift<S: Real + From<f64>>(levels: &Levels<f64>) -> Levels<S> {
    Levels { coulomb: S::from(levels.coulomb), breakaway: S::from(levels.breakaway) }
}

fn at<S: Real>(v: S, applied: S, prepared: S) -> At<S> {
    At { v, x: S::zero(), gauge_a: S::zero(), gauge_b: S::zero(), applied, prepared }
}

/// (friction force, rates of the bristles).
fn evaluate(law: &AnyLaw<f64>, p: &Point) -> (f64, Vec<f64>) {
    let mut dz = vec![0.0; p.z.len()];
    let at = at(p.v, p.applied, law.prepare(p.v));
    let force = law.force(&at, &law.levels(), &p.z, &mut dz, p.mode);
    (force, dz)
}

/// Velocities of both signs over many decades, with every mode and bristles up to their limit.
fn grid(meta: &Meta) -> Vec<Point> {
    let mut points = Vec::new();
    let speeds = [0.0, 1e-300, 1e-15, 1e-9, 1e-6, 1e-4, 3e-3, 0.02, 0.3, 2.0, 50.0, 1e3];
    let modes: &[f64] = if meta.sticks { &[-1.0, 0.0, 1.0] } else { &[0.0] };
    for v in speeds.iter().flat_map(|v| [*v, -v]) {
        for share in [-1.0, -0.4, 0.0, 1e-9, 0.9] {
            for &mode in modes {
                let z = vec![share * 4.5e-4; meta.states.len()];
                points.push(Point { v, applied: 40.0 * share, z, mode });
            }
        }
    }
    points
}

#[test]
fn finite_everywhere() {
    each_law(|meta, _, law| {
        for p in grid(meta) {
            let (force, dz) = evaluate(&law, &p);
            assert!(force.is_finite() && dz.iter().all(|r| r.is_finite()), "{} {p:?}", meta.key);
            let v = Dual::<f64, 1>::variable(p.v, 0);
            let z: Vec<_> = p.z.iter().map(|&z| Dual::c(z)).collect();
            let mut dz = z.clone();
            let at = at(v, Dual::c(p.applied), law.prepare(v));
            let force = law.force(&at, &lift(&law.levels()), &z, &mut dz, p.mode);
            let slopes = dz.iter().chain([&force]).map(|d| d.eps[0]);
            assert!(slopes.into_iter().all(f64::is_finite), "{} {p:?}", meta.key);
        }
    });
}

#[test]
fn derivatives_are_those_of_the_values() {
    each_law(|meta, _, law| {
        // Away from v = 0, where |v| has its kink; there each mode is smooth by design.
        for p in grid(meta).into_iter().filter(|p| p.v.abs() > 1e-5 && p.v.abs() < 100.0) {
            for i in 0..2 + p.z.len() {
                let moved = |change: f64| {
                    let mut q = p.clone();
                    match i {
                        0 => q.v += change,
                        1 => q.applied += change,
                        _ => q.z[i - 2] += change,
                    }
                    evaluate(&law, &q)
                };
                let h = [1e-5 * p.v.abs(), 1e-3, 1e-9][i.min(2)];
                let ((f1, dz1), (f0, dz0)) = (moved(h), moved(-h));
                let seed = |x: f64, here: bool| Dual::<f64, 1> { re: x, eps: [f64::from(here)] };
                let v = seed(p.v, i == 0);
                let z: Vec<_> = p.z.iter().enumerate().map(|(j, &z)| seed(z, j + 2 == i)).collect();
                let mut dz = z.clone();
                let at = at(v, seed(p.applied, i == 1), law.prepare(v));
                let force = law.force(&at, &lift(&law.levels()), &z, &mut dz, p.mode);
                let agree = |dual: f64, high: f64, low: f64| {
                    let difference = (high - low) / (2.0 * h);
                    // Truncation of the difference, and rounding of its two values.
                    let bound = 1e-5 * dual.abs() + 1e-14 * high.abs().max(low.abs()).max(1.0) / h;
                    assert!((dual - difference).abs() < bound, "{} {p:?} {i}: {dual} {difference}", meta.key);
                };
                agree(force.eps[0], f1, f0);
                for j in 0..z.len() {
                    agree(dz[j].eps[0], dz1[j], dz0[j]);
                }
            }
        }
    });
}

#[test]
fn lanes_equal_scalars_bit_for_bit() {
    type L = Lanes<4>;
    // Lanes share the choices of code: an exponent of two or not, fading or not.
    let near = [1.0, 1.1, 0.9, 1.3];
    for meta in LAWS {
        for set in &sets() {
            let laws: Vec<_> = near
                .iter()
                .map(|factor| {
                    let vary = |(&key, &value): (&&'static str, &f64)| match key {
                        "stribeck_exponent" => (key, value),
                        _ => (key, value * factor),
                    };
                    law(meta, &set.iter().map(vary).collect())
                })
                .collect();
            let gathered: AnyLaw<L> = AnyLaw::gather(&laws.iter().collect::<Vec<_>>());
            let points = grid(meta);
            for i in 0..points.len() {
                let each: Vec<&Point> = (0..4).map(|l| &points[(i + 7 * l) % points.len()]).collect();
                let put = |f: &dyn Fn(&Point) -> f64| Lanes(std::array::from_fn(|l| f(each[l])));
                let z: Vec<L> = (0..meta.states.len()).map(|j| put(&|p| p.z[j])).collect();
                let mut dz = z.clone();
                let v = put(&|p| p.v);
                let at = at(v, put(&|p| p.applied), gathered.prepare(v));
                let force = gathered.force(&at, &gathered.levels(), &z, &mut dz, put(&|p| p.mode));
                for l in 0..4 {
                    let (scalar, rates) = evaluate(&laws[l], each[l]);
                    assert_eq!(force.0[l].to_bits(), scalar.to_bits(), "{} {:?}", meta.key, each[l]);
                    for j in 0..z.len() {
                        assert_eq!(dz[j].0[l].to_bits(), rates[j].to_bits(), "{}", meta.key);
                    }
                }
            }
        }
    }
}

#[test]
fn odd_in_the_direction_of_motion() {
    each_law(|meta, _, law| {
        for p in grid(meta) {
            let turned =
                Point { v: -p.v, applied: -p.applied, z: p.z.iter().map(|z| -z).collect(), mode: -p.mode };
            let ((force, dz), (back, dz_back)) = (evaluate(&law, &p), evaluate(&law, &turned));
            assert_eq!(force, -back, "{} {p:?}", meta.key);
            assert!(dz.iter().zip(&dz_back).all(|(a, b)| *a == -b), "{} {p:?}", meta.key);
        }
    });
}

/// The Stribeck curve as it stands in the description's contract, by the library's functions.
fn curve(meta: &Meta, set: &Set, fc: f64, fs: f64, v: f64) -> f64 {
    let weight = match meta.key {
        "coulomb" => 0.0,
        _ => (-(v.abs() / set["stribeck_velocity"]).powf(set["stribeck_exponent"])).exp(),
    };
    (fc + (fs - fc) * weight) * v.signum() + set["viscous"] * v
}

/// Force at velocity v after the bristles have come to rest: dz/dt = 0 by Newton's method.
fn settled(law: &AnyLaw<f64>, levels: &Levels<f64>, v: f64) -> (f64, Vec<f64>) {
    let meta = law.meta();
    let mode = if meta.sticks { v.signum() } else { 0.0 };
    let mut z = vec![0.0; meta.states.len()];
    let at = at(Dual::<f64, 1>::c(v), Dual::c(0.0), law.prepare(Dual::c(v)));
    let mut force = Dual::c(0.0);
    for _ in 0..30 {
        assert!(z.len() <= 1, "settle several inner states together");
        let dual: Vec<_> = z.iter().map(|&z| Dual::variable(z, 0)).collect();
        let mut rate = dual.clone();
        force = law.force(&at, &lift(levels), &dual, &mut rate, mode);
        for (z, rate) in z.iter_mut().zip(&rate) {
            *z -= rate.re / rate.eps[0];
        }
    }
    (force.re, z)
}

#[test]
fn steady_sliding_is_a_stribeck_curve() {
    each_law(|meta, set, law| {
        for v in [1e-6, 1e-4, 2e-3, 0.02, 0.1, 1.5] {
            for v in [v, -v] {
                let by_hand = curve(meta, set, set["coulomb"], set["breakaway"], v);
                let (force, _) = settled(&law, &law.levels(), v);
                assert!((force / by_hand - 1.0).abs() < 1e-11, "{} {v}: {force} {by_hand}", meta.key);
                let steady = law.steady(v, &law.levels());
                assert!((steady / by_hand - 1.0).abs() < 1e-12, "{} {v}: {steady} {by_hand}", meta.key);
            }
        }
    });
}

#[test]
fn seal_lips_add_to_any_law() {
    let lips = SealLips { coulomb_a: 1e-5, coulomb_b: 2e-5, breakaway_a: 3e-5, breakaway_b: 5e-5 };
    let under = |law: &AnyLaw<f64>, gauge_a: f64, gauge_b: f64| {
        let at = At { gauge_a, gauge_b, ..at(0.0, 0.0, 0.0) };
        lips.apply(&law.levels(), &at)
    };
    each_law(|meta, set, law| {
        let base = law.levels();
        let free = under(&law, 0.0, 0.0);
        assert_eq!((free.coulomb, free.breakaway), (base.coulomb, base.breakaway));
        // 4 bar in a and 1 bar in b: 1e-5 * 4e5 + 2e-5 * 1e5 = 6 N, 3e-5 * 4e5 + 5e-5 * 1e5 = 17 N.
        let levels = under(&law, 4e5, 1e5);
        for v in [1e-3, 0.05, -0.5] {
            let by_hand = curve(meta, set, set["coulomb"] + 6.0, set["breakaway"] + 17.0, v);
            let (force, _) = settled(&law, &levels, v);
            assert!((force / by_hand - 1.0).abs() < 1e-11, "{} {v}: {force} {by_hand}", meta.key);
        }
        // Below ambient pressure it goes on affinely, but friction never changes sign.
        let levels = under(&law, -1e5, 0.0);
        assert!((levels.coulomb - (set["coulomb"] - 1.0)).abs() < 1e-12);
        assert!(under(&law, -1e9, 0.0).coulomb > 0.0);
    });
}

/// A random motion of pieces (velocity, duration): creeping and fast, long and short, in both directions.
fn random_motion(seed: u64) -> Vec<(f64, f64)> {
    let mut state = seed;
    let mut uniform = move || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 11) as f64 / (1_u64 << 53) as f64
    };
    let mut piece = || {
        let (speed, distance) =
            (10.0_f64.powf(-4.5 + 5.0 * uniform()), 10.0_f64.powf(-4.5 + 2.5 * uniform()));
        (if uniform() < 0.5 { -speed } else { speed }, distance / speed)
    };
    (0..60).map(|_| piece()).collect()
}

/// Moves the law; the least of (energy put in - energy stored) over all times, J, and the energy turned
/// over.
fn least_dissipation(law: &AnyLaw<f64>, motion: &[(f64, f64)]) -> (f64, f64) {
    const STEPS: u32 = 300;
    let mut z = vec![0.0; law.meta().states.len()];
    let (mut put_in, mut turned, mut least) = (0.0, 0.0, 0.0_f64);
    for &(v, duration) in motion {
        let dt = duration / f64::from(STEPS);
        let mode = if law.meta().sticks { v.signum() } else { 0.0 };
        let at = |z: Vec<f64>| evaluate(law, &Point { v, applied: 0.0, z, mode });
        for _ in 0..STEPS {
            // Midpoint rule, implicit in the bristles: dz/dt is linear in z at constant v.
            let (free, bent) = (at(vec![0.0; z.len()]).1, at(vec![1e-3; z.len()]).1);
            let slope = |j: usize| (bent[j] - free[j]) / 1e-3;
            let middle = |j: usize| (z[j] + 0.5 * dt * free[j]) / (1.0 - 0.5 * dt * slope(j));
            let middle: Vec<f64> = (0..z.len()).map(middle).collect();
            let work = at(middle.clone()).0 * v * dt;
            z = z.iter().zip(&middle).map(|(z, middle)| 2.0 * middle - z).collect();
            put_in += work;
            turned += work.abs();
            least = least.min(put_in - law.stored::<f64>(&z));
        }
    }
    (least, turned)
}

#[test]
fn passive_sets_give_no_energy() {
    let passive = [
        with(&[("viscous", 151.0)]),
        with(&[("damping_fade_velocity", 0.9), ("viscous", 0.0)]),
        with(&[("breakaway", 30.0), ("viscous", 0.0)]),
    ];
    for meta in LAWS {
        for set in &passive {
            let law = law(meta, set);
            assert_eq!(law.warning(&law.levels()), None, "{}: this set is passive", meta.key);
            for seed in 0..30 {
                let (least, turned) = least_dissipation(&law, &random_motion(seed));
                assert!(least > -1e-9 * turned, "{} motion {seed}: {least} of {turned}", meta.key);
            }
        }
    }
}

#[test]
fn heat_is_what_is_not_stored() {
    each_law(|meta, _, law| {
        for p in grid(meta).into_iter().filter(|p| p.mode * p.v >= 0.0 && p.v.abs() < 10.0) {
            let (force, dz) = evaluate(&law, &p);
            // The energy is quadratic in the bristles: any step gives its rate.
            let direction = 1e-4 / dz.iter().fold(1e-30_f64, |size, r| size.max(r.abs()));
            let moved: Vec<f64> = p.z.iter().zip(&dz).map(|(z, r)| z + direction * r).collect();
            let back: Vec<f64> = p.z.iter().zip(&dz).map(|(z, r)| z - direction * r).collect();
            let storing = (law.stored::<f64>(&moved) - law.stored::<f64>(&back)) / (2.0 * direction);
            let heat = law.heat(p.v, force, &p.z, &dz);
            let size = (force * p.v).abs() + storing.abs() + 1e-9;
            assert!((force * p.v - storing - heat).abs() < 1e-6 * size, "{} {p:?}", meta.key);
        }
    });
}

#[test]
fn a_set_that_is_not_passive_says_so_and_is_not() {
    let reference = LAWS.iter().find(|meta| meta.key == "lugre").expect("registered");
    let set = with(&[("viscous", 0.0), ("bristle_damping", 1e3)]);
    let law = law(reference, &set);
    let warning = law.warning(&law.levels()).expect("a warning");
    assert!(warning.contains("500 N s/m"), "condition and value: {warning}");
    // Fast through zero with stretched bristles: the damper pushes along.
    let p = Point { v: 1.0, applied: 0.0, z: vec![4.5e-4], mode: 0.0 };
    let (force, dz) = evaluate(&law, &p);
    assert!(law.heat(p.v, force, &p.z, &dz) < -100.0);
    let gives = |seed| {
        let (least, turned) = least_dissipation(&law, &random_motion(seed));
        least < -1e-3 * turned
    };
    assert!((0..30).any(gives), "random motions find it too");
}

#[test]
fn stick_ends_at_breakaway_and_slip_at_rest() {
    each_law(|meta, set, law| {
        if !meta.sticks {
            return;
        }
        let limit = if meta.key == "coulomb" { set["coulomb"] } else { set["breakaway"] };
        let levels = law.levels();
        let event =
            |v: f64, applied: f64, mode: f64| law.event(&at(v, applied, law.prepare(v)), &levels, mode);
        for sign in [-1.0, 1.0] {
            assert!(event(0.0, 0.999 * sign * limit, 0.0) > 0.0, "it sticks below the limit");
            assert!(event(0.0, 1.001 * sign * limit, 0.0) < 0.0, "and leaves above it");
            assert_eq!(law.next_mode(0.0, 1.001 * sign * limit, &levels), sign, "with the force");
            assert!(event(sign * 1e-3, 0.0, sign) > 0.0, "it slides as long as it moves");
            assert!(event(-sign * 1e-3, 0.0, sign) < 0.0);
            assert_eq!(law.next_mode(sign, -0.9 * sign * limit, &levels), 0.0, "it stops");
            assert_eq!(law.next_mode(sign, -1.1 * sign * limit, &levels), -sign, "it is pushed back");
            // In stick the friction is the applied force: nothing accelerates.
            let p = Point { v: 0.0, applied: 0.7 * sign * limit, z: vec![], mode: 0.0 };
            assert_eq!(evaluate(&law, &p).0, p.applied);
        }
    });
}
