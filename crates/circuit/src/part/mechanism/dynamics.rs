//! Equations of motion of a mechanism.
//!
//!   `M_ab = sum w dX/dq_a . dX/dq_b,   J_ia = dx_i/dq_a,   v = J u,   c = x'' at q'' = 0`
//!   `h_a  = sum w dX/dq_a . X'' at q'' = 0  +  sum m dX/dq_a . g                      [N], [N m]`
//!   `(M + J^T D J) q'' = J^T (F - D c) - h,   leg acceleration = J q'' + c`
//!
//! X are the weighted points, w their weights and m their masses. -g is the acceleration of gravity. F_i is the force
//! on leg i in +x, and D_i the mass inside its friction.

use crate::part::mechanism::jet::Jet;
use crate::part::mechanism::{Geometry, MOST, Mechanism, MechanismKind};
use math::{Dual, MOST_ARGUMENTS, Map, Over, Real};

/// Mass matrix, forces and legs at one pose and rate.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Forms<S, const N: usize> {
    /// M. Only the lower triangle is used.
    pub mass: [[S; N]; N],
    /// Forces h on the coordinates by motion and gravity.
    pub forces: [S; N],
    /// Positions of the legs.
    pub legs: [Jet<S, N>; N],
    /// Kinetic energy and energy in the field of gravity, J.
    pub energy: S,
}

/// Evaluates a mechanism at coordinates and rates.
pub(crate) fn forms<M: Mechanism<N>, P: Real, S: Over<P>, const N: usize>(
    geometry: &Geometry<P>,
    q: &[S; N],
    u: &[S; N],
) -> Forms<S, N> {
    let (mut mass, mut forces, mut energy) = ([[S::zero(); N]; N], [S::zero(); N], S::zero());
    let lift = geometry.lift.map(S::from);
    let legs =
        M::see(geometry, &Jet::coordinates(q, u), &mut |[weight, heavy]: [P; 2], x: [Jet<S, N>; 3]| {
            let (w, weight) = (S::from(weight), lift.map(|lift| lift * S::from(heavy)));
            for a in 0..N {
                for b in 0..=a {
                    let dot = (0..3).fold(S::zero(), |sum, k| sum + x[k].by_q[a] * x[k].by_q[b]);
                    mass[a][b] += w * dot;
                }
                let dot = (0..3).fold(S::zero(), |sum, k| sum + x[k].by_q[a] * x[k].a);
                forces[a] += w * dot + (0..3).fold(S::zero(), |sum, k| sum + weight[k] * x[k].by_q[a]);
            }
            let speed = (0..3).fold(S::zero(), |sum, k| sum + x[k].v * x[k].v);
            energy += S::c(0.5) * w * speed + (0..3).fold(S::zero(), |sum, k| sum + weight[k] * x[k].x);
        });
    Forms { mass, forces, legs, energy }
}

/// Triangular factor of a symmetric matrix from its lower triangle, with the reciprocals of the diagonal.
#[derive(Clone, Copy)]
pub(crate) struct Cholesky<S, const N: usize>([[S; N]; N]);

impl<S: Real, const N: usize> Cholesky<S, N> {
    pub fn of(mut a: [[S; N]; N]) -> Self {
        for i in 0..N {
            for j in 0..=i {
                let sum = (0..j).fold(a[i][j], |sum, k| sum - a[i][k] * a[j][k]);
                a[i][j] = if i == j { S::one() / sum.sqrt() } else { sum * a[j][j] };
            }
        }
        Cholesky(a)
    }

    pub fn solve(&self, mut b: [S; N]) -> [S; N] {
        for i in 0..N {
            b[i] = (0..i).fold(b[i], |sum, k| sum - self.0[i][k] * b[k]) * self.0[i][i];
        }
        for i in (0..N).rev() {
            b[i] = (i + 1..N).fold(b[i], |sum, k| sum - self.0[k][i] * b[k]) * self.0[i][i];
        }
        b
    }
}

/// Returns the lower triangle of a matrix plus J^T D J, for the legs' rows of J and the diagonal of D.
pub(crate) fn with_square<S: Real, const N: usize>(
    mut matrix: [[S; N]; N],
    legs: &[Jet<S, N>; N],
    diagonal: &[S; N],
) -> [[S; N]; N] {
    for (leg, weight) in legs.iter().zip(diagonal) {
        for a in 0..N {
            for b in 0..=a {
                matrix[a][b] += *weight * leg.by_q[a] * leg.by_q[b];
            }
        }
    }
    matrix
}

/// Returns a vector plus J^T x, for the legs' rows of J.
pub(crate) fn with_sum<S: Real, const N: usize>(start: [S; N], legs: &[Jet<S, N>; N], x: &[S; N]) -> [S; N] {
    std::array::from_fn(|a| legs.iter().zip(x).fold(start[a], |sum, (leg, x)| sum + leg.by_q[a] * *x))
}

impl<S: Real, const N: usize> Forms<S, N> {
    /// Returns the factor of M + J^T D J.
    pub fn factor(&self, inertia: &[S; N]) -> Cholesky<S, N> {
        Cholesky::of(with_square(self.mass, &self.legs, inertia))
    }

    /// Returns the accelerations of the coordinates under these forces on the legs, and the factor of their matrix.
    pub fn accelerate(&self, force: &[S; N], inertia: &[S; N]) -> ([S; N], Cholesky<S, N>) {
        let factor = self.factor(inertia);
        let rest = std::array::from_fn(|i| force[i] - inertia[i] * self.legs[i].a);
        (factor.solve(with_sum(self.forces.map(|h| -h), &self.legs, &rest)), factor)
    }

    /// Returns the accelerations of the legs.
    pub fn legs_at(&self, acceleration: &[S; N]) -> [S; N] {
        self.legs.map(|leg| (0..N).fold(leg.a, |sum, k| sum + leg.by_q[k] * acceleration[k]))
    }
}

/// Positions and velocities of the legs, from coordinates and rates.
pub(crate) struct Places<'g, P>(pub MechanismKind, pub &'g Geometry<P>);

/// Accelerations of coordinates and legs, from coordinates, rates and forces on the legs.
pub(crate) struct Accelerations<'g, P> {
    pub kind: MechanismKind,
    pub geometry: &'g Geometry<P>,
    /// Mass inside the friction of each leg, kg.
    pub inertia: &'g [P],
}

/// The `i`-th group of N numbers.
fn group<S: Real, const N: usize>(x: &[S], i: usize) -> [S; N] {
    std::array::from_fn(|k| x[i * N + k])
}

impl<P: Real> Map<P> for Places<'_, P> {
    fn at<S: Over<P>>(&self, x: &[S], out: &mut [S]) {
        each!(self.0, M, N => {
            let at = Jet::coordinates(&group::<S, N>(x, 0), &group(x, 1));
            let legs = <M as Mechanism<N>>::see(self.1, &at, &mut |_: [P; 2], _: [Jet<S, N>; 3]| {});
            for (i, leg) in legs.iter().enumerate() {
                (out[i], out[N + i]) = (leg.x, leg.v);
            }
        });
    }

    fn slopes(&self, x: &[P], out: &mut [P], slopes: &mut [[P; MOST_ARGUMENTS]]) {
        each!(self.0, M, N => {
            let at = Jet::curved(&group::<P, N>(x, 0), &group(x, 1));
            let legs = <M as Mechanism<N>>::see(self.1, &at, &mut |_: [P; 2], _: [Curved<P, N>; 3]| {});
            for (i, leg) in legs.iter().enumerate() {
                (out[i], out[N + i]) = (leg.x.re, leg.v.re);
                for k in 0..N {
                    slopes[i][k] = leg.by_q[k].re;
                    slopes[N + i][k] = leg.v.eps[k];
                    slopes[N + i][N + k] = leg.by_q[k].re;
                }
            }
        });
    }
}

const _: () = assert!(3 * MOST <= MOST_ARGUMENTS);

/// A function of the coordinates whose derivatives have derivatives too.
type Curved<P, const N: usize> = Jet<Dual<P, N>, N>;

/// Slopes of the sum of forces on the coordinates at constant acceleration.
struct Residual<P, const N: usize> {
    by_q: [[P; N]; N],
    by_u: [[P; N]; N],
}

/// Returns the second rate of a function under these accelerations of the coordinates.
fn accelerated<P: Real, const N: usize>(x: &Curved<P, N>, acceleration: &[P; N]) -> Dual<P, N> {
    (0..N).fold(x.a, |sum, k| sum + x.by_q[k].times(acceleration[k]))
}

impl<P: Real, const N: usize> Residual<P, N> {
    /// Adds the term `dx/dq . x''` times minus `weight`, and `dx/dq` times `force`.
    #[inline(always)]
    fn add(&mut self, x: &Curved<P, N>, weight: P, force: P, acceleration: &[P; N]) {
        let second = accelerated(x, acceleration);
        let rest = force - weight * second.re;
        for a in 0..N {
            for d in 0..N {
                let slope = x.by_q[a].re * weight;
                self.by_q[a][d] += x.by_q[a].eps[d] * rest - slope * second.eps[d];
                self.by_u[a][d] -= slope * P::c(2.0) * x.v.eps[d];
            }
        }
    }
}

impl<P: Real> Map<P> for Accelerations<'_, P> {
    fn at<S: Over<P>>(&self, x: &[S], out: &mut [S]) {
        each!(self.kind, M, N => {
            let forms = forms::<M, P, S, N>(self.geometry, &group(x, 0), &group(x, 1));
            let inertia = std::array::from_fn(|i| S::from(self.inertia[i]));
            let (acceleration, _) = forms.accelerate(&group(x, 2), &inertia);
            out[..N].copy_from_slice(&acceleration);
            out[N..2 * N].copy_from_slice(&forms.legs_at(&acceleration));
        });
    }

    fn slopes(&self, x: &[P], out: &mut [P], slopes: &mut [[P; MOST_ARGUMENTS]]) {
        each!(self.kind, M, N => {
            let (q, u, force) = (group::<P, N>(x, 0), group::<P, N>(x, 1), group::<P, N>(x, 2));
            let forms = forms::<M, P, P, N>(self.geometry, &q, &u);
            let inertia: [P; N] = std::array::from_fn(|i| self.inertia[i]);
            let (acceleration, factor) = forms.accelerate(&force, &inertia);
            out[..N].copy_from_slice(&acceleration);
            out[N..2 * N].copy_from_slice(&forms.legs_at(&acceleration));

            let along = |leg: &Jet<P, N>, own: &[P; N]| (0..N).fold(P::zero(), |sum, k| sum + leg.by_q[k] * own[k]);
            for d in 0..N {
                let own = factor.solve(forms.legs[d].by_q);
                for (k, leg) in forms.legs.iter().enumerate() {
                    slopes[k][2 * N + d] = own[k];
                    slopes[N + k][2 * N + d] = along(leg, &own);
                }
            }
            let zero = [[P::zero(); N]; N];
            let mut residual = Residual { by_q: zero, by_u: zero };
            let legs = <M as Mechanism<N>>::see(
                self.geometry,
                &Jet::curved(&q, &u),
                &mut |[weight, heavy]: [P; 2], x: [Curved<P, N>; 3]| {
                    for (k, x) in x.iter().enumerate() {
                        residual.add(x, weight, -(self.geometry.lift[k] * heavy), &acceleration);
                    }
                },
            );
            for (i, leg) in legs.iter().enumerate() {
                residual.add(leg, inertia[i], force[i], &acceleration);
            }
            for d in 0..N {
                let by_q = factor.solve(residual.by_q.map(|row| row[d]));
                let by_u = factor.solve(residual.by_u.map(|row| row[d]));
                for (i, leg) in legs.iter().enumerate() {
                    (slopes[i][d], slopes[i][N + d]) = (by_q[i], by_u[i]);
                    slopes[N + i][d] = along(&forms.legs[i], &by_q) + accelerated(leg, &acceleration).eps[d];
                    slopes[N + i][N + d] = along(&forms.legs[i], &by_u) + P::c(2.0) * leg.v.eps[d];
                }
            }
        });
    }
}
