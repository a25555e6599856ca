//! Generalised Maxwell slip as published: presliding that remembers every reversal (nonlocal memory, Masing's rule,
//! wiping out), whatever the speed; in sliding a level that follows the Stribeck curve with the attraction C.
//! Source: Al-Bender, Lampaert, Swevers, IEEE Trans. Automatic Control 50(11), 2005, 1883-1887 [albender2005].

use crate::support::*;
use physics::friction::{AnyLaw, Contact, Element};

/// Slip is viscous: with 1e11 m/s this speed adds 1e-8 of the level.
const SLOW: f64 = 1e-5;

/// A law of one level, 30 N on 1e5 N/m, so that only the path counts.
fn flat() -> Contact<f64> {
    Contact::from(law(
        registered("gms"),
        &with(&[("breakaway", 30.0), ("viscous", 0.0), ("slip_velocity", 1e11)]),
    ))
}

/// Moves from where `p` is to `x` m at a speed, m/s; the force there.
fn go(contact: &Contact<f64>, p: &mut Point, x: f64, speed: f64) -> f64 {
    const STEPS: u32 = 60;
    let way = x - p.x;
    p.v = speed * way.signum();
    for _ in 0..STEPS {
        implicit(contact, p, way.abs() / speed / f64::from(STEPS), 1.0, &mut |_, _| {});
    }
    p.x = x;
    evaluate(contact, p).0
}

/// The loading curve from rest, N, worked out from the elements.
fn virgin(x: f64) -> f64 {
    let of = |e: &Element<f64>| (1e5 * e.stiffness * x).min(30.0 * e.level);
    Element::tangents(4).iter().map(of).sum()
}

fn near(got: f64, by_hand: f64) {
    assert!((got - by_hand).abs() < 3e-6, "{got} N, by hand {by_hand} N");
}

#[test]
fn four_elements_stand_for_the_loading_curve_of_dahl() {
    let elements = Element::tangents(4);
    assert!((elements.iter().map(|e| e.level).sum::<f64>() - 1.0).abs() < 1e-15);
    assert!((elements.iter().map(|e| e.stiffness).sum::<f64>() - 1.0).abs() < 1e-15);
    // Tangents: never below the curve, and farthest above it where the last element yields.
    let excess = |u: f64| virgin(u * 3e-4) / 30.0 - (1.0 - (-u).exp());
    let all: Vec<f64> = (0..4000).map(|i| excess(f64::from(i) * 1e-3)).collect();
    assert!(all.iter().all(|e| *e > -1e-15));
    let last = 1.0 + 2.0 * 2.0_f64.ln();
    let most = all.iter().fold(0.0_f64, |a, b| a.max(*b));
    assert!((excess(last) - 0.092).abs() < 5e-4 && most <= excess(last) + 1e-12, "{most}");
}

#[test]
fn listed_elements_slip_in_the_order_of_their_yields() {
    // Stiffness in N/m, shares of any sum: of 30 N they yield at 1.25 mm, 1/12 mm and 5/12 mm.
    let listed = [[1e4, 5.0], [6e4, 2.0], [3e4, 5.0]];
    let mut contact = flat();
    let AnyLaw::MaxwellSlip(law) = &mut contact.law else { panic!("gms") };
    law.set_elements(listed.map(|[stiffness, level]| Element { stiffness, level }).to_vec());
    assert_eq!(law.common.bristle_stiffness, 1e5);
    let ordered: Vec<[f64; 2]> = law.elements.iter().map(|e| [e.stiffness * 1e5, e.level * 12.0]).collect();
    for (got, by_hand) in ordered.into_iter().zip([[6e4, 2.0], [3e4, 5.0], [1e4, 5.0]]) {
        near(got[0], by_hand[0]);
        near(got[1], by_hand[1]);
    }
    let mut p = Point::at_rest(&contact);
    // The first element alone slips at 0.2 mm, and the second with it at 0.8 mm; of 30 N, 5, 12.5 and 12.5 N.
    near(go(&contact, &mut p, 2e-4, SLOW), 5.0 + 6.0 + 2.0);
    near(p.inner[1], 5.0 / 6e4);
    near(go(&contact, &mut p, 8e-4, SLOW), 5.0 + 12.5 + 8.0);
    near(go(&contact, &mut p, 2e-3, SLOW), 30.0);
}

#[test]
fn loading_follows_the_virgin_curve_and_its_double_after_a_reversal() {
    let contact = flat();
    for turn in [2e-5, 1e-4, 2.1e-4, 5e-4, 2e-3] {
        let mut p = Point::at_rest(&contact);
        let top = go(&contact, &mut p, turn, SLOW);
        near(top, virgin(turn));
        // Masing: the way back is the loading curve at twice the scale, until it joins that of the other way.
        for back in [1e-5, 7e-5, 1.9e-4, 5e-4, 1.2e-3] {
            let force = go(&contact, &mut p, turn - back, SLOW);
            let joined = back > 2.0 * turn;
            near(force, if joined { -virgin(back - turn) } else { top - 2.0 * virgin(0.5 * back) });
        }
    }
}

#[test]
fn minor_loops_close_and_what_is_wiped_out_leaves_no_trace() {
    let contact = flat();
    // Out, back, and within that a loop, and within that another: each ends where it began.
    let path = [4e-4, -2e-4, 2.5e-4, 0.0, 1.4e-4, 0.6e-4];
    let mut p = Point::at_rest(&contact);
    let forces: Vec<f64> = path.iter().map(|x| go(&contact, &mut p, *x, SLOW)).collect();
    let mut inner = p.clone();
    for i in (0..4).rev() {
        near(go(&contact, &mut p, path[i + 1], SLOW), forces[i + 1]);
    }
    // Past the outermost reversal all that happened within is forgotten.
    let mut simple = Point::at_rest(&contact);
    go(&contact, &mut simple, path[0], SLOW);
    go(&contact, &mut simple, path[1], SLOW);
    let (once, again) = (go(&contact, &mut simple, 3.3e-4, SLOW), go(&contact, &mut p, 3.3e-4, SLOW));
    near(again, once);
    near(go(&contact, &mut inner, 3.3e-4, SLOW), once);
    // What was not passed is remembered: the same place and direction, another force.
    let mut other = Point::at_rest(&contact);
    for x in [4e-4, -2e-4, 0.6e-4] {
        go(&contact, &mut other, x, SLOW);
    }
    let mut within = Point::at_rest(&contact);
    path[..4].iter().for_each(|x| {
        go(&contact, &mut within, *x, SLOW);
    });
    let apart = go(&contact, &mut within, 0.6e-4, SLOW) - evaluate(&contact, &other).0;
    assert!(apart.abs() > 0.5, "{apart} N");
}

#[test]
fn presliding_does_not_depend_on_speed() {
    let contact = flat();
    let run = |speed: f64| {
        let mut p = Point::at_rest(&contact);
        [3e-4, -1e-4, 1.5e-4, 1e-3].map(|x| go(&contact, &mut p, x, speed))
    };
    // A thousand times faster: viscous slip adds sqrt(1e-13) of the level.
    for (slow, fast) in run(SLOW).into_iter().zip(run(1e-2)) {
        assert!((slow - fast).abs() < 1e-6 * 30.0, "{slow} {fast}");
    }
}

#[test]
fn a_step_of_velocity_is_answered_by_the_attraction() {
    // In slip the source has dF/dt = C (1 - F/s): from s(v1) to s(v2) with the time constant s(v2)/C.
    let contact = Contact::from(law(
        registered("gms"),
        &with(&[("viscous", 0.0), ("attraction", 200.0), ("slip_velocity", 1e11)]),
    ));
    let level = |v: f64| 30.0 + 15.0 * (-(v / 0.02_f64).powi(2)).exp();
    for (v1, v2) in [(0.002, 0.03), (0.03, 0.002)] {
        let mut p = Point { v: v1, ..Point::at_rest(&contact) };
        implicit(&contact, &mut p, 1e4, 1.0, &mut |_, _| {});
        p.v = v2;
        let (s1, s2) = (level(v1), level(v2));
        for k in 1..=400 {
            implicit(&contact, &mut p, 2.5e-3, 0.5, &mut |_, _| {});
            let by_hand = s2 + (s1 - s2) * (-200.0 * 2.5e-3 * f64::from(k) / s2).exp();
            let force = evaluate(&contact, &p).0;
            assert!((force - by_hand).abs() < 5e-3, "{v1} to {v2}, {k}: {force} {by_hand}");
        }
    }
}

#[test]
fn friction_lags_behind_velocity_by_the_level_over_the_attraction() {
    // v = 10 mm/s + 1 mm/s sin(w t), always sliding: the loop of F over v has the area of a first-order lag.
    let area = |attraction: f64| {
        let set = with(&[("viscous", 0.0), ("attraction", attraction)]);
        let contact = Contact::from(law(registered("gms"), &set));
        let (omega, steps) = (std::f64::consts::TAU * 2.0, 800_u32);
        let dt = std::f64::consts::TAU / omega / f64::from(steps);
        let v = |k: f64| 0.01 + 1e-3 * (omega * k * dt).sin();
        let mut p = Point { v: 0.01, ..Point::at_rest(&contact) };
        implicit(&contact, &mut p, 1e4, 1.0, &mut |_, _| {});
        let mut area = 0.0;
        for k in 0..3 * steps {
            let (t, force) = (f64::from(k), evaluate(&contact, &p).0);
            p.v = v(t + 0.5);
            implicit(&contact, &mut p, dt, 0.5, &mut |_, _| {});
            if k >= 2 * steps {
                area += 0.5 * (force + evaluate(&contact, &p).0) * (v(t + 1.0) - v(t));
            }
        }
        let weight = (-0.25_f64).exp();
        let (level, slope) = (30.0 + 15.0 * weight, 15.0 * weight * 2.0 * 0.01 / 4e-4);
        let lag = omega * level / attraction;
        (area, std::f64::consts::PI * 1e-6 * slope * lag / (1.0 + lag * lag))
    };
    for attraction in [500.0, 2000.0, 2e4] {
        let (got, by_hand) = area(attraction);
        // Positive: more friction while the velocity rises. Small amplitude: the curve is bent by 1 %.
        assert!((got / by_hand - 1.0).abs() < 0.02, "{attraction}: {got} {by_hand}");
    }
}
