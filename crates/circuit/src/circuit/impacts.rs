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
    /// A mass, and the masses that couplings move with it. Index of the state x of each; the next state is v.
    Masses(Vec<(Axis<f64>, usize)>),
    /// A leg of a platform whose first state is this one.
    Leg(Box<Platform<f64>>, usize, usize),
}

impl Mover {
    /// Returns position and velocity from the states.
    #[inline(always)]
    fn motion(&self, mut state: impl FnMut(usize) -> f64) -> [f64; 2] {
        match self {
            Mover::Masses(each) => [state(each[0].1), state(each[0].1 + 1)],
            Mover::Leg(platform, first, leg) => platform.leg_in((*first, *leg), &mut state),
        }
    }

    /// Returns the kinetic energy of all that moves in a direction, J.
    fn energy(&self, way: f64, mut state: impl FnMut(usize) -> f64) -> f64 {
        let of = |mass: f64, v: f64| 0.5 * mass * (way * v).max(0.0) * (way * v).max(0.0);
        match self {
            Mover::Masses(each) => {
                each.iter().map(|(axis, first)| of(axis.mass_at(state(*first)), state(first + 1))).sum()
            }
            Mover::Leg(platform, first, leg) => {
                of(platform.mass_on((*first, *leg), &mut state), self.motion(&mut state)[1])
            }
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
                (low, high) = if self.touches(at(middle)[0]) { (low, middle) } else { (middle, high) };
            }
            from = low;
            let touch = if low == 0.0 { 0.0 } else { high };
            let [x, v] = at(touch);
            let at_b = x > 0.5 * self.stops.stroke;
            let way = if at_b { 1.0 } else { -1.0 };
            self.open = Some(Impact {
                axis: AxisId(self.stops.axis),
                time: t + low * h,
                at_b,
                speed: way * v,
                energy: self.mover.energy(way, |i| states.course(i).value(touch)),
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
        let each = self.stops().cloned().filter_map(|mut stops| {
            let mover = if let Some((_, leg, first, platform)) = self.leg(AxisId(stops.axis)) {
                Mover::Leg(Box::new(platform.clone()), first, leg)
            } else {
                stops.meet(0);
                let mut moved = Vec::new();
                self.move_along(stops.axis, &mut moved);
                moved.first()?;
                Mover::Masses(moved)
            };
            Some(Impacts { stops, mover, open: None, done: Vec::new() })
        });
        each.collect()
    }

    /// Adds a mass, and the masses that couplings move with it.
    fn move_along(&self, node: usize, moved: &mut Vec<(Axis<f64>, usize)>) {
        let Some((_, place, axis, _)) = self.masses().find(|(.., axis, _)| axis.node == node) else { return };
        if moved.iter().any(|(own, _)| own.node == node) {
            return;
        }
        moved.push((axis.clone(), place.first));
        let links = self.parts.links.iter().map(|(_, own)| [own.from, own.to]);
        let plays = self.parts.couplings.iter().map(|(_, own)| [own.from, own.to]);
        let magnets = self.parts.magnets.iter().map(|(_, own)| [own.from, own.to]);
        for ends in links.chain(plays).chain(magnets).filter(|ends| ends.contains(&node)) {
            ends.iter().for_each(|end| self.move_along(*end, moved));
        }
    }
}
