//! Adaptation of the controller's model to the drive. Recursive least squares estimate friction, mass and valve while
//! the drive moves.

use crate::model::Model;
use crate::thresholds::*;
use crate::types::State;

/// Recursive least squares with forgetting, of `y = phi' theta`.
#[derive(Clone, Debug)]
struct Fit<const N: usize> {
    theta: [f64; N],
    covariance: [[f64; N]; N],
}

impl<const N: usize> Fit<N> {
    fn new(theta: [f64; N]) -> Self {
        let mut covariance = [[0.0; N]; N];
        (0..N).for_each(|i| covariance[i][i] = LEARN_VARIANCE);
        Fit { theta, covariance }
    }

    /// Updates the estimates with an observation of unit variance.
    fn observe(&mut self, phi: [f64; N], y: f64) {
        let p = &mut self.covariance;
        let p_phi: [f64; N] = std::array::from_fn(|i| (0..N).map(|j| p[i][j] * phi[j]).sum());
        let spread = 1.0 + (0..N).map(|i| phi[i] * p_phi[i]).sum::<f64>();
        let miss = y - (0..N).map(|i| phi[i] * self.theta[i]).sum::<f64>();
        for i in 0..N {
            self.theta[i] += p_phi[i] / spread * miss;
            for j in 0..N {
                p[i][j] -= p_phi[i] * p_phi[j] / spread;
            }
        }
        // Without excitation, the variance grows at most to its initial value.
        let most = (0..N).fold(0.0, |most: f64, i| most.max(p[i][i]));
        if most / LEARN_KEPT < LEARN_VARIANCE {
            p.iter_mut().flatten().for_each(|own| *own /= LEARN_KEPT);
        }
    }

    /// Clips estimates to their bounds.
    fn cut(&mut self, within: [[f64; 2]; N]) {
        (0..N).for_each(|i| self.theta[i] = self.theta[i].clamp(within[i][0], within[i][1]));
    }

    /// Clips estimates to their bounds and assigns the remaining error to the other estimates, by their covariance.
    /// If one estimate alone were clipped, the others would no longer fit past observations.
    fn project(&mut self, within: [[f64; 2]; N]) {
        for (i, [low, high]) in within.into_iter().enumerate() {
            let beyond = self.theta[i] - self.theta[i].clamp(low, high);
            let share = beyond / self.covariance[i][i];
            (0..N).for_each(|j| self.theta[j] -= self.covariance[j][i] * share);
        }
        self.cut(within);
    }
}

/// A signal after a first-order lag.
#[derive(Clone, Copy, Debug, Default)]
struct Lagged<const N: usize>(Option<[f64; N]>);

impl<const N: usize> Lagged<N> {
    fn follow(&mut self, signal: [f64; N], share: f64) -> [f64; N] {
        let own = self.0.get_or_insert(signal);
        for (own, signal) in own.iter_mut().zip(signal) {
            *own += share * (signal - *own);
        }
        *own
    }
}

/// Force and acceleration in the frequency band in which a controlled drive swings: after two lags, without the slow
/// part.
#[derive(Clone, Debug, Default)]
struct Band {
    lags: [Lagged<2>; 3],
    /// Mean square of the inertial force in the band, N2.
    power: f64,
}

impl Band {
    /// Returns force, N, and acceleration, m/s2, in the band, from force and velocity.
    fn follow(&mut self, [force, v]: [f64; 2], period: f64) -> [f64; 2] {
        let [fast, slow] = LEARN_BAND;
        let share = period / (period + fast);
        let [f1, v1] = self.lags[0].follow([force, v], share);
        let [f2, a2] = self.lags[1].follow([f1, (v - v1) / fast], share);
        let [f3, a3] = self.lags[2].follow([f2, a2], period / (period + slow));
        [f2 - f3, a2 - a3]
    }

    /// Adds the inertial force of a sample, N, and returns its effective value, N.
    fn effective(&mut self, inertia: f64, period: f64) -> f64 {
        self.power += period / (period + LEARN_BAND[1]) * (inertia * inertia - self.power);
        self.power.sqrt()
    }
}

/// Coulomb and viscous friction and the moving mass are estimated relative to the description. The valve's conductance
/// and overlap are estimated, too. A force that is equal in both directions is estimated as well, but the observer
/// compensates it. Zero offsets of pressure sensors look like such a force. Friction that differs between the
/// directions does, too.
#[derive(Clone, Debug)]
pub struct Adaptation {
    /// The model as described, before any learning.
    described: Model,
    /// Load of that model at first, N.
    load: f64,
    /// Factors of Coulomb and viscous friction, the constant force, and the factor of the mass.
    friction: Fit<4>,
    /// Factor of the mass in the band of a swing.
    mass: Fit<1>,
    valve: Fit<2>,
    motion: Lagged<4>,
    band: Band,
    gas: [Lagged<4>; 2],
    /// Residual of the force balance, in each direction.
    disturbance: [Lagged<1>; 2],
    /// Direction of motion since the last reversal, 1 or -1; 0 if it has not moved. The following numbers are the
    /// duration of this motion and of the rest after it, s.
    way: f64,
    gone: f64,
    stood: f64,
    /// Remaining time in which friction is not learned, s.
    rests: f64,
    /// Time for which the drive has slid, and has slid fast, s.
    slid: [f64; 2],
    /// Time for which the spool has moved slowly, s.
    calm: f64,
}

impl Adaptation {
    /// Returns the adaptation of a described model.
    pub fn new(model: &Model) -> Self {
        let d = model.valve.overlap;
        Adaptation {
            described: model.clone(),
            load: model.load,
            friction: Fit::new([1.0, 1.0, 0.0, 1.0]),
            mass: Fit::new([1.0]),
            valve: Fit::new([1.0 / (1.0 - d), -d / (1.0 - d)]),
            motion: Lagged::default(),
            band: Band::default(),
            gas: [Lagged::default(); 2],
            disturbance: [Lagged::default(); 2],
            way: 0.0,
            gone: 0.0,
            stood: 0.0,
            rests: 0.0,
            slid: [0.0; 2],
            calm: 0.0,
        }
    }

    /// Takes over another described mass, kg, and load, N. The learned factor of the mass stays.
    pub fn expect(&mut self, model: &mut Model, mass: f64, load: f64) {
        model.mass *= mass / self.described.mass;
        model.load = load;
        self.described.mass = mass;
    }

    /// Learns from a state that follows measured pressures, and from position and speed of the spool of a 5/3 valve.
    /// Parameters of other valves are not learned.
    pub fn learn(&mut self, model: &mut Model, state: &mut State, spool: Option<[f64; 2]>, period: f64) {
        self.turn(model, state, period);
        self.learn_friction(model, state, period);
        if let Some(spool) = spool {
            self.learn_valve(model, state, spool, period);
        }
    }

    /// Corrects the estimate when a drive reverses. Until then, the observer has assigned the unmodelled friction to a
    /// disturbance force. This part of the disturbance force is moved to the friction. Otherwise it would not change
    /// sign with the motion.
    fn turn(&mut self, model: &mut Model, state: &mut State, period: f64) {
        let way = self.way;
        if way * state.friction >= 0.0 {
            let goes = state.velocity.abs() > LEARN_MOVES && state.friction * state.velocity > 0.0;
            if goes && way == 0.0 {
                (self.way, self.gone) = (state.velocity.signum(), 0.0);
            }
            [self.gone, self.stood] =
                if goes { [self.gone + period, 0.0] } else { [self.gone, self.stood + period] };
            return;
        }
        self.way = 0.0;
        if self.rests > 0.0 || self.gone < LEARN_MOVED_FOR || self.stood > LEARN_STOOD_FOR {
            return;
        }
        let [level, _] = self.described.friction_levels([state.position, 0.0], state.pressures);
        let before = self.friction.theta[0];
        self.balance(
            [way * level, 0.0, 0.0],
            way * level * before - state.disturbance,
            level,
            1.0 / LEARN_REVERSAL,
        );
        let [coulomb, ..] = self.friction.theta;
        model.friction_shares[0] = coulomb;
        let taken = (coulomb - before) * way * level;
        state.disturbance += taken;
        state.friction += taken;
    }

    /// Learns from a force balance. Its terms are described Coulomb friction, viscous friction and inertia, N, the force
    /// of gas and load, N, the friction level, and a factor of the balance's deviation.
    fn balance(&mut self, [coulomb, viscous, inertia]: [f64; 3], force: f64, level: f64, factor: f64) {
        let area = 0.5 * self.described.sides.iter().map(|side| side.area).sum::<f64>();
        let least = LEARN_FORCE_DEVIATION.max(LEARN_PRESSURE_DEVIATION * area);
        let weight = self.load.abs();
        let (deviation, offset) = (least * factor, LEARN_OFFSET * (least / LEARN_FORCE_DEVIATION) + weight);
        let most = (level + (LEARN_MASS_WITHIN[1] - 1.0) * weight) / offset;
        let phi = [coulomb, viscous, offset, inertia].map(|own| own / deviation);
        let within = [LEARN_FRICTION_WITHIN, LEARN_FRICTION_WITHIN, [-most, most], LEARN_MASS_WITHIN];
        self.friction.observe(phi, force / deviation);
        self.friction.project(within);
    }

    fn learn_friction(&mut self, model: &mut Model, state: &State, period: f64) {
        let v = state.velocity;
        let [level, viscous] = self.described.friction_levels([state.position, v], state.pressures);
        let sign = if v == 0.0 { 0.0 } else { v.signum() };
        let force = model.gas_force(state.pressures) + model.load;
        let now = [force, v, sign * level, viscous * v];
        let [force, slow, coulomb, viscous] = self.motion.follow(now, period / (period + LEARN_MOTION_LAG));
        self.rests -= period;
        // The friction is not known during the first lag after the drive began to slide, or to slide fast.
        for (own, least) in self.slid.iter_mut().zip([LEARN_SLIDES, LEARN_FAST]) {
            *own = if v.abs() < least { 0.0 } else { *own + period };
        }
        let [slid, fast] = self.slid;
        let slid = if v.abs() < LEARN_FAST { slid } else { fast };
        if slid < LEARN_SETTLED * LEARN_MOTION_LAG || slow * v < 0.0 {
            return;
        }
        // Separate for each direction: wrong friction changes sign with the motion, and must be learned.
        let known = &mut self.disturbance[usize::from(v < 0.0)];
        let [known] = known.follow([state.disturbance], period / (period + LEARN_WAIT));
        let inertia = self.described.mass * (v - slow) / LEARN_MOTION_LAG;
        if (state.disturbance - known).abs() > LEARN_JUMP * (level + inertia.abs()) {
            self.rests = LEARN_WAIT;
        }
        if self.rests > 0.0 {
            return;
        }
        self.balance([coulomb, viscous, inertia], force, level, (LEARN_FAST / v.abs()).max(1.0));
        // Inertia is part of the balance, so it is not mistaken for friction. Other errors look like mass, too.
        let [coulomb, viscous, ..] = self.friction.theta;
        model.friction_shares = [coulomb, viscous];
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
    pub fn learn_mass(&mut self, model: &mut Model, state: &State, speed: f64, period: f64) {
        if !model.valve.arrangement.is_proportional() {
            return; // The pulses of valves that switch are in the same band.
        }
        let v = state.velocity;
        let [level, viscous] = model.friction_levels([state.position, v], state.pressures);
        let growth = model.load - self.load;
        let force = model.gas_force(state.pressures) - state.friction - viscous * v + growth;
        let [force, a] = self.band.follow([force, v], period);
        let inertia = self.described.mass * a;
        let least = LEARN_SWINGS[usize::from(speed < LEARN_SLIDES)];
        if self.band.effective(inertia, period) < least * level {
            return;
        }
        let deviation = LEARN_SWING_DEVIATION * level;
        self.mass.observe([inertia / deviation], force / deviation);
        self.mass.cut([LEARN_MASS_WITHIN]);
        model.mass = self.mass.theta[0] * self.described.mass;
    }

    fn learn_valve(&mut self, model: &mut Model, state: &State, [spool, speed]: [f64; 2], period: f64) {
        let described = &self.described;
        let place = [state.position, state.velocity];
        let gas = state.gas();
        let full = described.chambers(place, gas, if spool > 0.0 { [1.0, 0.0] } else { [0.0, 1.0] });
        let shut = described.chambers(place, gas, [0.0; 2]);
        let k1 = described.gas.heat_capacity_ratio - 1.0;
        self.calm = if speed.abs() < LEARN_SPOOL_SPEED { self.calm + period } else { 0.0 };
        let open = spool.abs() - model.valve.overlap > LEARN_OPEN && self.calm > LEARN_SPOOL_CALM;
        // The filling chamber comes first: the order is then the same in both directions, also at a bound.
        let [fills, vents] = if spool > 0.0 { [0, 1] } else { [1, 0] };
        let seen = [fills, vents].map(|side| {
            // Energy that flows in at full opening, W, while an edge is open.
            let is_open = f64::from(u8::from(spool.abs() > model.valve.overlap));
            let flow = is_open * (full.energy_rates[side] - shut.energy_rates[side]);
            let volume = described.sides[side].volume(state.position);
            let scale = described.valve.flow.gain * CHOKED * described.gas.cp * state.temperatures[side];
            let now =
                [state.pressures[side] * volume / k1, shut.energy_rates[side], flow * spool.abs(), flow];
            let [energy, other, by_spool, by_one] =
                self.gas[side].follow(now, period / (period + LEARN_GAS_LAG));
            let rate = (now[0] - energy) / LEARN_GAS_LAG;
            ([by_spool / scale, by_one / scale], (rate - other) / scale)
        });
        if !open {
            return;
        }
        // Near the supply's pressure, the filling flow depends on the supply and not on the valve.
        let is_full = state.pressures[fills] > LEARN_FULL * described.supply.pressure;
        for (phi, y) in seen.into_iter().skip(usize::from(is_full)) {
            let d = LEARN_OVERLAP_WITHIN;
            let [low, high] = LEARN_CONDUCTANCE_WITHIN;
            let within = [[low, high / (1.0 - d[1])], [-high * d[1] / (1.0 - d[1]), 0.0]];
            self.valve.observe(phi.map(|own| own / LEARN_FLOW_DEVIATION), y / LEARN_FLOW_DEVIATION);
            self.valve.cut(within);
        }
        let [slope, offset] = self.valve.theta;
        model.valve.overlap = (-offset / slope).clamp(LEARN_OVERLAP_WITHIN[0], LEARN_OVERLAP_WITHIN[1]);
        let share = (slope * (1.0 - model.valve.overlap))
            .clamp(LEARN_CONDUCTANCE_WITHIN[0], LEARN_CONDUCTANCE_WITHIN[1]);
        model.valve.flow.gain = share * described.valve.flow.gain;
    }
}

/// Choked flow per unit of conductance at a usual supply pressure, Pa/K^0.5: a scale (assumed).
const CHOKED: f64 = 7e5 / 17.0;
