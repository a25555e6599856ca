//! W^-1 of a mass between two pairs of states, in closed form.
//!
//! The states are x and v of the mass, (m, U) of one pair and of the other, and at most one more, z:
//!
//!   x' = v,   a pair follows from itself, x and v;   v' and z' from x, v, the U of both pairs and z
//!
//! Pairs and z are eliminated into v. What is left is of rank one: with r the row of v of the inverse, and g what one
//! unit of v makes of all states,
//!
//!   W^-1 = B + g r^T,   B the inverse where v is held
//!
//! Every scalar and lane takes these very operations.

use super::SMALL;
use math::{Lane, Real};
use std::array::from_fn;

/// A Jacobian, row by row. One in the shape of an arrow has entries only where
///
///   x v | m U | m U | z
///
/// of a mass and two pairs: row x is v alone; rows v and z have x, v, both U and z; a pair has x, v and itself.
pub type Dense<R> = [[R; SMALL]; SMALL];

const X: usize = 0;
const V: usize = 1;
const PAIRS: [usize; 2] = [2, 4];
const Z: usize = 6;

/// What becomes of a pair (m, U): by x, by v with the x that it brings, by m and by U.
struct Pair<R> {
    by_x: [R; 2],
    by_v: [R; 2],
    by_m: [R; 2],
    by_u: [R; 2],
}

impl<R: Real> Pair<R> {
    #[inline(always)]
    fn of(j: impl Fn(usize, usize) -> R, m: usize, diagonal: R, h_gamma: R) -> Self {
        let u = m + 1;
        let (mm, uu) = (diagonal - j(m, m), diagonal - j(u, u));
        let inverse = R::one() / mm.fma(uu, -(j(m, u) * j(u, m)));
        let by_m = [uu * inverse, j(u, m) * inverse];
        let by_u = [j(m, u) * inverse, mm * inverse];
        let times = |to_m: R, to_u: R| from_fn(|i| by_m[i].fma(to_m, by_u[i] * to_u));
        let with_x = |row: usize| j(row, X).fma(h_gamma, j(row, V));
        Pair {
            by_x: times(j(m, X) * h_gamma, j(u, X) * h_gamma),
            by_v: times(with_x(m), with_x(u)),
            by_m,
            by_u,
        }
    }
}

/// The columns of (I/(h gamma) - J)^-1.
#[inline(always)]
pub(super) fn invert<R: Lane>(jacobian: &Dense<R>, h_gamma: R::Plain, columns: &mut Dense<R::Plain>) {
    let j = |row: usize, column: usize| jacobian[row][column].plain();
    let (zero, one) = (R::Plain::zero(), R::Plain::one());
    let diagonal = one / h_gamma;
    let [a, b] = PAIRS.map(|m| Pair::of(j, m, diagonal, h_gamma));
    let [u_a, u_b] = PAIRS.map(|m| m + 1);
    // A row of v or z times what one unit of something makes of x and of both U.
    let row =
        |i: usize, x: R::Plain, a: R::Plain, b: R::Plain| j(i, X).fma(x, j(i, u_a).fma(a, j(i, u_b) * b));
    let z = one / (diagonal - j(Z, Z));
    let z_by_x = z * row(Z, h_gamma, a.by_x[1], b.by_x[1]);
    let z_by_v = z * (j(Z, V) + row(Z, h_gamma, a.by_v[1], b.by_v[1]));
    let v_by_v = (j(V, V) + row(V, h_gamma, a.by_v[1], b.by_v[1])) + j(V, Z) * z_by_v;
    let v = one / (diagonal - v_by_v);
    let made_by_v = [h_gamma, one, a.by_v[0], a.by_v[1], b.by_v[0], b.by_v[1], z_by_v, zero];
    let v_row = j(V, Z);
    let pair = |u: usize, by: [R::Plain; 2]| {
        let z_by = z * j(Z, u) * by[1];
        (z_by, v * v_row.fma(z_by, j(V, u) * by[1]))
    };
    let x_column = v * v_row.fma(z_by_x, row(V, h_gamma, a.by_x[1], b.by_x[1]));
    let [(am, v_am), (au, v_au)] = [pair(u_a, a.by_m), pair(u_a, a.by_u)];
    let [(bm, v_bm), (bu, v_bu)] = [pair(u_b, b.by_m), pair(u_b, b.by_u)];
    let mut column = |l: usize, by_v: R::Plain, held: [R::Plain; SMALL]| {
        for i in 0..SMALL {
            columns[l][i] = made_by_v[i].fma(by_v, held[i]);
        }
    };
    let o = zero;
    column(0, x_column, [h_gamma, o, a.by_x[0], a.by_x[1], b.by_x[0], b.by_x[1], z_by_x, o]);
    column(1, v, [o; SMALL]);
    column(2, v_am, [o, o, a.by_m[0], a.by_m[1], o, o, am, o]);
    column(3, v_au, [o, o, a.by_u[0], a.by_u[1], o, o, au, o]);
    column(4, v_bm, [o, o, o, o, b.by_m[0], b.by_m[1], bm, o]);
    column(5, v_bu, [o, o, o, o, b.by_u[0], b.by_u[1], bu, o]);
    column(6, v * v_row * z, [o, o, o, o, o, o, z, o]);
    columns[7] = [o, o, o, o, o, o, o, h_gamma];
}

#[cfg(test)]
mod tests {
    use super::*;

    /// W times its inverse, with all entries that the shape may have.
    #[test]
    fn it_is_the_inverse() {
        let mut j = [[0.0; SMALL]; SMALL];
        j[X][V] = 1.0;
        let mut next = 0.37_f64;
        let mut fill = |i: usize, columns: &[usize]| {
            for &k in columns {
                next = (next * 997.0).fract();
                j[i][k] = 20.0 * next - 10.0;
            }
        };
        fill(1, &[0, 1, 3, 5, 6]);
        fill(2, &[0, 1, 2, 3]);
        fill(3, &[0, 1, 2, 3]);
        fill(4, &[0, 1, 4, 5]);
        fill(5, &[0, 1, 4, 5]);
        fill(6, &[0, 1, 3, 5, 6]);
        let mut columns = [[0.0; SMALL]; SMALL];
        let h_gamma = 0.017;
        invert(&j, h_gamma, &mut columns);
        for (l, column) in columns.iter().enumerate() {
            for (i, row) in j.iter().enumerate() {
                let product: f64 = column[i] / h_gamma - (0..SMALL).map(|k| row[k] * column[k]).sum::<f64>();
                let unit = f64::from(u8::from(i == l));
                assert!((product - unit).abs() < 1e-12, "{i}, {l}: {product}");
            }
        }
    }
}
