//! A circuit as a system of equations.

use super::Circuit;
use super::fused::{Linearised, Rates};
use crate::ground::{Net, Own, Place};
use crate::part::gas;
use crate::part::mechanics::cylinder::INNER;
use math::{Lane, Over, Real};
use ode::{Accepted, Dense, Structure, System};
use std::sync::Arc;

impl<P: Lane> Circuit<P> {
    /// This function is rarely needed, and therefore compiled separately from the code of each step.
    #[inline(never)]
    fn fill_reservoirs<S: Over<P>>(&self, net: &mut Net<S>) {
        for (_, reservoir) in &self.parts.reservoirs {
            reservoir.fill(net, &self.common);
        }
        net.filled = self.filled;
    }

    #[inline(always)]
    pub(super) fn evaluate<S: Over<P>>(&self, y: &[S], net: &mut Net<S>) {
        self.parts.place(y, net, &self.common);
        self.parts.shape(net);
        self.parts.potential(y, net, &self.common);
        for &i in &self.open {
            self.parts.restrictions[i].1.pass(net);
        }
        self.parts.exchange(net, &self.common);
    }
}

impl<R: Lane> Circuit<R> {
    /// Returns 1 if the chambers of every cylinder have room and gas at all states within `spread`. See
    /// [`cylinder::Cylinder::holds`].
    #[inline(always)]
    fn cylinders_hold(&self, y: &[R], spread: impl Fn(Place) -> [R::Plain; INNER]) -> R::Plain {
        let mut holds = R::Plain::one();
        macro_rules! ask {
            ($kind:ident) => {
                for (place, cylinder) in &self.parts.$kind {
                    let scale = Own::of(&self.scale, *place);
                    holds = cylinder.holds(Own::of(y, *place), &spread(*place), scale, holds);
                }
            };
        }
        ask!(cylinders);
        ask!(other_cylinders);
        holds
    }

    /// The result if the volumes are valid too.
    #[inline(never)]
    fn volumes_hold(&self, y: &[R], net: &mut Net<R>, so_far: R::Plain) -> R::Plain {
        let mut inside = so_far;
        self.parts.place(y, net, &self.common);
        self.parts.shape(net);
        for (place, volume) in &self.parts.volumes {
            let room = net.gas[volume.node].volume.plain();
            let (states, scales): ([R; 2], _) =
                (Own::of(y, *place).first(), Own::of(&self.scale, *place).first());
            let least = R::Plain::c(gas::volume::LEAST_ROOM);
            inside = volume.holds(room, states.map(|state| state.plain()), scales, least, inside);
        }
        inside
    }
}

impl<R: Lane> System<R> for Circuit<R> {
    type Work<S: Over<R>> = Net<S>;

    fn work<S: Over<R>>(&self) -> Net<S> {
        let mut net = Net::new(self.gas_nodes, self.axis_nodes, self.signals, S::from(self.common.gas.cp));
        if self.common.gas.virial.is_some() {
            net.enthalpy = vec![S::zero(); self.gas_nodes];
        }
        if !self.parts.platforms.is_empty() {
            net.known = vec![Vec::new(); 2 * self.axis_nodes];
        }
        self.renew(&mut net);
        net
    }

    #[inline(always)]
    fn renew<S: Over<R>>(&self, net: &mut Net<S>) {
        if net.filled != self.filled {
            self.fill_reservoirs(net);
        }
        net.known.iter_mut().for_each(Vec::clear);
    }

    #[inline(never)]
    fn rhs<S: Over<R>>(&self, _t: S, y: &[S], dy: &mut [S], net: &mut Net<S>) {
        self.evaluate(y, net);
        self.parts.rate(y, dy, net, &self.common);
        if R::GENERAL && !self.topology.channels.is_empty() {
            let (dy, accounts) = dy.split_at_mut(self.topology.n_states);
            self.parts.account(y, dy, net, &self.common, accounts);
        }
    }

    #[inline(never)]
    fn add_rates(&self, t: R, y: &[R], known: &[R], out: &mut [R], net: &mut Net<R>) {
        match &self.fused {
            Some(fused) if self.topology.channels.is_empty() => {
                R::within(Rates { of: self.whole(fused), y, known, out });
            }
            _ if !R::GENERAL => unreachable!("derivatives by such numbers need a circuit without nodes"),
            _ => {
                self.rhs(t, y, out, net);
                for (out, known) in out.iter_mut().zip(known) {
                    *out += *known;
                }
            }
        }
    }

    #[inline(never)]
    fn linearise(&self, y: &[R], f: &mut [R], jacobian: &mut Dense<R>) -> bool {
        if let Some(fused) = &self.fused {
            R::within(Linearised { of: self.whole(fused), y, f, jacobian });
        }
        self.fused.is_some()
    }

    fn swings(&self) -> Vec<(usize, R)> {
        let usual = self.parts.cylinders.iter().map(|(place, part)| (place, part.swing_speed(&self.common)));
        let others = self.parts.other_cylinders.iter();
        let others = others.map(|(place, part)| (place, part.swing_speed(&self.common)));
        usual.chain(others).map(|(place, speed)| (place.first + 1, speed)).collect()
    }

    fn completes(&self) -> bool {
        let damped = || {
            let legs = || self.parts.platforms.iter().any(|(_, platform)| platform.is_damped());
            self.masses().any(|(.., axis, _)| axis.is_damped()) || legs()
        };
        !self.topology.channels.is_empty() && damped()
    }

    fn complete(&self, step: &mut Accepted<'_, R>, out: &mut [R]) {
        for (.., place, axis, inner) in self.masses() {
            let account = self.topology.n_states + place.first_account;
            axis.damped_in(place.first, inner, step, &self.common, &mut out[account..account + 3]);
        }
        for (place, platform) in &self.parts.platforms {
            let account = self.topology.n_states + place.first_account;
            let own = &mut out[account..account + place.accounts];
            platform.damped_in(place.first, step, &self.common, own);
        }
    }

    fn structure(&self) -> &Arc<Structure> {
        &self.topology.structure
    }

    fn scale(&self) -> &[R] {
        &self.scale
    }

    fn n_events(&self) -> usize {
        self.topology.events.len()
    }

    fn events(&self, _t: R, y: &[R], out: &mut [R], net: &mut Net<R>) {
        self.evaluate(y, net);
        for (out, &id) in out.iter_mut().zip(&self.topology.events) {
            *out = self.parts.event(id, y, net);
        }
    }

    fn event_tolerance(&self, event: usize) -> f64 {
        self.parts.event_tolerance(self.topology.events[event])
    }

    fn n_obstacles(&self) -> usize {
        self.parts.n_obstacles()
    }

    fn obstacles(&self, y: &[R], out: &mut [R], net: &mut Net<R>) {
        self.parts.obstacles(y, net, &self.common, out);
    }

    #[inline(always)]
    fn inside(&self, y: &[R], net: &mut Net<R>) -> R::Plain {
        let mut inside = self.cylinders_hold(y, |_| [R::Plain::zero(); INNER]);
        if R::GENERAL {
            for (place, platform) in &self.parts.platforms {
                inside = inside.min(platform.reaches(&y[place.first..place.first + place.count]));
            }
        }
        if self.parts.volumes.is_empty() { inside } else { self.volumes_hold(y, net, inside) }
    }

    #[inline(always)]
    fn surely_inside(&self, y: &[R], spread: &[R::Plain]) -> R::Plain {
        if !self.parts.volumes.is_empty() || !self.parts.platforms.is_empty() {
            return -R::Plain::one();
        }
        self.cylinders_hold(y, |place| std::array::from_fn(|i| spread[place.first + i]))
    }

    fn meet(&mut self, lane: usize) -> bool {
        let usual = self.parts.cylinders.iter_mut().map(|(_, cylinder)| cylinder.meet(lane));
        let others = self.parts.other_cylinders.iter_mut().map(|(_, cylinder)| cylinder.meet(lane));
        usual.chain(others).fold(false, |met, own| met | own) // each is asked
    }

    fn settle(&self, y: &mut [R]) {
        for &id in &self.topology.events {
            self.parts.settle(id, y);
        }
    }

    fn switch(&mut self, lane: usize, event: usize, y: &mut [R], net: &mut Net<R>) {
        self.evaluate(y, net);
        let id = self.topology.events[event];
        let (common, n_states) = (self.common, self.n_states());
        let before: Vec<f64> = y[..n_states].iter().map(|state| state.get(lane)).collect();
        self.parts.switch(id, lane, y, net, (&common, n_states));
        // A mass that is brought to rest loses the forces that depend on its velocity, such as the damping of an end
        // stop. It stays at rest only if the remaining forces allow it.
        if y[..n_states].iter().zip(&before).any(|(state, before)| state.get(lane) != *before) {
            self.evaluate(y, net);
            if self.parts.event(id, y, net).get(lane) < -self.parts.event_tolerance(id) {
                self.parts.switch(id, lane, y, net, (&common, n_states));
            }
        }
    }
}
