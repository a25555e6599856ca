//! Dense output: the state within a step.

use crate::stages::{BLOCK, Block, METHOD, combine_zero, zeros};
use math::Lane;

/// One step of all lanes, for dense output.
#[derive(Clone, Debug)]
pub(crate) struct Step<R> {
    pub y0: Vec<Block<R>>,
    pub y1: Vec<Block<R>>,
    k: [Vec<Block<R>>; 3],
    at: Vec<Block<R>>,
    /// `k` belongs to the present attempt.
    ready: bool,
}

impl<R: Lane> Step<R> {
    pub fn new(blocks: usize) -> Self {
        let zeros = || zeros(blocks);
        Step { y0: zeros(), y1: zeros(), k: [zeros(), zeros(), zeros()], at: zeros(), ready: false }
    }

    /// A new attempt from `y0`.
    pub fn begin(&mut self, y0: &[Block<R>]) {
        self.y0.copy_from_slice(y0);
        self.ready = false;
    }

    /// Prepares the interpolation from the stages of the attempt, once.
    pub fn prepare(&mut self, u: &[Block<R>]) {
        if !self.ready {
            for (k, coefficients) in self.k.iter_mut().zip(&METHOD.dense) {
                combine_zero(k, coefficients, u);
            }
            self.ready = true;
        }
    }

    /// The state at `t0 + theta h`, of the method's dense order; `prepare` comes first.
    pub fn interpolate(&mut self, theta: f64) -> &[R] {
        let (th, s) = (R::c(theta), R::c(1.0 - theta));
        let [k0, k1, k2] = &self.k;
        let ends = self.y0.iter().zip(&self.y1);
        for ((at, (y0, y1)), ((k0, k1), k2)) in self.at.iter_mut().zip(ends).zip(k0.iter().zip(k1).zip(k2)) {
            for l in 0..BLOCK {
                // From y0: a state that does not change keeps its bits.
                let bend = k2[l].fma(th, k1[l]).fma(th, k0[l]);
                at[l] = bend.fma(s, y1[l] - y0[l]).fma(th, y0[l]);
            }
        }
        self.at.as_flattened()
    }
}
