//! Impacts on the end stops, computed from the accepted steps.

use super::Circuit;
use crate::ground::AxisId;
use crate::part::{Axis, EndStops, Platform};
use ode::Accepted;

/// A contact with an end stop.
#[derive(Clone, Copy, Debug)]
pub struct Impact {
    /// Axis that hits the stop.
    pub axis: AxisId,
    /// Start time, s.
    pub time: f64,
    /// Whether it is at the end of chamber b. Otherwise it is at the end of chamber a.
    pub at_b: bool,
    /// Closing speed at the first touch, m/s.
    pub speed: f64,
    /// Kinetic energy at the first touch, J.
    pub energy: f64,
    /// Largest depth, m.
    pub depth: f64,
    /// Largest force of the stop and the cover behind it, N.
    pub force: f64,
    /// Whether the stop was fully compressed, so that the piston hit the cover.
    pub through: bool,
}

/// Least speed of a contact, m/s. Slower contacts are ignored, because a piston that is pressed against a stop vibrates
/// slightly (assumed).
const LEAST_SPEED: f64 = 1e-3;
/// Points of a step in contact at which depth and force are evaluated.
const POINTS: u32 = 8;
/// Halvings for the first touch within a step: a resolution of one millionth of the step.
const HALVINGS: u32 = 20;

/// The moving body.
pub(crate) enum Mover {
    /// A mass. Index of the state x; the next state is v.
    Mass(Box<Axis<f64>>, usize),
    /// A leg of a platform whose first state is this one.
    Leg(Box<Platform<f64>>, usize, usize),
}

impl Mover {
    /// Returns position and velocity from the states.
    #[inline(always)]
    fn motion(&self, mut state: impl FnMut(usize) -> f64) -> [f64; 2] {
        match self {
            Mover::Mass(_, first) => [state(*first), state(first + 1)],
            Mover::Leg(platform, first, leg) => platform.leg_in((*first, *leg), &mut state),
        }
    }

    /// Returns the mass that moves with it, kg.
    fn mass(&self, x: f64, mut state: impl FnMut(usize) -> f64) -> f64 {
        match self {
            Mover::Mass(axis, _) => axis.mass_at(x),
            Mover::Leg(platform, first, leg) => platform.mass_on((*first, *leg), &mut state),
        }
    }
}

/// Records the impacts of one moving body.
pub(crate) struct Impacts {
    stops: EndStops<f64>,
    mover: Mover,
    open: Option<Impact>,
    done: Vec<Impact>,
}

impl Impacts {
    pub fn new(stops: EndStops<f64>, mover: Mover) -> Self {
        Impacts { stops, mover, open: None, done: Vec::new() }
    }

    fn touches(&self, x: f64) -> bool {
        x < 0.0 || x > self.stops.stroke
    }

    /// Evaluates an accepted step.
    #[inline(always)]
    pub fn step(&mut self, t: f64, h: f64, states: &mut Accepted<'_, f64>) {
        let before = self.mover.motion(|i| states.before()[i])[0];
        let after = self.mover.motion(|i| states.after()[i])[0];
        if self.touches(before) || self.touches(after) {
            self.follow(t, h, states);
        }
    }

    #[inline(never)]
    fn follow(&mut self, t: f64, h: f64, states: &mut Accepted<'_, f64>) {
        let at = |theta: f64| self.mover.motion(|i| states.course(i).value(theta));
        let mut from = 0.0;
        if self.open.is_none() {
            let (mut low, mut high) = (0.0, 1.0);
            for _ in 0..if self.touches(at(0.0)[0]) { 0 } else { HALVINGS } {
                let middle = 0.5 * (low + high);
                if self.touches(at(middle)[0]) {
                    high = middle;
                } else {
                    low = middle;
                }
            }
            from = low;
            let [x, v] = at(if low == 0.0 { 0.0 } else { high });
            let at_b = x > 0.5 * self.stops.stroke;
            let speed = if at_b { v } else { -v };
            let mass = self.mover.mass(x, |i| states.course(i).value(high));
            let energy = 0.5 * mass * v * v;
            self.open = Some(Impact {
                axis: AxisId(self.stops.axis),
                time: t + low * h,
                at_b,
                speed,
                energy,
                depth: 0.0,
                force: 0.0,
                through: false,
            });
        }
        for k in 1..=POINTS {
            let [x, v] = at(from + (1.0 - from) * f64::from(k) / f64::from(POINTS));
            let (depth, force) = self.stops.pressed(x, v);
            let open = self.open.as_mut().expect("a contact");
            open.depth = open.depth.max(depth);
            open.force = open.force.max(force);
            open.through |= self.stops.in_cover(depth, open.at_b);
        }
        if !self.touches(at(1.0)[0]) {
            self.close();
        }
    }

    fn close(&mut self) {
        self.done.extend(self.open.take().filter(|impact| impact.speed >= LEAST_SPEED || impact.through));
    }

    /// Returns all impacts of the run, including one that has not ended.
    pub fn finish(mut self) -> Vec<Impact> {
        self.close();
        self.done
    }
}

impl Circuit<f64> {
    /// Trackers of the impacts of each cylinder.
    pub(crate) fn impacts(&self) -> Vec<Impacts> {
        let usual = self.parts.cylinders.iter().map(|(place, part)| (place, &part.stops, &part.axis));
        let others = self.parts.other_cylinders.iter().map(|(place, part)| (place, &part.stops, &part.axis));
        let alone = self.parts.end_stops.iter().filter_map(|(_, stops)| {
            let (place, axis) = self.parts.axes.iter().find(|(_, axis)| axis.node == stops.axis)?;
            Some((place, stops, axis))
        });
        let each = usual.chain(others).chain(alone).map(|(place, stops, axis)| {
            let mut stops = stops.clone();
            stops.meet(0);
            Impacts::new(stops, Mover::Mass(Box::new(axis.clone()), place.first))
        });
        let legs = self.parts.end_stops.iter().filter_map(|(_, stops)| {
            let (_, leg, first, platform) = self.leg(AxisId(stops.axis))?;
            Some(Impacts::new(stops.clone(), Mover::Leg(Box::new(platform.clone()), first, leg)))
        });
        each.chain(legs).collect()
    }
}
