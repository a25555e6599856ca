//! Samples, and other observers of the integration.

use crate::dense::{Course, Step};
use crate::stages::Block;
use math::Lane;

/// Receives samples while the integration runs.
pub trait Output<R: Lane, Sys> {
    /// Returns the time of the next sample of this lane. Infinity if no further sample is wanted.
    fn due(&self, _lane: usize) -> f64 {
        f64::INFINITY
    }
    /// The state of this lane at the due time.
    fn sample(&mut self, _lane: usize, _t: f64, _y: &[R], _system: &Sys) {}
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
    pub(crate) step: &'a mut Step<R>,
    pub(crate) u: &'a [Block<R>],
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
        self.step.attempts
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

impl<R: Lane, Sys> Output<R, Sys> for NoOutput {}
