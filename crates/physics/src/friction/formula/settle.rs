//! Steady sliding where no formula of it is given: inner states are led to rest.

use super::{Formula, MOST_STATES};
use crate::friction::{At, Levels};
use math::{Dual, Over, Real};

/// Implicit steps from this length, s, each so many times longer than the one before.
const FIRST_STEP: f64 = 1e-9;
const GROWTH: f64 = 2.0;
const STEPS: usize = 90;
/// Newton's method in each: the start is near, as the step before was half as long.
const ITERATIONS: usize = 4;

impl<P: Real> Formula<P> {
    /// Leads the inner states at a constant velocity to where they rest; the force there. The same work for
    /// every value, as lanes and derivatives go along: implicit Euler steps that grow without end.
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
        if let [own] = z {
            let (mut rate, step) = ([Dual::<S, 1>::zero()], end * dt);
            let state = [Dual::variable(*own, 0)];
            self.motion_in(|p| Dual::from(S::from(p)), &lift_at(at), &lift_levels(levels), &state, &mut rate);
            let residual = *own - start[0] - step * rate[0].re;
            *own -= residual / (S::one() - step * rate[0].eps[0]);
            return;
        }
        let n = z.len();
        let state: Vec<Dual<S, MOST_STATES>> =
            z.iter().enumerate().map(|(i, z)| Dual::variable(*z, i)).collect();
        let mut rates = vec![Dual::zero(); n];
        self.motion_in(|p| Dual::from(S::from(p)), &lift_at(at), &lift_levels(levels), &state, &mut rates);
        let step = end * dt;
        // Rows of I - step J and the residual.
        let mut rows: Vec<Vec<S>> = (0..n)
            .map(|i| {
                let unit = |j: usize| if i == j { S::one() } else { S::zero() };
                let mut row: Vec<S> = (0..n).map(|j| unit(j) - step * rates[i].eps[j]).collect();
                row.push(start[i] + step * rates[i].re - z[i]);
                row
            })
            .collect();
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

fn lift_at<S: Real, const N: usize>(at: &At<S>) -> At<Dual<S, N>> {
    At {
        v: at.v.into(),
        x: at.x.into(),
        gauge_a: at.gauge_a.into(),
        gauge_b: at.gauge_b.into(),
        applied: at.applied.into(),
        prepared: at.prepared.into(),
    }
}

fn lift_levels<S: Real, const N: usize>(levels: &Levels<S>) -> Levels<Dual<S, N>> {
    Levels {
        coulomb: levels.coulomb.into(),
        breakaway: levels.breakaway.into(),
        viscous: levels.viscous.into(),
    }
}
