//! The right-hand side and its Jacobian at the start of an attempt.

use super::{Direction, Stepper};
use crate::system::System;
use math::Lane;

impl<R: Lane, Sys: System<R>> Stepper<R, Sys> {
    /// Updates f, its Jacobian and the event functions at the present state.
    pub(super) fn refresh(&mut self) {
        self.refresh_as(Self::differentiate);
    }

    /// Does the same before the next attempt, with the Jacobian of a twin without derivatives. `share` gives
    /// the modes to the twin, and the caller sets its inputs. The derivatives of a step then ignore that W
    /// changes with them. They are no longer the exact derivatives of the step, but take less than half the
    /// time. A differentiated Jacobian would need second derivatives.
    pub fn refresh_by<T: System<R::Plain>>(
        &mut self,
        twin: &mut Stepper<R::Plain, T>,
        share: impl FnOnce(&mut Sys, &mut T),
    ) {
        if self.fresh {
            return;
        }
        share(&mut self.system, &mut twin.system);
        self.refresh_as(|own| {
            let values = |of: &mut [R::Plain], own: &[R]| {
                of.iter_mut().zip(own).for_each(|(value, own)| *value = own.plain());
            };
            values(twin.y.as_flattened_mut(), own.y.as_flattened());
            twin.t.copy_from_slice(&own.t);
            twin.refresh();
            let taken = |own: &mut [R], of: &[R::Plain]| {
                own.iter_mut().zip(of).for_each(|(own, value)| *own = R::from(*value));
            };
            taken(&mut own.linear.jacobian, &twin.linear.jacobian);
            own.linear.is_plain = true;
            taken(own.f_t.as_flattened_mut(), twin.f_t.as_flattened());
            let (n, t) = (own.structure.n, R::from_lanes(|lane| own.t[lane]));
            let (y, f0) = (&own.y.as_flattened()[..n], &mut own.f0.as_flattened_mut()[..n]);
            own.system.rhs(t, y, f0, &mut own.work);
        });
    }

    fn refresh_as(&mut self, differentiate: impl FnOnce(&mut Self)) {
        self.system.renew(&mut self.work);
        self.system.renew(&mut self.dual_work);
        let n = self.structure.n;
        let (y, f0) = (&self.y.as_flattened()[..n], self.f0.as_flattened_mut());
        let linear = &mut self.linear;
        linear.is_arrow = self.system.linearise(y, f0, &mut linear.dense);
        linear.is_plain = false;
        if R::GENERAL && (!linear.is_arrow || n > self.structure.n_coupled) {
            differentiate(self);
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
