//! Dense output: the state within a step.

use crate::rosenbrock::{RODAS3, RODAS5P};
use crate::stages::{BLOCK, Block, Method, sum_of_stages, zeros};
use math::{Lane, Real, Work};

/// One step of all lanes, for dense output, as a polynomial in theta = (t - t0)/h:
///
///   `y = c0 + theta (c1 + theta (c2 + theta (c3 + theta c4)))`
///   `c0 = y0,  c1 = y1 - y0 + K_1,  c2 = K_2 - K_1,  c3 = K_3 - K_2,  c4 = -K_3,  K_l = sum_j h_lj U_j`
#[derive(Clone, Debug)]
pub(crate) struct Step<R: Lane> {
    pub y0: Vec<Block<R>>,
    pub y1: Vec<Block<R>>,
    c: Vec<[Block<R>; 5]>,
    at: Vec<Block<R>>,
    spread: Vec<Block<R::Plain>>,
    /// Integration method.
    method: Method,
    /// `c` belongs to the present attempt.
    ready: bool,
    /// Number of attempts so far.
    pub attempts: u64,
}

/// Course of one state within a step, as a polynomial in the fraction of its length.
#[derive(Clone, Copy, Debug)]
pub struct Course<R>([R; 5]);

impl<R: Lane> Course<R> {
    /// Returns the course of one lane.
    #[inline(always)]
    pub fn of(&self, lane: usize) -> Course<f64> {
        Course(self.0.map(|c| c.get(lane)))
    }

    /// Returns the value at a fraction.
    #[inline(always)]
    pub fn value(&self, theta: f64) -> R {
        let [c0, c1, c2, c3, c4] = self.0;
        c4.fma_c(theta, c3).fma_c(theta, c2).fma_c(theta, c1).fma_c(theta, c0)
    }

    /// Returns the value at a fraction, and its derivative by the fraction.
    #[inline(always)]
    pub fn value_and_slope(&self, theta: f64) -> [R; 2] {
        let [rest @ .., c4] = self.0;
        let (mut value, mut slope) = (c4, R::zero());
        for c in rest.into_iter().rev() {
            slope = slope.fma_c(theta, value);
            value = value.fma_c(theta, c);
        }
        [value, slope]
    }

    /// Returns a bound on the distance from the initial value, anywhere in the step.
    #[inline(always)]
    pub fn spread(&self) -> R {
        let [_, c1, c2, c3, c4] = self.0;
        (c1.abs() + c2.abs()) + (c3.abs() + c4.abs())
    }
}

struct Prepare<'s, R: Lane>(&'s mut Step<R>, &'s [Block<R>]);

impl<R: Lane> Work for Prepare<'_, R> {
    type Out = ();
    #[inline(always)]
    fn work(self) {
        match self.0.method {
            Method::Rodas5P => self.0.prepare_by(&RODAS5P.dense, self.1),
            Method::Rodas3 => self.0.prepare_by(&RODAS3.dense, self.1),
        }
    }
}

impl<R: Lane> Step<R> {
    pub fn new(blocks: usize) -> Self {
        let c = vec![[[R::zero(); BLOCK]; 5]; blocks];
        Step {
            y0: zeros(blocks),
            y1: zeros(blocks),
            c,
            at: zeros(blocks),
            spread: zeros(blocks),
            method: Method::default(),
            ready: false,
            attempts: 0,
        }
    }

    /// Starts an attempt from `y0`.
    pub fn begin(&mut self, y0: &[Block<R>], method: Method) {
        self.y0.copy_from_slice(y0);
        self.method = method;
        self.ready = false;
        self.attempts += 1;
    }

    /// Returns the course of one state, from the coefficients of `prepare`.
    #[inline(always)]
    pub fn course(&self, i: usize, u: &[Block<R>]) -> Course<R> {
        match self.method {
            Method::Rodas5P => self.course_by(i, &RODAS5P.dense, u),
            Method::Rodas3 => self.course_by(i, &RODAS3.dense, u),
        }
    }

    #[inline(always)]
    fn course_by<const S: usize>(&self, i: usize, dense: &[[f64; S]; 3], u: &[Block<R>]) -> Course<R> {
        let (b, l, blocks) = (i / BLOCK, i % BLOCK, self.c.len());
        let (y0, y1) = (self.y0[b][l], self.y1[b][l]);
        let mut k = [R::zero(); 3];
        for (k, row) in k.iter_mut().zip(dense) {
            for j in 0..S {
                *k = u[j * blocks + b][l].fma_c(row[j], *k);
            }
        }
        let [k0, k1, k2] = k;
        Course([y0, (y1 - y0) + k0, k1 - k0, k2 - k1, -k2])
    }

    /// Prepares the interpolation from the stages of the attempt, once per attempt.
    pub fn prepare(&mut self, u: &[Block<R>]) {
        if !self.ready {
            R::within(Prepare(self, u));
            self.ready = true;
        }
    }

    #[inline(always)]
    fn prepare_by<const S: usize>(&mut self, dense: &[[f64; S]; 3], u: &[Block<R>]) {
        let blocks = self.c.len();
        for (b, c) in self.c.iter_mut().enumerate() {
            let k0 = sum_of_stages(b, blocks, &dense[0], u);
            let k1 = sum_of_stages(b, blocks, &dense[1], u);
            let k2 = sum_of_stages(b, blocks, &dense[2], u);
            let (y0, y1) = (self.y0[b], self.y1[b]);
            c[0] = y0;
            for l in 0..BLOCK {
                c[1][l] = (y1[l] - y0[l]) + k0[l];
            }
            for l in 0..BLOCK {
                c[2][l] = k1[l] - k0[l];
            }
            for l in 0..BLOCK {
                c[3][l] = k2[l] - k1[l];
            }
            for l in 0..BLOCK {
                c[4][l] = -k2[l];
            }
        }
    }

    /// Returns a bound on the distance of each state from `y0` in the step: |c1| + |c2| + |c3| + |c4|.
    #[inline(always)]
    pub fn spread(&mut self) -> &[R::Plain] {
        for (spread, c) in self.spread.iter_mut().zip(&self.c) {
            for l in 0..BLOCK {
                let part = |i: usize| c[i][l].plain().abs();
                spread[l] = (part(1) + part(2)) + (part(3) + part(4));
            }
        }
        self.spread.as_flattened()
    }

    /// Sets the state at the start of the step if only this state is requested.
    pub fn copy(&mut self, y: &[Block<R>]) -> &mut [R] {
        self.at.copy_from_slice(y);
        self.at.as_flattened_mut()
    }

    /// Returns one state at `t0 + theta h`, and its derivative by theta. Call `prepare` first.
    pub fn component(&self, i: usize, theta: f64) -> [R; 2] {
        Course(self.c[i / BLOCK].map(|coefficient| coefficient[i % BLOCK])).value_and_slope(theta)
    }

    /// Returns the state at `t0 + theta h`, to the dense order of the method. Call `prepare` first. A
    /// constant state keeps its bits.
    #[inline(always)]
    pub fn interpolate(&mut self, theta: f64) -> &mut [R] {
        for (at, c) in self.at.iter_mut().zip(&self.c) {
            // One coefficient of a whole block at a time gives vector code.
            let mut sum = c[4];
            for coefficient in [&c[3], &c[2], &c[1], &c[0]] {
                for l in 0..BLOCK {
                    sum[l] = sum[l].fma_c(theta, coefficient[l]);
                }
            }
            *at = sum;
        }
        self.at.as_flattened_mut()
    }
}
