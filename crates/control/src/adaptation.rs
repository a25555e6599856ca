//! Adaptation of the controller's model to the drive. Recursive least squares estimate friction, mass and valve while
//! the drive moves. Nothing branches on a number other than by a choice, so that the adaptation can be exported.

use crate::model::Model;
use crate::number::{Memory, Number, change, flag, memory};
use crate::thresholds::*;
use crate::types::State;

/// Recursive least squares with forgetting, of `y = phi' theta`.
#[derive(Clone, Copy, Debug)]
struct Fit<S, const N: usize> {
    theta: [S; N],
    covariance: [[S; N]; N],
}

impl<S: Number, const N: usize> Memory<S> for Fit<S, N> {
    fn each(&mut self, see: &mut dyn FnMut(&mut S)) {
        self.theta.each(see);
        self.covariance.each(see);
    }
}

fn sum<S: Number>(terms: impl Iterator<Item = S>) -> S {
    terms.fold(S::zero(), |sum, own| sum + own)
}

impl<S: Number, const N: usize> Fit<S, N> {
    fn new(theta: [f64; N]) -> Self {
        let mut covariance = [[S::zero(); N]; N];
        (0..N).for_each(|i| covariance[i][i] = S::c(LEARN_VARIANCE));
        Fit { theta: theta.map(S::c), covariance }
    }

    /// Updates the estimates with an observation of unit variance.
    fn observe(&mut self, phi: [S; N], y: S) {
        let p = &mut self.covariance;
        let p_phi: [S; N] = std::array::from_fn(|i| sum((0..N).map(|j| p[i][j] * phi[j])));
        let spread = S::one() + sum((0..N).map(|i| phi[i] * p_phi[i]));
        let miss = y - sum((0..N).map(|i| phi[i] * self.theta[i]));
        for i in 0..N {
            self.theta[i] += p_phi[i] / spread * miss;
            for j in 0..N {
                p[i][j] -= p_phi[i] * p_phi[j] / spread;
            }
        }
        // Without excitation, the variance grows at most to its initial value.
        let most = (0..N).fold(S::zero(), |most, i| most.max(p[i][i]));
        let grows = (most / S::c(LEARN_KEPT)).lt(S::c(LEARN_VARIANCE));
        let kept = S::select(grows, S::c(LEARN_KEPT), S::one());
        p.iter_mut().flatten().for_each(|own| *own = *own / kept);
    }

    /// Clips estimates to their bounds.
    fn cut(&mut self, within: [[f64; 2]; N]) {
        (0..N).for_each(|i| self.theta[i] = self.theta[i].within(within[i][0], within[i][1]));
    }

    /// Clips estimates to their bounds and assigns the remaining error to the other estimates, by their covariance.
    /// If one estimate alone were clipped, the others would no longer fit past observations.
    fn project(&mut self, within: [[S; 2]; N]) {
        let clipped = |own: S, [low, high]: [S; 2]| own.max(low).min(high);
        for (i, bounds) in within.into_iter().enumerate() {
            let beyond = self.theta[i] - clipped(self.theta[i], bounds);
            let share = beyond / self.covariance[i][i];
            (0..N).for_each(|j| self.theta[j] -= self.covariance[j][i] * share);
        }
        (0..N).for_each(|i| self.theta[i] = clipped(self.theta[i], within[i]));
    }
}

/// A signal after a first-order lag, and 1 as soon as it has begun.
#[derive(Clone, Copy, Debug)]
struct Lagged<S, const N: usize>([S; N], S);

impl<S: Number, const N: usize> Lagged<S, N> {
    fn follow(&mut self, signal: [S; N], share: f64) -> [S; N] {
        let Lagged(value, begun) = self;
        let has_begun = S::zero().lt(*begun);
        for (own, signal) in value.iter_mut().zip(signal) {
            let before = S::select(has_begun, *own, signal);
            *own = before + (signal - before).times(share);
        }
        *begun = S::one();
        *value
    }
}

impl<S: Number, const N: usize> Memory<S> for Lagged<S, N> {
    fn each(&mut self, see: &mut dyn FnMut(&mut S)) {
        self.0.each(see);
        self.1.each(see);
    }
}

impl<S: Default, const N: usize> Default for Lagged<S, N> {
    fn default() -> Self {
        Lagged(std::array::from_fn(|_| S::default()), S::default())
    }
}

memory! {
    /// Filtered signals, and times on which it depends what may be learned.
    struct Signals<S> {
        motion: Lagged<S, 4>,
        gas: [Lagged<S, 4>; 2],
        /// Residual of the force balance, in each direction.
        disturbance: [Lagged<S, 1>; 2],
        /// Force and acceleration after two lags, their slow part, and the mean square of the inertial force, N2.
        band: [Lagged<S, 2>; 3],
        power: S,
        /// Direction of motion since the last reversal, 1 or -1; 0 if it has not moved. The following numbers are the
        /// duration of this motion and of the rest after it, s.
        way: S,
        gone: S,
        stood: S,
        /// Remaining time in which friction is not learned, s.
        rests: S,
        /// Time for which the drive has slid, and has slid fast, s.
        slid: [S; 2],
        /// Time for which the spool has moved slowly, s.
        calm: S,
    }
}

impl<S: Number> Signals<S> {
    /// Returns force, N, and acceleration, m/s2, in the frequency band in which a controlled drive swings, from force
    /// and velocity.
    fn in_band(&mut self, [force, v]: [S; 2], period: f64) -> [S; 2] {
        let [fast, slow] = LEARN_BAND;
        let share = period / (period + fast);
        let [f1, v1] = self.band[0].follow([force, v], share);
        let [f2, a2] = self.band[1].follow([f1, (v - v1) / S::c(fast)], share);
        let [f3, a3] = self.band[2].follow([f2, a2], period / (period + slow));
        [f2 - f3, a2 - a3]
    }
}

/// Coulomb and viscous friction and the moving mass are estimated relative to the description. The valve's conductance
/// and overlap are estimated, too. A force that is equal in both directions is estimated as well, but the observer
/// compensates it. Zero offsets of pressure sensors look like such a force. Friction that differs between the
/// directions does, too.
#[derive(Clone, Debug)]
pub struct Adaptation<S = f64> {
    /// The model as described, before any learning, with its load at first.
    described: Model,
    /// Factors of Coulomb and viscous friction, the constant force, and the factor of the mass.
    friction: Fit<S, 4>,
    /// Factor of the mass in the band of a swing.
    mass: Fit<S, 1>,
    valve: Fit<S, 2>,
    signals: Signals<S>,
}

impl Adaptation {
    /// Takes over another described mass, kg, and load, N. The learned factor of the mass stays.
    pub fn expect(&mut self, model: &mut Model, mass: f64, load: f64) {
        model.mass *= mass / self.described.mass;
        model.load = load;
        self.described.mass = mass;
    }
}

impl<S: Number> Adaptation<S> {
    /// Returns the adaptation of a described model.
    pub fn new(model: &Model) -> Self {
        let d = model.valve.overlap;
        Adaptation {
            described: model.clone(),
            friction: Fit::new([1.0, 1.0, 0.0, 1.0]),
            mass: Fit::new([1.0]),
            valve: Fit::new([1.0 / (1.0 - d), -d / (1.0 - d)]),
            signals: Signals::default(),
        }
    }

    /// Visits each number that was learned.
    pub(crate) fn learned(&mut self, model: &mut Model<S>, see: &mut dyn FnMut(&mut S)) {
        self.friction.each(see);
        self.mass.each(see);
        self.valve.each(see);
        let Model { mass, friction_shares: [level, viscous], valve, .. } = model;
        [mass, level, viscous, &mut valve.overlap, &mut valve.flow.gain].into_iter().for_each(see);
    }

    /// Visits each number of the filters and times.
    pub(crate) fn signals(&mut self, see: &mut dyn FnMut(&mut S)) {
        self.signals.each(see);
    }

    /// Learns from a state that follows measured pressures, and from position and speed of the spool of a 5/3 valve.
    /// Parameters of other valves are not learned.
    pub fn learn(&mut self, model: &mut Model<S>, state: &mut State<S>, spool: Option<[S; 2]>, period: f64) {
        self.turn(model, state, period);
        self.learn_friction(model, state, period);
        if let Some(spool) = spool {
            self.learn_valve(model, state, spool, period);
        }
    }

    /// Corrects the estimate when a drive reverses. Until then, the observer has assigned the unmodelled friction to a
    /// disturbance force. This part of the disturbance force is moved to the friction. Otherwise it would not change
    /// sign with the motion.
    fn turn(&mut self, model: &mut Model<S>, state: &mut State<S>, period: f64) {
        let (zero, one, half) = (S::zero(), S::one(), S::c(0.5));
        let Signals { way, gone, stood, rests, .. } = self.signals;
        let reverses = flag(way * state.friction, zero);
        let moves = flag(S::c(LEARN_MOVES), state.velocity.abs());
        let goes = (one - reverses) * moves * flag(zero, state.friction * state.velocity);
        let begins = half.lt(goes * flag(way.abs(), half));
        let [reversed, gone_on] = [reverses, goes].map(|own| half.lt(own));
        let sign = S::select(state.velocity.lt(zero), -one, one);
        self.signals.way = S::select(reversed, zero, S::select(begins, sign, way));
        self.signals.gone = S::select(begins, zero, gone) + goes.times(period);
        let rested = S::select(gone_on, zero, stood + S::c(period));
        self.signals.stood = S::select(reversed, stood, rested);
        let is_new = flag(rests, S::c(f64::MIN_POSITIVE));
        let was_long = one - flag(gone, S::c(LEARN_MOVED_FOR));
        let was_short = one - flag(S::c(LEARN_STOOD_FOR), stood);
        let learns = half.lt(reverses * is_new * was_long * was_short);
        let taken = S::either(
            learns,
            &mut self.friction,
            |fit| {
                let place = [state.position, zero];
                let [level, _] = self.described.friction_levels(place, state.pressures);
                let before = fit.theta[0];
                let force = way * level * before - state.disturbance;
                let terms = [way * level, zero, zero];
                learn_balance(&self.described, fit, terms, force, level, S::c(1.0 / LEARN_REVERSAL));
                (fit.theta[0] - before) * way * level
            },
            |_| zero,
        );
        model.friction_shares[0] = self.friction.theta[0];
        state.disturbance += taken;
        state.friction += taken;
    }

    fn learn_friction(&mut self, model: &mut Model<S>, state: &State<S>, period: f64) {
        let (zero, one, half) = (S::zero(), S::one(), S::c(0.5));
        let v = state.velocity;
        let [level, viscous] = self.described.friction_levels([state.position, v], state.pressures);
        let sign = S::select(v.lt(zero), -one, S::select(zero.lt(v), one, zero));
        let force = model.gas_force(state.pressures) + S::c(model.load);
        let now = [force, v, sign * level, viscous * v];
        let [force, slow, coulomb, viscous] =
            self.signals.motion.follow(now, period / (period + LEARN_MOTION_LAG));
        self.signals.rests -= S::c(period);
        // The friction is not known during the first lag after the drive began to slide, or to slide fast.
        for (own, least) in self.signals.slid.iter_mut().zip([LEARN_SLIDES, LEARN_FAST]) {
            *own = S::select(v.abs().lt(S::c(least)), zero, *own + S::c(period));
        }
        let [slid, fast] = self.signals.slid;
        let slid = S::select(v.abs().lt(S::c(LEARN_FAST)), slid, fast);
        let is_settled = one - flag(slid, S::c(LEARN_SETTLED * LEARN_MOTION_LAG));
        let slides = is_settled * (one - flag(slow * v, zero));
        // Separate for each direction: wrong friction changes sign with the motion, and must be learned.
        let back = flag(v, zero);
        for (own, is_this) in self.signals.disturbance.iter_mut().zip([one - back, back]) {
            change(slides * is_this, own, |own| {
                _ = own.follow([state.disturbance], period / (period + LEARN_WAIT))
            });
        }
        let [Lagged([forth], _), Lagged([back], _)] = self.signals.disturbance;
        let known = S::select(v.lt(zero), back, forth);
        let inertia = (v - slow).times(self.described.mass) / S::c(LEARN_MOTION_LAG);
        let expected = (level + inertia.abs()).times(LEARN_JUMP);
        let jumps = half.lt(slides * flag(expected, (state.disturbance - known).abs()));
        self.signals.rests = S::select(jumps, S::c(LEARN_WAIT), self.signals.rests);
        let learns = slides * flag(self.signals.rests, S::c(f64::MIN_POSITIVE));
        change(learns, &mut self.friction, |fit| {
            // Slower motion is not learned. The bound avoids a division by zero in exported code.
            let factor = (S::c(LEARN_FAST) / v.abs().max(S::c(LEARN_SLIDES))).max(one);
            learn_balance(&self.described, fit, [coulomb, viscous, inertia], force, level, factor);
        });
        // Inertia is part of the balance, so it is not mistaken for friction. Other errors look like mass, too.
        let [coulomb, viscous, ..] = self.friction.theta;
        model.friction_shares = [coulomb, S::select(half.lt(learns), viscous, model.friction_shares[1])];
    }

    /// Learns the mass from a drive that swings. The pressures are measured, or those of the model:
    ///
    ///   F - F_fr - F_v v = theta M a,   each in the band of [`LEARN_BAND`]
    ///
    /// Friction is in phase with the velocity, a quarter of a period apart from the inertia. Errors of the friction
    /// therefore hardly move the mass. Slips of a creeping or resting drive would change the estimate. While the
    /// `speed` of the reference is below [`LEARN_SLIDES`], the inertial force must therefore exceed that of any slip,
    /// which is the difference between breakaway and Coulomb friction. A model with more mass than the drive makes
    /// predictive control swing, and the swing corrects the mass.
    pub fn learn_mass(&mut self, model: &mut Model<S>, state: &State<S>, speed: S, period: f64) {
        if !model.valve.arrangement.is_proportional() {
            return; // The pulses of valves that switch are in the same band.
        }
        let v = state.velocity;
        let [level, viscous] = model.friction_levels([state.position, v], state.pressures);
        let growth = S::c(model.load - self.described.load);
        let force = model.gas_force(state.pressures) - state.friction - viscous * v + growth;
        let [force, a] = self.signals.in_band([force, v], period);
        let inertia = a.times(self.described.mass);
        let [moves, creeps] = LEARN_SWINGS.map(S::c);
        let least = S::select(speed.lt(S::c(LEARN_SLIDES)), creeps, moves);
        let power = &mut self.signals.power;
        *power += (inertia * inertia - *power).times(period / (period + LEARN_BAND[1]));
        let is_weak = power.sqrt().lt(least * level);
        let learned = |fit: &mut Fit<S, 1>| {
            let deviation = level.times(LEARN_SWING_DEVIATION);
            fit.observe([inertia / deviation], force / deviation);
            fit.cut([LEARN_MASS_WITHIN]);
            fit.theta[0].times(self.described.mass)
        };
        model.mass = S::either(is_weak, &mut self.mass, |_| model.mass, learned);
    }

    fn learn_valve(&mut self, model: &mut Model<S>, state: &State<S>, [spool, speed]: [S; 2], period: f64) {
        let (zero, one, half) = (S::zero(), S::one(), S::c(0.5));
        let described = &self.described;
        let (place, gas) = ([state.position, state.velocity], state.gas());
        let forth = flag(zero, spool);
        let back = one - forth;
        let is_forth = half.lt(forth);
        let full = described.chambers(place, gas, [[forth, back], [back, forth]]);
        let shut = described.chambers(place, gas, [[zero; 2]; 2]);
        let k1 = described.gas.heat_capacity_ratio - 1.0;
        let is_fast = one - flag(speed.abs(), S::c(LEARN_SPOOL_SPEED));
        self.signals.calm = S::select(half.lt(is_fast), zero, self.signals.calm + S::c(period));
        let is_wide = flag(S::c(LEARN_OPEN), spool.abs() - model.valve.overlap);
        let opens = is_wide * flag(S::c(LEARN_SPOOL_CALM), self.signals.calm);
        let seen = [0, 1].map(|side| {
            // Energy that flows in at full opening, W, while an edge is open.
            let is_open = flag(model.valve.overlap, spool.abs());
            let flow = is_open * (full.energy_rates[side] - shut.energy_rates[side]);
            let volume = described.sides[side].volume(state.position);
            let scale = state.temperatures[side].times(described.valve.flow.gain * CHOKED * described.gas.cp);
            let energy = state.pressures[side] * volume / S::c(k1);
            let now = [energy, shut.energy_rates[side], flow * spool.abs(), flow];
            let [slow, other, by_spool, by_one] =
                self.signals.gas[side].follow(now, period / (period + LEARN_GAS_LAG));
            let rate = (energy - slow) / S::c(LEARN_GAS_LAG);
            [by_spool / scale, by_one / scale, (rate - other) / scale]
        });
        let pick = |a: S, b: S| S::select(is_forth, a, b);
        // The filling chamber comes first: the order is then the same in both directions, also at a bound.
        let [fills, vents] =
            [[0, 1], [1, 0]].map(|[a, b]| std::array::from_fn::<S, 3, _>(|i| pick(seen[a][i], seen[b][i])));
        // Near the supply's pressure, the filling flow depends on the supply and not on the valve.
        let filled = pick(state.pressures[0], state.pressures[1]);
        let is_full = flag(S::c(LEARN_FULL * described.supply.pressure), filled);
        for ([by_spool, by_one, y], is_seen) in [(fills, opens * (one - is_full)), (vents, opens)] {
            change(is_seen, &mut self.valve, |fit| {
                let d = LEARN_OVERLAP_WITHIN;
                let [low, high] = LEARN_CONDUCTANCE_WITHIN;
                let within = [[low, high / (1.0 - d[1])], [-high * d[1] / (1.0 - d[1]), 0.0]];
                let deviation = S::c(LEARN_FLOW_DEVIATION);
                fit.observe([by_spool / deviation, by_one / deviation], y / deviation);
                fit.cut(within);
            });
        }
        let [slope, offset] = self.valve.theta;
        let [low, high] = LEARN_OVERLAP_WITHIN;
        let overlap = (-offset / slope).within(low, high);
        let [low, high] = LEARN_CONDUCTANCE_WITHIN;
        let share = (slope * (one - overlap)).within(low, high);
        let opens = half.lt(opens);
        let Model { valve, .. } = model;
        valve.overlap = S::select(opens, overlap, valve.overlap);
        valve.flow.gain = S::select(opens, share.times(described.valve.flow.gain), valve.flow.gain);
    }
}

/// Learns from a force balance. Its terms are described Coulomb friction, viscous friction and inertia, N, the force of
/// gas and load, N, the friction level, and a factor of the balance's deviation.
fn learn_balance<S: Number>(
    described: &Model,
    fit: &mut Fit<S, 4>,
    [coulomb, viscous, inertia]: [S; 3],
    force: S,
    level: S,
    factor: S,
) {
    let area = 0.5 * described.sides.iter().map(|side| side.area).sum::<f64>();
    let usual = LEARN_FORCE_DEVIATION.max(LEARN_PRESSURE_DEVIATION * area);
    let weight = described.load.abs();
    // Unit of the constant force, N.
    let offset = LEARN_OFFSET * (usual / LEARN_FORCE_DEVIATION) + weight;
    let deviation = factor.times(usual);
    let rest = (LEARN_MASS_WITHIN[1] - 1.0) * weight;
    let most = (level + S::c(rest)) / S::c(offset);
    let phi = [coulomb, viscous, S::c(offset), inertia].map(|own| own / deviation);
    fit.observe(phi, force / deviation);
    let of_friction = LEARN_FRICTION_WITHIN.map(S::c);
    fit.project([of_friction, of_friction, [-most, most], LEARN_MASS_WITHIN.map(S::c)]);
}

/// Choked flow per unit of conductance at a usual supply pressure, Pa/K^0.5: a scale (assumed).
const CHOKED: f64 = 7e5 / 17.0;
