//! The right-hand side and its Jacobian at the start of an attempt.

use super::{Direction, Stepper};
use crate::system::System;
use math::Lane;

impl<R: Lane, Sys: System<R>> Stepper<R, Sys> {
    /// Updates f, its Jacobian and the event functions at the present state.
    pub(super) fn refresh(&mut self) {
        self.system.renew(&mut self.work);
        self.system.renew(&mut self.dual_work);
        let n = self.structure.n;
        let (y, f0) = (&self.y.as_flattened()[..n], self.f0.as_flattened_mut());
        let linear = &mut self.linear;
        linear.is_arrow = self.system.linearise(y, f0, &mut linear.dense);
        if R::GENERAL && (!linear.is_arrow || n > self.structure.n_coupled) {
            self.differentiate();
        }
        if !self.g0.is_empty() {
            let t = R::from_lanes(|lane| self.t[lane]);
            self.system.events(t, &self.y.as_flattened()[..n], &mut self.g0, &mut self.work);
        }
        for lane in &mut self.lanes {
            lane.statistics.jacobians += 1;
        }
        self.fresh = true;
    }

    /// Computes f and its Jacobian by passes of dual numbers.
    fn differentiate(&mut self) {
        let structure = self.structure.clone();
        let n = structure.n;
        let t = R::from_lanes(|lane| self.t[lane]);
        for pass in &structure.passes {
            if self.seeded {
                for (dual, y) in self.dual_y.iter_mut().zip(self.y.as_flattened()) {
                    dual.re = *y;
                }
            } else {
                for (dual, y) in self.dual_y.iter_mut().zip(self.y.as_flattened()) {
                    *dual = Direction::from(*y);
                }
                for &(state, direction) in &pass.seeds {
                    self.dual_y[state as usize].eps[direction as usize] = R::one();
                }
                // With one pass, the directions never change.
                self.seeded = structure.passes.len() == 1;
            }
            let time = match pass.time {
                Some(direction) => Direction::variable(t, direction as usize),
                None => Direction::from(t),
            };
            self.system.rhs(time, &self.dual_y, &mut self.dual_dy, &mut self.dual_work);
            for &(row, direction, slot) in &pass.results {
                self.linear.jacobian[slot as usize] = self.dual_dy[row as usize].eps[direction as usize];
            }
            if let Some(direction) = pass.time {
                for (f_t, dual) in self.f_t.as_flattened_mut().iter_mut().zip(&self.dual_dy) {
                    *f_t = dual.eps[direction as usize];
                }
            }
        }
        if structure.passes.is_empty() {
            self.system.rhs(
                t,
                &self.y.as_flattened()[..n],
                &mut self.f0.as_flattened_mut()[..n],
                &mut self.work,
            );
        } else {
            for (f0, dual) in self.f0.as_flattened_mut().iter_mut().zip(&self.dual_dy) {
                *f0 = dual.re;
            }
        }
    }
}
