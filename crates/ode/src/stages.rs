//! States in blocks, and the sums over stages.

use crate::rosenbrock::{RODAS5P, Rosenbrock};
use math::Lane;

pub(crate) const S: usize = 8;
pub(crate) const METHOD: Rosenbrock<S> = RODAS5P;
/// States are stored in blocks of this many, so that a loop over them fills vector registers.
pub(crate) const BLOCK: usize = 4;
pub(crate) type Block<R> = [R; BLOCK];

/// `count` blocks of zeros.
pub(crate) fn zeros<R: Lane>(count: usize) -> Vec<Block<R>> {
    vec![[R::zero(); BLOCK]; count]
}

/// stage = y + sum_j a_j u_j and b = sum_j (c_j/h) u_j, unrolled for the number of stages done.
#[inline(never)]
pub(crate) fn combine<R: Lane>(
    stage: &mut [Block<R>],
    b: &mut [Block<R>],
    y: &[Block<R>],
    a: &[f64],
    c: &[f64],
    inverse_h: R,
    u: &[Block<R>],
) {
    macro_rules! unrolled {
        ($($k:literal)*) => { match a.len() {
            $($k => combine_stages::<R, $k>(stage, b, y, a, c, inverse_h, u),)*
            _ => unreachable!("a method has at most {S} stages"),
        }};
    }
    unrolled!(1 2 3 4 5 6 7);
}

#[inline(always)]
fn combine_stages<R: Lane, const K: usize>(
    stage: &mut [Block<R>],
    b: &mut [Block<R>],
    y: &[Block<R>],
    a: &[f64],
    c: &[f64],
    inverse_h: R,
    u: &[Block<R>],
) {
    let blocks = y.len();
    for k in 0..blocks {
        let (mut sum_a, mut sum_c) = (y[k], [R::zero(); BLOCK]);
        for j in 0..K {
            let row = &u[j * blocks + k];
            for l in 0..BLOCK {
                sum_a[l] = row[l].fma(R::c(a[j]), sum_a[l]);
                sum_c[l] = row[l].fma(R::c(c[j]), sum_c[l]);
            }
        }
        stage[k] = sum_a;
        for l in 0..BLOCK {
            b[k][l] = sum_c[l] * inverse_h;
        }
    }
}

/// sum_j coefficient_j u_j over all stages, of block `b`.
#[inline(always)]
pub(crate) fn sum_of_stages<R: Lane>(
    b: usize,
    blocks: usize,
    coefficients: &[f64; S],
    u: &[Block<R>],
) -> Block<R> {
    let mut sum = [R::zero(); BLOCK];
    for (j, c) in coefficients.iter().enumerate() {
        for (sum, u) in sum.iter_mut().zip(u[j * blocks + b]) {
            *sum = u.fma(R::c(*c), *sum);
        }
    }
    sum
}
