//! A custom law: formulas, checked and run by an interpreter.

mod compile;
mod examine;
mod settle;
mod text;

use super::{At, InnerState, Levels, Meta};
use crate::Bounds;
use ::formula::{Graph, Program};
use math::{Dual, Gather, Lane, Over, Real};
use std::sync::Mutex;

pub use text::{ParameterText, Problem, Refusal, StateText, Text};

/// Largest number of inner states of a custom law.
pub const MOST_STATES: usize = 8;

/// Variables of a formula in the order of a graph's inputs, followed by the states and their rates.
const VARIABLES: [(&str, &str); 4] = [("v", "m/s"), ("x", "m"), ("pressure_a", "Pa"), ("pressure_b", "Pa")];
const LEVELS: [(&str, &str); 3] = [("coulomb", "N"), ("breakaway", "N"), ("viscous", "N s/m")];
const FIRST_STATE: usize = VARIABLES.len() + LEVELS.len();

/// A checked law: the part common to all sets of its parameters. Each text is compiled once and kept for the life of
/// the process, so that names and tables are static as in other laws.
#[derive(Debug)]
pub struct OwnLaw {
    /// Its entry, in the form of the registry.
    pub meta: Meta,
    /// Warnings to the author.
    pub warnings: Vec<String>,
    graph: Graph,
    /// Force, then the rates of the inner states.
    motion: Program,
    energy: Option<Program>,
    slip: Program,
    steady: Option<Program>,
    /// Index of the parameter for each level of [`LEVELS`].
    levels: [Option<usize>; 3],
    /// Names of the states in formulas, and their bounds.
    keys: Vec<&'static str>,
    kept: Vec<Bounds>,
    /// The last values that passed the checks, because a fit repeats them often.
    good: Mutex<Vec<f64>>,
}

/// A custom law with values for its parameters.
///
/// Terms of parameters only are computed in advance, in the scalar type of the parameters. The rest runs as a
/// [`Program`] over the scalar type of the states. A custom law has neither a mode nor events.
#[derive(Clone, Debug)]
pub struct Formula<P> {
    /// The part common to all sets of parameters.
    pub law: &'static OwnLaw,
    /// Its parameters, in the order of `meta.parameters`, in SI.
    pub parameters: Vec<P>,
    motion: Vec<P>,
    energy: Vec<P>,
    slip: Vec<P>,
    steady: Vec<P>,
}

impl OwnLaw {
    /// Whether the law has a level that modifiers can change.
    pub fn has_levels(&self) -> bool {
        self.levels[0].is_some()
    }
}

impl<P: Real> Formula<P> {
    /// Creates the law with these parameters, in the order of `meta.parameters`.
    pub fn new(law: &'static OwnLaw, parameters: Vec<P>) -> Self {
        let constants = law.graph.constants(&parameters);
        let of = |program: Option<&Program>| program.map_or(Vec::new(), |program| program.own(&constants));
        Formula {
            law,
            motion: law.motion.own(&constants),
            energy: of(law.energy.as_ref()),
            slip: law.slip.own(&constants),
            steady: of(law.steady.as_ref()),
            parameters,
        }
    }

    #[inline(always)]
    pub(super) fn states(&self) -> &'static [InnerState] {
        self.law.meta.states
    }

    #[inline(always)]
    pub(super) fn levels(&self) -> Levels<P> {
        let level = |i: usize| self.law.levels[i].map(|k| self.parameters[k]);
        let coulomb = level(0).unwrap_or(P::zero());
        Levels::new(coulomb, level(1).unwrap_or(coulomb), level(2).unwrap_or(P::zero()))
    }

    #[inline]
    pub(super) fn force<S: Over<P>>(&self, at: &At<S>, levels: &Levels<S>, z: &[S], dz: &mut [S]) -> S {
        self.motion_in(S::from, at, levels, z, dz)
    }

    /// [`Formula::force`] in any scalar type that parameters can be lifted to.
    #[inline]
    fn motion_in<S: Real>(
        &self,
        lift: impl Fn(P) -> S,
        at: &At<S>,
        levels: &Levels<S>,
        z: &[S],
        dz: &mut [S],
    ) -> S {
        let mut out = [S::zero(); 1 + MOST_STATES];
        let n = self.states().len();
        self.law.motion.run(&self.motion, lift, |k| input(k, at, levels, z), &mut out[..=n]);
        dz[..n].copy_from_slice(&out[1..=n]);
        out[0]
    }

    pub(super) fn slip<S: Over<P>>(&self, v: S, dz: &[S]) -> S {
        let first_rate = FIRST_STATE + self.states().len();
        let mut out = [v];
        let given = |k: usize| if k == 0 { v } else { dz[k - first_rate] };
        self.law.slip.run(&self.slip, S::from, given, &mut out);
        out[0]
    }

    pub(super) fn stored<S: Over<P>>(&self, z: &[S]) -> S {
        self.stored_in(S::from, z)
    }

    fn stored_in<S: Real>(&self, lift: impl Fn(P) -> S, z: &[S]) -> S {
        let mut out = [S::zero()];
        if let Some(energy) = &self.law.energy {
            energy.run(&self.energy, lift, |k| z[k - FIRST_STATE], &mut out);
        }
        out[0]
    }

    pub(super) fn heat<S: Over<P>>(&self, v: S, force: S, z: &[S], dz: &[S]) -> S {
        if self.law.energy.is_none() {
            return force * v;
        }
        let along: Vec<Dual<S, 1>> = z.iter().zip(dz).map(|(z, dz)| Dual { re: *z, eps: [*dz] }).collect();
        force * v - self.stored_in(|p| Dual::from(S::from(p)), &along).eps[0]
    }

    /// Returns steady sliding at `at`, N. A law that depends on position and pressures uses the given ones.
    pub fn steady<S: Over<P>>(&self, at: &At<S>, levels: &Levels<S>) -> S {
        match &self.law.steady {
            Some(steady) => {
                let mut out = [S::zero()];
                steady.run(&self.steady, S::from, |k| input(k, at, levels, &[]), &mut out);
                out[0]
            }
            None => {
                let mut z = vec![S::zero(); self.states().len()];
                self.settle(at, levels, &mut z)
            }
        }
    }
}

/// Returns the value of a graph's input.
#[inline(always)]
fn input<S: Real>(k: usize, at: &At<S>, levels: &Levels<S>, z: &[S]) -> S {
    match k {
        0 => at.v,
        1 => at.x,
        2 => at.gauge_a,
        3 => at.gauge_b,
        4 => levels.coulomb,
        5 => levels.breakaway,
        6 => levels.viscous,
        _ => z[k - FIRST_STATE],
    }
}

impl Formula<f64> {
    /// Returns the same law with its parameters as other numbers, in their order.
    pub fn lifted<P: Real>(&self, values: &[P]) -> Formula<P> {
        Formula::new(self.law, values.to_vec())
    }
}

impl<R: Lane> Gather<R> for Formula<f64> {
    type Lanes = Formula<R>;

    fn gather(each: &[&Self]) -> Formula<R> {
        let law = each[0].law;
        assert!(each.iter().all(|other| std::ptr::eq(other.law, law)), "lanes must share one friction law");
        let parameter = |k: usize| R::from_lanes(|lane| each[lane].parameters[k]);
        Formula::new(law, (0..law.meta.parameters.len()).map(parameter).collect())
    }
}
