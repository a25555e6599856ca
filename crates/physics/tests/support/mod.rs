//! What the contracts of friction share: every law with every kind of composition, evaluated at a point.

#![allow(dead_code)] // every contract uses its own part

use math::{Dual, Real};
use physics::Parameter;
use physics::friction::{
    AnyLaw, At, Choices, Composition, Contact, Direction, Dwell, Growth, Harmonic, LAWS, Levels, Meta,
    Position, Relaxation, SealLips, SideLoad,
};
use std::collections::BTreeMap;

/// A value for each name of a parameter; a law takes those that it lists.
pub type Set = BTreeMap<&'static str, f64>;

const BASE: [(&str, f64); 9] = [
    ("coulomb", 30.0),
    ("breakaway", 45.0),
    ("stribeck_velocity", 0.02),
    ("stribeck_exponent", 2.0),
    ("viscous", 40.0),
    ("bristle_stiffness", 1e5),
    ("bristle_damping", 300.0),
    ("damping_fade_velocity", f64::INFINITY),
    ("breakaway_share", 0.9),
];

pub fn with(changes: &[(&'static str, f64)]) -> Set {
    BASE.into_iter().chain(changes.iter().copied()).collect()
}

/// The reference set, one with a general exponent, one that fades, and one where nothing is round.
pub fn sets() -> [Set; 4] {
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
            ("breakaway_share", 0.61),
        ]),
    ]
}

pub fn law(meta: &Meta, set: &Set) -> AnyLaw<f64> {
    let mut value = |p: &Parameter| {
        let value = set.get(p.key).copied().or(p.default);
        let value = value.unwrap_or_else(|| panic!("a value for the new parameter {}", p.key));
        assert!(p.bounds.contain(value) || value.is_infinite(), "{}", p.key);
        value
    };
    AnyLaw::build(meta.key, &mut value, &Choices::default()).expect("registered")
}

pub fn registered(key: &str) -> &'static Meta {
    LAWS.iter().find(|meta| meta.key == key).expect("registered")
}

pub const LIPS: SealLips<f64> =
    SealLips { coulomb_a: 1e-5, coulomb_b: 2e-5, breakaway_a: 3e-5, breakaway_b: 5e-5 };

pub fn dwell(growth: Growth) -> Dwell<f64> {
    let (time, exponent) = if growth == Growth::Saturating { (5e4, 0.4) } else { (1.0, 1.0) };
    Dwell::new(growth, [1.5, time, exponent, 2e-5, 1e-6, 2e-6])
}

pub fn relaxation() -> Relaxation<f64> {
    Relaxation { share: 0.3, time: 5.0, distance: 2e-4 }
}

pub fn position() -> Position<f64> {
    let wave = |period, amplitude, phase| Harmonic { period, amplitude, phase };
    Position { harmonics: vec![wave(0.05, 0.04, 0.3), wave(0.007, 0.02, -1.1)], slope: 0.2, reference: 0.1 }
}

pub fn side_load() -> SideLoad<f64> {
    SideLoad { force: -20.0, coefficient: 0.1 }
}

pub fn direction(meta: &Meta) -> Direction<f64> {
    Direction { positive: 1.2, negative: 0.85, sticks: meta.sticks }
}

/// Kinds of composition, from nothing to everything.
pub const KINDS: [&str; 5] = ["alone", "log dwell", "saturating dwell", "relaxation", "everything"];

/// The law in one kind of composition; relaxation only where there are bristles.
pub fn composed(kind: &str, meta: &Meta, law: AnyLaw<f64>) -> Contact<f64> {
    let own = |relaxing: bool| (relaxing && meta.bristles).then(relaxation);
    let (lips, composition) = match kind {
        "alone" => (None, Composition::NONE),
        "log dwell" => (None, Composition { dwell: Some(dwell(Growth::Logarithmic)), ..Composition::NONE }),
        "saturating dwell" => {
            (Some(LIPS), Composition { dwell: Some(dwell(Growth::Saturating)), ..Composition::NONE })
        }
        "relaxation" => (None, Composition { relaxation: own(true), ..Composition::NONE }),
        "everything" => {
            let composition = Composition {
                position: Some(position()),
                direction: Some(direction(meta)),
                side_load: Some(side_load()),
                dwell: Some(dwell(Growth::Hyperbolic)),
                relaxation: own(true),
            };
            (Some(LIPS), composition)
        }
        _ => unreachable!(),
    };
    Contact::new(law, lips, composition)
}

/// A law with a set of parameters in one kind of composition.
pub struct Subject {
    pub meta: &'static Meta,
    pub set: Set,
    pub kind: &'static str,
    pub contact: Contact<f64>,
}

impl Subject {
    pub fn name(&self) -> String {
        format!("{} {}", self.meta.key, self.kind)
    }
}

pub fn subjects() -> impl Iterator<Item = Subject> {
    LAWS.iter().flat_map(|meta| {
        sets().into_iter().flat_map(move |set| {
            KINDS.map(|kind| {
                let contact = composed(kind, meta, law(meta, &set));
                Subject { meta, set: set.clone(), kind, contact }
            })
        })
    })
}

/// One evaluation: where, with which inner states (bristles, relaxed part, age) and mode.
#[derive(Clone, Debug)]
pub struct Point {
    pub v: f64,
    pub applied: f64,
    pub x: f64,
    pub gauges: [f64; 2],
    pub inner: Vec<f64>,
    pub mode: f64,
}

impl Point {
    /// At rest at x = 0 without pressure, all inner states zero.
    pub fn at_rest(contact: &Contact<f64>) -> Self {
        let inner = vec![0.0; contact.states().len()];
        Point { v: 0.0, applied: 0.0, x: 0.0, gauges: [0.0; 2], inner, mode: 0.0 }
    }

    /// v, applied, x, both gauges, inner states, as variables of their own.
    pub fn dual<const N: usize>(
        &self,
        of: impl Fn(usize) -> Option<usize>,
    ) -> (At<Dual<f64, N>>, Vec<Dual<f64, N>>) {
        let seed = |x: f64, i: usize| of(i).map_or(Dual::c(x), |direction| Dual::variable(x, direction));
        let at = At {
            v: seed(self.v, 0),
            applied: seed(self.applied, 1),
            x: seed(self.x, 2),
            gauge_a: seed(self.gauges[0], 3),
            gauge_b: seed(self.gauges[1], 4),
            prepared: Dual::c(0.0),
        };
        (at, self.inner.iter().enumerate().map(|(j, &z)| seed(z, 5 + j)).collect())
    }

    /// The `i`-th of the variables of [`Point::dual`].
    pub fn variable(&mut self, i: usize) -> &mut f64 {
        match i {
            0 => &mut self.v,
            1 => &mut self.applied,
            2 => &mut self.x,
            3 | 4 => &mut self.gauges[i - 3],
            _ => &mut self.inner[i - 5],
        }
    }
}

pub fn at(p: &Point) -> At<f64> {
    let [gauge_a, gauge_b] = p.gauges;
    At { v: p.v, x: p.x, gauge_a, gauge_b, applied: p.applied, prepared: 0.0 }
}

/// (friction force, rates of the inner states).
pub fn evaluate(contact: &Contact<f64>, p: &Point) -> (f64, Vec<f64>) {
    let mut rates = vec![0.0; p.inner.len()];
    let at = At { prepared: contact.law.prepare(p.v), ..at(p) };
    let force = contact.force(&at, &p.inner, &mut rates, p.mode);
    (force, rates)
}

pub fn evaluate_dual<const N: usize>(
    contact: &Contact<f64>,
    p: &Point,
    of: impl Fn(usize) -> Option<usize>,
) -> (Dual<f64, N>, Vec<Dual<f64, N>>) {
    let (at, inner) = p.dual::<N>(of);
    let at = At { prepared: contact.law.prepare(at.v), ..at };
    let mut rates = inner.clone();
    let force = contact.force(&at, &inner, &mut rates, p.mode);
    (force, rates)
}

/// Velocities of both signs over many decades, with every mode, bristles up to and beyond their limit,
/// relaxed parts of either sign, young and old contacts.
pub fn grid(subject: &Subject) -> Vec<Point> {
    let mut points = Vec::new();
    let speeds = [0.0, 1e-300, 1e-15, 1e-9, 1e-6, 1e-4, 3e-3, 0.02, 0.3, 2.0, 50.0, 1e3];
    let modes: &[f64] = if subject.meta.sticks { &[-1.0, 0.0, 1.0] } else { &[0.0] };
    let ages = [1e-5, 0.31, 41.0, 1e-9, 1e5];
    for v in speeds.iter().flat_map(|v| [*v, -v]) {
        for (i, share) in [-1.07, -0.4, 0.0, 1e-9, 0.93].into_iter().enumerate() {
            for &mode in modes {
                let states = subject.contact.states();
                let inner = states.iter().map(|state| match state.name {
                    "bristle_deflection_m" => share * 4.5e-4,
                    "relaxed_deflection_m" => [0.3, 1.3, -0.6, 0.0, 0.2][i] * share * 4.5e-4,
                    "contact_age_s" => ages[i],
                    name => panic!("a value for the new state {name}"),
                });
                let inner = inner.collect();
                let (x, gauges) = (0.071 * i as f64, [3.1e5 * share.abs(), 1.7e5]);
                points.push(Point { v, applied: 40.0 * share, x, gauges, inner, mode });
            }
        }
    }
    points
}

/// The Stribeck curve as it stands in the description's contract, by the library's functions.
pub fn curve(meta: &Meta, set: &Set, fc: f64, fs: f64, v: f64) -> f64 {
    let weight = match meta.key {
        "coulomb" => 0.0,
        _ => (-(v.abs() / set["stribeck_velocity"]).powf(set["stribeck_exponent"])).exp(),
    };
    (fc + (fs - fc) * weight) * v.signum() + set["viscous"] * v
}

/// Fc and Fs of a set: both the same for a law without breakaway.
pub fn levels(meta: &Meta, set: &Set) -> Levels<f64> {
    let coulomb = set["coulomb"];
    let breakaway = if meta.key == "coulomb" { coulomb } else { set["breakaway"] };
    Levels { coulomb, breakaway, viscous: set["viscous"] }
}

/// Solves `f(y) = 0` for up to three unknowns by Newton's method, `f` giving values and derivatives; whether
/// it converged.
pub fn newton(y: &mut [f64], mut f: impl FnMut(&[f64]) -> Vec<Dual<f64, 3>>) -> bool {
    for _ in 0..40 {
        let mut rows: Vec<Vec<f64>> =
            f(y).iter().map(|r| r.eps[..y.len()].iter().copied().chain([-r.re]).collect()).collect();
        let n = rows.len();
        for i in 0..n {
            let pivot = (i..n).max_by(|&a, &b| rows[a][i].abs().total_cmp(&rows[b][i].abs())).expect("rows");
            rows.swap(i, pivot);
            for j in 0..n {
                if j != i {
                    let ratio = rows[j][i] / rows[i][i];
                    let subtract: Vec<f64> = rows[i].iter().map(|x| ratio * x).collect();
                    rows[j].iter_mut().zip(subtract).for_each(|(x, s)| *x -= s);
                }
            }
        }
        let steps: Vec<f64> = (0..n).map(|i| rows[i][n] / rows[i][i]).collect();
        y.iter_mut().zip(&steps).for_each(|(y, step)| *y += step);
        if steps.iter().zip(&*y).all(|(step, y)| step.abs() <= 1e-13 * y.abs()) {
            return true;
        }
    }
    false
}

/// One step of length `dt` of the inner states at constant velocity: the rates hold at its end (`end` = 1)
/// or in its middle (`end` = 1/2). Where Newton's method hangs on a kink, in two halves; `note` sees the
/// point of each.
pub fn implicit(
    contact: &Contact<f64>,
    p: &mut Point,
    dt: f64,
    end: f64,
    note: &mut impl FnMut(&Point, f64),
) {
    let start = p.inner.clone();
    let mut found = start.clone();
    let converged = newton(&mut found, |y| {
        p.inner.copy_from_slice(y);
        let rates = evaluate_dual::<3>(contact, p, |i| i.checked_sub(5)).1;
        let lag = |j: usize| Dual::variable(y[j], j) - Dual::from(start[j]) - Dual::from(end * dt) * rates[j];
        (0..y.len()).map(lag).collect()
    });
    if !converged {
        assert!(dt > 1e-15, "no solution from {start:?} at {p:?}");
        p.inner = start;
        implicit(contact, p, 0.5 * dt, end, note);
        implicit(contact, p, 0.5 * dt, end, note);
        return;
    }
    p.inner = found;
    note(p, dt);
    p.inner = start.iter().zip(&p.inner).map(|(start, found)| start + (found - start) / end).collect();
}

/// A random motion of pieces (velocity, duration): creeping and fast, long and short, in both
/// directions, some at rest.
pub fn random_motion(seed: u64) -> Vec<(f64, f64)> {
    let mut state = seed;
    let mut uniform = move || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 11) as f64 / (1_u64 << 53) as f64
    };
    let mut piece = || {
        let (speed, distance) =
            (10.0_f64.powf(-4.5 + 5.0 * uniform()), 10.0_f64.powf(-4.5 + 2.5 * uniform()));
        let way = uniform();
        let v = if way < 0.45 { -speed } else { speed };
        if way > 0.9 { (0.0, 10.0_f64.powf(-2.0 + 5.0 * uniform())) } else { (v, distance / speed) }
    };
    (0..60).map(|_| piece()).collect()
}
