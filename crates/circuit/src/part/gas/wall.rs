use crate::ground::{Common, Given, Kind, Net, Own, OwnMut, Part, State};
use math::{Lane, Over};
use physics::heat;

/// The wall of volumes as a heat store at one temperature:
///
///   `C T_w' = -sum Q_i + h A_out (T_amb - T_w),   Q_i = alpha A_i (T_w - T_i)            [W]`
///
/// * `C`: heat capacity, J/K.
/// * `alpha`: coefficient of heat transfer to the gas, W/(m2 K).
/// * `A_i`: wetted wall of a volume, m2.
/// * `h`: coefficient of heat transfer to the ambient air, on A_out, W/(m2 K).
///
/// The volumes then have no other heat transfer. Without a stated alpha, each volume has that of its law.
#[derive(Clone, Debug)]
pub struct Wall<P> {
    pub capacity: P,
    /// `None`: by the law of each volume.
    pub heat_transfer: Option<P>,
    /// h A_out, W/K.
    pub outward: P,
    /// Start temperature, K.
    pub start: P,
    /// Index of its temperature among the signals.
    pub signal: usize,
    pub nodes: Vec<usize>,
}

math::gather!(Wall { capacity, heat_transfer, outward, start } same { signal, nodes });

impl<P: Lane> Wall<P> {
    fn temperature<S: Over<P>>(&self, net: &Net<S>) -> S {
        net.signal[self.signal]
    }

    /// Heat into the gas of a volume, W.
    fn gas_heat<S: Over<P>>(&self, node: usize, net: &Net<S>) -> S {
        let gas = &net.gas[node];
        let Some(coefficient) = self.heat_transfer else { return gas.heat };
        heat::newton(S::from(coefficient), gas.wall, self.temperature(net), gas.t)
    }

    /// Heat from the air around, W.
    fn outer_heat<S: Over<P>>(&self, net: &Net<S>, common: &Common<P>) -> S {
        S::from(self.outward) * (S::from(common.ambient_temperature) - self.temperature(net))
    }
}

impl<P: Lane> Part<P> for Wall<P> {
    fn states(&self) -> Vec<State> {
        vec![State::own("wall_temperature_k", "K", 1.0)]
    }

    fn begin(&self, _given: &Given<P>, mut y: OwnMut<P>, _net: &Net<P>, _common: &Common<P>) {
        y.set([self.start]);
    }

    #[inline(always)]
    fn place<S: Over<P>>(&self, y: Own<S>, net: &mut Net<S>, _common: &Common<P>) {
        let [temperature] = y.first();
        net.signal[self.signal] = temperature;
        for &node in &self.nodes {
            net.gas[node].wall_temperature = temperature;
        }
    }

    #[inline(always)]
    fn exchange<S: Over<P>>(&self, net: &mut Net<S>, _common: &Common<P>) {
        let nodes = if self.heat_transfer.is_some() { &self.nodes[..] } else { &[] };
        for &node in nodes {
            let heat = self.gas_heat(node, net);
            net.gas[node].h_dot += heat;
        }
    }

    #[inline(always)]
    fn rate<S: Over<P>>(&self, _y: Own<S>, mut dy: OwnMut<S>, net: &mut Net<S>, common: &Common<P>) {
        let given = self.nodes.iter().fold(S::zero(), |sum, &node| sum + self.gas_heat(node, net));
        dy.set([(self.outer_heat(net, common) - given) / S::from(self.capacity)]);
    }

    fn stored<S: Over<P>>(&self, _y: Own<S>, net: &Net<S>, _common: &Common<P>) -> [S; 3] {
        [S::zero(), S::from(self.capacity) * self.temperature(net), S::zero()]
    }

    fn channels(&self) -> Vec<(&'static str, Kind)> {
        vec![
            ("heat from the air around", Kind::Energy),
            ("wall heat over wall temperature", Kind::EntropyIn),
            ("heat transfer", Kind::EntropyOfGas),
            ("heat transfer outside", Kind::EntropyOfSolid),
        ]
    }

    fn account<S: Over<P>>(&self, _y: Own<S>, _dy: Own<S>, net: &Net<S>, common: &Common<P>, out: &mut [S]) {
        let (wall, around) = (self.temperature(net), S::from(common.ambient_temperature));
        let from_around = self.outer_heat(net, common);
        out[0] = from_around;
        (out[1], out[2]) = (S::zero(), S::zero());
        for &node in &self.nodes {
            let (heat, gas) = (self.gas_heat(node, net), net.gas[node].t);
            out[1] += heat / wall;
            out[2] += heat * (wall - gas) / (wall * gas);
        }
        out[3] = from_around * (around - wall) / (around * wall);
    }
}
