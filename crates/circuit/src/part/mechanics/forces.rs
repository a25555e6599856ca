//! Forces on one axis.

use crate::ground::{Common, Kind, Net, Own, OwnMut, Part, State, Switching, force_on, gathered, inputs};
use math::{Lane, Over};
use physics::curve::Curve;
use physics::written::Formula;

gathered! {
    /// A spring between an axis and the ground: F = -k (x - x_rest).
    pub struct Spring {
        numbers { stiffness, rest_position }
        same { axis: usize }
    }
}

impl<P: Lane> Part<P> for Spring<P> {
    #[inline(always)]
    fn exchange<S: Over<P>>(&self, net: &mut Net<S>, _common: &Common<P>) {
        let node = &mut net.axis[self.axis];
        node.force -= S::from(self.stiffness) * (node.x - S::from(self.rest_position));
    }

    fn stored<S: Over<P>>(&self, _y: Own<S>, net: &Net<S>, _common: &Common<P>) -> [S; 3] {
        let stretch = net.axis[self.axis].x - S::from(self.rest_position);
        [S::zero(), S::c(0.5) * S::from(self.stiffness) * stretch * stretch, S::zero()]
    }
}

gathered! {
    /// A force on an axis, given by a user's formula. See [`physics::mechanics::FORCE`]. It may store energy or not. All
    /// of its work is therefore in a balance.
    pub struct FormulaForce {
        numbers { command }
        laws { law: Formula }
        same { axis: usize }
    }
}

impl<P: Lane> Part<P> for FormulaForce<P> {
    inputs! { command: "command", "1", physics::within(-1.0, 1.0) }

    fn force<S: Over<P>>(&self, net: &Net<S>) -> S {
        let axis = &net.axis[self.axis];
        let given = [axis.x, axis.v, S::from(self.command)];
        self.law.value(|k| given[k])
    }

    force_on!(axis);

    fn channels(&self) -> Vec<(&'static str, Kind)> {
        vec![("work", Kind::Energy)]
    }

    fn account<S: Over<P>>(&self, _y: Own<S>, _dy: Own<S>, net: &Net<S>, _common: &Common<P>, out: &mut [S]) {
        out[0] = self.force(net) * net.axis[self.axis].v;
    }
}

/// Depth of the event, s: much less than any step resolves.
const TOLERANCE: f64 = 1e-9;

/// The variable that a force depends on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Along {
    Position,
    Velocity,
    Time,
}

gathered! {
    /// A force in +x on an axis, given by a curve. Over the position it stores the energy -int F dx. Over velocity or
    /// time, its work comes from outside. Time is a state, because the equations do not contain time. Each point of the
    /// curve is an event, so that no step misses one.
    pub struct TableForce {
        numbers {
            /// Number of points passed.
            mode,
        }
        laws { curve: Curve }
        same {
            along: Along,
            axis: usize,
            /// Index of the time since the start among the signals.
            time: usize,
        }
    }
}

impl<P: Lane> TableForce<P> {
    fn is_timed(&self) -> bool {
        self.along == Along::Time
    }
}

impl<P: Lane> Part<P> for TableForce<P> {
    fn states(&self) -> Vec<State> {
        let time = State::own("time_s", "s", 1.0);
        if self.is_timed() { vec![time] } else { Vec::new() }
    }

    #[inline(always)]
    fn place<S: Over<P>>(&self, y: Own<S>, net: &mut Net<S>, _common: &Common<P>) {
        if self.is_timed() {
            [net.signal[self.time]] = y.first();
        }
    }

    fn force<S: Over<P>>(&self, net: &Net<S>) -> S {
        let axis = &net.axis[self.axis];
        self.curve.value(match self.along {
            Along::Position => axis.x,
            Along::Velocity => axis.v,
            Along::Time => net.signal[self.time],
        })
    }

    force_on!(axis);

    #[inline(always)]
    fn rate<S: Over<P>>(&self, _y: Own<S>, mut dy: OwnMut<S>, _net: &mut Net<S>, _common: &Common<P>) {
        if self.is_timed() {
            dy.set([S::one()]);
        }
    }

    fn stored<S: Over<P>>(&self, _y: Own<S>, net: &Net<S>, _common: &Common<P>) -> [S; 3] {
        let is_stored = self.along == Along::Position;
        let energy = if is_stored { -self.curve.integral(net.axis[self.axis].x) } else { S::zero() };
        [S::zero(), energy, S::zero()]
    }

    fn channels(&self) -> Vec<(&'static str, Kind)> {
        if self.along == Along::Position { Vec::new() } else { vec![("external work", Kind::Energy)] }
    }

    fn account<S: Over<P>>(&self, _y: Own<S>, _dy: Own<S>, net: &Net<S>, _common: &Common<P>, out: &mut [S]) {
        if let [work] = out {
            *work = self.force(net) * net.axis[self.axis].v;
        }
    }

    fn events(&self) -> &'static [f64] {
        if self.is_timed() { &[TOLERANCE] } else { &[] }
    }

    /// Returns the time to the next point.
    fn event(&self, _event: usize, _y: Own<P>, net: &Net<P>) -> P {
        let each = (0..self.curve.places().count()).rev().zip(self.curve.places().rev());
        each.fold(P::one(), |next, (k, place)| {
            P::select(self.mode.lt(P::c(k as f64 + 0.5)), place - net.signal[self.time], next)
        })
    }

    fn switch(&mut self, Switching { lane, .. }: Switching<P>) {
        self.mode.put(lane, self.mode.get(lane) + 1.0);
    }

    fn mode_mut(&mut self, _event: usize) -> &mut P {
        &mut self.mode
    }

    fn find_mode(&mut self, _event: usize, _y: OwnMut<P>, net: &Net<P>) {
        let (places, now) = (self.curve.places().collect::<Vec<_>>(), net.signal[self.time]);
        for lane in 0..P::L {
            let passed = places.iter().filter(|place| place.get(lane) <= now.get(lane)).count();
            self.mode.put(lane, passed as f64);
        }
    }
}
