//! Samples, and other observers of the integration.

use super::{Stepper, is_outside};
use crate::dense::{Course, Step};
use crate::stages::Block;
use crate::system::System;
use math::Lane;

/// Receives samples while the integration runs.
pub trait Output<R: Lane, Sys> {
    /// Returns the time of the next sample of this lane. Infinity if no further sample is wanted.
    fn due(&self, lane: usize) -> f64;
    /// The state of this lane at the due time.
    fn sample(&mut self, lane: usize, t: f64, y: &[R], system: &Sys);
    /// Announces a change of the system of this lane. The samples so far belong to the system before the
    /// change.
    #[inline(always)]
    fn changes(&mut self, _lane: usize, _system: &Sys) {}
    /// Receives an accepted step of this lane from `t` of length `h`.
    #[inline(always)]
    fn step(&mut self, _lane: usize, _t: f64, _h: f64, _states: &mut Accepted<'_, R>, _system: &Sys) {}
}

/// The states within one accepted step.
pub struct Accepted<'a, R: Lane> {
    pub(super) step: &'a mut Step<R>,
    pub(super) u: &'a [Block<R>],
}

impl<R: Lane> Accepted<'_, R> {
    /// Returns the time at the start of the step.
    pub fn before(&self) -> &[R] {
        self.step.y0.as_flattened()
    }
    /// Returns the time at its end.
    pub fn after(&self) -> &[R] {
        self.step.y1.as_flattened()
    }
    /// Returns the number of the attempt. All lanes that accept it share this number.
    pub fn attempt(&self) -> u64 {
        self.step.attempts()
    }
    /// Returns the course of one state.
    #[inline(always)]
    pub fn course(&self, i: usize) -> Course<R> {
        self.step.course(i, self.u)
    }
    /// Returns one state at a fraction of the step, and its derivative by that fraction.
    pub fn state(&mut self, i: usize, theta: f64) -> [R; 2] {
        self.step.prepare(self.u);
        self.step.component(i, theta)
    }
    /// Returns the state at a fraction of the step.
    #[inline(always)]
    pub fn at(&mut self, theta: f64) -> &[R] {
        self.step.prepare(self.u);
        self.step.interpolate(theta)
    }
}

/// Output without samples.
pub struct NoOutput;

impl<R: Lane, Sys> Output<R, Sys> for NoOutput {
    fn due(&self, _lane: usize) -> f64 {
        f64::INFINITY
    }
    fn sample(&mut self, _lane: usize, _t: f64, _y: &[R], _system: &Sys) {}
}

impl<R: Lane, Sys: System<R>> Stepper<R, Sys> {
    /// Gives the samples of one lane that are due before `t1`, the end of the step of length `h` from `t0`. A
    /// sample outside the valid range of the equations is not given. The fraction of the step at which it was
    /// due is returned.
    #[inline(always)]
    pub(super) fn give_samples(
        &mut self,
        lane: usize,
        t0: f64,
        h: f64,
        t1: f64,
        output: &mut impl Output<R, Sys>,
    ) -> Option<f64> {
        let (n, has_modes) = (self.structure.n(), !self.g0.is_empty());
        while output.due(lane) <= t0 {
            let y = &mut self.step.copy(&self.y)[..n];
            if has_modes {
                self.system.settle(y);
            }
            output.sample(lane, t0, y, &self.system);
        }
        if output.due(lane) >= t1 {
            return None;
        }
        self.step.prepare(&self.u);
        let sure = self.system.surely_inside(&self.y.as_flattened()[..n], &self.step.spread()[..n]);
        let sure = !is_outside::<R>(sure, lane);
        let inverse_h = 1.0 / h;
        loop {
            let t = output.due(lane);
            if t >= t1 {
                return None;
            }
            let theta = ((t - t0) * inverse_h).clamp(0.0, 1.0);
            let y = &mut self.step.interpolate(theta)[..n];
            if !sure && is_outside::<R>(self.system.inside(y, &mut self.work), lane) {
                return Some(theta);
            }
            if has_modes {
                self.system.settle(y);
            }
            output.sample(lane, t, y, &self.system);
        }
    }
}
