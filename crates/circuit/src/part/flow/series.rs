use crate::ground::{Between, Common, Kind, Net, Own, Part, log, one_path, path};
use crate::part::gas::volume::HEAT_CHANNELS;
use math::{Lane, Over};
use physics::flow::Iso6358;
use physics::heat::Heat;

/// Wall of a steady tube, which brings the gas that passes to its temperature:
///
///   `T_out = T_w + (T_in - T_w) exp(-NTU),   NTU = A h/(m' cp)`
///
/// A wall, m2; h heat-transfer coefficient at the mass flow m'.
#[derive(Clone, Debug)]
pub struct TubeWall<P> {
    /// Heat transfer; the law of a tube, or a constant coefficient.
    pub heat: Heat<P>,
    /// Area of the wall, m2.
    pub area: P,
    /// Its temperature, K.
    pub temperature: P,
}

/// Restrictions in series as one flow path, with the walls of their tubes. The series rule depends on the order in which
/// gas passes the restrictions, so each direction has a separate law.
#[derive(Clone, Debug)]
pub struct Series<P> {
    /// Law of the flow in the direction of the path.
    pub forward: Iso6358<P>,
    /// Law of the flow against it; `None`: the same.
    pub backward: Option<Iso6358<P>>,
    /// Walls in the direction of the path.
    pub walls: Vec<TubeWall<P>>,
    /// Its ends.
    pub path: Between,
}

/// Least mass flow in the number of transfer units, kg/s, so that gas at rest has a number.
const LEAST_FLOW: f64 = 1e-9;

math::gather!(TubeWall { heat, area, temperature });
math::gather!(Series { forward, backward, walls } same { path });

impl<P: Lane> Series<P> {
    /// Returns the heat from the walls into the gas that passes, W, the heat over the temperature of its wall, W/K, and
    /// the temperature behind the walls, K. Gas that leaves the circuit takes no heat.
    fn warm<S: Over<P>>(&self, net: &Net<S>, (m_dot, backward): (S, S::Mask), common: &Common<P>) -> [S; 3] {
        let (one, two) = (&net[self.path.from], &net[self.path.to]);
        let entry = S::select(backward, two.t, one.t);
        let capacity = m_dot.abs().times(common.gas.cp);
        let least = S::from(common.gas.cp).times(P::c(LEAST_FLOW));
        let mut t = entry;
        let (mut heat, mut over_wall) = (S::zero(), S::zero());
        for wall in &self.walls {
            let coefficient = match &wall.heat {
                Heat::Pipe(pipe) => pipe.coefficient(m_dot.abs()),
                Heat::Newton(coefficient) => S::from(*coefficient),
                Heat::Film(_) => unreachable!("a tube"),
            };
            let units = coefficient.times(wall.area) / (capacity + least);
            let (before, wall) = (t, S::from(wall.temperature));
            t = (t - wall).fma((-units).exp(), wall);
            let own = capacity * (t - before);
            heat += own;
            over_wall += own / wall;
        }
        let [from, to] = self.path.boundary;
        let kept = |is_boundary: bool, value: S| if is_boundary { S::zero() } else { value };
        let of = |value: S| S::select(backward, kept(from, value), kept(to, value));
        [of(heat), of(over_wall), t]
    }
}

impl<P: Lane> Part<P> for Series<P> {
    one_path!(path);

    #[inline(always)]
    fn flow<S: Over<P>>(&self, _path: usize, net: &Net<S>) -> (S, S::Mask) {
        let (one, two) = (&net[self.path.from], &net[self.path.to]);
        let through = |law: &Iso6358<P>| law.flow(S::one(), &one.end(), &two.end());
        let (ahead, is_backward) = through(&self.forward);
        let Some(backward) = &self.backward else { return (ahead, is_backward) };
        (S::select(is_backward, through(backward).0, ahead), is_backward)
    }

    #[inline(always)]
    fn exchange<S: Over<P>>(&self, net: &mut Net<S>, common: &Common<P>) {
        let flow = self.flow(0, net);
        path::post(net, self.path, flow);
        if self.walls.is_empty() {
            return;
        }
        let [heat, ..] = self.warm(net, flow, common);
        net.gas[self.path.from.0].h_dot += S::select(flow.1, heat, S::zero());
        net.gas[self.path.to.0].h_dot += S::select(flow.1, S::zero(), heat);
    }

    fn channels(&self) -> Vec<(&'static str, Kind)> {
        let mut all = path::CHANNELS.to_vec();
        if !self.walls.is_empty() {
            all.extend(HEAT_CHANNELS);
        }
        all
    }

    fn account<S: Over<P>>(&self, _y: Own<S>, _dy: Own<S>, net: &Net<S>, common: &Common<P>, out: &mut [S]) {
        let flow = self.flow(0, net);
        path::throttling(net, self.path, flow, common, out);
        if self.walls.is_empty() {
            return;
        }
        let (one, two) = (&net[self.path.from], &net[self.path.to]);
        let [before, receiver] =
            [[one.t, two.t], [two.t, one.t]].map(|[ahead, back]| S::select(flow.1, back, ahead));
        let [heat, over_wall, after] = self.warm(net, flow, common);
        (out[5], out[6]) = (heat, over_wall);
        out[7] = heat / receiver - over_wall;
        if common.gas.virial.is_none() {
            // The gas mixes behind the walls, at their end's temperature.
            let mixed = |t: S| t / receiver - log(t / receiver);
            let more = flow.0.abs().times(common.gas.cp) * (mixed(after) - mixed(before));
            let is_kept = S::zero().lt(heat.abs());
            let more = S::select(is_kept, more, S::zero());
            out[4] += more;
            out[7] -= more;
        }
    }
}
