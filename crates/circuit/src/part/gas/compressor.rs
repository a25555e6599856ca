use crate::ground::{
    Common, GasId, Kind, Net, Own, OwnMut, PRESSURE_TOLERANCE, Part, gathered, log, path, specific_entropy,
};
use math::{Lane, Over};

gathered! {
    /// A mass flow into a node that a pressure switch turns off above `stop_pressure` and on below `start_pressure`,
    /// Pa: `mass_flow`, kg/s, at `temperature`, K. The gas that it takes from the ambient air and its work cross the
    /// boundary.
    pub struct Compressor {
        numbers {
            mass_flow,
            temperature,
            start_pressure,
            stop_pressure,
            /// One while it runs, zero at rest.
            mode,
        }
        same {
            node: GasId,
            /// Whether the node is a reservoir, so that the delivered gas stays outside the balance.
            boundary: bool,
        }
    }
}

impl<P: Lane> Part<P> for Compressor<P> {
    /// Flow along the single path of the compressor, from outside.
    #[inline(always)]
    fn flow<S: Over<P>>(&self, _path: usize, _net: &Net<S>) -> (S, S::Mask) {
        (S::from(self.mass_flow * self.mode), S::zero().lt(S::zero()))
    }

    #[inline(always)]
    fn exchange<S: Over<P>>(&self, net: &mut Net<S>, common: &Common<P>) {
        let (m_dot, _) = self.flow(0, net);
        let t = S::from(self.temperature);
        let h_dot = match &common.gas.virial {
            None => m_dot * net.cp * t,
            Some(virial) => m_dot * virial.enthalpy(&common.gas, net[self.node].p, t),
        };
        net.gas[self.node.0].receive(m_dot, h_dot);
    }

    fn channels(&self) -> Vec<(&'static str, Kind)> {
        path::CHANNELS.into_iter().filter(|(name, _)| *name != "throttling").collect()
    }

    fn account<S: Over<P>>(&self, _y: Own<S>, _dy: Own<S>, net: &Net<S>, common: &Common<P>, out: &mut [S]) {
        let ((m_dot, _), t, node) = (self.flow(0, net), S::from(self.temperature), &net[self.node]);
        let m_dot = if self.boundary { S::zero() } else { m_dot };
        let (cp, ratio) = (S::from(common.gas.cp), t / node.t);
        let s = |t: S| specific_entropy(t, node.p, common);
        out[0] = m_dot;
        out[1] = m_dot * cp * t;
        out[2] = m_dot * s(t);
        out[3] = m_dot * cp * (ratio - S::one() - log(ratio));
        if let Some(virial) = &common.gas.virial {
            let h = |t: S| virial.enthalpy(&common.gas, node.p, t);
            out[1] = m_dot * h(t);
            out[3] = m_dot * (s(node.t) - s(t) + (h(t) - h(node.t)) / node.t);
        }
    }

    fn events(&self) -> &'static [f64] {
        &[PRESSURE_TOLERANCE]
    }

    fn event(&self, _event: usize, _y: Own<P>, net: &Net<P>) -> P {
        let p = net[self.node].p;
        P::select(self.mode.lt(P::c(0.5)), p - self.start_pressure, self.stop_pressure - p)
    }

    fn mode_mut(&mut self, _event: usize) -> &mut P {
        &mut self.mode
    }

    /// At the start it runs if the pressure is below the stop pressure, like a compressor that was just turned on.
    fn find_mode(&mut self, _event: usize, _y: OwnMut<P>, net: &Net<P>) {
        self.mode = P::select(net[self.node].p.lt(self.stop_pressure), P::one(), P::zero());
    }
}
