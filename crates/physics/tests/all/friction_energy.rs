//! What every friction law promises of energy, alone and with everything that can act on it: heat is power less
//! what is stored; a law gives no energy that it was not given, or says with which parameters it may.

use crate::support::*;
use math::Dual;
use physics::friction::{Contact, LAWS};

/// What a motion shows of a contact's energy.
struct Energy {
    /// The least of (energy put in - energy stored) over all times, J.
    least: f64,
    /// Energy turned over, J.
    turned: f64,
    /// The least heat over the greatest power, of all points.
    coldest: f64,
}

fn moved(contact: &Contact<f64>, motion: &[(f64, f64)]) -> Energy {
    const STEPS: u32 = 100;
    let mut p = Point::at_rest(contact);
    let (mut put_in, mut turned, mut least, mut x) = (0.0, 0.0, 0.0_f64, 0.0);
    let (mut heat, mut power) = (0.0_f64, 0.0_f64);
    for &(v, duration) in motion {
        let dt = duration / f64::from(STEPS);
        (p.v, p.mode) = (v, if contact.law.meta().sticks { v.signum() } else { 0.0 });
        for _ in 0..STEPS {
            // Midpoint rule: it keeps what is stored as a square exactly.
            p.x = (x + 0.5 * v * dt).rem_euclid(0.2);
            let mut work = 0.0;
            implicit(contact, &mut p, dt, 0.5, &mut |p, dt| {
                let (force, rates) = evaluate(contact, p);
                work += force * v * dt;
                heat = heat.min(contact.heat(v, force, &p.inner, &rates));
                power = power.max((force * v).abs());
            });
            x += v * dt;
            put_in += work;
            turned += work.abs();
            least = least.min(put_in - contact.stored::<f64>(&p.inner));
        }
    }
    Energy { least, turned, coldest: heat / power }
}

/// Whether one of so many random motions finds energy that was not given.
fn gives(contact: &Contact<f64>, motions: u64) -> bool {
    (0..motions).any(|seed| {
        let Energy { least, turned, .. } = moved(contact, &random_motion(seed));
        least < -1e-3 * turned
    })
}

#[test]
fn passive_sets_give_no_energy() {
    for meta in LAWS {
        let mut seeds = 0..;
        for (set, kind) in passive_sets().iter().flat_map(|set| KINDS.map(|kind| (set, kind))) {
            let contact = composed(kind, meta, law(meta, set));
            let warnings = contact.warnings(6e5, 0.2);
            assert_eq!(warnings, Vec::<String>::new(), "{} {kind}: passive", meta.key);
            // Each its own motions; many states take their time.
            let motions = if contact.states().len() > 4 { 2 } else { 5 };
            for seed in seeds.by_ref().take(motions) {
                let Energy { least, turned, coldest } = moved(&contact, &random_motion(seed));
                assert!(least > -1e-9 * turned, "{} {kind} {seed}: {least} of {turned}", meta.key);
                assert!(coldest > -1e-9, "{} {kind} {seed}: heat {coldest} of the power", meta.key);
            }
        }
    }
}

#[test]
fn a_set_that_is_not_passive_says_so_and_is_not() {
    for meta in LAWS {
        let contacts = sets(meta).into_iter().map(|set| Contact::from(law(meta, &set)));
        let contacts: Vec<_> = contacts.map(|contact| (contact.warnings(0.0, 1.0), contact)).collect();
        for (warnings, contact) in &contacts {
            if meta.claims.always_passive {
                assert_eq!(warnings, &Vec::<String>::new(), "{} is always passive", meta.key);
            }
            assert!(!warnings.is_empty() || !gives(contact, 6), "{} gives energy and says nothing", meta.key);
        }
        let warned = contacts.iter().filter(|(warnings, _)| !warnings.is_empty());
        let shown = warned.filter(|(_, contact)| gives(contact, 40)).count();
        assert!(shown > 0 || meta.claims.always_passive, "{}: a set in `values` that gives energy", meta.key);
    }
}

#[test]
fn the_warning_of_bristles_names_condition_and_values() {
    let set = with(&[("viscous", 0.0), ("bristle_damping", 1e3)]);
    for key in ["lugre", "elasto-plastic"] {
        let contact = Contact::from(law(registered(key), &set));
        let warnings = contact.warnings(0.0, 1.0);
        assert!(warnings[0].contains(&format!("this {key} set")), "{warnings:?}");
        assert!(warnings[0].contains("500 N s/m"), "condition and value: {warnings:?}");
        // Fast through zero with stretched bristles: the damper pushes along.
        let p = Point { v: 1.0, inner: vec![4.5e-4], ..Point::at_rest(&contact) };
        let (force, dz) = evaluate(&contact, &p);
        assert!(contact.heat(p.v, force, &p.inner, &dz) < -100.0);
    }
}

#[test]
fn heat_is_what_is_not_stored() {
    for subject in subjects() {
        let contact = &subject.contact;
        for p in grid(&subject).into_iter().filter(|p| p.mode * p.v >= 0.0 && p.v.abs() < 10.0) {
            let (force, dz) = evaluate(contact, &p);
            let along = |(z, rate): (&f64, &f64)| Dual::<f64, 1> { re: *z, eps: [*rate] };
            let moving: Vec<_> = p.inner.iter().zip(&dz).map(along).collect();
            let storing = contact.stored(&moving).eps[0];
            let heat = contact.heat(p.v, force, &p.inner, &dz);
            let size = (force * p.v).abs() + storing.abs() + 1e-9;
            assert!((force * p.v - storing - heat).abs() < 1e-9 * size, "{} {p:?}", subject.name());
        }
    }
}
