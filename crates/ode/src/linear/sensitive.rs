//! The same systems for numbers with derivatives. Only the value of W is factorised.
//!
//!   W x = b   =>   W dx = db + dJ x     as dW = -dJ
//!
//! The value uses exactly the operations that it uses without derivatives.

use super::arrow::CHANGING;
use super::{Linear, product};
use crate::stages::BLOCK;
use crate::structure::{SMALL, Structure, StructureEntry};
use math::Lane;
use std::array::from_fn;

impl<R: Lane> Linear<R> {
    /// Computes the value of W^-1 x, then its derivatives.
    #[inline(never)]
    pub(super) fn solve_sensitive(&self, structure: &Structure, x: &mut [R]) {
        assert_eq!(structure.n, structure.n_coupled, "accounts have no derivatives");
        if !R::GENERAL || structure.n <= SMALL {
            let (first, _) = x.split_first_chunk_mut::<SMALL>().expect("two blocks are stored");
            let values = product(&self.inverse, &from_fn(|l| first[l].plain()));
            if !R::GENERAL || self.is_arrow {
                self.add_change_of_arrow(first, &values);
            } else {
                self.add_change_of_matrix(structure, first, &values);
            }
            // Whole blocks for every system, and a block side by side, so that no sum waits for another.
            let known = *first;
            for (k, rows) in first.as_chunks_mut::<BLOCK>().0.iter_mut().enumerate() {
                let mut sums = [R::zero(); BLOCK];
                for (known, column) in known.iter().zip(&self.inverse) {
                    for (l, sum) in sums.iter_mut().enumerate() {
                        *sum = known.fma_plain(column[BLOCK * k + l], *sum);
                    }
                }
                for (l, (row, sum)) in rows.iter_mut().zip(sums).enumerate() {
                    *row = sum.with_value(values[BLOCK * k + l]);
                }
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

    /// The same for a Jacobian with the shape of an arrow.
    #[inline(always)]
    fn add_change_of_arrow(&self, x: &mut [R; SMALL], values: &[R::Plain; SMALL]) {
        for (row, columns) in CHANGING {
            for &column in columns {
                x[row] = self.dense[row][column].fma_plain(values[column], x[row]);
            }
        }
    }

    /// Adds dJ values to the derivatives of x.
    fn add_change_of_matrix(&self, structure: &Structure, x: &mut [R], values: &[R::Plain]) {
        let diagonal = (0..structure.n_coupled as u16).map(|k| StructureEntry { row: k, column: k });
        let entries = structure.lower.iter().chain(&structure.upper).copied().chain(diagonal);
        for (entry, change) in entries.zip(&self.jacobian) {
            let row = &mut x[entry.row as usize];
            *row = change.fma_plain(values[entry.column as usize], *row);
        }
    }
}
