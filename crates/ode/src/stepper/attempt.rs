//! One attempt at a step: its stages and its error.

use super::Stepper;
use crate::control::{LEAST_ERROR, inverse_cube_root};
use crate::linear::{Pair, VELOCITY};
use crate::stages::{BLOCK, Block, Fifth, MOST_STAGES, Method, Tableau, Third, combine, stands};
use crate::system::System;
use math::{Lane, Real, Work};

/// An attempt of a step of this length.
struct Attempt<'s, R: Lane, Sys: System<R>>(&'s mut Stepper<R, Sys>, R::Plain);

impl<R: Lane, Sys: System<R>> Work for Attempt<'_, R, Sys> {
    type Out = ();
    #[inline(always)]
    fn work(self) {
        self.0.take_stages(self.1);
    }
}

/// Fraction of a tolerance that errors of one sign may use.
const ONE_SIGN: f64 = 0.5;
/// Least fraction of the tolerance for a mass that accelerates slowly. The friction law ends that phase
/// (assumed).
const LEAST_SHARE: f64 = 0.02;

/// sum += other.
#[inline(always)]
fn add<R: Lane>(sum: &mut [R], other: &[R]) {
    for (sum, other) in sum.iter_mut().zip(other) {
        *sum += *other;
    }
}

impl<R: Lane, Sys: System<R>> Stepper<R, Sys> {
    /// Attempts one step of all lanes with their own `h`. The stages go into `u`, and the new state into
    /// `step.y1`. It is not inlined, because each kind of output would compile another copy of all stages.
    #[inline(never)]
    pub(super) fn attempt(&mut self, h: R::Plain) {
        R::within(Attempt(self, h));
    }

    #[inline(always)]
    fn take_stages(&mut self, h: R::Plain) {
        let is_small = R::DIRECTIONS == 0 && (!R::GENERAL || self.structure.is_small());
        let inverse_h = R::Plain::one() / h;
        macro_rules! stages {
            ($method:ident $count:literal: $($i:literal)*) => {{
                let gamma = const { <$method as Tableau<$count>>::METHOD.gamma };
                self.linear.prepare(&self.structure, h * R::Plain::c(gamma));
                $(if is_small {
                    self.small_stage::<$method, $count, $i>(h, inverse_h);
                } else {
                    self.stage::<$method, $count, $i>(h, inverse_h);
                })*
            }};
        }
        match self.options.method {
            Method::Rodas5P => stages!(Fifth 8: 0 1 2 3 4 5 6 7),
            Method::Rodas3 => stages!(Third 4: 0 1 2 3),
        }
        self.step.begin(&self.y, self.options.method);
        let last = &self.u[(self.options.method.stages() - 1) * self.y.len()..];
        for ((y1, stage), u) in self.step.y1.iter_mut().zip(&self.stage).zip(last) {
            for l in 0..BLOCK {
                y1[l] = stage[l] + u[l];
            }
        }
    }

    /// Stage `I` of a system of two blocks, whose W^-1 is known: U_I into `u`, with sizes that are constants.
    #[inline(always)]
    fn small_stage<M: Tableau<S>, const S: usize, const I: usize>(
        &mut self,
        h: R::Plain,
        inverse_h: R::Plain,
    ) {
        let Stepper { structure, system, t, y, f0, u, stage, rhs, linear, work, .. } = self;
        let n = structure.n;
        let y: &Pair<R> = y.first_chunk().expect("two blocks");
        let u: &mut [Pair<R>; MOST_STAGES] =
            u.as_chunks_mut().0.first_chunk_mut().expect("a row for each stage");
        let (done, rest) = u.split_at_mut(I);
        let stage: &mut Pair<R> = stage.first_chunk_mut().expect("two blocks");
        let rhs: &mut Pair<R> = rhs.first_chunk_mut().expect("two blocks");
        let own = &mut rest[0];
        let known = if I == 0 {
            f0.first_chunk().expect("two blocks")
        } else {
            combine::<R, M, S, I, BLOCK>(stage, own, y, inverse_h, (done.as_flattened(), y.len()));
            if const { stands(&M::METHOD, I) } {
                add(own.as_flattened_mut(), f0.as_flattened());
                &*own
            } else {
                let t = R::Plain::from_lanes(|lane| t[lane]);
                let time = R::from(h.fma(R::Plain::c(const { M::METHOD.alpha[I] }), t));
                let (known, out) = (&own.as_flattened()[..n], &mut rhs.as_flattened_mut()[..n]);
                system.add_rates(time, &stage.as_flattened()[..n], known, out, work);
                &*rhs
            }
        };
        *own = linear.multiply(known);
    }

    /// Stage `I` of the present attempt: U_I into `u`.
    #[inline(always)]
    fn stage<M: Tableau<S>, const S: usize, const I: usize>(&mut self, h: R::Plain, inverse_h: R::Plain) {
        let Stepper { structure, system, t, y, f0, f_t, u, stage, rhs, linear, work, .. } = self;
        let (n, blocks) = (structure.n, y.len());
        let (done, b) = u[..(I + 1) * blocks].split_at_mut(I * blocks);
        if I == 0 {
            b.copy_from_slice(f0);
        } else {
            if const { R::DIRECTIONS > 0 } {
                // One by one: four at a time with their derivatives exceed the registers.
                let (stage, y, done) = (stage.as_flattened_mut(), y.as_flattened(), done.as_flattened());
                let alone = (done.as_chunks().0, BLOCK * blocks);
                let (stage, b) = (stage.as_chunks_mut().0, b.as_flattened_mut().as_chunks_mut().0);
                combine::<R, M, S, I, 1>(stage, &mut b[..n], y[..n].as_chunks().0, inverse_h, alone);
                // The padding of the last block takes part in products. It could hold values of a rejected
                // attempt.
                b[n..].fill([R::zero()]);
            } else {
                combine::<R, M, S, I, BLOCK>(stage, b, y, inverse_h, (done, blocks));
            }
            if const { stands(&M::METHOD, I) } {
                add(b.as_flattened_mut(), f0.as_flattened());
            } else {
                let t = R::Plain::from_lanes(|lane| t[lane]);
                let time = R::from(h.fma(R::Plain::c(const { M::METHOD.alpha[I] }), t));
                let (stage, b) = (&stage.as_flattened()[..n], &mut b.as_flattened_mut()[..n]);
                let out = &mut rhs.as_flattened_mut()[..n];
                if R::GENERAL && !linear.is_arrow {
                    system.rhs(time, stage, out, work);
                    add(b, out);
                } else {
                    system.add_rates(time, stage, b, out, work);
                    b.copy_from_slice(out);
                }
            }
        }
        if structure.depends_on_time {
            let weight = h * R::Plain::c(const { M::METHOD.gamma_t[I] });
            for (b, f_t) in b.as_flattened_mut().iter_mut().zip(f_t.as_flattened()) {
                *b = f_t.fma_plain(weight, *b);
            }
        }
        linear.solve(structure, b);
    }

    /// Returns the errors of the present attempt: the numbers that its last stage added.
    pub(super) fn errors(&self) -> &[Block<R>] {
        &self.u[(self.options.method.stages() - 1) * self.y.len()..][..self.y.len()]
    }

    /// Returns the largest error of any state, in units of its tolerance, for all lanes. NaN if a state is
    /// not finite.
    #[inline(always)]
    pub(super) fn error(&self) -> R::Plain {
        let rtol = R::Plain::from_lanes(|lane| self.lanes[lane].share * self.options.rtol);
        let rtol = rtol * self.share_of_slow();
        let (zero, infinite) = (R::Plain::zero(), R::Plain::c(f64::INFINITY));
        let (mut worst, mut poison) = ([zero; BLOCK], [zero; BLOCK]);
        for (b, error) in self.errors().iter().enumerate() {
            for l in 0..BLOCK {
                let size = self.y[b][l].plain().abs().max(self.step.y1[b][l].plain().abs());
                let ratio = error[l].plain().abs() / (rtol * (self.scale[b][l] + size));
                // A quadrature never influences the step, even if it is NaN.
                let ratio = R::Plain::select(self.scale[b][l].lt(infinite), ratio, zero);
                worst[l] = worst[l].max(ratio);
                poison[l] += ratio * zero;
            }
        }
        let (mut w, mut p) = (worst[0], poison[0]);
        for l in 1..BLOCK {
            w = w.max(worst[l]);
            p += poison[l];
        }
        self.of_fifth_order(w + p)
    }

    /// Returns the fraction of the tolerance for an attempt in which a mass accelerates because friction
    /// falls with speed. An error there is a time shift. It persists and grows with the speed, up to the
    /// scale of the speed and beyond. One half of the tolerance, because these errors have one sign.
    #[inline(always)]
    fn share_of_slow(&self) -> R::Plain {
        let (zero, one) = (R::Plain::zero(), R::Plain::one());
        if !self.linear.is_arrow {
            return one;
        }
        let of = |blocks: &[Block<R>]| blocks.as_flattened()[VELOCITY].plain();
        let (v, rate, scale) = (of(&self.y), of(&self.f0), self.scale.as_flattened()[VELOCITY]);
        let share = (v.abs() / (scale + v.abs()) * R::Plain::c(ONE_SIGN)).max(R::Plain::c(LEAST_SHARE));
        let faster = R::Plain::select(zero.lt(v * rate), share, one);
        R::Plain::select(zero.lt(self.linear.growth()), faster, one)
    }

    /// Step control expects an error of order h^5. The error of the method of order 3 is raised to the power
    /// that gives this order: e^(5/3) = e^2 e^(-1/3). An error of one remains one.
    #[inline(always)]
    fn of_fifth_order(&self, error: R::Plain) -> R::Plain {
        match self.options.method {
            Method::Rodas5P => error,
            Method::Rodas3 => R::Plain::from_lanes(|lane| {
                let e = error.get(lane);
                e * e * inverse_cube_root(e.max(LEAST_ERROR))
            }),
        }
    }
}
