//! What the contracts of friction share: every law with every kind of composition, evaluated at a point.

#![allow(dead_code)] // every contract uses its own part

mod values;

use math::{Dual, Real};
use physics::friction::{
    AnyLaw, At, Composition, Contact, Direction, Dwell, Growth, Harmonic, Heating, LAWS, Levels, Meta,
    Position, Relaxation, SealLips, SideLoad, Table, Wear,
};
pub use values::*;

pub fn registered(key: &str) -> &'static Meta {
    LAWS.iter().find(|meta| meta.key == key).expect("registered")
}

pub const LIPS: SealLips<f64> =
    SealLips { coulomb_a: 1e-5, coulomb_b: 2e-5, breakaway_a: 3e-5, breakaway_b: 5e-5 };

pub fn dwell(growth: Growth) -> Dwell<f64> {
    let (time, exponent) = if growth == Growth::Saturating { (5e4, 0.4) } else { (1.0, 1.0) };
    Dwell::new(growth, &[1.5, time, exponent, 2e-5, 1e-6, 2e-6])
}

pub fn relaxation() -> Relaxation<f64> {
    Relaxation { share: 0.3, time: 5.0, distance: 2e-4 }
}

pub fn position() -> Position<f64> {
    let wave = |period, amplitude, phase| Harmonic { period, amplitude, phase };
    let table = Table::new(&[[0.01, 1.1], [0.05, 0.95], [0.13, 1.07], [0.2, 1.0]]);
    let harmonics = vec![wave(0.05, 0.04, 0.3), wave(0.007, 0.02, -1.1)];
    Position { table, harmonics, slope: 0.2, reference: 0.1 }
}

pub fn side_load() -> SideLoad<f64> {
    SideLoad { force: -20.0, coefficient: 0.1 }
}

pub fn direction(meta: &Meta) -> Direction<f64> {
    Direction { positive: 1.2, negative: 0.85, sense: meta.sense }
}

/// 0.1 m of run-in takes 2.7 K/W of some 10 W.
pub fn heating() -> Heating<f64> {
    Heating { reference: 290.0, viscous: 2e-3, levels: -1e-3, resistance: 2.7, time: 0.4, ambient: 300.0 }
}

pub fn wear() -> Wear<f64> {
    Wear { run_in: 0.1, run_in_distance: 0.1, rate: -1e-7, slid: 0.05 }
}

/// Kinds of composition, from nothing to everything.
pub const KINDS: [&str; 6] =
    ["alone", "log dwell", "saturating dwell", "relaxation", "everything", "warm and worn"];

/// Whether sliding at constant velocity comes to an end of all change.
pub fn settles(kind: &str) -> bool {
    kind != "warm and worn"
}

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
                ..Composition::NONE
            };
            (Some(LIPS), composition)
        }
        "warm and worn" => {
            let dwell = Some(dwell(Growth::Logarithmic));
            let (heating, wear) = (Some(heating()), Some(wear()));
            (None, Composition { heating, wear, dwell, relaxation: own(true), ..Composition::NONE })
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
        sets(meta).into_iter().flat_map(move |set| {
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
    /// The inner states at which the last implicit step was solved, where the next begins to search.
    pub solved: Vec<f64>,
}

impl Point {
    /// At rest at x = 0 without pressure, all inner states zero.
    pub fn at_rest(contact: &Contact<f64>) -> Self {
        let inner = vec![0.0; contact.states().len()];
        Point { v: 0.0, applied: 0.0, x: 0.0, gauges: [0.0; 2], solved: inner.clone(), inner, mode: 0.0 }
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

/// Velocities of both signs over many decades, with every mode, inner states up to and beyond their limit, of
/// either sign where they have one, young and old contacts.
pub fn grid(subject: &Subject) -> Vec<Point> {
    let mut points = Vec::new();
    let speeds = [0.0, 1e-300, 1e-15, 1e-9, 1e-6, 1e-4, 3e-3, 0.02, 0.3, 2.0, 50.0, 1e3];
    let modes: &[f64] = if subject.meta.sticks { &[-1.0, 0.0, 1.0] } else { &[0.0] };
    let ranges: Vec<Range> = subject.contact.states().iter().map(Range::of).collect();
    for v in speeds.iter().flat_map(|v| [*v, -v]) {
        for (i, share) in [-1.07, -0.4, 0.0, 1e-9, 0.93].into_iter().enumerate() {
            for &mode in modes {
                let inner = ranges.iter().enumerate().map(|(j, range)| range.at(i, j)).collect();
                let (x, gauges) = (0.071 * i as f64, [3.1e5 * f64::abs(share), 1.7e5]);
                let applied = 40.0 * share;
                points.push(Point { v, applied, x, gauges, inner, mode, ..Point::at_rest(&subject.contact) });
            }
        }
    }
    points
}

/// Steady sliding as it stands in the description's contract, by the library's functions.
pub fn curve(meta: &Meta, set: &Set, levels: &Levels<f64>, v: f64) -> f64 {
    let Levels { coulomb, breakaway, viscous, .. } = *levels;
    let ratio = v.abs() / set["stribeck_velocity"];
    let stribeck = || coulomb + (breakaway - coulomb) * (-ratio.powf(set["stribeck_exponent"])).exp();
    let level = match meta.key {
        "coulomb" | "dahl" | "bouc-wen" => coulomb,
        "stribeck" | "karnopp" | "lugre" | "elasto-plastic" => stribeck(),
        "armstrong" => coulomb + (breakaway - coulomb) / (1.0 + ratio * ratio),
        // Slip is viscous: 1e5 m/s double the level.
        "gms" => stribeck() * (1.0 + (v.abs() / 1e5).sqrt()),
        "film-lugre" => {
            let film =
                (1.0 - coulomb / breakaway) * (v.abs() / set["film_velocity"]).min(1.0).powf(2.0 / 3.0);
            let excess = ((1.0 - film) * breakaway - coulomb).max(0.0);
            coulomb + excess * (-ratio.powf(set["stribeck_exponent"])).exp()
        }
        "rate-and-state" => {
            let (a, b, v0) = (set["direct_effect"], set["evolution_effect"], set["reference_velocity"]);
            let held = ((1.0 + b * (v0 / v.abs()).ln()) / a).exp();
            a * coulomb * (v.abs() / (1.0 - v.abs() / 1000.0) / (2.0 * v0) * held).asinh()
        }
        key => panic!("the steady curve of the new law {key}, worked out by hand"),
    };
    level * v.signum() + viscous * v
}

/// Fc, Fs and Fv of a set: what stands for one that a law has not.
pub fn levels(meta: &Meta, set: &Set) -> Levels<f64> {
    let given = |key: &str| meta.parameters.iter().any(|p| p.key == key).then(|| set[key]);
    let own = law(meta, set).levels();
    let coulomb = given("coulomb").unwrap_or(own.coulomb);
    let (breakaway, viscous) = (given("breakaway"), given("viscous"));
    Levels::new(coulomb, breakaway.unwrap_or(coulomb), viscous.unwrap_or(own.viscous))
}

/// Directions of one dual pass.
const PASS: usize = 4;

/// Friction and the rates of the inner states at `p`, and their derivatives by v (first) and the inner states:
/// rows of (value, derivatives), the force first.
fn slopes(contact: &Contact<f64>, p: &Point) -> Vec<(f64, Vec<f64>)> {
    let n = p.inner.len();
    let mut rows = vec![(0.0, vec![0.0; n + 1]); n + 1];
    for first in (0..=n).step_by(PASS) {
        let of = |i: usize| {
            let direction = if i == 0 { 0 } else { (i + 1).checked_sub(5)? };
            direction.checked_sub(first).filter(|d| *d < PASS)
        };
        let (force, rates) = evaluate_dual::<PASS>(contact, p, of);
        for (row, dual) in rows.iter_mut().zip([force].iter().chain(&rates)) {
            row.0 = dual.re;
            let last = (first + PASS).min(n + 1);
            row.1[first..last].copy_from_slice(&dual.eps[..last - first]);
        }
    }
    rows
}

/// Solves `f(y) = 0` by Newton's method, `f` giving rows of (value, derivatives); whether it converged, to steps
/// of 1e-13 of `y` or 1e-15 of its `scales`.
pub fn newton(y: &mut [f64], scales: &[f64], mut f: impl FnMut(&[f64]) -> Vec<(f64, Vec<f64>)>) -> bool {
    for _ in 0..40 {
        let mut rows = f(y);
        let n = rows.len();
        for i in 0..n {
            let pivot =
                (i..n).max_by(|&a, &b| rows[a].1[i].abs().total_cmp(&rows[b].1[i].abs())).expect("rows");
            rows.swap(i, pivot);
            let (above, below) = rows.split_at_mut(i + 1);
            let (value, slopes) = &above[i];
            for (other, others) in below {
                let ratio = others[i] / slopes[i];
                if ratio != 0.0 {
                    others[i..].iter_mut().zip(&slopes[i..]).for_each(|(x, s)| *x -= ratio * s);
                    *other -= ratio * value;
                }
            }
        }
        let mut steps = vec![0.0; n];
        for i in (0..n).rev() {
            let (value, slopes) = &rows[i];
            let known: f64 =
                slopes[i + 1..].iter().zip(&steps[i + 1..]).map(|(slope, step)| slope * step).sum();
            steps[i] = (-value - known) / slopes[i];
        }
        y.iter_mut().zip(&steps).for_each(|(y, step)| *y += step);
        let small = |((step, y), scale): ((&f64, &f64), &f64)| step.abs() <= 1e-13 * y.abs() + 1e-15 * scale;
        if steps.iter().zip(&*y).zip(scales).all(small) {
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
    let scales: Vec<f64> = contact.states().iter().map(|state| state.scale).collect();
    let mut found = p.solved.clone();
    let converged = newton(&mut found, &scales, |y| {
        p.inner.copy_from_slice(y);
        let rates = slopes(contact, p).into_iter().skip(1);
        let lag = |(j, (rate, slopes)): (usize, (f64, Vec<f64>))| {
            let of = |(k, slope): (usize, &f64)| f64::from(j == k) - end * dt * slope;
            (y[j] - start[j] - end * dt * rate, slopes[1..].iter().enumerate().map(of).collect())
        };
        rates.enumerate().map(lag).collect()
    });
    if !converged {
        assert!(dt > 1e-15, "no solution from {start:?} at {p:?}");
        p.solved.clone_from(&start);
        p.inner = start;
        implicit(contact, p, 0.5 * dt, end, note);
        implicit(contact, p, 0.5 * dt, end, note);
        return;
    }
    p.solved.clone_from(&found);
    p.inner = found;
    note(p, dt);
    p.inner = start.iter().zip(&p.inner).map(|(start, found)| start + (found - start) / end).collect();
}

/// One step of a mass, kg, that a force, N, moves against friction: like [`implicit`] with `end` = 1, the velocity
/// an unknown.
pub fn pushed(contact: &Contact<f64>, p: &mut Point, mass: f64, force: f64, dt: f64) {
    let mass = mass + contact.law.inertia();
    let start: Vec<f64> = [p.v].into_iter().chain(p.inner.iter().copied()).collect();
    let scales: Vec<f64> = [1.0].into_iter().chain(contact.states().iter().map(|s| s.scale)).collect();
    let mut found = start.clone();
    let converged = newton(&mut found, &scales, |y| {
        (p.v, p.applied) = (y[0], force);
        p.inner.copy_from_slice(&y[1..]);
        let lag = |(j, (value, slopes)): (usize, (f64, Vec<f64>))| {
            // m dv/dt = force - friction, in the first row.
            let (rate, gain) = if j == 0 { ((force - value) / mass, -1.0 / mass) } else { (value, 1.0) };
            let of = |(k, slope): (usize, &f64)| f64::from(j == k) - dt * gain * slope;
            (y[j] - start[j] - dt * rate, slopes.iter().enumerate().map(of).collect())
        };
        slopes(contact, p).into_iter().enumerate().map(lag).collect()
    });
    if !converged {
        assert!(dt > 1e-12, "no solution from {start:?} at {p:?}");
        (p.v, p.inner) = (start[0], start[1..].to_vec());
        pushed(contact, p, mass - contact.law.inertia(), force, 0.5 * dt);
        pushed(contact, p, mass - contact.law.inertia(), force, 0.5 * dt);
        return;
    }
    p.v = found[0];
    p.inner.copy_from_slice(&found[1..]);
    p.x += dt * p.v;
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
