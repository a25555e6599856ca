//! Estimates of unmeasured quantities: velocity, disturbance, friction, gas temperatures, spool.

#![allow(clippy::needless_range_loop)] // rows and columns of matrices, and sides of the piston

use crate::model::Model;
use crate::number::{Memory, Number, StateOf};
use crate::spool::Spool;
use crate::thresholds::{FOLLOWED, GAS_TEMPERATURES, LEAST_PRESSURE, LONGEST_PIECE, OBSERVER_REST};
use crate::types::{Edges, Sample, State, gas_at};
use math::Over;

impl<P: Over<f64>> Model<P> {
    /// Advances a state by `h` s with edges open by `openings`. If pressures are `measured`, the gas follows them.
    /// Returns the initial acceleration, m/s2.
    pub fn advance<S: StateOf<P>>(
        &self,
        own: &mut State<S>,
        openings: Edges<S>,
        h: f64,
        measured: Option<[S; 2]>,
    ) -> S {
        let pieces = (h / LONGEST_PIECE - 1e-6).ceil().max(1.0);
        self.advance_in(pieces as u32, own, openings, h, measured)
    }

    /// Does the same with the motion in several pieces, by the classical fourth-order Runge-Kutta method.
    pub(crate) fn advance_in<S: StateOf<P>>(
        &self,
        pieces: u32,
        own: &mut State<S>,
        openings: Edges<S>,
        h: f64,
        measured: Option<[S; 2]>,
    ) -> S {
        let (piece, old) = (h / f64::from(pieces), self.gas_force(own.pressures));
        let followed = FOLLOWED * piece;
        let begin = self.pushed(own, old, followed, [own.velocity, own.friction]);
        let speed = own.velocity + begin[1].times(0.5 * h);
        let [pressures, temperatures] = self.flow(own, openings, h, speed);
        (own.pressures, own.temperatures) = (measured.unwrap_or(pressures), temperatures);
        let grown = (self.gas_force(own.pressures) - old).times(1.0 / f64::from(pieces));
        for k in 0..pieces {
            let [v, f] = [own.velocity, own.friction];
            // The force of the gas changes from the old value to the new one.
            let rates = |own: &State<S>, at: f64, motion: [S; 2]| {
                self.pushed(own, old + grown.times(f64::from(k) + at), followed, motion)
            };
            let after = |[f_dot, a]: [S; 2], t: f64| [v + a.times(t), f + f_dot.times(t)];
            let first = if k == 0 { begin } else { rates(own, 0.0, [v, f]) };
            let one = after(first, 0.5 * piece);
            let second = rates(own, 0.5, one);
            let two = after(second, 0.5 * piece);
            let third = rates(own, 0.5, two);
            let three = after(third, piece);
            let last = rates(own, 1.0, three);
            let gone = |[a, b, c, d]: [S; 4]| (a + (b + c).times(2.0) + d).times(piece / 6.0);
            own.friction += gone([first[0], second[0], third[0], last[0]]);
            own.velocity += gone([first[1], second[1], third[1], last[1]]);
            own.position += gone([v, one[0], two[0], three[0]]);
        }
        begin[1]
    }

    /// Returns pressures, Pa, and temperatures, K, of a state after `h` s, by the midpoint method. The gas is simulated
    /// with a separate `speed` of the piston, m/s.
    pub(crate) fn flow<S: StateOf<P>>(
        &self,
        own: &State<S>,
        openings: Edges<S>,
        h: f64,
        speed: S,
    ) -> [[S; 2]; 2] {
        let mut gas = [own.pressures, own.temperatures];
        for (from, to) in [(0.0, 0.5 * h), (0.5 * h, h)] {
            let place = [own.position + own.velocity.times(from), speed];
            let chambers = self.chambers(place, gas_at(&gas), openings);
            for side in 0..2 {
                let p = own.pressures[side] + chambers.pressure_rates[side].times(to);
                let t = own.temperatures[side] + chambers.temperature_rates[side].times(to);
                gas[0][side] = p.max(S::c(LEAST_PRESSURE));
                gas[1][side] = t.max(S::c(GAS_TEMPERATURES[0])).min(S::c(GAS_TEMPERATURES[1]));
            }
        }
        gas
    }

    /// Returns the rate of the friction, N/s, and the acceleration, m/s2, under a force of the gas. The rate is one
    /// that a step of `h` s can follow. Velocity and friction are separate arguments.
    fn pushed<S: StateOf<P>>(
        &self,
        own: &State<S>,
        force: S,
        h: f64,
        [velocity, friction]: [S; 2],
    ) -> [S; 2] {
        let [level, viscous] = self.friction_levels([own.position, velocity], own.pressures);
        let rate = self.stick_rate(velocity, friction, level, h);
        let friction = friction + rate.times(self.damping_time(h));
        let force = force + S::c(self.load) - friction - viscous * velocity + own.disturbance;
        [rate, force.times(P::one() / self.mass)]
    }

    /// Returns the acceleration of a state, m/s2.
    pub fn acceleration<S: StateOf<P>>(&self, own: &State<S>) -> S {
        let (force, step) = (self.gas_force(own.pressures), FOLLOWED * LONGEST_PIECE);
        self.pushed(own, force, step, [own.velocity, own.friction])[1]
    }
}

/// Estimates position, velocity and disturbance by a steady Kalman filter over the model's motion. Gas, friction and
/// spool are simulated in parallel.
#[derive(Clone, Debug)]
pub struct Observer<S = f64> {
    /// The state at the last sample.
    pub state: State<S>,
    /// The spool.
    pub spool: Spool<S>,
    /// Gains of position, 1, velocity, 1/s, and of the disturbance over the mass, 1/s2. The poles stay the same if the
    /// mass is learned.
    gain: [f64; 3],
    /// Time of the last sample, s.
    pub time: f64,
}

/// Noise of the position sensor, and expected wander of the disturbance.
#[derive(Clone, Copy, Debug)]
pub struct Noise {
    /// Wander of the disturbance, N/s^0.5.
    pub disturbance: f64,
    /// Standard deviation of the position, m.
    pub position: f64,
}

/// Gain of a steady Kalman filter of (x, v, d) with x' = v, v' = d/M, d' = noise, where x is sampled with a period.
///
/// Source: [anderson1979].
fn steady_gain(mass: f64, period: f64, noise: Noise) -> [f64; 3] {
    type Matrix = [[f64; 3]; 3];
    let matrix = |entry: &dyn Fn(usize, usize) -> f64| -> Matrix {
        std::array::from_fn(|i| std::array::from_fn(|j| entry(i, j)))
    };
    let t = period;
    let f = [[1.0, t, 0.5 * t * t / mass], [0.0, 1.0, t / mass], [0.0, 0.0, 1.0]];
    let q = noise.disturbance * noise.disturbance;
    // Covariance of a disturbance that wanders evenly within a period: the integral of F(s) e3 e3' F(s)'.
    let way = |s: f64| [0.5 * s * s / mass, s / mass, 1.0];
    let nodes = [(0.5 - 0.15_f64.sqrt(), 5.0 / 18.0), (0.5, 8.0 / 18.0), (0.5 + 0.15_f64.sqrt(), 5.0 / 18.0)];
    let nodes = nodes.map(|(node, weight)| (way(node * t), weight));
    let wander = matrix(&|i, j| nodes.iter().map(|(own, weight)| q * t * weight * own[i] * own[j]).sum());
    let r = noise.position * noise.position;
    let mut p = [[1e-6, 0.0, 0.0], [0.0, 1e-2, 0.0], [0.0, 0.0, 1e4]];
    let mut gain = [0.0; 3];
    for _ in 0..20_000 {
        let fp = matrix(&|i, j| (0..3).map(|k| f[i][k] * p[k][j]).sum());
        let next = matrix(&|i, j| wander[i][j] + (0..3).map(|k| fp[i][k] * f[j][k]).sum::<f64>());
        let before = gain;
        gain = [0, 1, 2].map(|i| next[i][0] / (next[0][0] + r));
        p = matrix(&|i, j| next[i][j] - gain[i] * next[0][j]);
        if (0..3).all(|i| (gain[i] - before[i]).abs() <= 1e-12 * gain[i].abs()) {
            break;
        }
    }
    gain
}

impl<S: Number> State<S> {
    /// Returns the state of a drive at rest at a first sample.
    pub(crate) fn at_rest(model: &Model<S>, sample: &Sample<S>) -> Self {
        // The pressures are not measured: the usual start is the mean of supply and ambient.
        let mean = 0.5 * (model.supply.pressure + model.ambient.pressure);
        let pressures = sample.pressures.unwrap_or([S::c(mean); 2]);
        State {
            position: sample.position,
            velocity: S::zero(),
            disturbance: S::zero(),
            friction: model.gas_force(pressures) + S::c(model.load),
            pressures,
            temperatures: [S::c(model.wall_temperature); 2],
        }
    }
}

impl Observer {
    /// Returns the observer of a drive at rest at a first sample, sampled with a period, s.
    pub fn new(model: &Model, sample: &Sample, period: f64, noise: Noise) -> Self {
        let [of_position, of_velocity, of_force] = steady_gain(model.mass, period, noise);
        Observer {
            state: State::at_rest(model, sample),
            spool: Spool::new(&model.valve),
            gain: [of_position, of_velocity, of_force / model.mass],
            time: sample.time,
        }
    }

    /// Returns the observer in other numbers, at the same time and without any past samples.
    pub(crate) fn at_rest<S: Number>(&self) -> Observer<S> {
        Observer { state: State::default(), spool: self.spool.at_rest(), gain: self.gain, time: self.time }
    }
}

impl<S: Number> Observer<S> {
    /// Uses a sample to correct the estimates.
    pub fn update(&mut self, model: &Model<S>, sample: &Sample<S>) {
        let (from, to) = (self.time, sample.time);
        if to > from {
            let edges = self.spool.edges(model, from, to);
            model.advance(&mut self.state, edges, to - from, sample.pressures);
        }
        self.time = to;
        correct(model, &mut self.state, sample.position, self.gain);
    }

    /// Predicts state and spool at a later time, s, under the commands given so far and a further load, N.
    pub fn predict(&self, model: &Model<S>, to: f64, step: f64, load: f64) -> (State<S>, Spool<S>) {
        // Rounding of times must not change the number of steps.
        let n = ((to - self.time) / step - 1e-6).ceil().max(1.0);
        let h = (to - self.time) / n;
        let (mut state, mut spool) = (self.state, self.spool.clone());
        state.disturbance += S::c(load);
        for k in 0..n as usize {
            let begin = self.time + h * k as f64;
            let edges = spool.edges(model, begin, begin + h);
            model.advance(&mut state, edges, h, None);
        }
        state.disturbance -= S::c(load);
        (state, spool)
    }
}

impl<S: Number> Memory<S> for Observer<S> {
    fn each(&mut self, see: &mut dyn FnMut(&mut S)) {
        self.state.each(see);
        self.spool.numbers(see);
    }
}

/// Corrects a state by a measured position with the gain of a filter, and with the innovation e = x - x_model:
///
///   x += K_x e,   v += K_v e,   F_fr -= s K_a M e within +-g,   d += K_a M e + (change of F_fr)
///
/// s = 1/(1 + (v/[`OBSERVER_REST`])^2): at rest, an unexplained force is assigned to friction up to the friction level.
/// No sensor could distinguish the two.
fn correct<S: Number>(model: &Model<S>, state: &mut State<S>, measured: S, gain: [f64; 3]) {
    let miss = measured - state.position;
    state.position += miss.times(gain[0]);
    state.velocity += miss.times(gain[1]);
    let force = miss * (S::c(gain[2]) * model.mass);
    let [level, _] = model.friction_levels([state.position, S::zero()], state.pressures);
    let slides = state.velocity / S::c(OBSERVER_REST);
    let rests = S::one() / (S::one() + slides * slides);
    let before = state.friction;
    state.friction = (before - rests * force).max(-level).min(level);
    state.disturbance += force + (state.friction - before);
}
