//! What every friction law promises along a path: its steady curve in steady sliding and in slow motion; a force
//! that depends on the path alone, and no drift under a load that oscillates, where it claims them, and
//! only there.

use crate::support::*;
use physics::friction::{At, Contact, LAWS, Levels, Meta};

/// Force at `p` after the inner states have settled: longer and longer implicit steps.
fn settled(subject: &Subject, p: &Point) -> f64 {
    let mut p = p.clone();
    p.mode = if subject.meta.sticks { p.v.signum() } else { 0.0 };
    let mut dt = 1e-6 / p.v.abs();
    while dt < 1e15 {
        implicit(&subject.contact, &mut p, dt, 1.0, &mut |_, _| {});
        dt *= 1.5;
    }
    evaluate(&subject.contact, &p).0
}

#[test]
fn steady_sliding_is_the_curve_of_the_law() {
    for subject in subjects().filter(|subject| settles(subject.kind)) {
        let Subject { meta, set, contact, .. } = &subject;
        for v in [1e-6, 1e-4, 2e-3, 0.02, 0.1, 1.5] {
            for v in [v, -v] {
                let p = Point { v, x: 0.165, gauges: [4e5, 1e5], ..Point::at_rest(contact) };
                let by_hand = curve(meta, set, &by_hand(&subject, v), v);
                let force = settled(&subject, &p);
                assert!((force / by_hand - 1.0).abs() < 1e-11, "{} {v}: {force} {by_hand}", subject.name());
                let steady = contact.steady(&at(&p));
                assert!((steady / by_hand - 1.0).abs() < 1e-12, "{} {v}: {steady}", subject.name());
            }
        }
    }
}

/// Fc and Fs at velocity v, 0.165 m, 4 bar in a and 1 bar in b, from the numbers in `support`.
fn by_hand(subject: &Subject, v: f64) -> Levels<f64> {
    let Levels { mut coulomb, mut breakaway, viscous, .. } = levels(subject.meta, &subject.set);
    // 1e-5 * 4e5 + 2e-5 * 1e5 = 6 N, 3e-5 * 4e5 + 5e-5 * 1e5 = 17 N; the increment by 1 + 0.4 + 0.2.
    let pressed = |fc: f64, fs: f64| (fc + 6.0, fs + 17.0);
    let mut more = 0.0;
    match subject.kind {
        "log dwell" => more = 1.6 * 1.5 * (1.0 + 2e-5 / v.abs()).ln(),
        "saturating dwell" => {
            (coulomb, breakaway) = pressed(coulomb, breakaway);
            more = 1.6 * 1.5 * (1.0 - (-(2e-5 / v.abs() / 5e4).powf(0.4)).exp());
        }
        "everything" => {
            (coulomb, breakaway) = pressed(coulomb, breakaway);
            let (x, turn) = (0.065, 2.0 * std::f64::consts::PI);
            let waves = 0.04 * (turn * x / 0.05 + 0.3).cos() + 0.02 * (turn * x / 0.007 - 1.1).cos();
            // Halfway between 1.07 at 0.13 m and 1.0 at 0.2 m, where the table is level.
            let factor = 1.035 * (1.0 + 0.2 * x + waves) * if v > 0.0 { 1.2 } else { 0.85 };
            (coulomb, breakaway) = (coulomb * factor, breakaway * factor);
            let age = 2e-5 / v.abs();
            more = 0.1 * 20.0 + 1.6 * 1.5 * age / (1.0 + age);
        }
        _ => {}
    }
    Levels::new(coulomb + more, breakaway + more, viscous)
}

#[test]
fn slow_motion_follows_the_steady_curve() {
    // From 1 to 100 mm/s and back in `duration`: how far friction is from its steady curve, over Fs.
    let off = |contact: &Contact<f64>, duration: f64| {
        const STEPS: u32 = 400;
        let mut p = Point { v: 1e-3, mode: 1.0, ..Point::at_rest(contact) };
        let dt = duration / f64::from(STEPS);
        let mut worst = 0.0_f64;
        implicit(contact, &mut p, 1e4 * dt, 1.0, &mut |_, _| {});
        for k in 0..=STEPS {
            let way = 1.0 - (2.0 * f64::from(k) / f64::from(STEPS) - 1.0).abs();
            p.v = 1e-3 * 100.0_f64.powf(way);
            implicit(contact, &mut p, dt, 1.0, &mut |_, _| {});
            let steady = contact.steady(&at(&p));
            worst = worst.max((evaluate(contact, &p).0 - steady).abs() / steady);
        }
        worst
    };
    for meta in LAWS {
        for kind in KINDS.into_iter().filter(|kind| settles(kind)) {
            let contact = composed(kind, meta, law(meta, &with(&[])));
            let (slow, slower) = (off(&contact, 1e5), off(&contact, 1e6));
            assert!(slow < 1e-4, "{} {kind}: {slow:e}", meta.key);
            assert!(slower < 0.11 * slow + 1e-11, "{} {kind}: {slow:e}, then {slower:e}", meta.key);
        }
    }
}

#[test]
fn a_path_passed_faster_gives_the_same_force_where_that_is_claimed() {
    // There and back over tenths of a millimetre, without viscous friction; the force along the path.
    let along = |contact: &Contact<f64>, speed: f64| {
        let mut p = Point::at_rest(contact);
        let mut forces = Vec::new();
        for (way, distance) in [(1.0, 3e-4), (-1.0, 5e-4), (1.0, 2e-4), (-1.0, 1e-4), (1.0, 2e-3)] {
            (p.v, p.mode) = (way * speed, if contact.law.meta().sticks { way } else { 0.0 });
            for _ in 0..50 {
                implicit(contact, &mut p, distance / 50.0 / speed, 0.5, &mut |_, _| {});
                forces.push(evaluate(contact, &p).0);
            }
        }
        forces
    };
    let apart = |meta: &'static Meta| {
        let contact = Contact::from(law(meta, &with(&[("viscous", 0.0)])));
        let (slow, fast) = (along(&contact, 1e-5), along(&contact, 0.3));
        slow.iter().zip(&fast).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
    };
    for meta in LAWS {
        match (meta.claims.rate_independent, apart(meta)) {
            (true, apart) => assert!(apart < 1e-9, "{}: {apart} N", meta.key),
            (false, apart) => assert!(apart > 1e-3, "{} could claim it: {apart:e} N", meta.key),
        }
    }
}

/// Drift, m/s, of 10 g under 15 +- 2 N at 20 Hz, by 400 backward steps a cycle: 20 cycles after 4.
fn drift(contact: &Contact<f64>) -> f64 {
    const STEPS: u32 = 400;
    let (frequency, mut start) = (20.0, 0.0);
    let mut p = Point::at_rest(contact);
    for cycle in 0..24 {
        start = if cycle == 4 { p.x } else { start };
        for k in 0..STEPS {
            let phase = f64::from(k + 1) / f64::from(STEPS);
            let force = 15.0 + 2.0 * (std::f64::consts::TAU * phase).sin();
            let event = contact.event(&At { applied: force, ..at(&p) }, &p.inner, p.mode);
            assert!(event > 0.0, "{}: {force} N end its stick", contact.law.meta().key);
            if !(contact.law.meta().sticks && contact.law.meta().stops) {
                pushed(contact, &mut p, 0.01, force, 1.0 / frequency / f64::from(STEPS));
            }
        }
    }
    (p.x - start) * frequency / 20.0
}

#[test]
fn a_load_that_oscillates_below_breakaway_moves_nothing_where_that_is_claimed() {
    for meta in LAWS {
        for kind in ["alone", "log dwell", "saturating dwell"] {
            let contact = composed(kind, meta, law(meta, &with(&[])));
            let drift = drift(&contact);
            let name = format!("{} {kind}: {drift:e} m/s", meta.key);
            match meta.claims.no_drift {
                true => assert!(drift.abs() < 1e-12, "{name}"),
                false => assert!(drift > 1e-6, "{name}: it could claim that there is none"),
            }
        }
    }
    // LuGre by hand, where inertia does not count: docs/theory/friction.md.
    let open = |force: f64| 1.0 - (force / 45.0_f64).powi(2);
    let by_hand = 20.0 * 45.0 / 1e5 * (open(13.0) / open(17.0)).ln();
    let set = with(&[("bristle_damping", 3.0), ("viscous", 0.0)]);
    let lugre = drift(&Contact::from(law(registered("lugre"), &set)));
    assert!((lugre / by_hand - 1.0).abs() < 0.02, "{lugre} {by_hand}");
}
