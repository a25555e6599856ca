//! What every friction law promises at a point, for every law in the registry, alone and with everything that can
//! act on it: finite everywhere, derivatives that belong to its values, lanes equal to scalars, odd in the
//! direction of motion, a complete entry in the registry.

use crate::support::*;
use math::{Dual, Gather, Lanes};
use physics::friction::{At, Composition, Contact, Direction, LAWS, MOST_INNER, Shape, weight};

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

/// A search may try exponents for which the power of the velocity is infinite.
#[test]
fn a_stribeck_curve_with_a_steep_exponent_has_finite_slopes() {
    type D = Dual<f64, 2>;
    let of = |value: f64, direction: usize| D {
        re: value,
        eps: [0, 1].map(|i| f64::from(u8::from(i == direction))),
    };
    for v in [0.003, 0.02, 0.021, 0.4] {
        let slopes = weight(D::from(v), of(0.02, 0), of(4e5, 1), Shape::Power);
        assert_eq!(
            (slopes.re, slopes.eps.map(f64::is_finite)),
            (weight(v, 0.02, 4e5, Shape::Power), [true; 2]),
            "{v}"
        );
    }
    assert_eq!(weight(0.021, 0.02, 4e5, Shape::Power), 0.0);
}

#[test]
fn derivatives_are_those_of_the_values() {
    for subject in subjects() {
        // Away from v = 0 and from inner states at nought, where |v| and the slip have their kinks; at v = 0
        // each mode is smooth by design.
        let ranges: Vec<Range> = subject.contact.states().iter().map(Range::of).collect();
        let smooth = |p: &Point| {
            let mut inner = ranges.iter().zip(&p.inner);
            let bent = inner.all(|(range, z)| !range.is_signed() || z.abs() > 100.0 * range.step(*z));
            p.v.abs() > 1e-5 && p.v.abs() < 100.0 && bent
        };
        for p in grid(&subject).into_iter().filter(smooth) {
            for i in 0..5 + p.inner.len() {
                let moved = |change: f64| {
                    let mut q = p.clone();
                    *q.variable(i) += change;
                    evaluate(&subject.contact, &q)
                };
                let h = match i {
                    0 => 1e-5 * p.v.abs(),
                    1 => 1e-3,
                    2 => 1e-7,
                    3 | 4 => 10.0,
                    _ => ranges[i - 5].step(p.inner[i - 5]),
                };
                let ((f1, dz1), (f0, dz0)) = (moved(h), moved(-h));
                let (force, rates) = evaluate_dual::<1>(&subject.contact, &p, |j| (i == j).then_some(0));
                let agree = |dual: f64, high: f64, low: f64, summand: f64| {
                    let difference = (high - low) / (2.0 * h);
                    // Truncation of the difference, and rounding of its two values.
                    let bound = 1e-5 * dual.abs() + 2e-14 * high.abs().max(low.abs()).max(summand) / h;
                    let name = subject.name();
                    assert!((dual - difference).abs() < bound, "{name} {p:?} {i}: {dual} {difference}");
                };
                agree(force.eps[0], f1, f0, 1.0);
                for j in 0..rates.len() {
                    // Slip is a difference of velocities, heat one of powers, rounded as they are: age by
                    // 2e-5 m multiplies the one, 2.7 K/W over 0.4 s the other.
                    let summand = match subject.contact.states()[j].unit {
                        "s" => p.v.abs() * p.inner[j] / 2e-5,
                        "K" => (p.v * f1).abs() * 2.7 / 0.4,
                        _ => 1.0,
                    };
                    agree(rates[j].eps[0], dz1[j], dz0[j], summand.max(1.0));
                }
            }
        }
    }
}

#[test]
fn lanes_equal_scalars_bit_for_bit() {
    type L = Lanes<4>;
    // Lanes share what selects code.
    let near = [1.0, 1.1, 0.9, 1.3];
    for subject in subjects() {
        let meta = subject.meta;
        let contacts: Vec<_> = near
            .iter()
            .map(|factor| {
                let varied = law(meta, &varied(meta, &subject.set, *factor));
                let mut contact = composed(subject.kind, meta, varied);
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
    if let Some(heating) = &mut composition.heating {
        heating.viscous *= factor;
        heating.resistance *= factor;
        heating.ambient *= 2.0 - factor;
    }
    if let Some(wear) = &mut composition.wear {
        wear.run_in *= factor;
        wear.slid *= factor;
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
    for subject in subjects().filter(|subject| subject.meta.claims.odd) {
        let mut other = subject.contact.clone();
        if let Some(Composition { direction: Some(way), .. }) = other.composition.as_deref_mut() {
            *way = Direction { positive: way.negative, negative: way.positive, ..*way };
        }
        let states = subject.contact.states();
        let turn = |values: &[f64]| -> Vec<f64> {
            let signs = states.iter().map(|state| if Range::of(state).is_signed() { -1.0 } else { 1.0 });
            values.iter().zip(signs).map(|(value, sign)| sign * value).collect()
        };
        // At rest there is no direction for a factor of direction.
        let directed = subject.kind == "everything";
        for p in grid(&subject).into_iter().filter(|p| p.v != 0.0 || !directed) {
            let turned =
                Point { v: -p.v, applied: -p.applied, inner: turn(&p.inner), mode: -p.mode, ..p.clone() };
            let ((force, dz), (back, dz_back)) = (evaluate(&subject.contact, &p), evaluate(&other, &turned));
            assert_eq!(force, -back, "{} {p:?}", subject.name());
            assert_eq!(dz, turn(&dz_back), "{} {p:?}", subject.name());
        }
    }
}

/// A level that jumped with the sign of v, under a contact that presses as hard as it can, would turn the mass round at
/// every instant: no step would be short enough.
#[test]
fn nothing_jumps_where_the_velocity_changes_its_sign() {
    for subject in subjects().filter(|subject| !(subject.meta.sticks && subject.meta.stops)) {
        let own = subject.contact.law.states().len();
        // Armstrong's slip is a mode that ends there, by an event.
        for p in grid(&subject).into_iter().filter(|p| p.v == 1e-15 && p.mode == 0.0) {
            let ((force, rates), (back, rates_back)) =
                (evaluate(&subject.contact, &p), evaluate(&subject.contact, &Point { v: -p.v, ..p.clone() }));
            let near = |a: f64, b: f64| (a - b).abs() <= 1e-9 * (1.0 + a.abs());
            assert!(near(force, back), "{} {p:?}: {force} {back}", subject.name());
            for (rate, rate_back) in rates.iter().zip(&rates_back).take(own) {
                assert!(near(*rate, *rate_back), "{} {p:?}: {rate} {rate_back}", subject.name());
            }
        }
    }
}

#[test]
fn the_registry_is_complete() {
    let bibliography = include_str!("../../../../references.bib");
    let known = |unit: &str| {
        let factor = |f: &str| {
            let base = f.trim_end_matches(|c: char| c.is_ascii_digit());
            ["N", "m", "s", "kg", "K", "Pa", "J", "W", "rad", "1", "-"].contains(&if f == "1" {
                f
            } else {
                base
            })
        };
        unit.split(['/', ' ', '(', ')']).filter(|part| !part.is_empty()).all(factor)
    };
    for meta in LAWS {
        let key = meta.key;
        assert!(bibliography.contains(&format!("{{{},", meta.source)), "{key}: no entry {}", meta.source);
        assert!(!meta.title.is_empty() && LAWS.iter().filter(|other| other.key == key).count() == 1);
        for p in meta.parameters {
            let name = format!("{key}.{}", p.key);
            assert!(known(p.unit), "{name}: unit {}", p.unit);
            assert!(p.meaning.trim().len() > 5, "{name} has no meaning");
            assert!(p.bounds.lower <= p.bounds.upper && !p.bounds.contain(f64::NAN), "{name}");
            assert!(p.default.is_none_or(|x| p.bounds.contain(x) || x.is_infinite()), "{name}: default");
        }
    }
    for subject in subjects() {
        let states = subject.contact.states();
        assert!(states.len() <= MOST_INNER, "{}: {} states", subject.name(), states.len());
        for state in &states {
            assert!(known(state.unit) && state.scale > 0.0, "{}: {state:?}", subject.name());
        }
        for source in subject.contact.sources() {
            assert!(bibliography.contains(&format!("{{{source},")), "no entry {source}");
        }
    }
}

#[test]
fn stick_ends_at_breakaway_and_slip_at_rest() {
    for meta in LAWS.iter().filter(|meta| meta.sticks && meta.stops) {
        for set in &sets(meta) {
            let law = law(meta, set);
            let limit = levels(meta, set).breakaway;
            let levels = law.levels();
            let event = |v: f64, applied: f64, mode: f64| {
                let at = At { v, applied, prepared: law.prepare(v), ..At::at_rest() };
                law.event(&at, &levels, &[], mode)
            };
            let next = |applied: f64, mode: f64| {
                law.next_mode(mode, &At { applied, ..At::at_rest() }, &levels, &mut [])
            };
            for sign in [-1.0, 1.0] {
                assert!(event(0.0, 0.999 * sign * limit, 0.0) > 0.0, "it sticks below the limit");
                assert!(event(0.0, 1.001 * sign * limit, 0.0) < 0.0, "and leaves above it");
                assert_eq!(next(1.001 * sign * limit, 0.0).signum(), sign, "with the force");
                assert!(event(sign * 1e-3, 0.0, sign) > 0.0, "it slides as long as it moves");
                assert!(event(-sign * 1e-3, 0.0, sign) < 0.0);
                assert_eq!(next(-0.9 * sign * limit, sign), 0.0, "it stops");
                assert_eq!(next(-1.1 * sign * limit, sign).signum(), -sign, "it is pushed back");
                // In stick the friction is the applied force: nothing accelerates.
                let contact = Contact::from(law.clone());
                let p = Point { applied: 0.7 * sign * limit, ..Point::at_rest(&contact) };
                assert_eq!(evaluate(&contact, &p).0, p.applied);
            }
        }
    }
}
