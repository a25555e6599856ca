//! The search for events within an attempted step.

use super::Stepper;
use crate::event::{LOOKOUTS, locate};
use crate::system::System;
use math::Lane;

/// Result of the search.
pub(super) enum Found {
    Nothing,
    /// The step ends on the event.
    AtEnd(usize),
    /// The event lies at this fraction of the step.
    Inside(f64, usize),
}

impl<R: Lane, Sys: System<R>> Stepper<R, Sys> {
    /// Event functions of one lane at `t0 + theta h` of the present attempt, into `g_look`.
    fn look(&mut self, lane: usize, t0: f64, h: f64, theta: f64) {
        let n = self.structure.n();
        let t = R::from_lanes(|l| if l == lane { t0 + theta * h } else { self.t[l] });
        let y = if theta == 1.0 { self.step.y1.as_flattened() } else { &*self.step.interpolate(theta) };
        self.system.events(t, &y[..n], &mut self.g_look, &mut self.work);
    }

    /// The first event of one lane within the present attempt.
    pub(super) fn look_for_event(&mut self, lane: usize, t0: f64, h: f64) -> Found {
        self.g1.copy_from_slice(&self.g0);
        let mut before = 0.0;
        let patience = self.lanes[lane].patience();
        for theta in LOOKOUTS {
            self.look(lane, t0, h, theta);
            let mut first: Option<(f64, usize)> = None;
            for event in 0..self.g0.len() {
                let tolerance = patience * self.system.event_tolerance(event);
                if self.g_look[event].get(lane) >= -tolerance {
                    continue;
                }
                let shift = 0.5 * tolerance;
                let (low, high) = (self.g1[event].get(lane) + shift, self.g_look[event].get(lane) + shift);
                let at = if low <= 0.0 {
                    before
                } else {
                    let saved = self.g_look.clone();
                    let at = locate(before, low, theta, high, |middle| {
                        self.look(lane, t0, h, middle);
                        self.g_look[event].get(lane) + shift
                    });
                    self.g_look = saved;
                    at
                };
                if first.is_none_or(|(earliest, _)| at < earliest) {
                    first = Some((at, event));
                }
            }
            if let Some((at, event)) = first {
                return Found::Inside(at, event);
            }
            std::mem::swap(&mut self.g1, &mut self.g_look);
            before = theta;
        }
        let near = |event: usize| {
            let above = if patience > 1.0 { patience * self.system.event_tolerance(event) } else { 0.0 };
            self.g1[event].get(lane) <= above && self.g0[event].get(lane) > 0.0
        };
        match (0..self.g1.len()).find(|&event| near(event)) {
            Some(event) => Found::AtEnd(event),
            None => Found::Nothing,
        }
    }
}
