//! Checks of a custom law with given values of its parameters: finite, steady, opposing, passive.

use super::{Formula, LEVELS, MOST_STATES, OwnLaw, VARIABLES};
use crate::friction::{At, Levels};
use crate::written::not_finite;
use math::{Dual, Real};

/// Directions of a derivative: v, x, both pressures, then the states.
type Slopes = Dual<f64, { VARIABLES.len() + MOST_STATES }>;

const VELOCITIES: [f64; 11] = [0.0, 1e-6, -1e-6, 1e-3, -1e-3, 0.02, -0.02, 0.3, -0.3, 5.0, -5.0];
/// Fractions of a state's scale.
const DEFLECTIONS: [f64; 5] = [0.0, 1e-3, -1e-3, 0.3, -0.3];
const GAUGES: [[f64; 2]; 3] = [[0.0, 0.0], [6e5, 0.0], [-5e4, 1e6]];
/// Velocities at which steady sliding is checked, m/s.
const STEADY: [f64; 5] = [1e-4, 1e-3, 0.02, 0.3, 1.0];
/// Velocities after a sudden change, m/s.
const SUDDEN: [f64; 8] = [1e-3, 0.01, 0.03, 0.1, 0.3, 1.0, 2.0, 5.0];
/// Fraction of its first rate at which a state counts as settled.
const AT_REST: f64 = 1e-6;
const SAME_FORCE: f64 = 1e-6;
/// Velocity at which a force with a jump at v = 0 has jumped, m/s, and the relative size of the jump at SLOW.
const SLOWEST: f64 = 1e-10;
const SLOW: f64 = 1e-3;
const JUMP: f64 = 0.1;

impl OwnLaw {
    /// Returns whether the law has bristles, which can relax: one state, a length, whose energy is its square.
    pub(super) fn is_bristles(&self) -> bool {
        let [state] = self.meta.states else { return false };
        let Some(energy) = self.energy.as_ref().filter(|_| state.unit == "m") else { return false };
        let typical = |bounds: &crate::Bounds| match (bounds.lower.is_finite(), bounds.upper.is_finite()) {
            (true, true) => 0.5 * (bounds.lower + bounds.upper),
            (true, false) => bounds.lower + 1.0,
            (false, true) => bounds.upper - 1.0,
            (false, false) => 1.0,
        };
        let values = self.meta.parameters.iter().map(|p| p.default.unwrap_or(typical(&p.bounds)));
        let own = energy.own(&self.graph.constants(&values.collect::<Vec<f64>>()));
        let energy = |z: f64| {
            let mut out = [0.0];
            energy.run(&own, |p| p, |_| z, &mut out);
            out[0]
        };
        let one = energy(1e-3);
        let square = |z: f64| (energy(z) - one * (z / 1e-3).powi(2)).abs() <= 1e-12 * energy(z).abs();
        one > 0.0 && energy(0.0) == 0.0 && [2e-3, -1e-3, 0.1].into_iter().all(square)
    }
}

impl Formula<f64> {
    /// Refuses invalid values of the law. Each message names the place.
    pub fn examine(&self) -> Result<(), String> {
        let mut good = self.law.good.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
        if !good.is_empty() && *good == self.parameters {
            return Ok(());
        }
        self.look()?;
        *good = self.parameters.clone();
        Ok(())
    }

    fn look(&self) -> Result<(), String> {
        let points = self.points();
        for (at, z) in &points {
            self.finite(at, z)?;
        }
        if self.law.meta.claims.odd {
            points.iter().try_for_each(|(at, z)| self.odd(at, z))?;
        }
        points.iter().try_for_each(|(at, z)| self.continuous(at, z))?;
        let forces = STEADY.iter().flat_map(|v| [*v, -v]).map(|v| Ok((v, self.rests(v)?)));
        let forces = forces.collect::<Result<Vec<(f64, f64)>, String>>()?;
        if forces.iter().all(|(v, force)| force * v < 0.0) {
            return Err(format!(
                "friction law \"{}\": in steady sliding the force drives the motion at every tested speed; \
                 it must be positive where it opposes v > 0: change its sign",
                self.law.meta.key
            ));
        }
        Ok(())
    }

    /// Returns warnings about these values with these levels.
    pub fn warning(&self, levels: &Levels<f64>) -> Option<String> {
        let name = self.law.meta.key;
        let pushes = STEADY.iter().flat_map(|v| [*v, -v]).find_map(|v| {
            let force = self.steady(&At { v, ..At::at_rest() }, levels);
            (force * v < 0.0).then(|| {
                format!(
                    "friction law \"{name}\" drives the motion: {force:.3} N in steady sliding at {} mm/s{}",
                    1e3 * v,
                    self.with(levels)
                )
            })
        });
        pushes.or_else(|| self.gives_power(levels)).or_else(|| self.gives_energy(levels))
    }

    /// Checks a law with an energy: a sudden change of speed after steady sliding must not give more power than the
    /// states lose.
    fn gives_power(&self, levels: &Levels<f64>) -> Option<String> {
        self.law.energy.as_ref()?;
        let speeds = |all: &[f64]| all.iter().flat_map(|v| [*v, -v]).collect::<Vec<f64>>();
        for before in speeds(&STEADY) {
            let mut z = vec![0.0; self.law.meta.states.len()];
            self.settle(&At { v: before, ..At::at_rest() }, levels, &mut z);
            for v in speeds(&SUDDEN) {
                let mut rates = z.clone();
                let force = self.force(&At { v, ..At::at_rest() }, levels, &z, &mut rates);
                let heat = self.heat(v, force, &z, &rates);
                if heat < -GIVEN * (force * v).abs() {
                    return Some(format!(
                        "friction law \"{}\" is not passive{}: when sliding at {} mm/s changes suddenly to {} mm/s, it gives \
                         {:.4} W more than its states lose, so friction can give energy during fast transients",
                        self.law.meta.key,
                        self.with(levels),
                        1e3 * before,
                        1e3 * v,
                        -heat
                    ));
                }
            }
        }
        None
    }

    fn with(&self, levels: &Levels<f64>) -> String {
        let values = [levels.coulomb, levels.breakaway, levels.viscous];
        let known = LEVELS.iter().zip(values).zip(self.law.levels).filter(|(_, level)| level.is_some());
        let words: Vec<String> =
            known.map(|(((name, unit), value), _)| format!("{name} {value:.6} {unit}")).collect();
        if words.is_empty() { String::new() } else { format!(" (with {})", words.join(", ")) }
    }

    fn points(&self) -> Vec<(At<f64>, Vec<f64>)> {
        let states = self.law.meta.states;
        let mut out = Vec::new();
        for v in VELOCITIES {
            for share in DEFLECTIONS {
                let z: Vec<f64> = states
                    .iter()
                    .zip(&self.law.kept)
                    .map(|(state, kept)| {
                        let z = share * state.scale;
                        if kept.contain(z) { z } else { 0.0 }
                    })
                    .collect();
                for [a, b] in GAUGES {
                    out.push((At { v, x: 0.1, ..At::at_rest() }.pressed(a, b), z.clone()));
                }
                if states.is_empty() {
                    break;
                }
            }
        }
        out
    }

    fn both(&self, at: &At<f64>, z: &[f64]) -> Vec<f64> {
        let mut out = vec![0.0; z.len() + 1];
        let (force, rates) = out.split_first_mut().expect("a force");
        *force = self.force(at, &self.levels(), z, rates);
        out
    }

    fn finite(&self, at: &At<f64>, z: &[f64]) -> Result<(), String> {
        let dual = At {
            v: Slopes::variable(at.v, 0),
            x: Slopes::variable(at.x, 1),
            gauge_a: Slopes::variable(at.gauge_a, 2),
            gauge_b: Slopes::variable(at.gauge_b, 3),
            applied: Slopes::zero(),
            prepared: Slopes::zero(),
        };
        let levels = self.levels().map(Slopes::from);
        let states: Vec<Slopes> =
            z.iter().enumerate().map(|(i, z)| Slopes::variable(*z, VARIABLES.len() + i)).collect();
        let mut rates = vec![Slopes::zero(); z.len()];
        let force = self.force(&dual, &levels, &states, &mut rates);
        let names = std::iter::once("force".to_string())
            .chain(self.law.keys.iter().map(|key| format!("the rate of {key}")));
        for (name, value) in names.zip(std::iter::once(&force).chain(&rates)) {
            let by =
                |i: usize| VARIABLES.get(i).map_or_else(|| self.law.keys[i - VARIABLES.len()], |own| own.0);
            let Some(what) = not_finite(value, by) else { continue };
            return Err(format!(
                "friction law \"{}\": {name} is not finite at {}: {what}",
                self.law.meta.key,
                self.place(at, z)
            ));
        }
        Ok(())
    }

    fn place(&self, at: &At<f64>, z: &[f64]) -> String {
        let mut words = vec![format!("v = {} m/s", at.v)];
        let states = self.law.keys.iter().zip(self.law.meta.states).zip(z);
        words.extend(states.map(|((key, state), z)| format!("{key} = {z} {}", state.unit)));
        words.push(format!("pressure_a = {} Pa, pressure_b = {} Pa", at.gauge_a, at.gauge_b));
        words.join(", ")
    }

    fn odd(&self, at: &At<f64>, z: &[f64]) -> Result<(), String> {
        let turned: Vec<f64> = z.iter().map(|z| -z).collect();
        let (own, other) = (self.both(at, z), self.both(&At { v: -at.v, ..*at }, &turned));
        let size = own[0].abs().max(f64::MIN_POSITIVE);
        if (own[0] + other[0]).abs() <= SAME_FORCE * size {
            return Ok(());
        }
        Err(format!(
            "friction law \"{}\" has odd = true, but at {} the force is {} N, and {} N with v and all states reversed",
            self.law.meta.key,
            self.place(at, z),
            own[0],
            other[0]
        ))
    }

    /// A force with a jump at v = 0 would make the integrator chatter.
    fn continuous(&self, at: &At<f64>, z: &[f64]) -> Result<(), String> {
        let jump = |v: f64| self.both(&At { v, ..*at }, z)[0] - self.both(&At { v: -v, ..*at }, z)[0];
        let (near, far) = (jump(SLOWEST).abs(), jump(SLOW).abs());
        if near <= JUMP * far || near < 1e-9 {
            return Ok(());
        }
        Err(format!(
            "friction law \"{}\": the force jumps by {near:.4} N where v changes its sign, which an integrator cannot pass; \
             write tanh(v/v0) with a small v0, or give it an inner state (bristles), or use \"coulomb\" or \"stribeck\", \
             which stick exactly",
            self.law.meta.key
        ))
    }

    /// Returns the force in steady sliding at `v`, after a check that it exists.
    fn rests(&self, v: f64) -> Result<f64, String> {
        let name = self.law.meta.key;
        let (at, levels) = (At { v, ..At::at_rest() }, self.levels());
        let mut z = vec![0.0; self.law.meta.states.len()];
        let first = self.both(&at, &z);
        let force = self.settle(&at, &levels, &mut z);
        let last = self.both(&at, &z);
        for (i, key) in self.law.keys.iter().enumerate() {
            let (begin, end) = (first[i + 1].abs(), last[i + 1].abs());
            if end <= AT_REST * begin {
                continue;
            }
            return Err(format!(
                "friction law \"{name}\": state {key} does not come to rest in steady sliding at {} mm/s: its rate is {end:.4e} {}/s \
                 (at first {begin:.4e}); every state of a friction law must have a steady value at constant speed",
                1e3 * v,
                self.law.meta.states[i].unit
            ));
        }
        let said = self.steady(&at, &levels);
        if (said - force).abs() > SAME_FORCE * force.abs().max(1e-9) {
            return Err(format!(
                "friction law \"{name}\": steady gives {said} N at {} mm/s, but the force settles at {force} N there",
                1e3 * v
            ));
        }
        Ok(force)
    }
}

/// Random motions: their number, the pieces of each, and the steps of each piece.
const MOTIONS: u64 = 10;
const PIECES: usize = 30;
const PIECE_STEPS: u32 = 20;
/// Ratio of produced to exchanged energy that exceeds the errors of integration.
const GIVEN: f64 = 1e-4;

impl Formula<f64> {
    /// Moves the contact at random, from rest. Returns a motion that extracts more energy than it put in.
    fn gives_energy(&self, levels: &Levels<f64>) -> Option<String> {
        (1..=MOTIONS).find_map(|seed| self.gives_energy_in(random_motion(seed), levels))
    }

    fn gives_energy_in(&self, motion: Vec<(f64, f64)>, levels: &Levels<f64>) -> Option<String> {
        let mut z = vec![0.0; self.law.meta.states.len()];
        let (mut put_in, mut turned, mut most, mut time) = (0.0, 0.0, 0.0, 0.0);
        let mut found = None;
        for (v, duration) in motion {
            let dt = duration / f64::from(PIECE_STEPS);
            let at = At { v, ..At::at_rest() };
            for _ in 0..PIECE_STEPS {
                let (work, size) = self.midpoint(&at, levels, &mut z, dt, 0);
                put_in += work;
                turned += size;
                time += dt;
                let given = self.stored(&z) - put_in;
                if given > most && given > GIVEN * turned {
                    most = given;
                    found = Some((v, z.clone(), time));
                }
            }
        }
        let (v, z, time) = found?;
        let states: Vec<String> = self
            .law
            .keys
            .iter()
            .zip(self.law.meta.states)
            .zip(&z)
            .map(|((key, state), z)| format!(", {key} = {z:.4e} {}", state.unit))
            .collect();
        Some(format!(
            "friction law \"{}\" is not passive{}: a random motion of {time:.3} s got {:.4} mJ more out of it than had been put in, \
             when v = {:.3} mm/s{}; friction can drive the piston then",
            self.law.meta.key,
            self.with(levels),
            1e3 * most,
            1e3 * v,
            states.concat()
        ))
    }

    /// Takes one step at constant velocity with the midpoint rule, which conserves an energy that is a square exactly.
    /// Returns the work and its magnitude, J. The step is halved if Newton's method fails at a kink.
    fn midpoint(&self, at: &At<f64>, levels: &Levels<f64>, z: &mut [f64], dt: f64, depth: u32) -> (f64, f64) {
        let start = z.to_vec();
        let near = |z: &[f64], before: &[f64]| {
            z.iter().zip(before).all(|(z, before)| (z - before).abs() <= 1e-12 * z.abs().max(1e-30))
        };
        let mut converged = z.is_empty();
        for _ in 0..20 {
            if converged {
                break;
            }
            let before = z.to_vec();
            self.newton(at, levels, &start, z, dt, 0.5);
            converged = near(z, &before);
        }
        if !converged && depth < 8 {
            z.copy_from_slice(&start);
            let first = self.midpoint(at, levels, z, 0.5 * dt, depth + 1);
            let second = self.midpoint(at, levels, z, 0.5 * dt, depth + 1);
            return (first.0 + second.0, first.1 + second.1);
        }
        let mut rates = vec![0.0; z.len()];
        let work = self.force(at, levels, z, &mut rates) * at.v * dt;
        for (z, start) in z.iter_mut().zip(start) {
            *z = 2.0 * *z - start;
        }
        (work, work.abs())
    }
}

/// Returns pieces (velocity, duration): slow and fast, long and short, in both directions, some at rest.
fn random_motion(seed: u64) -> Vec<(f64, f64)> {
    let mut state = seed.wrapping_mul(0x9E37_79B9_7F4A_7C15);
    let mut uniform = move || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 11) as f64 / (1_u64 << 53) as f64
    };
    let mut piece = || {
        let (speed, distance) =
            (10.0_f64.powf(-4.5 + 5.0 * uniform()), 10.0_f64.powf(-4.5 + 2.5 * uniform()));
        let way = uniform();
        let v = if way < 0.45 { -speed } else { speed };
        if way > 0.9 { (0.0, 10.0_f64.powf(-2.0 + 3.0 * uniform())) } else { (v, distance / speed) }
    };
    (0..PIECES).map(|_| piece()).collect()
}
