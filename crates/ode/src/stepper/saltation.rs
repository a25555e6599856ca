//! Effect of an event on derivatives.
//!
//! A step ends on an event at a fixed time t*, but the event moves with the parameters. The derivatives of
//! the state before and after the event then differ by the rates times dt*:
//!
//!   `S+ = R' (S- + f- dt*) - f+ dt*,     dt* = -dg/(grad g . f-)`
//!
//! Here g is the event function, dg its derivative at fixed time, and R the effect of the switch on the state.
//! Source: [galan1999].

use super::Stepper;
use crate::system::System;
use math::Lane;

impl<R: Lane, Sys: System<R>> Stepper<R, Sys> {
    /// Changes the mode of one lane. `moved` is true if time has passed since its last switch.
    pub(super) fn switch(&mut self, lane: usize, event: usize, moved: bool) {
        if R::DIRECTIONS > 0 {
            if moved {
                // A second switch at the same time has the same dt*.
                self.event_shift = self.shift_of(event);
            }
            self.shift_state(self.event_shift);
        }
        let n = self.structure.n;
        self.system.switch(lane, event, &mut self.y.as_flattened_mut()[..n], &mut self.work);
        if R::DIRECTIONS > 0 {
            self.shift_state(-self.event_shift);
        }
        self.lanes[lane].note_switch(self.t[lane], event, moved);
    }

    /// Returns the rates at the present state and mode.
    fn rates(&mut self) -> Vec<R> {
        let n = self.structure.n;
        let mut rates = vec![R::zero(); n];
        let t = R::c(self.t[0]);
        self.system.rhs(t, &self.y.as_flattened()[..n], &mut rates, &mut self.work);
        rates
    }

    /// Returns dt* of an event at the present state. `None` if the function only touches zero.
    fn shift_of(&mut self, event: usize) -> R {
        let n = self.structure.n;
        let y = self.y.as_flattened()[..n].to_vec();
        let rates = self.rates();
        let mut function = |y: &[R]| {
            let mut g = vec![R::zero(); self.g0.len()];
            self.system.events(R::c(self.t[0]), y, &mut g, &mut self.work);
            g[event]
        };
        // Slope along the rates, without the part of the parameters in the same direction.
        let along = |slope: f64| -> Vec<R> {
            let seed = |part: usize, value: f64, rate: f64| match part {
                0 => value,
                1 => slope * rate,
                _ => 0.0,
            };
            let states = y.iter().zip(&rates);
            states.map(|(y, f)| R::from_parts(|part| seed(part, y.get(0), f.get(0)))).collect()
        };
        let speed = function(&along(1.0)).part(1) - function(&along(0.0)).part(1);
        let g = function(&y);
        let crosses = speed < 0.0;
        R::from_parts(|part| if part == 0 || !crosses { 0.0 } else { -g.part(part) / speed })
    }

    /// Adds the rates times `shift` to the derivatives of the state. The values keep their bits.
    fn shift_state(&mut self, shift: R) {
        let rates = self.rates();
        for (y, f) in self.y.as_flattened_mut().iter_mut().zip(rates) {
            let (state, f) = (*y, f.get(0));
            *y = R::from_parts(|part| {
                if part == 0 { state.part(0) } else { shift.part(part).mul_add(f, state.part(part)) }
            });
        }
    }
}
