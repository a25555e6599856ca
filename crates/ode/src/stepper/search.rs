//! The search for events within an attempted step.

use super::Stepper;
use crate::event::{Found, LOOKOUTS, locate};
use crate::system::System;
use math::{Lane, Real};

impl<R: Lane, Sys: System<R>> Stepper<R, Sys> {
    /// Computes the event functions of one lane at `t0 + theta h` of the present attempt, into `g_look`.
    fn look(&mut self, lane: usize, t0: f64, h: f64, theta: f64) {
        let n = self.structure.n;
        let t = R::from_lanes(|l| if l == lane { t0 + theta * h } else { self.t[l] });
        let y = if theta == 1.0 { self.step.y1.as_flattened() } else { &*self.step.interpolate(theta) };
        self.system.events(t, &y[..n], &mut self.g_look, &mut self.work);
    }

    /// Computes the event functions of all lanes at the interior points of the present attempt.
    fn look_out(&mut self, h: R::Plain) {
        let n = self.structure.n;
        self.step.prepare(&self.u);
        let t0 = R::Plain::from_lanes(|lane| self.t[lane]);
        for (g, theta) in self.looks.iter_mut().zip(LOOKOUTS) {
            let t = R::from(t0 + h * R::Plain::c(theta));
            let y = if theta == 1.0 { self.step.y1.as_flattened() } else { &*self.step.interpolate(theta) };
            self.system.events(t, &y[..n], g, &mut self.work);
        }
        self.looked = true;
    }

    /// Returns the first event of one lane within the present attempt. `steps` are the steps of all lanes,
    /// and `h` is that of this lane.
    pub(super) fn look_for_event(&mut self, lane: usize, t0: f64, h: f64, steps: R::Plain) -> Found {
        if !self.looked {
            self.look_out(steps);
        }
        let looks = std::mem::take(&mut self.looks);
        let found = self.look_through(&looks, lane, t0, h);
        self.looks = looks;
        found
    }

    fn look_through(&mut self, looks: &[Vec<R>; LOOKOUTS.len()], lane: usize, t0: f64, h: f64) -> Found {
        let patience = self.lanes[lane].patience();
        for (k, theta) in LOOKOUTS.into_iter().enumerate() {
            let mut first: Option<(f64, usize)> = None;
            for (event, high) in looks[k].iter().enumerate() {
                let tolerance = patience * self.system.event_tolerance(event);
                let high = high.get(lane);
                if high >= -tolerance {
                    continue;
                }
                let shift = 0.5 * tolerance;
                let (before, low) = match k.checked_sub(1) {
                    Some(last) => (LOOKOUTS[last], looks[last][event].get(lane)),
                    None => (0.0, self.g0[event].get(lane)),
                };
                let at = if low + shift <= 0.0 {
                    before
                } else {
                    locate(before, low + shift, theta, high + shift, |middle| {
                        self.look(lane, t0, h, middle);
                        self.g_look[event].get(lane) + shift
                    })
                };
                if first.is_none_or(|(earliest, _)| at < earliest) {
                    first = Some((at, event));
                }
            }
            if let Some((at, event)) = first {
                return Found::Inside(at, event);
            }
        }
        let near = |event: &usize| {
            let above = if patience > 1.0 { patience * self.system.event_tolerance(*event) } else { 0.0 };
            looks[LOOKOUTS.len() - 1][*event].get(lane) <= above && self.g0[*event].get(lane) > 0.0
        };
        (0..self.g0.len()).find(near).map_or(Found::Nothing, Found::AtEnd)
    }
}
