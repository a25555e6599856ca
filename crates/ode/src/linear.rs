//! The linear systems of a step: W = I/(h gamma) - J, factorised once and solved for each stage.

mod arrow;
mod sensitive;

pub use arrow::Dense;
pub(crate) use arrow::V as VELOCITY;

use crate::stages::{BLOCK, Block, zeros};
use crate::structure::{SMALL, Structure, StructureEntry};
use math::{Lane, Real, Work};

/// Returns the number of blocks for `n` states. A small system always fills its fixed array.
pub(crate) fn blocks(n: usize) -> usize {
    n.div_ceil(BLOCK).max(SMALL / BLOCK)
}

/// The Jacobian and the factors of W, in the slots of a [`Structure`].
#[derive(Clone, Debug)]
pub(crate) struct Linear<R: Lane> {
    pub jacobian: Vec<R>,
    lu: Vec<R::Plain>,
    reciprocal: Vec<Block<R::Plain>>,
    /// Columns of W^-1 of a small system.
    pub inverse: Dense<R::Plain>,
    /// A Jacobian with the shape of an arrow, in place of `jacobian`.
    pub dense: Dense<R>,
    pub is_arrow: bool,
}

struct Invert<'l, R: Lane>(&'l mut Linear<R>, R::Plain);

impl<R: Lane> Work for Invert<'_, R> {
    type Out = ();
    #[inline(always)]
    fn work(self) {
        arrow::invert(&self.0.dense, self.1, &mut self.0.inverse);
    }
}

impl<R: Lane> Linear<R> {
    pub fn new(structure: &Structure) -> Self {
        Linear {
            jacobian: vec![R::zero(); structure.n_slots],
            lu: vec![R::Plain::zero(); structure.n_slots],
            reciprocal: zeros(blocks(structure.n)),
            inverse: [[R::Plain::zero(); SMALL]; SMALL],
            dense: [[R::zero(); SMALL]; SMALL],
            is_arrow: false,
        }
    }

    /// Whether W^-1 uses the arrow shape instead of the factors of W.
    #[inline(always)]
    pub fn prepare(&mut self, structure: &Structure, h_gamma: R::Plain) {
        if R::GENERAL && (!self.is_arrow || structure.n > structure.n_coupled) {
            self.factorise(structure, h_gamma);
        }
        if !R::GENERAL || self.is_arrow {
            self.invert_arrow(h_gamma);
        }
    }

    /// Returns a value above zero if friction falls with speed after the deflection has settled. The Jacobian
    /// must be an arrow.
    #[inline(always)]
    pub fn growth(&self) -> R::Plain {
        arrow::growth(&self.dense)
    }

    #[inline(never)]
    fn invert_arrow(&mut self, h_gamma: R::Plain) {
        R::within(Invert(self, h_gamma));
    }

    /// Factorises W in the fixed order. Values below the diagonal, and pivot-scaled values above it, are
    /// stored with the sign in which the substitutions add them.
    #[inline(never)] // One body of this size in `attempt` is enough: more spill registers.
    fn factorise(&mut self, structure: &Structure, h_gamma: R::Plain) {
        let one = R::Plain::one();
        let diagonal = one / h_gamma;
        for (w, j) in self.lu.iter_mut().zip(&self.jacobian) {
            *w = -j.plain();
        }
        let (lower, upper) = (structure.lower.len(), structure.upper.len());
        let first_diagonal = self.lu.len() - structure.n_coupled;
        for w in &mut self.lu[first_diagonal..] {
            *w += diagonal;
        }
        let reciprocal = self.reciprocal.as_flattened_mut();
        for r in &mut reciprocal[structure.n_coupled..] {
            *r = h_gamma;
        }
        for w in &mut self.lu[lower + upper..first_diagonal] {
            *w = -(*w * h_gamma);
        }
        for pivot in &structure.pivots {
            let inverse = one / self.lu[pivot.diagonal as usize];
            reciprocal[pivot.row as usize] = inverse;
            for below in &pivot.below {
                let negative = -(self.lu[below.slot as usize] * inverse);
                self.lu[below.slot as usize] = negative;
                for &(target, right) in &below.updates {
                    self.lu[target as usize] =
                        negative.fma(self.lu[right as usize], self.lu[target as usize]);
                }
            }
        }
        for (entry, value) in structure.upper.iter().zip(&mut self.lu[lower..lower + upper]) {
            *value = -(*value * reciprocal[entry.row as usize]);
        }
        if structure.n_coupled <= SMALL {
            self.invert(structure);
        }
    }

    /// Computes the columns of W^-1 of a small system. Eight substitutions side by side cost as much as one.
    /// Each of the eight solves of a step becomes a product without a chain of dependences.
    #[inline(never)]
    fn invert(&mut self, structure: &Structure) {
        let (lower, upper) = (&structure.lower[..], &structure.upper[..]);
        let (lower_values, rest) = self.lu.split_at(lower.len());
        let z = &mut self.inverse;
        *z = [[R::Plain::zero(); SMALL]; SMALL];
        for (k, row) in z.iter_mut().enumerate() {
            row[k] = R::Plain::one();
        }
        substitute_transposed(z, upper, &rest[..upper.len()]);
        for (row, d) in z.iter_mut().zip(self.reciprocal.as_flattened()) {
            for value in row {
                *value *= *d;
            }
        }
        substitute_transposed(z, lower, lower_values);
    }

    /// x = W^-1 x.
    #[inline(always)]
    pub fn solve(&self, structure: &Structure, x: &mut [Block<R>]) {
        if R::DIRECTIONS > 0 {
            return self.solve_sensitive(structure, x.as_flattened_mut());
        }
        if structure.n_coupled <= SMALL {
            let first: &mut Pair<R> = x.first_chunk_mut().expect("at least SMALL entries are stored");
            *first = self.multiply(first);
        } else {
            self.eliminate(structure, x.as_flattened_mut());
        }
        if structure.n > structure.n_coupled {
            self.finish_quadratures(structure, x.as_flattened_mut());
        }
    }

    /// W^-1 x by the inverse, for a small system.
    #[inline(always)]
    pub fn multiply(&self, x: &Pair<R>) -> Pair<R> {
        let sum = product(&self.inverse, x.as_flattened().first_chunk().expect("two blocks"));
        let mut out = [[R::zero(); BLOCK]; SMALL / BLOCK];
        out.as_flattened_mut().copy_from_slice(&sum);
        out
    }

    /// x = W^-1 x by substitution, for the coupled states.
    #[inline(never)]
    fn eliminate<T: Lane<Plain = R::Plain>>(&self, structure: &Structure, x: &mut [T]) {
        let coupled = structure.n_coupled;
        let (lower, rest) = self.lu.split_at(structure.lower.len());
        substitute(x, &structure.lower, lower);
        for (x, d) in x.iter_mut().zip(self.reciprocal.as_flattened()).take(coupled) {
            *x = x.scale(*d);
        }
        substitute(x, &structure.upper, &rest[..structure.upper.len()]);
    }

    /// Rows of the quadratures, from the solved coupled states. In a small system, the first rows are already
    /// multiplied by h gamma, together with their block.
    #[inline(never)]
    fn finish_quadratures(&self, structure: &Structure, x: &mut [R]) {
        let first = if structure.n_coupled <= SMALL { SMALL } else { structure.n_coupled };
        for (x, d) in x.iter_mut().zip(self.reciprocal.as_flattened()).skip(first) {
            *x = x.scale(*d);
        }
        let values = &self.lu[structure.lower.len() + structure.upper.len()..];
        substitute(x, &structure.quadratures, values);
    }
}

/// x[row] += value * x[column] for each entry, column by column. No entry of a column changes that column's
/// own x.
#[inline(always)]
fn substitute<R: Lane>(x: &mut [R], entries: &[StructureEntry], values: &[R::Plain]) {
    let mut of = (u16::MAX, R::zero());
    for (e, value) in entries.iter().zip(values) {
        if e.column != of.0 {
            of = (e.column, x[e.column as usize]);
        }
        x[e.row as usize] = of.1.fma_plain(*value, x[e.row as usize]);
    }
}

/// Applies the transposed operations in reverse order, on all rows of `z` at once.
#[inline(always)]
fn substitute_transposed<R: Real>(z: &mut [[R; SMALL]; SMALL], entries: &[StructureEntry], values: &[R]) {
    for (e, value) in entries.iter().rev().zip(values.iter().rev()) {
        // A masked index into a fixed array needs no bounds check.
        let (row, column) = (e.row as usize % SMALL, e.column as usize % SMALL);
        let (from, mut to) = (z[row], z[column]);
        for l in 0..SMALL {
            to[l] = value.fma(from[l], to[l]);
        }
        z[column] = to;
    }
}

/// Returns the two blocks of a small system.
pub(crate) type Pair<R> = [Block<R>; SMALL / BLOCK];

/// Returns sum_j x_j columns_j, in four chains. The x_j are read one by one. A wide load of values just
/// written by narrow stores would have to wait for them.
#[inline(always)]
fn product<R: Lane>(columns: &Dense<R::Plain>, x: &[R; SMALL]) -> [R; SMALL] {
    const CHAINS: usize = 4;
    let mut chains = [[R::zero(); SMALL]; CHAINS];
    for (c, chain) in chains.iter_mut().enumerate() {
        for l in 0..SMALL {
            chain[l] = x[c].scale(columns[c][l]);
        }
        for l in 0..SMALL {
            chain[l] = x[CHAINS + c].fma_plain(columns[CHAINS + c][l], chain[l]);
        }
    }
    let [mut sum, second, third, fourth] = chains;
    for l in 0..SMALL {
        sum[l] = (sum[l] + second[l]) + (third[l] + fourth[l]);
    }
    sum
}
