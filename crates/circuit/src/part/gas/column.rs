use crate::ground::{
    Between, Common, GasNode, Kind, Net, Own, OwnMut, Part, State, first_is_a_signal, gathered, one_path,
    path,
};
use math::{Lane, Over, Real};
use physics::flow::pipe::friction;

gathered! {
    /// The gas between two cells of a line, which has inertia and friction:
    ///
    ///   `l/A m' = p1 - p2 - (f l/d + zeta) m |m|/(2 rho A^2),   rho = (rho1 + rho2)/2`
    ///   `f Re = 64 below Re = 2000, 0.3164 Re^0.75 above Re = 4000, smoothly between`
    ///
    /// Its kinetic energy l m^2/(2 rho A) is exchanged with the cell to which it flows. Friction therefore warms that
    /// cell, and energy is conserved exactly. Source of f: [modelica-straight-pipe].
    ///
    /// Gas that would leave a cell faster than sound is held back by the excess of its momentum flux rho w^2 over k p,
    /// the momentum flux at the speed of sound. A shock therefore empties no cell.
    ///
    /// * `m`: mass flow, the state, kg/s.
    /// * `A`, `d`: cross-section, diameter, m2 and m.
    /// * `l`: length, m.
    /// * `zeta`: coefficient of local loss.
    pub struct Column {
        numbers {
            /// l/A, 1/m.
            inertance,
            /// Factor from mass flow to Re, d/(A mu), s/kg.
            reynolds,
            /// Factor of f Re: mu l/(2 d^2 A), times the factor on the friction of a smooth pipe.
            friction,
            /// Factor of |m|: zeta/(2 A^2), 1/m4.
            loss,
            /// 1/A, 1/m2.
            per_area,
        }
        same {
            /// Absolute error scale of the mass flow, kg/s.
            scale: f64,
            /// Index of the mass flow among the signals.
            signal: usize,
            path: Between,
        }
    }
}

impl<P: Lane> Column<P> {
    fn ends<'n, S: Real>(&self, net: &'n Net<S>) -> [&'n GasNode<S>; 2] {
        [&net[self.path.from], &net[self.path.to]]
    }

    /// Returns the reciprocal of the mean density, m3/kg.
    #[inline(always)]
    fn specific_volume<S: Over<P>>(&self, net: &Net<S>, common: &Common<P>) -> S {
        let [one, two] = self.ends(net);
        if let Some(virial) = &common.gas.virial {
            let each = [one, two].map(|node| virial.density(&common.gas, node.p, node.t));
            return S::c(2.0) / (each[0] + each[1]);
        }
        let double = S::from(common.gas.gas_constant + common.gas.gas_constant);
        double * (one.t * two.t) / one.p.fma(two.t, two.p * one.t)
    }

    /// Rate of the mass flow, kg/s2.
    #[inline(always)]
    fn acceleration<S: Over<P>>(&self, m_dot: S, specific: S, net: &Net<S>, common: &Common<P>) -> S {
        let [one, two] = self.ends(net);
        let size = m_dot.abs();
        let of_pipe = S::from(self.friction) * friction(size * S::from(self.reynolds));
        let resists = S::from(self.loss).fma(size, of_pipe) * m_dot * specific;
        let backward = m_dot.lt(S::zero());
        let leaves = |node: &GasNode<S>| {
            let flux = S::from(self.per_area) * m_dot;
            let r_t = S::from(common.gas.gas_constant) * node.t;
            let sonic = S::from(common.gas.heat_capacity_ratio) * node.p;
            (flux * flux * r_t / node.p - sonic).max(S::zero())
        };
        let held_back = S::select(backward, -leaves(two), leaves(one));
        (one.p - two.p - resists - held_back) * S::from(P::one() / self.inertance)
    }

    /// Rate of the kinetic energy, W.
    #[inline(always)]
    fn kinetic<S: Over<P>>(&self, m_dot: S, rate: S, specific: S, net: &Net<S>) -> S {
        let [one, two] = self.ends(net);
        // Twice the rate of the density.
        let denser = one.m_dot.fma(two.volume, two.m_dot * one.volume) / (one.volume * two.volume);
        let lighter = S::c(0.25) * m_dot * denser * specific;
        S::from(self.inertance) * m_dot * specific * (rate - lighter)
    }

    /// Returns the cell to which it flows.
    fn receiver<S: Real>(&self, m_dot: S, net: &Net<S>) -> S {
        let [one, two] = self.ends(net);
        S::select(m_dot.lt(S::zero()), one.t, two.t)
    }
}

impl<P: Lane> Part<P> for Column<P> {
    fn states(&self) -> Vec<State> {
        vec![State::own("inner_flow_kg_s", "kg/s", self.scale)]
    }

    first_is_a_signal!(signal);

    one_path!(path);

    #[inline(always)]
    fn flow<S: Over<P>>(&self, _path: usize, net: &Net<S>) -> (S, S::Mask) {
        let m_dot = net.signal[self.signal];
        (m_dot, m_dot.lt(S::zero()))
    }

    /// It runs before the cells update their states.
    #[inline(always)]
    fn rate<S: Over<P>>(&self, y: Own<S>, mut dy: OwnMut<S>, net: &mut Net<S>, common: &Common<P>) {
        let [m_dot] = y.first();
        let specific = self.specific_volume(net, common);
        let rate = self.acceleration(m_dot, specific, net, common);
        let taken = self.kinetic(m_dot, rate, specific, net);
        let (backward, zero) = (m_dot.lt(S::zero()), S::zero());
        net.gas[self.path.from.0].h_dot -= S::select(backward, taken, zero);
        net.gas[self.path.to.0].h_dot -= S::select(backward, zero, taken);
        dy.set([rate]);
    }

    fn stored<S: Over<P>>(&self, y: Own<S>, net: &Net<S>, common: &Common<P>) -> [S; 3] {
        let [m_dot] = y.first();
        let energy = S::c(0.5) * S::from(self.inertance) * m_dot * m_dot * self.specific_volume(net, common);
        [S::zero(), energy, S::zero()]
    }

    fn channels(&self) -> Vec<(&'static str, Kind)> {
        path::CHANNELS.into_iter().chain([("acceleration", Kind::EntropyOfGas)]).collect()
    }

    fn account<S: Over<P>>(&self, _y: Own<S>, dy: Own<S>, net: &Net<S>, common: &Common<P>, out: &mut [S]) {
        let (flow, [rate]) = (self.flow(0, net), dy.first());
        path::throttling(net, self.path, flow, common, out);
        let taken = self.kinetic(flow.0, rate, self.specific_volume(net, common), net);
        out[5] = -taken / self.receiver(flow.0, net);
    }
}
