//! Samples of an accepted step.

use super::{Stepper, is_outside};
use crate::output::Output;
use crate::system::System;
use math::Lane;

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
        let (n, has_modes) = (self.structure.n, !self.g0.is_empty());
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
