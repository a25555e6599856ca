//! States in blocks, and the sums over stages.

use crate::rosenbrock::{RODAS3, RODAS5P, Rosenbrock};
use math::Lane;

/// Largest number of stages of a method.
pub(crate) const MOST_STAGES: usize = 8;

/// Rosenbrock method that takes the steps.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Method {
    /// [`RODAS5P`]: long steps.
    #[default]
    Rodas5P,
    /// [`RODAS3`]: half the work for each step. It suits steps that are short for other reasons than
    /// accuracy.
    Rodas3,
}

impl Method {
    pub(crate) fn stages(self) -> usize {
        match self {
            Method::Rodas5P => RODAS5P.a.len(),
            Method::Rodas3 => RODAS3.a.len(),
        }
    }

    /// Returns the number of right-hand sides of a step, without the one computed with the Jacobian.
    pub(crate) fn right_hand_sides(self) -> u64 {
        match self {
            Method::Rodas5P => Fifth::RIGHT_HAND_SIDES,
            Method::Rodas3 => Third::RIGHT_HAND_SIDES,
        }
    }
}

/// A method as a type: its coefficients are constants of the code.
pub(crate) trait Tableau<const S: usize> {
    const METHOD: Rosenbrock<S>;
    const RIGHT_HAND_SIDES: u64 = {
        let (mut i, mut count) = (1, 0);
        while i < S {
            count += !stands(&Self::METHOD, i) as u64;
            i += 1;
        }
        count
    };
}

pub(crate) struct Fifth;
impl Tableau<8> for Fifth {
    const METHOD: Rosenbrock<8> = RODAS5P;
}

pub(crate) struct Third;
impl Tableau<4> for Third {
    const METHOD: Rosenbrock<4> = RODAS3;
}

/// States are stored in blocks of this size, so that a loop over them fills vector registers.
pub(crate) const BLOCK: usize = 4;
pub(crate) type Block<R> = [R; BLOCK];

/// Returns `count` blocks of zeros.
pub(crate) fn zeros<R: Lane>(count: usize) -> Vec<Block<R>> {
    vec![[R::zero(); BLOCK]; count]
}

/// Returns whether the state of stage `i` equals the previous stage's state plus one of its numbers.
const fn follows<const S: usize>(method: &Rosenbrock<S>, i: usize) -> bool {
    let mut same = i > 1 && method.a[i][i - 1] == 1.0;
    let mut j = 0;
    while same && j + 1 < i {
        same = method.a[i][j] == method.a[i - 1][j];
        j += 1;
    }
    same
}

/// Returns whether stage `i` is at the start of the step, where the right-hand side is known.
pub(crate) const fn stands<const S: usize>(method: &Rosenbrock<S>, i: usize) -> bool {
    let mut stands = method.alpha[i] == 0.0;
    let mut j = 0;
    while j < i {
        stands = stands && method.a[i][j] == 0.0;
        j += 1;
    }
    stands
}

/// Computes `stage = y + sum_j a_j u_j` and `b = sum_j (c_j/h) u_j` for stage `I`, over the `I` stages before it and
/// for `W` numbers side by side. At entry, `stage` holds the previous stage. Each stage has `stride` rows in `u`.
#[inline(always)]
pub(crate) fn combine<R: Lane, M: Tableau<S>, const S: usize, const I: usize, const W: usize>(
    stage: &mut [[R; W]],
    b: &mut [[R; W]],
    y: &[[R; W]],
    inverse_h: R::Plain,
    (u, stride): (&[[R; W]], usize),
) {
    let follows = const { follows(&M::METHOD, I) };
    let (a, c) = const { (&M::METHOD.a[I], &M::METHOD.c[I]) };
    for k in 0..y.len() {
        let mut sum_a = if follows { stage[k] } else { y[k] };
        let mut sum_c = [R::zero(); W];
        for j in 0..I {
            let row = &u[j * stride + k];
            let is_new = !follows || j + 1 == I;
            if is_new && a[j] != 0.0 {
                for l in 0..W {
                    sum_a[l] = row[l].fma_c(a[j], sum_a[l]);
                }
            }
            if c[j] != 0.0 {
                for l in 0..W {
                    sum_c[l] = row[l].fma_c(c[j], sum_c[l]);
                }
            }
        }
        stage[k] = sum_a;
        for l in 0..W {
            b[k][l] = sum_c[l].scale(inverse_h);
        }
    }
}

/// sum_j coefficient_j u_j over all stages, of block `b`.
#[inline(always)]
pub(crate) fn sum_of_stages<R: Lane, const S: usize>(
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
