//! Steady sliding without a formula: inner states are integrated until they settle.

use super::Formula;
use crate::friction::{At, Levels};
use math::{Dual, Over, Real};

/// First implicit step, s, and the growth factor of each next step.
const FIRST_STEP: f64 = 1e-9;
const GROWTH: f64 = 2.0;
const STEPS: usize = 90;
/// Newton iterations in each step. The start is close, because the previous step was half as long.
const ITERATIONS: usize = 4;

impl<P: Real> Formula<P> {
    /// Moves the inner states at a constant velocity to their rest, and returns the force there. The work is the same
    /// for every value, including lanes and derivatives: implicit Euler steps of growing length.
    pub(super) fn settle<S: Over<P>>(&self, at: &At<S>, levels: &Levels<S>, z: &mut [S]) -> S {
        let mut dt = FIRST_STEP;
        if !z.is_empty() {
            for _ in 0..STEPS {
                let start: Vec<S> = z.to_vec();
                for _ in 0..ITERATIONS {
                    self.newton(at, levels, &start, z, S::c(dt), S::one());
                }
                dt *= GROWTH;
            }
        }
        let mut dz = vec![S::zero(); z.len()];
        self.force(at, levels, z, &mut dz)
    }

    /// One iteration of Newton's method towards z = start + end dt rates(z).
    pub(super) fn newton<S: Over<P>>(
        &self,
        at: &At<S>,
        levels: &Levels<S>,
        start: &[S],
        z: &mut [S],
        dt: S,
        end: S,
    ) {
        let (n, step) = (z.len(), end * dt);
        // Rows of I - step J, followed by the residual.
        let mut rows = vec![vec![S::zero(); n + 1]; n];
        for j in 0..n {
            let seed =
                |(i, z): (usize, &S)| Dual { re: *z, eps: [if i == j { S::one() } else { S::zero() }] };
            let state: Vec<Dual<S, 1>> = z.iter().enumerate().map(seed).collect();
            let mut rates = vec![Dual::zero(); n];
            self.motion_in(
                |p| Dual::from(S::from(p)),
                &at.map(Dual::from),
                &levels.map(Dual::from),
                &state,
                &mut rates,
            );
            for (i, (row, rate)) in rows.iter_mut().zip(&rates).enumerate() {
                row[j] = state[i].eps[0] - step * rate.eps[0];
                row[n] = start[i] + step * rate.re - z[i];
            }
        }
        for i in 0..n {
            for j in (0..n).filter(|j| *j != i) {
                let ratio = rows[j][i] / rows[i][i];
                let pivot = rows[i].clone();
                for (row, own) in rows[j].iter_mut().zip(pivot) {
                    *row -= ratio * own;
                }
            }
        }
        for (i, z) in z.iter_mut().enumerate() {
            *z += rows[i][n] / rows[i][i];
        }
    }
}
