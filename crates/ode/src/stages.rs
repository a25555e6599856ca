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

/// Whether the state of stage `I` is that of the stage before and one of the numbers that this added.
const fn follows(i: usize) -> bool {
    let mut same = i > 1 && METHOD.a[i][i - 1] == 1.0;
    let mut j = 0;
    while same && j + 1 < i {
        same = METHOD.a[i][j] == METHOD.a[i - 1][j];
        j += 1;
    }
    same
}

/// stage = y + sum_j a_j u_j and b = sum_j (c_j/h) u_j for stage `I`, over the `I` stages before it; `stage` holds that
/// of the stage before.
#[inline(always)]
pub(crate) fn combine<R: Lane, const I: usize>(
    stage: &mut [Block<R>],
    b: &mut [Block<R>],
    y: &[Block<R>],
    inverse_h: R::Plain,
    u: &[Block<R>],
) {
    let blocks = y.len();
    for k in 0..blocks {
        let first = if const { follows(I) } { I - 1 } else { 0 };
        let (mut sum_a, mut sum_c) = (if first > 0 { stage[k] } else { y[k] }, [R::zero(); BLOCK]);
        for j in 0..I {
            let row = &u[j * blocks + k];
            if j >= first && METHOD.a[I][j] != 0.0 {
                for l in 0..BLOCK {
                    sum_a[l] = row[l].fma_c(METHOD.a[I][j], sum_a[l]);
                }
            }
            if METHOD.c[I][j] != 0.0 {
                for l in 0..BLOCK {
                    sum_c[l] = row[l].fma_c(METHOD.c[I][j], sum_c[l]);
                }
            }
        }
        stage[k] = sum_a;
        for l in 0..BLOCK {
            b[k][l] = sum_c[l].scale(inverse_h);
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
    for j in 0..S {
        let (row, c) = (&u[j * blocks + b], coefficients[j]);
        for l in 0..BLOCK {
            sum[l] = row[l].fma_c(c, sum[l]);
        }
    }
    sum
}
