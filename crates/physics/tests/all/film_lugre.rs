//! LuGre with a lubricant film, as published: a loop of friction over velocity in sliding at low speed that
//! widens towards higher velocities with the frequency, grows with the driving pressure and shrinks with the
//! resisting pressure; breakaway that grows exponentially with the stop.
//! Source: Tran and Yanada, Intelligent Control and Automation 4(2), 2013 [tran2013]. The tables of its
//! parameters could not be read: the numbers here are assumed, the trends are those of its abstract.

use crate::support::*;
use physics::friction::{At, Composition, Contact, Levels, SealLips};

fn film(changes: &[(&'static str, f64)]) -> Contact<f64> {
    Contact::from(law(registered("film-lugre"), &with(changes)))
}

/// The loop of F over v for v = 1 to 49 mm/s at `hz` after some periods: (v, F rising, F falling).
fn hysteresis(contact: &Contact<f64>, hz: f64, gauges: [f64; 2]) -> Vec<(f64, f64, f64)> {
    const STEPS: usize = 400;
    let dt = 1.0 / hz / STEPS as f64;
    let v = |k: f64| 0.025 - 0.024 * (std::f64::consts::TAU * k / STEPS as f64).cos();
    let mut p = Point { v: v(0.0), gauges, ..Point::at_rest(contact) };
    let mut forces = vec![0.0; STEPS + 1];
    for k in 0..8 * STEPS {
        p.v = v(k as f64 + 1.0);
        implicit(contact, &mut p, dt, 1.0, &mut |_, _| {});
        forces[(k + 1) % STEPS] = evaluate(contact, &p).0;
    }
    (1..STEPS / 2).map(|k| (v(k as f64), forces[k], forces[STEPS - k])).collect()
}

/// Area of the loop, W, and the velocity up to which it is open by a tenth of Fs - Fc.
fn size(contact: &Contact<f64>, hz: f64, gauges: [f64; 2]) -> (f64, f64) {
    let open = hysteresis(contact, hz, gauges);
    let area = open.windows(2).map(|w| (w[1].0 - w[0].0) * (w[0].1 - w[0].2)).sum();
    let last = open.iter().rev().find(|(_, rising, falling)| (rising - falling).abs() > 1.5);
    (area, last.map_or(0.0, |(v, ..)| *v))
}

#[test]
fn friction_over_velocity_is_a_loop_that_widens_with_the_frequency() {
    let contact = film(&[]);
    let each = [0.1, 0.3, 1.0, 3.0].map(|hz| size(&contact, hz, [0.0; 2]));
    for pair in each.windows(2) {
        assert!(pair[1].1 > 1.05 * pair[0].1, "the loop reaches to higher velocities: {each:?}");
    }
    // More friction while it accelerates, as the film has still to grow.
    assert!(each[1].0 > 0.0 && each[2].0 > each[1].0, "{each:?}");
    // Far above the velocity of the greatest film friction is a straight line.
    let (slow, fast) = (At { v: 0.3, ..At::at_rest() }, At { v: 0.5, ..At::at_rest() });
    assert!((contact.steady(&fast) - contact.steady(&slow) - 40.0 * 0.2).abs() < 1e-9);
}

#[test]
fn the_loop_grows_with_driving_pressure_and_shrinks_with_resistance() {
    // Breakaway force and Stribeck velocity that rise with the driving pressure, in chamber a, more than the
    // Coulomb force does, and fall with the resisting one, in b.
    let lips = SealLips { coulomb_a: 1e-5, coulomb_b: 2e-5, breakaway_a: 6e-5, breakaway_b: 0.0 };
    let set = with(&[("stribeck_velocity_a", 1e-8), ("stribeck_velocity_b", -1e-8)]);
    let contact = Contact::new(law(registered("film-lugre"), &set), Some(lips), Composition::NONE);
    let area = |a: f64, b: f64| size(&contact, 1.0, [a, b]).0;
    let (driven, resisted) = ([0.0, 2e5, 4e5].map(|a| area(a, 1e5)), [0.0, 2e5, 4e5].map(|b| area(2e5, b)));
    assert!(driven.windows(2).all(|w| w[1] > 1.2 * w[0]), "{driven:?}");
    assert!(resisted.windows(2).all(|w| w[1] < 0.85 * w[0]), "{resisted:?}");
    // The steady curve knows the pressure, too.
    let at = |a: f64| At { v: 0.02, ..At::at_rest() }.pressed(a, 0.0);
    let by_hand = |a: f64| {
        let (fc, fs, vs) = (30.0 + 1e-5 * a, 45.0 + 6e-5 * a, 0.02 + 1e-8 * a);
        let h = (1.0 - fc / fs) * 0.4_f64.powf(2.0 / 3.0);
        fc + ((1.0 - h) * fs - fc) * (-(0.02_f64 / vs).powi(2)).exp() + 0.8
    };
    for a in [0.0, 4e5] {
        assert!((contact.steady(&at(a)) - by_hand(a)).abs() < 1e-9, "{a}");
    }
}

#[test]
fn breakaway_grows_exponentially_with_the_stop() {
    // Slid at 0.1 m/s the film is h = 1 - Fc/Fs = 1/3; after a stop T it is exp(-T/20 s)/3.
    // Broken away so fast that the film stays, and that Stribeck's part does.
    let contact = film(&[
        ("bristle_stiffness", 1e6),
        ("viscous", 0.0),
        ("stribeck_velocity", 0.5),
        ("film_growth_time", 5.0),
        ("film_decay_time", 100.0),
    ]);
    let broken = |stop: f64| {
        let mut p = Point { v: 0.1, ..Point::at_rest(&contact) };
        (0..400).for_each(|_| implicit(&contact, &mut p, 5.0, 1.0, &mut |_, _| {}));
        assert!((p.inner[1] - 1.0 / 3.0).abs() < 1e-9);
        p.v = 0.0;
        (0..2000).for_each(|_| implicit(&contact, &mut p, stop / 2000.0, 0.5, &mut |_, _| {}));
        p.v = 0.01;
        let mut highest = 0.0_f64;
        for _ in 0..400 {
            implicit(&contact, &mut p, 1e-4, 1.0, &mut |_, _| {});
            highest = highest.max(evaluate(&contact, &p).0);
        }
        highest
    };
    for stop in [1.0_f64, 10.0, 20.0, 60.0, 200.0] {
        let by_hand = 45.0 * (1.0 - (-stop / 20.0).exp() / 3.0);
        let force = broken(stop);
        // Bristles creep while they are loaded: a little of the peak is lost on the way.
        assert!((force / by_hand - 1.0).abs() < 0.02, "{stop} s: {force} {by_hand}");
    }
}

#[test]
fn at_rest_and_sliding_have_time_constants_of_their_own() {
    let contact = film(&[]);
    let rate = |v: f64, h: f64| {
        let p = Point { v, inner: vec![0.0, h], ..Point::at_rest(&contact) };
        evaluate(&contact, &p).1[1]
    };
    let steady = |v: f64| (v / 0.05_f64).min(1.0).powf(2.0 / 3.0) / 3.0;
    for v in [3e-6, 1e-4, 0.01, 0.3] {
        let (grows, shrinks) = (steady(v) / 0.03, (steady(v) - 0.4) / 0.2);
        assert!((rate(v, 0.0) / grows - 1.0).abs() < 1.3e-4, "{v}");
        assert!((rate(v, 0.4) / shrinks - 1.0).abs() < 1.3e-4, "{v}");
    }
    assert!((rate(0.0, 0.3) / (-0.3 / 20.0) - 1.0).abs() < 1e-7);
    assert!(
        (rate(1e-7, 0.3) / (-0.3 / 20.0) - 1.0).abs() < 1.1,
        "a tenth of the rest velocity is nearly rest"
    );
}

#[test]
fn the_film_keeps_the_level_between_its_bounds_whatever_presses() {
    // Breakaway that falls below the Coulomb force under pressure: the level is the Coulomb force.
    let contact = film(&[]);
    let steady = |fc: f64, fs: f64| {
        let levels = Levels::new(fc, fs, 0.0);
        contact.law.steady_at(&At { v: 1e-3, ..At::at_rest() }, &levels)
    };
    assert_eq!(steady(30.0, 20.0), 30.0);
    let between = steady(30.0, 45.0);
    assert!(between > 30.0 && between < 45.0);
}

#[test]
fn viscous_friction_that_leads_moves_along_as_a_mass() {
    assert!((film(&[("fluid_lead_time", 0.05)]).law.inertia() - 2.0).abs() < 1e-15);
    // A force of 10 N on 1 kg at rest, bristles unloaded: 10 N/(1 kg + 40 N s/m 0.05 s) = 10/3 m/s2.
    let contact = film(&[("fluid_lead_time", 0.05)]);
    let mut p = Point::at_rest(&contact);
    pushed(&contact, &mut p, 1.0, 10.0, 1e-7);
    assert!((p.v / 1e-7 - 10.0 / 3.0).abs() < 1e-3, "{}", p.v);
}
