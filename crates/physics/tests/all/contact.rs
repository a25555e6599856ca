//! What acts on a law: friction that grows with the age of the contact, bristles that relax, position,
//! direction and side load, each against numbers worked out by hand.

use crate::support::*;
use physics::friction::{
    At, Composition, Contact, Dwell, Growth, Heating, LAWS, Position, Relaxation, SealLips, Wear,
};

fn reference(key: &str, composition: Composition<f64>) -> Contact<f64> {
    Contact::new(law(registered(key), &with(&[("viscous", 200.0)])), None, composition)
}

fn aging(dwell: Dwell<f64>) -> Composition<f64> {
    Composition { dwell: Some(dwell), ..Composition::NONE }
}

/// Random numbers in [0, 1).
fn uniform(seed: u64) -> impl FnMut() -> f64 {
    let mut state = seed;
    move || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 11) as f64 / (1_u64 << 53) as f64
    }
}

#[test]
fn age_grows_friction_by_the_law_of_its_name() {
    let at = At::at_rest();
    let grown = |growth, time, exponent, age| {
        Dwell::new(growth, &[2.0, time, exponent, 1e-5, 0.0, 0.0]).increment(&at, age)
    };
    let near = |a: f64, b: f64| assert!((a - b).abs() < 1e-12, "{a} {b}");
    near(grown(Growth::Logarithmic, 0.5, 1.0, 0.0), 0.0);
    near(grown(Growth::Logarithmic, 0.5, 1.0, 99.5), 2.0 * 200.0_f64.ln());
    near(grown(Growth::Hyperbolic, 30.0, 1.0, 10.0), 0.5);
    near(grown(Growth::Saturating, 30.0, 1.0, 30.0), 2.0 * (1.0 - (-1.0_f64).exp()));
    // The prior for elastomers: m = 0.4, tau = 5.4e4 s give 3.7 % of the increment after 15 s.
    let share = grown(Growth::Saturating, 5.4e4, 0.4, 15.0) / 2.0;
    near(share, 1.0 - (-(15.0_f64 / 5.4e4).powf(0.4)).exp());
    assert!((share - 0.037).abs() < 5e-4);
    // Pressure in either chamber raises the increment, and never turns it round.
    let dwell = Dwell::new(Growth::Hyperbolic, &[2.0, 30.0, 1.0, 1e-5, 1e-6, -4e-6]);
    near(dwell.increment(&at.pressed(5e5, 0.0), 30.0), 1.5);
    near(dwell.increment(&at.pressed(0.0, 1e5), 30.0), 0.6);
    near(dwell.increment(&at.pressed(0.0, 9e5), 30.0), 0.0);
}

#[test]
fn age_counts_standing_time_and_is_worn_off_by_slip_alone() {
    for meta in LAWS {
        let contact = reference(meta.key, aging(dwell(Growth::Logarithmic)));
        let age = contact.age_index().expect("it ages");
        let rate = |v: f64, z: f64, phi: f64, mode: f64| {
            let mut p = Point { v, mode, ..Point::at_rest(&contact) };
            p.inner[..age].fill(z);
            p.inner[age] = phi;
            evaluate(&contact, &p).1[age]
        };
        // Within what holds: the first element of `gms` less than the bristles; rate and state under no load at all.
        let held = match meta.key {
            "gms" => 1e-6,
            "rate-and-state" => 0.0,
            _ => 1e-4,
        };
        for phi in [0.0, 3.0, 1e4] {
            assert_eq!(rate(0.0, held, phi, 0.0), 1.0, "{}: at rest it grows as time", meta.key);
        }
        // Relaxing at rest, either way, stops the ageing of an old contact and makes it no younger.
        if ["gms", "rate-and-state"].contains(&meta.key) {
            assert_eq!([1e-3, -1e-3].map(|z| rate(0.0, z, 1e4, 0.0)), [0.0; 2], "{}", meta.key);
        }
        // Bristles at 20 N of some 45 N: only LuGre's slip then, by 0.44 mm/s.
        let level = 30.0 + 15.0 * (-0.0025_f64).exp() + 1.5 * 1.5_f64.ln();
        let (slip, all) = match meta.key {
            "lugre" => (1e-3 * 20.0 / level, 0.0),
            "elasto-plastic" => (0.0, 0.0),
            _ if meta.sticks && meta.stops => (1e-3, 1.0),
            _ => continue,
        };
        // A young contact ages by what its slip leaves; an old one is made younger by slip of the whole alone.
        for phi in [1e-3, 0.5] {
            let left = 1.0 - phi * slip / 2e-5;
            let (got, by_hand) = (rate(1e-3, 2e-4, phi, 1.0), if left < 0.0 { all * left } else { left });
            assert!((got - by_hand).abs() < 1e-3, "{} {phi}: {got} {by_hand}", meta.key);
        }
        // After 99 s bristles that are beyond their limit renew the contact, those that lack half of what may
        // lack by half.
        if meta.key == "lugre" {
            let increment = 1.5 * 100.0_f64.ln();
            let level = level - 1.5 * 1.5_f64.ln() + increment;
            let lacking = 0.04 * increment / (45.0 + increment);
            let half = level * (1.0 - 0.5 * lacking);
            for (force, share) in [(level * 1.01, 1.0), (half, 0.5), (level * (1.0 - lacking), 0.0)] {
                let slip = 1e-3 * force / level;
                let (got, by_hand) =
                    (rate(1e-3, 1e-5 * force, 99.0, 1.0), share * (1.0 - 99.0 * slip / 2e-5));
                assert!((got - by_hand).abs() < 1e-7, "{force} N: {got} {by_hand}");
            }
        }
    }
}

/// Law and relaxation with numbers of all sizes, at a point within the bounds that motion keeps to.
fn relaxing(seed: u64) -> (Contact<f64>, Contact<f64>, Point) {
    let mut unit = uniform(seed);
    let mut log = |low: f64, high: f64| low * (high / low).powf(unit());
    let key = if seed.is_multiple_of(2) { "elasto-plastic" } else { "lugre" };
    let relaxation =
        Relaxation { share: 1.0 - log(0.02, 1.0), time: log(1e-3, 1e3), distance: log(1e-7, 1e-2) };
    let keep = 1.0 - relaxation.share;
    let alone = reference(key, Composition::NONE);
    let contact = reference(key, Composition { relaxation: Some(relaxation.clone()), ..Composition::NONE });
    let v = log(1e-9, 10.0);
    let mut side = || 2.0 * unit() - 1.0;
    let (s, d) = (4.5e-4 * side(), 4.5e-4 / keep * side());
    let mut p = Point { v: v * side().signum(), ..Point::at_rest(&contact) };
    p.inner.copy_from_slice(&[s + relaxation.share * d, d]);
    (contact, alone, p)
}

#[test]
fn relaxing_bristles_only_add_to_the_heat_of_their_law() {
    let mut more = 0;
    for seed in 0..20_000 {
        let (contact, alone, p) = relaxing(seed);
        let (force, rates) = evaluate(&contact, &p);
        let heat = contact.heat(p.v, force, &p.inner, &rates);
        let seen = p.inner[0]
            - contact.composition.as_ref().unwrap().relaxation.as_ref().unwrap().share * p.inner[1];
        let plain = Point { inner: vec![seen], ..p.clone() };
        let (same, rate) = evaluate(&alone, &plain);
        assert!((force - same).abs() < 1e-9 * (1.0 + force.abs()), "the law sees s");
        let of_law = alone.heat(p.v, same, &plain.inner, &rate);
        let turned =
            (force * p.v).abs() + (1e5 * p.inner[0] * rates[0]).abs() + (1e5 * p.inner[1] * rates[1]).abs();
        assert!(heat - of_law > -1e-12 * turned, "{p:?}: {heat} {of_law}");
        more += usize::from(heat - of_law > 1e-6 * turned);
    }
    assert!(more > 10_000, "and mostly do: {more}");
}

#[test]
fn relaxing_bristles_never_push_harder_than_their_law() {
    for seed in 0..40 {
        let (contact, _, _) = relaxing(seed);
        let share = contact.composition.as_ref().unwrap().relaxation.as_ref().unwrap().share;
        let mut p = Point::at_rest(&contact);
        for (v, duration) in random_motion(seed) {
            p.v = v;
            for _ in 0..50 {
                implicit(&contact, &mut p, duration / 50.0, 1.0, &mut |_, _| {});
                let seen = p.inner[0] - share * p.inner[1];
                assert!(seen.abs() <= 4.5e-4 * (1.0 + 1e-9), "{seed}: {seen}");
            }
        }
    }
}

#[test]
fn a_trend_along_the_stroke_never_turns_friction_round() {
    let position = Position { slope: -3.0, ..position() };
    let contact = reference("coulomb", Composition { position: Some(position), ..Composition::NONE });
    let level = |x: f64| contact.levels(&At { x, ..At::at_rest() }, &[], 1.0).coulomb;
    assert!(level(0.1) > 29.0);
    assert_eq!(level(5.0), 0.3);
}

#[test]
fn direction_follows_mode_and_force_of_a_law_that_sticks() {
    let meta = registered("stribeck");
    let contact =
        reference("stribeck", Composition { direction: Some(direction(meta)), ..Composition::NONE });
    let level =
        |applied: f64, mode: f64| contact.levels(&At { applied, ..At::at_rest() }, &[], mode).breakaway;
    // 45 N by 1.2 and 0.85: in slip whatever the force, in stick as the force pushes.
    assert_eq!([level(-9.0, 1.0), level(9.0, 1.0)], [54.0; 2]);
    assert_eq!([level(-9.0, -1.0), level(9.0, -1.0)], [38.25; 2]);
    assert_eq!([level(-9.0, 0.0), level(9.0, 0.0)], [38.25, 54.0]);
    let event = |applied: f64| contact.event(&At { applied, ..At::at_rest() }, &[], 0.0);
    assert!((event(40.0) - 14.0).abs() < 1e-12);
    assert!((event(-40.0) + 1.75).abs() < 1e-12, "it leaves backwards where forwards it would stick");
}

#[test]
fn a_contact_warms_by_its_own_heat_and_by_no_more() {
    // 200 N s/m exp(-0.02 (300 - 290)) and 30 N (1 - 0.003 * 10) at the start.
    let heating = Heating { viscous: 0.02, levels: -3e-3, ..heating() };
    let contact = |heating| reference("coulomb", Composition { heating: Some(heating), ..Composition::NONE });
    let warm = contact(heating.clone());
    let at = |v: f64, rise: f64| Point { v, mode: 1.0, inner: vec![rise], ..Point::at_rest(&warm) };
    let by_hand =
        |rise: f64, v: f64| 30.0 * (1.0 - 3e-3 * (10.0 + rise)) + 200.0 * (-0.02 * (10.0 + rise)).exp() * v;
    for (v, rise) in [(0.1, 0.0), (0.4, 0.0), (0.4, 25.0)] {
        let (force, rates) = evaluate(&warm, &at(v, rise));
        assert!((force - by_hand(rise, v)).abs() < 1e-12, "{v} m/s, {rise} K: {force} N");
        // 2.7 K/W of the power, with 0.4 s.
        let rate = (2.7 * force * v - rise) / 0.4;
        assert!((rates[0] - rate).abs() < 1e-11 * rate.abs(), "{rates:?} {rate}");
        assert_eq!(warm.heat(v, force, &[rise], &rates), force * v, "the heat is booked when it is made");
    }
    // Where it comes to rest: a rise that its own friction keeps up.
    let mut p = at(0.4, 0.0);
    implicit(&warm, &mut p, 1e9, 1.0, &mut |_, _| {});
    let rise = p.inner[0];
    assert!((rise - 2.7 * by_hand(rise, 0.4) * 0.4).abs() < 1e-6 && rise > 50.0, "{rise} K");
    // At constant heat in closed form: the beginning, its slope, and the end.
    let alone = heating.clone();
    assert_eq!(alone.after(5.0, 20.0, 0.0), 5.0);
    let slope = (alone.after(5.0, 20.0, 1e-6) - 5.0) / 1e-6;
    assert!((slope - alone.rate(5.0, 20.0)).abs() < 1e-3, "{slope} K/s");
    assert!((alone.after(5.0, 20.0, 40.0) - 54.0).abs() < 1e-9);
    // Surroundings at the reference: the law as it is.
    let cold = contact(heating).surrounded(290.0);
    assert!((evaluate(&cold, &at(0.1, 0.0)).0 - 50.0).abs() < 1e-12);
}

#[test]
fn a_seal_runs_in_and_wears_with_the_way_that_it_slides() {
    let wear = Wear { run_in: 0.3, run_in_distance: 100.0, rate: 2e-5, slid: 40.0 };
    let factor = |slid: f64| 1.0 + 0.3 * (-slid / 100.0).exp() + 2e-5 * slid;
    for key in ["stribeck", "elasto-plastic"] {
        let contact = reference(key, Composition { wear: Some(wear.clone()), ..Composition::NONE });
        let n = contact.states().len() - 1;
        let mut p = Point { v: -0.5, mode: -1.0, ..Point::at_rest(&contact) };
        // 4000 times 25 mm: no more steps than the elastic deflection, 0.5 mm, can hide.
        for _ in 0..4000 {
            implicit(&contact, &mut p, 0.05, 0.5, &mut |_, _| {});
        }
        assert!((p.inner[n] - 100.0).abs() < 1e-3, "{key}: {} m", p.inner[n]);
        let levels = contact.levels(&at(&p), &p.inner, -1.0);
        let by_hand = factor(40.0 + p.inner[n]);
        assert!(
            (levels.coulomb / 30.0 - by_hand).abs() < 1e-12
                && (levels.breakaway / 45.0 - by_hand).abs() < 1e-12
        );
        assert_eq!(levels.viscous, 200.0, "wear changes no viscosity");
        // Elastic bristles slide on nothing.
        let held = Point { v: 1e-3, inner: vec![1e-4; n + 1], ..Point::at_rest(&contact) };
        let rate = evaluate(&contact, &Point { mode: 1.0, ..held }).1[n];
        assert_eq!(rate, if key == "stribeck" { 1e-3 } else { 0.0 });
    }
}

#[test]
fn what_does_not_fit_together_is_told() {
    // 200 N s/m is enough for the law, 300 (45 - 30)/30 = 150, but not for a day's stop: 1.5 ln(86401) = 17 N.
    let contact = reference("elasto-plastic", aging(dwell(Growth::Logarithmic)));
    let warnings = contact.warnings(0.0, 1.0);
    assert!(warnings.len() == 1 && warnings[0].contains("breakaway 62.0"), "{warnings:?}");
    let lips = SealLips { coulomb_a: 8e-5, ..LIPS };
    let contact = Contact::new(law(registered("stribeck"), &with(&[])), Some(lips), Composition::NONE);
    let warnings = contact.warnings(6e5, 1.0);
    assert!(warnings.len() == 1 && warnings[0].contains("falls below the Coulomb force"), "{warnings:?}");
}
