//! What every friction law promises, for every law in the registry, alone and with everything that can
//! act on it: finite everywhere, derivatives that belong to its values, lanes equal to scalars, odd in the
//! direction of motion, a Stribeck curve in steady sliding, and no energy from nothing.

mod support;

use math::Lanes;
use physics::friction::{At, Composition, Contact, Direction, LAWS, Levels};
use support::*;

#[test]
fn finite_everywhere() {
    for subject in subjects() {
        for p in grid(&subject) {
            let (force, rates) = evaluate(&subject.contact, &p);
            assert!(force.is_finite() && rates.iter().all(|r| r.is_finite()), "{} {p:?}", subject.name());
            for i in 0..5 + p.inner.len() {
                let (force, rates) = evaluate_dual::<1>(&subject.contact, &p, |j| (i == j).then_some(0));
                let slopes = rates.iter().chain([&force]).map(|d| d.eps[0]);
                assert!(slopes.into_iter().all(f64::is_finite), "{} {p:?} by {i}", subject.name());
            }
        }
    }
}

#[test]
fn derivatives_are_those_of_the_values() {
    for subject in subjects() {
        // Away from v = 0 and from bristles at rest, where |v| and the slip have their kinks; at v = 0 each
        // mode is smooth by design.
        let smooth = |p: &Point| {
            let bent = subject.meta.states.is_empty() || p.inner[0].abs() > 1e-6;
            p.v.abs() > 1e-5 && p.v.abs() < 100.0 && bent
        };
        for p in grid(&subject).into_iter().filter(smooth) {
            for i in 0..5 + p.inner.len() {
                let moved = |change: f64| {
                    let mut q = p.clone();
                    *q.variable(i) += change;
                    evaluate(&subject.contact, &q)
                };
                let name = i.checked_sub(5).map(|j| subject.contact.states()[j].name);
                let h = match (i, name) {
                    (0, _) => 1e-5 * p.v.abs(),
                    (1, _) => 1e-3,
                    (2, _) => 1e-7,
                    (3 | 4, _) => 10.0,
                    (_, Some("contact_age_s")) => 1e-5 * p.inner[i - 5],
                    _ => 1e-9,
                };
                let ((f1, dz1), (f0, dz0)) = (moved(h), moved(-h));
                let (force, rates) = evaluate_dual::<1>(&subject.contact, &p, |j| (i == j).then_some(0));
                let agree = |dual: f64, high: f64, low: f64| {
                    let difference = (high - low) / (2.0 * h);
                    // Truncation of the difference, and rounding of its two values.
                    let bound = 1e-5 * dual.abs() + 2e-14 * high.abs().max(low.abs()).max(1.0) / h;
                    let name = subject.name();
                    assert!((dual - difference).abs() < bound, "{name} {p:?} {i}: {dual} {difference}");
                };
                agree(force.eps[0], f1, f0);
                for j in 0..rates.len() {
                    agree(rates[j].eps[0], dz1[j], dz0[j]);
                }
            }
        }
    }
}

#[test]
fn lanes_equal_scalars_bit_for_bit() {
    type L = Lanes<4>;
    // Lanes share the choices of code: an exponent of two or not, fading or not.
    let near = [1.0, 1.1, 0.9, 1.3];
    for subject in subjects() {
        let meta = subject.meta;
        let contacts: Vec<_> = near
            .iter()
            .map(|factor| {
                let vary = |(&key, &value): (&&'static str, &f64)| match key {
                    "stribeck_exponent" => (key, value),
                    "breakaway_share" => (key, value.powf(*factor)),
                    _ => (key, value * factor),
                };
                let mut contact =
                    composed(subject.kind, meta, law(meta, &subject.set.iter().map(vary).collect()));
                if let Some(composition) = contact.composition.as_deref_mut() {
                    vary_composition(composition, *factor);
                }
                contact
            })
            .collect();
        let gathered: Contact<L> = Contact::gather(&contacts.iter().collect::<Vec<_>>());
        let points = grid(&subject);
        for i in 0..points.len() {
            let each: Vec<&Point> = (0..4).map(|l| &points[(i + 7 * l) % points.len()]).collect();
            let put = |f: &dyn Fn(&Point) -> f64| Lanes(std::array::from_fn(|l| f(each[l])));
            let inner: Vec<L> = (0..points[0].inner.len()).map(|j| put(&|p| p.inner[j])).collect();
            let mut rates = inner.clone();
            let v = put(&|p| p.v);
            let at = At {
                v,
                x: put(&|p| p.x),
                gauge_a: put(&|p| p.gauges[0]),
                gauge_b: put(&|p| p.gauges[1]),
                applied: put(&|p| p.applied),
                prepared: gathered.law.prepare(v),
            };
            let force = gathered.force(&at, &inner, &mut rates, put(&|p| p.mode));
            for l in 0..4 {
                let (scalar, own) = evaluate(&contacts[l], each[l]);
                assert_eq!(force.0[l].to_bits(), scalar.to_bits(), "{} {:?}", subject.name(), each[l]);
                for j in 0..own.len() {
                    assert_eq!(rates[j].0[l].to_bits(), own[j].to_bits(), "{}", subject.name());
                }
            }
        }
    }
}

/// Other numbers for the same composition.
fn vary_composition(composition: &mut Composition<f64>, factor: f64) {
    if let Some(dwell) = &mut composition.dwell {
        dwell.increment *= factor;
        dwell.time *= 2.0 - factor;
        dwell.distance *= factor;
    }
    if let Some(relaxation) = &mut composition.relaxation {
        relaxation.share *= factor;
        relaxation.time *= factor;
    }
    if let Some(position) = &mut composition.position {
        position.slope *= factor;
        position.harmonics[0].period *= factor;
    }
    if let Some(direction) = &mut composition.direction {
        direction.negative *= factor;
    }
    if let Some(side_load) = &mut composition.side_load {
        side_load.force *= factor;
    }
}

#[test]
fn odd_in_the_direction_of_motion() {
    for subject in subjects() {
        let mut other = subject.contact.clone();
        if let Some(Composition { direction: Some(way), .. }) = other.composition.as_deref_mut() {
            *way = Direction { positive: way.negative, negative: way.positive, ..*way };
        }
        let states = subject.contact.states();
        let turn = |values: &[f64]| -> Vec<f64> {
            let signs = states.iter().map(|state| if state.name == "contact_age_s" { 1.0 } else { -1.0 });
            values.iter().zip(signs).map(|(value, sign)| sign * value).collect()
        };
        for p in grid(&subject) {
            let turned =
                Point { v: -p.v, applied: -p.applied, inner: turn(&p.inner), mode: -p.mode, ..p.clone() };
            let ((force, dz), (back, dz_back)) = (evaluate(&subject.contact, &p), evaluate(&other, &turned));
            assert_eq!(force, -back, "{} {p:?}", subject.name());
            assert_eq!(dz, turn(&dz_back), "{} {p:?}", subject.name());
        }
    }
}

/// Force at `p` after the inner states have come to rest: longer and longer implicit steps.
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
fn steady_sliding_is_a_stribeck_curve() {
    for subject in subjects() {
        let Subject { meta, set, contact, .. } = &subject;
        for v in [1e-6, 1e-4, 2e-3, 0.02, 0.1, 1.5] {
            for v in [v, -v] {
                let p = Point { v, x: 0.13, gauges: [4e5, 1e5], ..Point::at_rest(contact) };
                let Levels { coulomb, breakaway, .. } = by_hand(&subject, v);
                let by_hand = curve(meta, set, coulomb, breakaway, v);
                let force = settled(&subject, &p);
                assert!((force / by_hand - 1.0).abs() < 1e-11, "{} {v}: {force} {by_hand}", subject.name());
                let steady = contact.steady(&at(&p));
                assert!((steady / by_hand - 1.0).abs() < 1e-12, "{} {v}: {steady}", subject.name());
            }
        }
    }
}

/// Fc and Fs at velocity v, 0.13 m, 4 bar in a and 1 bar in b, from the numbers in `support`.
fn by_hand(subject: &Subject, v: f64) -> Levels<f64> {
    let Levels { mut coulomb, mut breakaway, viscous } = levels(subject.meta, &subject.set);
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
            let (x, turn) = (0.03, 2.0 * std::f64::consts::PI);
            let waves = 0.04 * (turn * x / 0.05 + 0.3).cos() + 0.02 * (turn * x / 0.007 - 1.1).cos();
            let factor = (1.0 + 0.2 * x + waves) * if v > 0.0 { 1.2 } else { 0.85 };
            (coulomb, breakaway) = (coulomb * factor, breakaway * factor);
            let age = 2e-5 / v.abs();
            more = 0.1 * 20.0 + 1.6 * 1.5 * age / (1.0 + age);
        }
        _ => {}
    }
    Levels { coulomb: coulomb + more, breakaway: breakaway + more, viscous }
}

/// Moves the contact; the least of (energy put in - energy stored) over all times, J, and the energy
/// turned over.
fn least_dissipation(contact: &Contact<f64>, motion: &[(f64, f64)]) -> (f64, f64) {
    const STEPS: u32 = 100;
    let mut p = Point::at_rest(contact);
    let (mut put_in, mut turned, mut least, mut x) = (0.0, 0.0, 0.0_f64, 0.0);
    for &(v, duration) in motion {
        let dt = duration / f64::from(STEPS);
        (p.v, p.mode) = (v, if contact.law.meta().sticks { v.signum() } else { 0.0 });
        for _ in 0..STEPS {
            // Midpoint rule: it keeps what is stored as a square exactly.
            p.x = (x + 0.5 * v * dt).rem_euclid(0.2);
            let mut work = 0.0;
            implicit(contact, &mut p, dt, 0.5, &mut |p, dt| work += evaluate(contact, p).0 * v * dt);
            x += v * dt;
            put_in += work;
            turned += work.abs();
            least = least.min(put_in - contact.stored::<f64>(&p.inner));
        }
    }
    (least, turned)
}

#[test]
fn passive_sets_give_no_energy() {
    // A day's stop and 6 bar in both chambers bring breakaway to 120 N against 30 N.
    let passive = [
        with(&[("viscous", 1000.0)]),
        with(&[("damping_fade_velocity", 0.7), ("viscous", 0.0)]),
        with(&[("breakaway", 30.0), ("viscous", 800.0)]),
    ];
    for meta in LAWS {
        for (set, kind) in passive.iter().flat_map(|set| KINDS.map(|kind| (set, kind))) {
            let contact = composed(kind, meta, law(meta, set));
            let creeps = meta.creeps && contact.states().iter().any(|state| state.name == "contact_age_s");
            let warnings = contact.warnings(6e5, 0.2);
            assert_eq!(warnings.len(), usize::from(creeps), "{} {kind}: passive. {warnings:?}", meta.key);
            for seed in 0..10 {
                let (least, turned) = least_dissipation(&contact, &random_motion(seed));
                assert!(least > -1e-9 * turned, "{} {kind} {seed}: {least} of {turned}", meta.key);
            }
        }
    }
}

#[test]
fn heat_is_what_is_not_stored() {
    for subject in subjects() {
        let contact = &subject.contact;
        for p in grid(&subject).into_iter().filter(|p| p.mode * p.v >= 0.0 && p.v.abs() < 10.0) {
            let (force, dz) = evaluate(contact, &p);
            // The energy is quadratic in the bristles: any step gives its rate.
            let bristles = dz.iter().zip(contact.states()).filter(|(_, state)| state.unit == "m");
            let direction = 1e-4 / bristles.fold(1e-30_f64, |size, (r, _)| size.max(r.abs()));
            let moved: Vec<f64> = p.inner.iter().zip(&dz).map(|(z, r)| z + direction * r).collect();
            let back: Vec<f64> = p.inner.iter().zip(&dz).map(|(z, r)| z - direction * r).collect();
            let storing = (contact.stored::<f64>(&moved) - contact.stored::<f64>(&back)) / (2.0 * direction);
            let heat = contact.heat(p.v, force, &p.inner, &dz);
            let size = (force * p.v).abs() + storing.abs() + 1e-9;
            assert!((force * p.v - storing - heat).abs() < 1e-6 * size, "{} {p:?}", subject.name());
        }
    }
}

#[test]
fn a_set_that_is_not_passive_says_so_and_is_not() {
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
        let gives = |seed| {
            let (least, turned) = least_dissipation(&contact, &random_motion(seed));
            least < -1e-3 * turned
        };
        assert!((0..30).any(gives), "random motions find it too");
    }
}

#[test]
fn stick_ends_at_breakaway_and_slip_at_rest() {
    for meta in LAWS.iter().filter(|meta| meta.sticks) {
        for set in &sets() {
            let law = law(meta, set);
            let limit = levels(meta, set).breakaway;
            let levels = law.levels();
            let event = |v: f64, applied: f64, mode: f64| {
                let at = At { v, applied, prepared: law.prepare(v), ..At::at_rest() };
                law.event(&at, &levels, mode)
            };
            for sign in [-1.0, 1.0] {
                assert!(event(0.0, 0.999 * sign * limit, 0.0) > 0.0, "it sticks below the limit");
                assert!(event(0.0, 1.001 * sign * limit, 0.0) < 0.0, "and leaves above it");
                assert_eq!(law.next_mode(0.0, 1.001 * sign * limit, &levels), sign, "with the force");
                assert!(event(sign * 1e-3, 0.0, sign) > 0.0, "it slides as long as it moves");
                assert!(event(-sign * 1e-3, 0.0, sign) < 0.0);
                assert_eq!(law.next_mode(sign, -0.9 * sign * limit, &levels), 0.0, "it stops");
                assert_eq!(law.next_mode(sign, -1.1 * sign * limit, &levels), -sign, "it is pushed back");
                // In stick the friction is the applied force: nothing accelerates.
                let contact = Contact::from(law.clone());
                let p = Point { applied: 0.7 * sign * limit, ..Point::at_rest(&contact) };
                assert_eq!(evaluate(&contact, &p).0, p.applied);
            }
        }
    }
}
