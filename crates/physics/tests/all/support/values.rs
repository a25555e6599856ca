//! Numbers for the contracts of friction: a value for each parameter, a range for each inner state. A new law
//! adds those that are missing, and nothing else; one that already has a name and a fitting number adds none.

use physics::Parameter;
use physics::friction::{AnyLaw, Choices, InnerState, Meta};
use std::collections::BTreeMap;

/// A value for each name of a parameter; a law takes those that it lists.
pub type Set = BTreeMap<&'static str, f64>;

/// The reference set.
const BASE: &[(&str, f64)] = &[
    ("coulomb", 30.0),
    ("breakaway", 45.0),
    ("stribeck_velocity", 0.02),
    ("stribeck_exponent", 2.0),
    ("viscous", 40.0),
    ("bristle_stiffness", 1e5),
    ("bristle_damping", 300.0),
    ("damping_fade_velocity", f64::INFINITY),
    ("breakaway_share", 0.9),
    ("dead_zone", 5e-7),
    ("dahl_exponent", 1.0),
    ("bouc_wen_exponent", 1.0),
    ("loop_shape", 0.8),
    ("memory_time", 0.02),
    ("recovery_time", 1.0),
    ("attraction", 2000.0),
    ("direct_effect", 0.1),
    ("evolution_effect", 0.03),
    ("distance", 5e-5),
    ("reference_velocity", 1e-3),
    ("film_velocity", 0.05),
    ("film_growth_time", 0.03),
    ("film_decay_time", 0.2),
    ("film_rest_time", 20.0),
];

/// Parameters that select code or count states: the same in all lanes.
const SELECTING: &[&str] = &["stribeck_exponent"];

pub fn with(changes: &[(&'static str, f64)]) -> Set {
    BASE.iter().chain(changes).copied().collect()
}

/// The reference set, one with a general exponent, one that fades, one where nothing is round; then those that
/// only some laws need, as for a condition of passivity that none of these breaks.
pub fn sets(meta: &Meta) -> Vec<Set> {
    let mut sets = vec![
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
    ];
    let own: &[&[(&'static str, f64)]] = match meta.key {
        "dahl" => &[&[("dahl_exponent", 1.7)]],
        "bouc-wen" => &[&[("bouc_wen_exponent", 2.3), ("loop_shape", 0.5)]],
        "lugre" | "elasto-plastic" | "film-lugre" => &[&[("viscous", 0.0), ("bristle_damping", 1e3)]],
        "rate-and-state" => &[&[("direct_effect", 0.04), ("evolution_effect", 0.06)]],
        _ => &[],
    };
    sets.extend(own.iter().map(|changes| with(changes)));
    sets
}

/// Sets that every law is passive with, also pressed, aged, worn and warm: breakaway up to 120 N on 30 N.
pub fn passive_sets() -> [Set; 3] {
    [
        with(&[("viscous", 1000.0)]),
        with(&[("damping_fade_velocity", 0.7), ("viscous", 0.0)]),
        with(&[("breakaway", 30.0), ("viscous", 800.0)]),
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

/// The set with other numbers of the same kind, for a lane of its own.
pub fn varied(meta: &Meta, set: &Set, factor: f64) -> Set {
    let vary = |p: &Parameter| {
        let value = set.get(p.key).copied().or(p.default).expect("a value");
        let candidates = [value * factor, value.powf(factor)];
        let fitting = candidates.into_iter().find(|v| p.bounds.contain(*v));
        (p.key, if SELECTING.contains(&p.key) { value } else { fitting.unwrap_or(value) })
    };
    meta.parameters.iter().map(vary).collect()
}

/// Which values an inner state takes.
pub enum Range {
    /// Turns with the direction of motion; up to this.
    Signed(f64),
    /// Does not; a share of this, or ages of every length.
    Share(f64),
    Ages,
}

impl Range {
    pub fn of(state: &InnerState) -> Self {
        match (state.name, state.unit) {
            ("contact_log_age" | "sliding_distance_m", _) => Range::Share(3.0),
            ("relaxed_deflection_m", _) => Range::Signed(5e-4),
            (_, "m") => Range::Signed(4.5e-4),
            (_, "N") => Range::Signed(45.0),
            (_, "m/s") => Range::Signed(0.1),
            (_, "s") => Range::Ages,
            (_, "-") => Range::Share(0.3),
            (_, "K") => Range::Share(20.0),
            (name, unit) => panic!("a range for the new state {name}, {unit}"),
        }
    }

    pub fn is_signed(&self) -> bool {
        matches!(self, Range::Signed(_))
    }

    /// The `i`-th of five points of the grid for the `j`-th state: both signs, beyond the limit, nought.
    pub fn at(&self, i: usize, j: usize) -> f64 {
        const WAYS: [[f64; 5]; 3] =
            [[-1.07, -0.4, 0.0, 1e-9, 0.93], [0.3, 1.01, -0.6, 0.0, 0.2], [0.7, -0.97, 0.11, -0.31, 1e-3]];
        let way = WAYS[j % 3][i];
        match self {
            Range::Signed(size) => way * size,
            Range::Share(size) => way.abs().min(1.0) * size,
            Range::Ages => [1e-5, 0.31, 41.0, 1e-9, 1e5][i],
        }
    }

    /// A step for a difference at `value`.
    pub fn step(&self, value: f64) -> f64 {
        match self {
            Range::Signed(size) | Range::Share(size) => 1e-6 * size,
            Range::Ages => 1e-5 * value,
        }
    }
}
