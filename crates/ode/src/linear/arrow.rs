//! W^-1 of a mass between two pairs of states, in closed form.
//!
//! The states are x and v of the mass, (m, U) of one pair and of the other, and at most one more, z:
//!
//!   `x' = v`. A pair follows from itself, x and v. v' and z' follow from x, v, the U of both pairs and z.
//!
//! Pairs and z are eliminated into v. The remainder has rank one. Let r be the row of v of the inverse,
//! and g the response of all states to one unit of v:
//!
//!   `W^-1 = B + g r^T`, with B the inverse if v is held.
//!
//! Every scalar type and every lane uses exactly these operations.

use crate::structure::SMALL;
use math::{Lane, Real};

/// A Jacobian, row by row. One in the shape of an arrow has entries only where
///
///   x v | m U | m U | z
///
/// of a mass and two pairs. Row x depends only on v. Rows v and z depend on x, v, both U and z. A pair
/// depends on x, v and itself.
pub type Dense<R> = [[R; SMALL]; SMALL];

const X: usize = 0;
/// Index of the velocity.
pub(crate) const V: usize = 1;
const PAIRS: [usize; 2] = [2, 4];
const Z: usize = 6;

/// Rows of an arrow that may change with the differentiated numbers, and their columns that may change.
pub(super) const CHANGING: [(usize, &[usize]); 6] = [
    (V, &[0, 1, 3, 5, 6]),
    (2, &[0, 1, 2, 3]),
    (3, &[0, 1, 2, 3]),
    (4, &[0, 1, 4, 5]),
    (5, &[0, 1, 4, 5]),
    (Z, &[0, 1, 3, 5, 6]),
];

/// Response of a pair (m, U) to x, to v with the x that follows from it, to m and to U.
struct Block2<R> {
    by_x: [R; 2],
    by_v: [R; 2],
    by_m: [R; 2],
    by_u: [R; 2],
}

/// Returns the response of m and U to given inputs to both.
#[inline(always)]
fn makes<R: Real>(by_m: [R; 2], by_u: [R; 2], to_m: R, to_u: R) -> [R; 2] {
    [by_m[0].fma(to_m, by_u[0] * to_u), by_m[1].fma(to_m, by_u[1] * to_u)]
}

impl<R: Real> Block2<R> {
    #[inline(always)]
    fn of(j: impl Fn(usize, usize) -> R, m: usize, diagonal: R, h_gamma: R) -> Self {
        let u = m + 1;
        let (mm, uu) = (diagonal - j(m, m), diagonal - j(u, u));
        let inverse = R::one() / mm.fma(uu, -(j(m, u) * j(u, m)));
        let by_m = [uu * inverse, j(u, m) * inverse];
        let by_u = [j(m, u) * inverse, mm * inverse];
        // v changes x as well.
        let (v_m, v_u) = (j(m, X).fma(h_gamma, j(m, V)), j(u, X).fma(h_gamma, j(u, V)));
        Block2 {
            by_x: makes(by_m, by_u, j(m, X) * h_gamma, j(u, X) * h_gamma),
            by_v: makes(by_m, by_u, v_m, v_u),
            by_m,
            by_u,
        }
    }
}

/// Returns a row of v or z, multiplied by given responses of x and of both U.
#[inline(always)]
fn row<R: Lane>(jacobian: &Dense<R>, i: usize, [x, a, b]: [R::Plain; 3]) -> R::Plain {
    let j = |column: usize| jacobian[i][column].plain();
    let [u_a, u_b] = [PAIRS[0] + 1, PAIRS[1] + 1];
    j(X).fma(x, j(u_a).fma(a, j(u_b) * b))
}

/// Returns the response of z and, multiplied by `v`, of v to one unit of m or U. `j` are the entries of this
/// U in the rows of z and v.
#[inline(always)]
fn through<R: Real>(z: R, v: R, v_by_z: R, j: [R; 2], by: [R; 2]) -> (R, R) {
    let z_by = z * j[0] * by[1];
    (z_by, v * v_by_z.fma(z_by, j[1] * by[1]))
}

/// Fills a column of the inverse: the response to v, plus the response with v held.
#[inline(always)]
fn fill<R: Real>(column: &mut [R; SMALL], made_by_v: &[R; SMALL], by_v: R, held: [R; SMALL]) {
    for i in 0..SMALL {
        column[i] = made_by_v[i].fma(by_v, held[i]);
    }
}

/// Returns a value above zero if v, alone or with z, is unstable about a balance. Then v' grows with v, or
/// the determinant of both is negative. In both cases one growth rate is real and positive.
#[inline(always)]
pub(super) fn growth<R: Lane>(jacobian: &Dense<R>) -> R::Plain {
    let j = |row: usize, column: usize| jacobian[row][column].plain();
    (j(V, Z) * j(Z, V) - j(V, V) * j(Z, Z)).max(j(V, V))
}

/// Computes the columns of (I/(h gamma) - J)^-1. Its parts are functions marked inline, because closures are
/// not always inlined.
#[inline(always)]
pub(super) fn invert<R: Lane>(jacobian: &Dense<R>, h_gamma: R::Plain, columns: &mut Dense<R::Plain>) {
    let j = |row: usize, column: usize| jacobian[row][column].plain();
    let (zero, one) = (R::Plain::zero(), R::Plain::one());
    let diagonal = one / h_gamma;
    let (a, b) = (Block2::of(j, PAIRS[0], diagonal, h_gamma), Block2::of(j, PAIRS[1], diagonal, h_gamma));
    let [u_a, u_b] = [PAIRS[0] + 1, PAIRS[1] + 1];
    let z = one / (diagonal - j(Z, Z));
    let z_by_x = z * row(jacobian, Z, [h_gamma, a.by_x[1], b.by_x[1]]);
    let z_by_v = z * (j(Z, V) + row(jacobian, Z, [h_gamma, a.by_v[1], b.by_v[1]]));
    let v_by_v = (j(V, V) + row(jacobian, V, [h_gamma, a.by_v[1], b.by_v[1]])) + j(V, Z) * z_by_v;
    let v = one / (diagonal - v_by_v);
    let made = [h_gamma, one, a.by_v[0], a.by_v[1], b.by_v[0], b.by_v[1], z_by_v, zero];
    let v_row = j(V, Z);
    let x_column = v * v_row.fma(z_by_x, row(jacobian, V, [h_gamma, a.by_x[1], b.by_x[1]]));
    let (to_a, to_b) = ([j(Z, u_a), j(V, u_a)], [j(Z, u_b), j(V, u_b)]);
    let ((am, v_am), (au, v_au)) = (through(z, v, v_row, to_a, a.by_m), through(z, v, v_row, to_a, a.by_u));
    let ((bm, v_bm), (bu, v_bu)) = (through(z, v, v_row, to_b, b.by_m), through(z, v, v_row, to_b, b.by_u));
    let o = zero;
    let [x, vs, m_a, us_a, m_b, us_b, zs, rest] = columns;
    fill(x, &made, x_column, [h_gamma, o, a.by_x[0], a.by_x[1], b.by_x[0], b.by_x[1], z_by_x, o]);
    fill(vs, &made, v, [o; SMALL]);
    fill(m_a, &made, v_am, [o, o, a.by_m[0], a.by_m[1], o, o, am, o]);
    fill(us_a, &made, v_au, [o, o, a.by_u[0], a.by_u[1], o, o, au, o]);
    fill(m_b, &made, v_bm, [o, o, o, o, b.by_m[0], b.by_m[1], bm, o]);
    fill(us_b, &made, v_bu, [o, o, o, o, b.by_u[0], b.by_u[1], bu, o]);
    fill(zs, &made, v * v_row * z, [o, o, o, o, o, o, z, o]);
    *rest = [o, o, o, o, o, o, o, h_gamma];
}

#[cfg(test)]
#[path = "../../tests/unit/arrow.rs"]
mod tests;
