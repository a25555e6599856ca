//! Whether a drive can follow a reference: the inverse of its model, run along the reference.

use crate::model::Model;
use crate::reference::{Reference, Wanted};
use crate::thresholds::*;
use crate::types::State;

/// Largest demands of a reference on a drive.
#[derive(Clone, Copy, Debug, Default)]
pub struct Demand {
    /// Fraction of the valve's opening; infinite if no opening suffices.
    pub opening: f64,
    /// Time of this demand, s.
    pub opening_time: f64,
    /// Time for which the demand exceeds the full opening, s.
    pub exceeded: f64,
    /// Fraction of the force that the supply can produce in this direction.
    pub force: f64,
    /// Least and largest pressure in the chambers, Pa absolute.
    pub pressures: [f64; 2],
}

impl Demand {
    /// Returns the larger of the fractions that have a limit.
    pub fn most(&self) -> f64 {
        self.opening.max(self.force)
    }
}

/// Number of steps after which the caller is asked whether to stop.
const LOOKS: u64 = 4096;
/// Number of times at which the direction of a reference is sampled.
const MOMENTS: u32 = 2000;

/// Returns a force, N, as a fraction of the force that the supply can produce in its direction.
fn force_share(model: &Model, force: f64) -> f64 {
    let side = if force > 0.0 { &model.sides[0] } else { &model.sides[1] };
    force.abs() / (side.area * (model.supply.pressure - model.ambient.pressure))
}

/// Returns the fractions of the supply's force that weight and friction at rest need in +x and in -x, at a position, m.
pub fn least_forces(model: &Model, x: f64) -> [f64; 2] {
    let [level, _] = model.friction_levels([x, 0.0], model.rest_pressures());
    [level, -level].map(|friction| force_share(model, friction - model.load))
}

/// Fraction of the force that friction and weight need at any speed of the reference.
fn least_force(model: &Model, reference: &Reference, duration: f64) -> f64 {
    let moments = (0..=MOMENTS).map(|i| reference.at(duration * f64::from(i) / f64::from(MOMENTS)));
    let moving = moments.filter(|wanted| wanted.velocity != 0.0);
    let shares =
        moving.map(|wanted| least_forces(model, wanted.position)[usize::from(wanted.velocity < 0.0)]);
    shares.fold(0.0, f64::max)
}

/// Moves a piston to a wanted state, with friction after a step, s. Returns the force of the gas that this needs, N:
///
///   F = M a_d + F_fr + F_v v_d - F_load
///
/// Friction follows the direction of motion, however slow the motion is.
fn followed(model: &Model, state: &mut State, wanted: &Wanted, step: f64) -> f64 {
    (state.position, state.velocity) = (wanted.position, wanted.velocity);
    let [level, viscous] = model.friction_levels([wanted.position, wanted.velocity], state.pressures);
    let speed = wanted.velocity.abs();
    let share = (speed / FEASIBLE_SLOW).min(1.0);
    let slides = wanted.velocity.signum() * speed.max(FEASIBLE_SLOW);
    let rate = share * model.stick_rate(slides, state.friction, level, step);
    state.friction += step * rate;
    let friction = state.friction + model.stick_damping_time * rate + viscous * wanted.velocity;
    model.mass * wanted.acceleration + friction - model.load
}

/// Returns the demands of a reference that is slowed by a factor in time, over `duration` s of the unslowed
/// reference. The piston follows the reference exactly. The model simulates the gas under the opening that produces the
/// required force. If `stop` returns true, the demands up to then are returned.
pub fn demand(
    model: &Model,
    reference: &Reference,
    duration: f64,
    factor: f64,
    stop: &mut dyn FnMut(f64) -> bool,
) -> Demand {
    let step = (factor * reference.shortest() / FEASIBLE_PIECES).clamp(FEASIBLE_LEAST_STEP, FEASIBLE_STEP);
    let first = reference.slowed(0.0, factor);
    let mut state = State {
        position: first.position,
        velocity: first.velocity,
        pressures: model.rest_pressures(),
        temperatures: [model.wall_temperature; 2],
        ..State::default()
    };
    let mut found = Demand { pressures: [f64::INFINITY, f64::NEG_INFINITY], ..Demand::default() };
    let mut force = followed(model, &mut state, &first, step);
    for k in 0..(factor * duration / step).ceil() as u64 {
        let t = step * k as f64;
        if k % LOOKS == 0 && stop(t) {
            break;
        }
        let now = state;
        let next = followed(model, &mut state, &reference.slowed(t + step, factor), step);
        let rate = (next - force) / step + FEASIBLE_FOLLOWS * (force - model.gas_force(now.pressures));
        let (way, share) = model.opening_for(&now, rate);
        let share = if share >= 0.0 { share } else { f64::INFINITY };
        if share > found.opening {
            (found.opening, found.opening_time) = (share, t);
        }
        found.exceeded += if share > 1.0 { step } else { 0.0 };
        found.force = found.force.max(force_share(model, force));
        let [a, b] = now.pressures;
        found.pressures = [found.pressures[0].min(a).min(b), found.pressures[1].max(a).max(b)];
        let open = model.opened_by(way * share.min(1.0));
        [state.pressures, state.temperatures] = model.flow(&now, open, step, now.velocity);
        force = next;
    }
    found
}

/// Returns the least factor in time, at least 1, by which a reference must be slowed to use at most a fraction of
/// each limit. A bisection determines it. `None` if slowing does not help. After `stop` has returned true, it must
/// continue to do so.
pub fn least_factor(
    model: &Model,
    reference: &Reference,
    duration: f64,
    share: f64,
    stop: &mut dyn FnMut(f64) -> bool,
) -> Option<f64> {
    let mut fits = |factor| demand(model, reference, duration, factor, stop).most() <= share;
    let (mut low, mut high) = (1.0, 1.0);
    while !fits(high) {
        let is_in_vain = high == 2.0 && least_force(model, reference, duration) > share;
        (low, high) = (high, 2.0 * high);
        if is_in_vain || high > FEASIBLE_SLOWEST {
            return None;
        }
    }
    while high / low > 1.0 + FEASIBLE_FOUND {
        let middle = (low * high).sqrt();
        if fits(middle) {
            high = middle;
        } else {
            low = middle;
        }
    }
    Some(high)
}
