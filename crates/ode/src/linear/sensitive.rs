//! The same systems for numbers with derivatives: only the value of W is factorised.
//!
//!   W x = b   =>   W dx = db + dJ x     as dW = -dJ
//!
//! The value takes the very operations that it takes without derivatives.

use super::{Linear, SMALL, product};
use crate::structure::{Entry, Structure};
use math::Lane;
use std::array::from_fn;

impl<R: Lane> Linear<R> {
    /// The value of W^-1 x, then its derivatives.
    #[inline(never)]
    pub(super) fn solve_sensitive(&self, structure: &Structure, x: &mut [R]) {
        assert_eq!(structure.n, structure.n_coupled, "accounts have no derivatives");
        if structure.n <= SMALL {
            let values = product(&self.inverse, &from_fn(|l| x[l].plain()));
            self.add_change_of_matrix(structure, x, &values);
            let known: [R; SMALL] = from_fn(|l| x[l]);
            for (l, (x, value)) in x[..structure.n].iter_mut().zip(values).enumerate() {
                let mut sum = R::zero();
                for (known, column) in known[..structure.n].iter().zip(&self.inverse) {
                    sum = known.fma_plain(column[l], sum);
                }
                *x = sum.with_value(value);
            }
        } else {
            let mut values: Vec<R::Plain> = x.iter().map(R::plain).collect();
            self.eliminate(structure, &mut values);
            self.add_change_of_matrix(structure, x, &values);
            self.eliminate(structure, x);
            for (x, value) in x.iter_mut().zip(values) {
                *x = x.with_value(value);
            }
        }
    }

    /// x += dJ values, in the derivatives.
    fn add_change_of_matrix(&self, structure: &Structure, x: &mut [R], values: &[R::Plain]) {
        let diagonal = (0..structure.n_coupled as u16).map(|k| Entry { row: k, column: k });
        let entries = structure.lower.iter().chain(&structure.upper).copied().chain(diagonal);
        for (entry, change) in entries.zip(&self.jacobian) {
            let row = &mut x[entry.row as usize];
            *row = change.fma_plain(values[entry.column as usize], *row);
        }
    }
}
