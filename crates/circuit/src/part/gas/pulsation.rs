use crate::ground::{Common, GasId, Given, Input, Net, Own, OwnMut, Part, State, gathered};
use math::{Over, Real};

gathered! {
    /// A reservoir whose pressure oscillates about a mean, p = p_m + A s. Two additional states keep time out of the
    /// equations:
    ///
    ///   `s' = w c,   c' = -w s                            s = sin(w t),  c = cos(w t)`
    ///
    /// * `A`: amplitude, Pa.
    /// * `w`: angular frequency, rad/s.
    pub struct Pulsation {
        numbers { mean, amplitude, angular_frequency }
        laws {}
        same { node: GasId }
    }
}

impl<P: Real> Part<P> for Pulsation<P> {
    fn states(&self) -> Vec<State> {
        ["sine", "cosine"].map(|name| State::own(name, "1", 1.0)).to_vec()
    }

    fn inputs(&self) -> &'static [Input] {
        const { &[Input { name: "mean pressure", unit: "Pa", bounds: physics::above(0.0) }] }
    }

    fn input(&self, _input: usize) -> P {
        self.mean
    }

    fn input_mut(&mut self, _input: usize) -> &mut P {
        &mut self.mean
    }

    #[inline(always)]
    fn place<S: Over<P>>(&self, y: Own<S>, net: &mut Net<S>, _common: &Common<P>) {
        let [sine] = y.first();
        net.gas[self.node.0].set_pressure(S::from(self.mean) + S::from(self.amplitude) * sine);
    }

    #[inline(always)]
    fn rate<S: Over<P>>(&self, y: Own<S>, mut dy: OwnMut<S>, _net: &mut Net<S>, _common: &Common<P>) {
        let ([sine, cosine], w) = (y.first(), S::from(self.angular_frequency));
        dy.set([w * cosine, -(w * sine)]);
    }

    fn begin(&self, _given: &Given<P>, mut y: OwnMut<P>, _net: &Net<P>, _common: &Common<P>) {
        y.set([P::zero(), P::one()]);
    }
}
