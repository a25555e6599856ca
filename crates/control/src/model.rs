//! Model of the drive in a controller: the equations of gas, motion and friction, written with the laws of `physics`.

mod parts;

use crate::number::{Number, StateOf};
use crate::thresholds::{LEAST_SPEED, OVERLAP_WIDTH, SLOPE_STEP, SMOOTH_SPEED};
use crate::types::{Edges, Plant, State};
use math::{Function, Over};
pub use parts::{ConstantGas, Side, Slip, Valve};
use physics::chamber::{EnergyBalance, Exchange, GasState};
use physics::flow::{End, leaking, opened};
use physics::friction::{At, Contact, plastic_share};
use physics::{Gas, heat};

/// Controller model of the drive. The numbers `P` may be learned.
#[derive(Clone, Debug)]
pub struct Model<P = f64> {
    /// The gas.
    pub gas: Gas<f64>,
    /// The air around.
    pub ambient: ConstantGas,
    /// The supply.
    pub supply: ConstantGas,
    /// Chambers a and b.
    pub sides: [Side; 2],
    /// Stroke, m.
    pub stroke: f64,
    /// Moving mass, kg.
    pub mass: P,
    /// Weight along the axis and external force, N in +x.
    pub load: f64,
    /// Heat-transfer coefficient to the walls, W/(m2 K).
    pub heat_transfer: f64,
    /// Wall temperature, K.
    pub wall_temperature: f64,
    /// The valve.
    pub valve: Valve<P>,
    /// Friction of the moving parts.
    pub friction: Contact<f64>,
    /// Stiffness of the contact in stick, N/m.
    pub stick_stiffness: f64,
    /// Slip condition of the contact.
    pub slip: Slip,
    /// Factors of the described friction: of its level, and of its viscous part.
    pub friction_shares: [P; 2],
    /// Damping of the contact in stick over its stiffness, s.
    pub stick_damping_time: f64,
}

math::mapped!(Model { mass } parts { valve, friction_shares } same {
    gas, ambient, supply, sides, stroke, load, heat_transfer, wall_temperature, friction, stick_stiffness, slip,
    stick_damping_time
});

/// Rates of the gas in both chambers.
#[derive(Clone, Copy, Debug)]
pub struct Chambers<S> {
    /// dU/dt of each chamber, W.
    pub energy_rates: [S; 2],
    /// dp/dt of each chamber, Pa/s.
    pub pressure_rates: [S; 2],
    /// dT/dt of each chamber, K/s.
    pub temperature_rates: [S; 2],
}

impl Model {
    /// Volume flow at which gas leaves a chamber through the open valve, choked, m3/s.
    pub fn volume_flow(&self) -> f64 {
        self.valve.flow.gain * self.gas.gas_constant * self.supply.temperature.sqrt()
    }

    /// Rate at which the open valve fills a chamber with the piston at x, Pa/s.
    pub fn most_rate(&self, side: usize, x: f64) -> f64 {
        let k = self.gas.heat_capacity_ratio;
        k * self.volume_flow() * self.supply.pressure / self.sides[side].volume(x)
    }

    /// Returns pressures, Pa, about the mean of supply and ambient, under which a resting piston needs no friction.
    /// The difference is divided equally between both chambers.
    pub fn rest_pressures(&self) -> [f64; 2] {
        let mean = 0.5 * (self.supply.pressure + self.ambient.pressure);
        let missing = -self.load - self.gas_force([mean; 2]);
        let of = |i: usize, sign: f64| {
            let own = mean + sign * 0.5 * missing / self.sides[i].area;
            own.clamp(self.ambient.pressure, self.supply.pressure)
        };
        [of(0, 1.0), of(1, -1.0)]
    }

    /// Returns the decay rates of the pressures in the shut chambers by leakage and heat, 1/s: -(dp'/dp) of each, with
    /// the piston at rest near mid-stroke. If they are equal, the position determines the force of the gas alone, not
    /// both
    /// pressures.
    pub fn pressure_decay(&self) -> [f64; 2] {
        let (x, p) = (0.5 * self.stroke, self.rest_pressures());
        let at = |by: f64| {
            // Gas that was at the wall's temperature, compressed without heat.
            let k = self.gas.heat_capacity_ratio;
            let temperature = self.wall_temperature * (1.0 + by).powf(1.0 - 1.0 / k);
            let gas = p.map(|p| GasState::at(p * (1.0 + by), temperature));
            self.chambers([x, 0.0], gas, self.openings(0.0)).pressure_rates
        };
        let [low, high] = [-SLOPE_STEP, SLOPE_STEP].map(at);
        [0, 1].map(|i| (low[i] - high[i]) / (2.0 * SLOPE_STEP * p[i]))
    }

    /// Returns the fraction by which a command opens an edge.
    pub fn share_of(&self, command: f64) -> f64 {
        let overlap = self.valve.overlap;
        command.signum() * (command.abs() - overlap).max(0.0) / (1.0 - overlap)
    }
}

impl<P: Over<f64>> Model<P> {
    /// Returns the force of the gas in +x, N.
    #[inline(always)]
    pub fn gas_force<S: Over<f64>>(&self, pressures: [S; 2]) -> S {
        let [a, b] = pressures.map(|p| p - S::c(self.ambient.pressure));
        a.times(self.sides[0].area) - b.times(self.sides[1].area)
    }

    /// Returns the open fractions of the conductance with the spool of a 5/3 valve at `spool`.
    #[inline(always)]
    pub fn openings<S: StateOf<P>>(&self, spool: S) -> Edges<S> {
        self.edges_at(spool, self.valve.overlap)
    }

    /// Returns the same for a fraction of the opening beyond the overlap.
    #[inline(always)]
    pub fn opened_by<S: StateOf<P>>(&self, share: S) -> Edges<S> {
        self.edges_at(share, P::zero())
    }

    #[inline(always)]
    fn edges_at<S: StateOf<P>>(&self, spool: S, overlap: P) -> Edges<S> {
        let whole = P::one() - overlap;
        let leak = leaking(S::c(self.valve.leakage), S::c(self.valve.leakage_width), spool);
        let [forth, back] = [1.0, -1.0]
            .map(|way| opened(S::from(-overlap / whole), S::from(P::c(way) / whole), spool) + leak);
        [[forth, back], [back, forth]]
    }

    /// Returns the rates of the chambers' gas at (x, v), with the edges open by `openings`.
    #[inline(always)]
    pub fn chambers<S: StateOf<P>>(
        &self,
        place: [S; 2],
        gas: [GasState<S>; 2],
        openings: Edges<S>,
    ) -> Chambers<S> {
        self.chambers_on(&self.supply, place, gas, openings)
    }

    /// Returns the same for another supply.
    #[inline(always)]
    pub fn chambers_on<S: StateOf<P>>(
        &self,
        supply: &ConstantGas,
        [x, v]: [S; 2],
        gas: [GasState<S>; 2],
        openings: Edges<S>,
    ) -> Chambers<S> {
        let (source, exhaust) = (supply.end(), self.ambient.end());
        let cp = self.gas.cp;
        let mut rates = [[S::zero(); 2]; 3];
        for (i, (side, gas)) in self.sides.iter().zip(&gas).enumerate() {
            let volume = side.volume(x);
            let own = End { p: gas.p, inverse_p: gas.inverse_p, choked: gas.p * gas.inverse_sqrt_t };
            let [fills, vents] = openings[i];
            let (inflow, back) = self.valve.flow.flow(fills, &source, &own);
            let (outflow, drawn) = self.valve.flow.flow(vents, &own, &exhaust);
            let filled = S::select(back, gas.t, S::c(supply.temperature));
            let vented = S::select(drawn, S::c(self.ambient.temperature), gas.t);
            let wall = side.wall(x);
            let exchange = Exchange {
                m_dot: inflow - outflow,
                h_dot: (inflow * filled - outflow * vented).times(cp),
                volume,
                volume_rate: v.times(side.sign * side.area),
                heat: heat::newton(S::c(self.heat_transfer), wall, S::c(self.wall_temperature), gas.t),
            };
            let [m_dot, u_dot] = EnergyBalance::rate(gas.p, &exchange);
            // p V = (k - 1) U = m R T.
            let (grown, inverse) = (u_dot.times(self.gas.heat_capacity_ratio - 1.0), S::one() / volume);
            let warmed = (grown - (m_dot * gas.t).times(self.gas.gas_constant)) * gas.t;
            rates[0][i] = u_dot;
            rates[1][i] = (grown - gas.p * exchange.volume_rate) * inverse;
            rates[2][i] = warmed * gas.inverse_p * inverse;
        }
        let [energy_rates, pressure_rates, temperature_rates] = rates;
        Chambers { energy_rates, pressure_rates, temperature_rates }
    }

    /// Returns the steady friction level without its viscous part at |v|, g(v), N, and the viscous coefficient Fv, N
    /// s/m.
    #[inline(always)]
    pub fn friction_levels<S: StateOf<P>>(&self, [x, v]: [S; 2], pressures: [S; 2]) -> [S; 2] {
        let [a, b] = pressures;
        let steady = Steady { friction: &self.friction, ambient: self.ambient.pressure };
        let level = if self.friction.is_of_velocity() {
            <S as Over<f64>>::composed(&steady, [v])
        } else {
            <S as Over<f64>>::composed(&steady, [v, x, a, b])
        };
        let [share, slope] = self.friction_shares;
        let viscous = slope * P::c(self.friction.law.levels().viscous);
        [level.times(share).max(S::c(f64::MIN_POSITIVE)), S::from(viscous)]
    }

    /// Returns the rate of the friction force f of the contact, N/s, without its viscous part. The contact is a
    /// spring that slips at the level g. A step of `h` s can follow the rate
    ///
    ///   df/dt = min(s |v|/g, 1/h) (g sgn v - f)
    ///
    /// s stiffness N/m. The rate is exact below the bound 1/h. Above the bound, f reaches its level within a step. A
    /// contact that does not drift
    /// follows df/dt = s v (1 - alpha |f|/g) below its level, and does not exceed g within the step. Here alpha is the
    /// [`plastic_share`] of the motion. It is zero if the contact slips only at its level.
    #[inline(always)]
    pub fn stick_rate<S: StateOf<P>>(&self, v: S, f: S, level: S, h: f64) -> S {
        let speed = (v * v + S::c(SMOOTH_SPEED * SMOOTH_SPEED)).sqrt();
        let rate = (speed.times(self.stick_stiffness) / level).min(S::c(1.0 / h));
        // g sgn v |v| = g v avoids the sign at rest.
        let sign = v / speed;
        let left = level * sign - f;
        let spring = v.times(self.stick_stiffness);
        let sprung = match self.slip {
            Slip::Always => return rate * left,
            Slip::From(share) => {
                let q = f.abs() / level;
                spring * (S::one() - plastic_share(S::c(share), v * f, q) * q)
            }
            Slip::AtLevel => spring,
        };
        // Near rest the sign changes faster than a step can follow. Its derivative is limited to the value that brings
        // the mass to rest within one step.
        let most = S::from(self.mass / P::c(h));
        let slope = || (S::c(SMOOTH_SPEED * SMOOTH_SPEED) / (speed * speed * speed)).min(most / level);
        let rest = (level * sign.sloped(v, slope) - f).times(1.0 / h);
        let elastic = S::select(rest.abs().lt(sprung.abs()), rest, sprung);
        S::select((left * v).lt(S::zero()), rate * left, elastic)
    }

    /// Returns the damping of the contact over its stiffness, s, for a step of `h` s. The damping can bring the mass to
    /// rest within the step, but cannot reverse its motion.
    pub fn damping_time(&self, h: f64) -> P {
        P::c(self.stick_damping_time).min(self.mass / P::c(self.stick_stiffness * h))
    }
}

impl<S: Number> Model<S> {
    /// Returns the command that opens an edge by a fraction of its conductance. The command includes the overlap. It
    /// changes sign smoothly within a width about zero.
    pub fn command_for(&self, share: S) -> S {
        let overlap = self.valve.overlap;
        let inverse = (share / S::c(OVERLAP_WIDTH)).tanh() * overlap;
        (share * (S::one() - overlap) + inverse).limited()
    }

    /// Returns the opening under which the force of the gas changes at a rate, N/s: its direction, and its fraction.
    /// Flow is linear in the fraction on each side. The fraction is above 1 if the valve is too small, and below 0 if
    /// no opening suffices.
    pub fn opening_for(&self, state: &State<S>, rate: S) -> (S, S) {
        let gas = state.gas();
        let at = |openings: Edges<S>| {
            let [a, b] = self.chambers([state.position, state.velocity], gas, openings).pressure_rates;
            a.times(self.sides[0].area) - b.times(self.sides[1].area)
        };
        let shut = at(self.openings(S::zero()));
        let is_back = rate.lt(shut);
        let [to, fro] = [[0.0, 1.0], [1.0, 0.0]].map(|[back, on]| S::select(is_back, S::c(back), S::c(on)));
        let full = at([[to, fro], [fro, to]]);
        (S::select(is_back, S::c(-1.0), S::one()), (rate - shut) / (full - shut))
    }
}

impl Plant {
    /// Returns the linear model with the piston at x between the pressures `p`, Pa, sampled with a period:
    ///
    ///   omega^2 = k (p_a A_a^2/V_a + p_b A_b^2/V_b)/M,   K_v = C rho0 R T/A,   zeta = Fv/(2 M omega)
    pub fn of(model: &Model, x: f64, p: [f64; 2], period: f64) -> Self {
        let k = model.gas.heat_capacity_ratio;
        let stiffness: f64 =
            (model.sides.iter().zip(p)).map(|(side, p)| k * p * side.area * side.area / side.volume(x)).sum();
        let natural_frequency = (stiffness / model.mass).sqrt();
        let [coulomb, viscous] = model.friction_levels([x, 1.0], p);
        let area = 0.5 * (model.sides[0].area + model.sides[1].area);
        // Choked exhaust: the gas leaves at its density times this volume flow.
        let volume_flow = model.volume_flow();
        let volume = 0.5 * (model.sides[0].volume(x) + model.sides[1].volume(x));
        Plant {
            natural_frequency,
            damping_ratio: viscous / (2.0 * model.mass * natural_frequency),
            speed: volume_flow / area,
            force_rate: k * volume_flow * model.supply.pressure * area / volume,
            lag: model.valve.lag() + 0.5 * model.valve.arrangement.acts_for(period),
            coulomb,
        }
    }
}

/// Described friction level, N, at a velocity, m/s, a position, m, and the pressures of both chambers, Pa. The ambient
/// pressure is in Pa.
struct Steady<'a> {
    friction: &'a Contact<f64>,
    ambient: f64,
}

impl Function<f64, 4> for Steady<'_> {
    #[inline(always)]
    fn at<S: Over<f64>>(&self, [v, x, a, b]: [S; 4]) -> S {
        let Steady { friction, ambient } = *self;
        // Formulas may give zero friction at rest, where it has no direction.
        let speed = v.abs().max(S::c(LEAST_SPEED));
        let [gauge_a, gauge_b] = [a, b].map(|p| p - S::c(ambient));
        let at = At { x, v: S::select(v.lt(S::zero()), -speed, speed), ..At::at_rest() };
        friction.steady(&at.pressed(gauge_a, gauge_b)).abs() - speed.times(friction.law.levels().viscous)
    }
}

/// Friction level that depends on the velocity alone.
impl Function<f64, 1> for Steady<'_> {
    #[inline(always)]
    fn at<S: Over<f64>>(&self, [v]: [S; 1]) -> S {
        self.at([v, S::zero(), S::zero(), S::zero()])
    }
}
