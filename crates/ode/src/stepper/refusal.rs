//! Rejected attempts: a shorter attempt follows, or the lane fails.

use super::{MIN_RELATIVE_STEP, Stepper};
use crate::control::Failure;
use crate::system::System;
use math::Lane;

/// End of the next attempt before an obstacle, as a fraction of the way.
const SHORT_OF_OBSTACLE: f64 = 0.999;
/// Length of the attempt after that as a fraction of its planned length, because it enters a region with
/// other equations (assumed).
const BEYOND_OBSTACLE: f64 = 0.005;
/// Near t = 0, a step counts as too small relative to this time, s.
const LEAST_TIME: f64 = 1e-3;

impl<R: Lane, Sys: System<R>> Stepper<R, Sys> {
    /// Handles an attempt with a very large error. If the tangent of the solution reaches an obstacle within
    /// its length, the next attempt ends shortly before the obstacle.
    pub(super) fn stop_before_obstacle(&mut self, lane: usize, h: f64) {
        let n = self.structure.n;
        let (y, f0) = (self.y.as_flattened(), self.f0.as_flattened());
        for ((end, y), f) in self.stage.as_flattened_mut().iter_mut().zip(y).zip(f0) {
            *end = f.fma(R::c(h), *y);
        }
        let [ahead, behind] = &mut self.obstacles;
        self.system.obstacles(&self.stage.as_flattened()[..n], behind, &mut self.work);
        if !behind.iter().any(|behind| behind.get(lane) < 0.0) {
            return;
        }
        self.system.obstacles(&self.y.as_flattened()[..n], ahead, &mut self.work);
        let mut first = 1.0_f64;
        for (before, behind) in ahead.iter().zip(&*behind) {
            let (before, behind) = (before.get(lane), behind.get(lane));
            if before > 0.0 && behind < 0.0 {
                first = first.min(before / (before - behind));
            }
        }
        let cut = SHORT_OF_OBSTACLE * first * h;
        if first < 1.0 && cut > self.lanes[lane].wish {
            self.lanes[lane].cut = Some(cut);
            self.lanes[lane].wish = BEYOND_OBSTACLE * cut;
        }
    }

    fn is_too_small(&self, lane: usize) -> bool {
        self.lanes[lane].wish < MIN_RELATIVE_STEP * self.t[lane].abs().max(LEAST_TIME)
    }

    /// Fails a lane whose step has become too small.
    pub(super) fn check_progress(&mut self, lane: usize, error: f64) {
        if self.is_too_small(lane) {
            let (t, state) = (self.t[lane], self.worst_state(lane));
            let control = &mut self.lanes[lane];
            control.failure = Some(if error.is_finite() {
                Failure::StepTooSmall { t, h: control.wish, state }
            } else {
                Failure::NotFinite { t, state }
            });
        }
    }

    /// Fails a lane that stays invalid at every shorter step.
    pub(super) fn check_outside(&mut self, lane: usize) {
        if self.is_too_small(lane) {
            self.lanes[lane].failure = Some(Failure::Outside { t: self.t[lane] });
        }
    }

    fn worst_state(&self, lane: usize) -> usize {
        let errors = &self.errors().as_flattened()[..self.structure.n];
        let relative = |i: usize| {
            let size = self.y.as_flattened()[i].get(lane).abs();
            let ratio = errors[i].get(lane).abs() / (self.scale.as_flattened()[i].get(lane) + size);
            if ratio.is_nan() { f64::INFINITY } else { ratio }
        };
        (0..errors.len()).max_by(|&a, &b| relative(a).total_cmp(&relative(b))).unwrap_or(0)
    }
}
