use crate::ground::{Common, GasNode, Given, Kind, Net, Of, Own, OwnMut, Part, State, specific_entropy};
use math::{Both, Lane, Over, Real};
use physics::chamber::{AsPrinted, EnergyBalance, Exchange, GasState};
// The standard reference atmosphere, for error scales and as the zero of entropy.
use physics::constants::{P_0, T_0};
use physics::heat::{Heat, Wetted};

/// Fraction of the dead volume at which the piston has reached the cover, because a gap of zero height cannot be
/// filled.
pub(crate) const LEAST_ROOM: f64 = 1e-3;
/// Fraction of the gas in the dead volume at standard conditions, by mass and by energy, below which a chamber is
/// empty. This fraction is far below any tolerance.
pub(crate) const LEAST_GAS: f64 = 1e-9;

/// Balances of the heat from a wall.
pub(crate) const HEAT_CHANNELS: [(&str, Kind); 3] = [
    ("wall heat", Kind::Energy),
    ("wall heat over wall temperature", Kind::EntropyIn),
    ("heat transfer", Kind::EntropyOfGas),
];

/// State variables of a volume's balance.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ChamberLaw {
    /// Mass and energy, states (m, U).
    EnergyBalance,
    /// The source paper's equations, states (p, T); for reproducing the paper only.
    AsPrinted,
}

/// Uniform gas in a rigid volume plus the free volume in front of the pistons.
#[derive(Clone, Debug)]
pub struct Volume<P> {
    /// Volume outside the strokes of pistons, m3.
    pub dead_volume: P,
    /// Wetted wall of the dead volume, m2.
    pub dead_wall: P,
    /// Heat transfer to the wall.
    pub heat: Heat<P>,
    /// Wall temperature, K.
    pub wall_temperature: P,
    /// Index among the gas nodes of the net.
    pub node: usize,
    /// Node that gives the gas state at the start.
    pub starts_as: usize,
    /// Balance of the volume.
    pub law: ChamberLaw,
    /// Whether a wall that stores heat gives the heat, so that it stays inside the circuit.
    pub stored_wall: bool,
    /// Absolute error scales of the two states.
    pub scales: [f64; 2],
}

math::gather!(Volume { dead_volume, dead_wall, heat, wall_temperature } same { node, starts_as, law, stored_wall, scales });

impl<R: Real> Volume<R> {
    /// Returns two of them side by side, with the choices of the first, if both have the same laws.
    pub(crate) fn beside(&self, other: &Self) -> Option<Volume<Both<R>>> {
        (self.law == other.law).then_some(())?;
        Some(Volume {
            dead_volume: Both([self.dead_volume, other.dead_volume]),
            dead_wall: Both([self.dead_wall, other.dead_wall]),
            heat: self.heat.beside(&other.heat)?,
            wall_temperature: Both([self.wall_temperature, other.wall_temperature]),
            node: self.node,
            starts_as: self.starts_as,
            law: self.law,
            stored_wall: self.stored_wall,
            scales: self.scales,
        })
    }
}

impl<R: Lane> Volume<R> {
    pub(crate) fn set_scales(&mut self, k: f64, r: f64) {
        self.scales = match self.law {
            ChamberLaw::EnergyBalance => {
                [P_0 / (r * T_0) * self.dead_volume.get(0), P_0 * self.dead_volume.get(0) / (k - 1.0)]
            }
            ChamberLaw::AsPrinted => [P_0, T_0],
        };
    }
}

impl<P: Real> Volume<P> {
    /// Sets the volume without pistons, and zero flow.
    #[inline(always)]
    pub(crate) fn reset<S: Over<P>>(&self, node: &mut GasNode<S>) {
        node.volume = S::from(self.dead_volume);
        node.wall = S::from(self.dead_wall);
        node.volume_rate = S::zero();
        node.m_dot = S::zero();
        node.h_dot = S::zero();
        node.wall_temperature = S::from(self.wall_temperature);
        if let Some(least) = self.heat.least_flow() {
            node.turnover = S::zero();
            node.least_flow = S::from(least);
            node.is_stirred = true;
        }
    }

    /// Computes pressure and temperature from the states.
    #[inline(always)]
    pub(crate) fn fill<S: Over<P>>(&self, y: [S; 2], node: &mut GasNode<S>, common: &Common<P>) {
        node.fill(match self.law {
            ChamberLaw::EnergyBalance => EnergyBalance::state(&common.gas, y, node.volume),
            ChamberLaw::AsPrinted => GasState::at(y[0], y[1]),
        });
    }

    /// Does the same for a real gas, with its enthalpy, after `fill`.
    #[inline(always)]
    pub(crate) fn fill_real<S: Over<P>>(
        &self,
        y: [S; 2],
        node: &mut GasNode<S>,
        enthalpy: &mut [S],
        common: &Common<P>,
    ) {
        let Some(virial) = &common.gas.virial else { return };
        let (p, t, h) = virial.p_t_h(&common.gas, y, node.volume);
        // If the coefficient is zero, the ratios are one and the bits are those of the ideal gas.
        let inverse_p = node.inverse_p * (node.p / p);
        let inverse_sqrt_t = node.inverse_sqrt_t * (node.t / t).sqrt();
        node.fill(GasState { p, t, inverse_p, inverse_sqrt_t });
        enthalpy[self.node] = h;
    }

    /// Returns the states at a pressure and temperature.
    pub(crate) fn start(&self, [p, t]: [P; 2], node: &GasNode<P>, common: &Common<P>) -> [P; 2] {
        if let Some(virial) = &common.gas.virial {
            return virial.initial(&common.gas, p, t, node.volume);
        }
        match self.law {
            ChamberLaw::EnergyBalance => EnergyBalance::initial(&common.gas, p, t, node.volume),
            ChamberLaw::AsPrinted => [p, t],
        }
    }

    /// Computes the rates of the states from all flows.
    #[inline(always)]
    pub(crate) fn rates<S: Over<P>>(&self, node: &mut GasNode<S>, common: &Common<P>) -> [S; 2] {
        node.heat = self.heat.flow(&wetted(node));
        let exchange = Exchange {
            m_dot: node.m_dot,
            h_dot: node.h_dot,
            volume: node.volume,
            volume_rate: node.volume_rate,
            heat: node.heat,
        };
        match self.law {
            ChamberLaw::EnergyBalance => EnergyBalance::rate(node.p, &exchange),
            ChamberLaw::AsPrinted => AsPrinted::rate(&common.gas, node.p, node.t, &exchange),
        }
    }
}

/// Returns the gas of a node with its wall.
#[inline(always)]
pub(crate) fn wetted<S: Real>(node: &GasNode<S>) -> Wetted<S> {
    Wetted {
        p: node.p,
        t: node.t,
        wall_temperature: node.wall_temperature,
        area: node.wall,
        volume: node.volume,
        volume_rate: node.volume_rate,
        m_dot: node.m_dot,
        turnover: node.turnover,
    }
}

impl<R: Lane> Volume<R> {
    /// Returns `so_far` in each lane where the volume has gas and more than the fraction `least_room` of the dead
    /// volume is left. Other lanes get -1.
    #[inline(always)]
    pub(crate) fn holds(
        &self,
        room: R::Plain,
        states: [R::Plain; 2],
        scales: [R; 2],
        least_room: R::Plain,
        so_far: R::Plain,
    ) -> R::Plain {
        let mut out = so_far;
        let mut ask = |value: R::Plain, least: R::Plain| {
            out = R::Plain::select(least.lt(value), out, -R::Plain::one());
        };
        ask(room, self.dead_volume.plain() * least_room);
        for (state, scale) in states.into_iter().zip(scales) {
            ask(state, scale.plain() * R::Plain::c(LEAST_GAS));
        }
        out
    }
}

impl<P: Lane> Part<P> for Volume<P> {
    fn states(&self) -> Vec<State> {
        let [first, second] = self.scales;
        let both = match self.law {
            ChamberLaw::EnergyBalance => {
                [State::own("mass_kg", "kg", first), State::own("internal_energy_j", "J", second)]
            }
            ChamberLaw::AsPrinted => {
                [State::own("pressure_pa", "Pa", first), State::own("temperature_k", "K", second)]
            }
        };
        both.map(|state| state.of(Of::Gas(self.node))).to_vec()
    }

    #[inline(always)]
    fn place<S: Over<P>>(&self, _y: Own<S>, net: &mut Net<S>, _common: &Common<P>) {
        self.reset(&mut net.gas[self.node]);
    }

    #[inline(always)]
    fn potential<S: Over<P>>(&self, y: Own<S>, net: &mut Net<S>, common: &Common<P>) {
        let node = &mut net.gas[self.node];
        self.fill(y.first(), node, common);
        self.fill_real(y.first(), node, &mut net.enthalpy, common);
    }

    #[inline(always)]
    fn rate<S: Over<P>>(&self, _y: Own<S>, mut dy: OwnMut<S>, net: &mut Net<S>, common: &Common<P>) {
        dy.set(self.rates(&mut net.gas[self.node], common));
    }

    fn begin(&self, given: &Given<P>, mut y: OwnMut<P>, net: &Net<P>, common: &Common<P>) {
        if let Some(gas) = given.gas(self.starts_as) {
            y.set(self.start(gas, &net.gas[self.node], common));
        }
    }

    fn stored<S: Over<P>>(&self, _y: Own<S>, net: &Net<S>, common: &Common<P>) -> [S; 3] {
        let node = &net.gas[self.node];
        if let Some(virial) = &common.gas.virial {
            let [m, u] = virial.initial(&common.gas, node.p, node.t, node.volume);
            return [m, u, m * specific_entropy(node.t, node.p, common)];
        }
        let m = node.p * node.volume / (S::from(common.gas.gas_constant) * node.t);
        [m, m * S::from(common.gas.cv) * node.t, m * specific_entropy(node.t, node.p, common)]
    }

    fn channels(&self) -> Vec<(&'static str, Kind)> {
        HEAT_CHANNELS.to_vec()
    }

    fn account<S: Over<P>>(&self, _y: Own<S>, _dy: Own<S>, net: &Net<S>, _common: &Common<P>, out: &mut [S]) {
        if self.stored_wall {
            out[..3].fill(S::zero());
            return;
        }
        let node = &net.gas[self.node];
        let wall = S::from(self.wall_temperature);
        out[0] = node.heat;
        out[1] = node.heat / wall;
        out[2] = node.heat * (wall - node.t) / (wall * node.t);
    }
}
