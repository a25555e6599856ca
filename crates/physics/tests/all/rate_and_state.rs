//! Rate and state as published: a step of velocity answered at once by a ln(v2/v1), then over the distance L by
//! -b ln(v2/v1); healing by b for each e-fold of a hold; the ageing law and the slip law apart from each other.
//! Sources: Dieterich, J. Geophys. Res. 84, 1979 [dieterich1979]; Ruina, J. Geophys. Res. 88, 1983 [ruina1983];
//! Marone, Annu. Rev. Earth Planet. Sci. 26, 1998 [marone1998].

use crate::support::*;
use physics::friction::{AnyLaw, At, Choices, Contact, Evolution};

const LEVEL: f64 = 30.0;
const A: f64 = 0.04;
const B: f64 = 0.06;
const DISTANCE: f64 = 5e-5;
const REFERENCE: f64 = 1e-3;

/// On a contact so stiff that its own deflection, A LEVEL/1e9, is far below the distance.
fn contact(evolution: Evolution) -> Contact<f64> {
    elastic(evolution, 1e9)
}

/// With this stiffness, N/m.
fn elastic(evolution: Evolution, stiffness: f64) -> Contact<f64> {
    let own =
        [("direct_effect", A), ("evolution_effect", B), ("viscous", 0.0), ("bristle_stiffness", stiffness)];
    let set = with(&own);
    let choices = Choices { evolution, ..Choices::default() };
    Contact::from(
        AnyLaw::build("rate-and-state", &mut |p| set.get(p.key).copied().or(p.default).unwrap(), &choices)
            .unwrap(),
    )
}

/// The contact in steady sliding at `v`.
fn sliding(contact: &Contact<f64>, v: f64) -> Point {
    let mut p = Point { v, ..Point::at_rest(contact) };
    for _ in 0..2000 {
        implicit(contact, &mut p, 0.1 * DISTANCE / v, 1.0, &mut |_, _| {});
    }
    p
}

/// Forces after a step from v1 to v2, at slips of 0.1 L, 0.2 L, ... 5 L; and those of the analytic solution.
fn step(evolution: Evolution, v1: f64, v2: f64) -> Vec<(f64, f64)> {
    let contact = contact(evolution);
    let mut p = sliding(&contact, v1);
    p.v = v2;
    let mut out = Vec::new();
    let mut slip = 0.0_f64;
    for _ in 0..50 {
        for _ in 0..200 {
            implicit(&contact, &mut p, 5e-4 * DISTANCE / v2, 1.0, &mut |_, _| {});
        }
        slip += 0.1;
        let jump = (v2 / v1).ln();
        // theta v2/L in steady sliding is one.
        let state = match evolution {
            Evolution::Ageing => (1.0 + (v2 / v1 - 1.0) * (-slip).exp()).ln(),
            Evolution::Slip => jump * (-slip).exp(),
        };
        let by_hand = LEVEL * (1.0 + (A - B) * (v2 / REFERENCE).ln() + B * state);
        out.push((evaluate(&contact, &p).0, by_hand));
    }
    out
}

#[test]
fn a_step_of_velocity_jumps_and_decays_over_the_distance() {
    for evolution in [Evolution::Ageing, Evolution::Slip] {
        for (v1, v2) in [(1e-4, 1e-3), (1e-3, 1e-4), (1e-6, 1e-5), (2e-3, 2e-2)] {
            for (i, (force, by_hand)) in step(evolution, v1, v2).into_iter().enumerate() {
                let bound = 2e-3 * A * LEVEL;
                assert!((force - by_hand).abs() < bound, "{evolution:?} {v1} {v2} {i}: {force} {by_hand}");
            }
        }
    }
}

#[test]
fn steps_up_and_down_mirror_each_other_in_the_slip_law_alone() {
    let excess = |evolution, v1: f64, v2: f64| -> Vec<f64> {
        let steady = LEVEL * (1.0 + (A - B) * (v2 / REFERENCE).ln());
        step(evolution, v1, v2).iter().map(|(force, _)| force - steady).collect()
    };
    let mirrored = |evolution| {
        let (up, down) = (excess(evolution, 1e-4, 1e-3), excess(evolution, 1e-3, 1e-4));
        up.iter().zip(&down).map(|(a, b)| (a + b).abs()).fold(0.0, f64::max) / (B * LEVEL)
    };
    assert!(mirrored(Evolution::Slip) < 2e-3);
    assert!(mirrored(Evolution::Ageing) > 0.3);
}

/// The highest force of sliding at the reference velocity after a hold of some time at v = 0.
fn peak(evolution: Evolution, hold: f64) -> f64 {
    let contact = contact(evolution);
    let mut p = sliding(&contact, REFERENCE);
    p.v = 0.0;
    let mut dt = 1e-7;
    let mut t = 0.0;
    while t < hold {
        let h = f64::min(dt, hold - t);
        implicit(&contact, &mut p, h, 1.0, &mut |_, _| {});
        (t, dt) = (t + h, 1.02 * dt);
    }
    p.v = REFERENCE;
    let mut highest = 0.0_f64;
    for _ in 0..3000 {
        implicit(&contact, &mut p, 2e-4 * DISTANCE / REFERENCE, 1.0, &mut |_, _| {});
        highest = highest.max(evaluate(&contact, &p).0);
    }
    highest
}

#[test]
fn healing_is_b_for_each_e_fold_of_the_hold_in_the_ageing_law() {
    let slope = |evolution| {
        let peaks: Vec<f64> = [10.0, 100.0, 1000.0].iter().map(|hold| peak(evolution, *hold)).collect();
        let per_fold = |i: usize| (peaks[i + 1] - peaks[i]) / 10.0_f64.ln() / LEVEL;
        [per_fold(0), per_fold(1)]
    };
    for slope in slope(Evolution::Ageing) {
        assert!((slope / B - 1.0).abs() < 0.02, "{slope}");
    }
    // The slip law heals only by the little slip of the hold: much less on a stiff contact.
    for slope in slope(Evolution::Slip) {
        assert!(slope < 0.5 * B, "{slope}");
    }
}

#[test]
fn a_soft_contact_slides_steadily_instead_of_sticking_and_slipping_by_itself() {
    // Ten and a hundred times softer than b F0/L, with b > a, driven at constant velocity after a rest.
    for evolution in [Evolution::Ageing, Evolution::Slip] {
        for softness in [10.0, 100.0] {
            let (v, stiffness) = (0.05, B * LEVEL / DISTANCE / softness);
            let contact = elastic(evolution, stiffness);
            let mut p = Point { v, ..Point::at_rest(&contact) };
            let mut go = |ways: f64| {
                let steps = (40.0 * ways) as u32;
                for _ in 0..steps {
                    implicit(
                        &contact,
                        &mut p,
                        ways * softness * DISTANCE / v / f64::from(steps),
                        0.5,
                        &mut |_, _| {},
                    );
                }
                evaluate(&contact, &p).0
            };
            go(60.0);
            let by_hand = LEVEL * (1.0 + (A - B) * (v / REFERENCE).ln());
            for _ in 0..50 {
                let force = go(0.2);
                assert!((force / by_hand - 1.0).abs() < 1e-3, "{evolution:?} {softness}: {force} {by_hand}");
            }
        }
    }
}

#[test]
fn where_the_curve_would_be_negative_it_slides_without_friction_in_motion_too() {
    // 1 - 0.02 ln(v/v0) < 0 at 1 m/s: the contact may not hold as if it were stuck.
    let set = with(&[
        ("direct_effect", A),
        ("evolution_effect", 0.2),
        ("viscous", 0.0),
        ("bristle_stiffness", 1e6),
        ("reference_velocity", 1e-8),
    ]);
    let contact = Contact::from(law(registered("rate-and-state"), &set));
    let mut p = Point { v: 1.0, ..Point::at_rest(&contact) };
    for _ in 0..2000 {
        implicit(&contact, &mut p, 1e-6, 1.0, &mut |_, _| {});
    }
    let (force, steady) = (evaluate(&contact, &p).0, contact.steady(&at(&p)));
    // What is left is viscous: a v/(2 vc) of the level.
    assert!((force / (A * LEVEL * 1.0 / 2000.0) - 1.0).abs() < 2e-3, "{force} N");
    assert!((force / steady - 1.0).abs() < 1e-6, "{force} N {steady} N");
}

#[test]
fn it_creeps_at_rest_by_the_logarithm_of_the_load() {
    // Held at 70, 80, 90 % of the level with a fresh contact: ln of the creep rises by 0.1/a each.
    let contact = contact(Evolution::Ageing);
    let creep = |share: f64| {
        let p = Point { inner: vec![share * LEVEL / 1e9, 0.0], ..Point::at_rest(&contact) };
        -evaluate(&contact, &p).1[0]
    };
    for share in [0.7, 0.8, 0.9] {
        let by_hand = REFERENCE * ((share - 1.0) / A).exp();
        assert!((creep(share) / by_hand - 1.0).abs() < 1e-6, "{share}");
    }
}

#[test]
fn the_state_stays_good_over_a_hold_of_twelve_decades() {
    let contact = contact(Evolution::Ageing);
    let mut p = sliding(&contact, 1.0);
    p.v = 0.0;
    let mut dt = 1e-9;
    while dt < 1e9 {
        implicit(&contact, &mut p, dt, 1.0, &mut |_, _| {});
        dt *= 1.2;
    }
    let (force, rates) = evaluate(&contact, &p);
    // theta is the time held, some 6e9 s: psi = ln(v0 t/L).
    assert!((p.inner[1] - (REFERENCE * 6e9 / DISTANCE).ln()).abs() < 0.5, "{}", p.inner[1]);
    assert!(force > 0.0 && force < LEVEL && rates.iter().all(|rate| rate.is_finite()), "{force}");
}

#[test]
fn steady_sliding_ends_below_the_limit_of_slip() {
    // w = vc/2 takes u = vc: an argument twice as large. At 0.999 vc and beyond, a thousand times.
    let set =
        with(&[("direct_effect", A), ("evolution_effect", B), ("viscous", 0.0), ("slip_velocity", 0.5)]);
    let contact = Contact::from(law(registered("rate-and-state"), &set));
    let v0 = set["reference_velocity"];
    for (v, slips, more) in
        [(0.25, 0.25, 2.0), (0.4995, 0.4995, 1000.0), (0.6, 0.4995, 1000.0), (9.0, 0.4995, 1000.0)]
    {
        let hold = ((1.0 - B * f64::ln(slips / v0)) / A).max(f64::ln(v0 / 0.5));
        let by_hand = A * set["coulomb"] * (0.5 * more * slips / v0 * hold.exp()).asinh();
        for sign in [1.0, -1.0] {
            let got = contact.steady(&At { v: sign * v, ..At::at_rest() });
            assert!((got - sign * by_hand).abs() < 1e-9, "{v} m/s: {got} N, by hand {by_hand} N");
        }
    }
}
