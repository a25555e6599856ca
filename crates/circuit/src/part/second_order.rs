use super::path::gathered;
use super::{Common, Given, Input, Own, OwnMut, Part, State};
use crate::net::Net;
use math::{Over, Real};

gathered! {
    /// A pressure that follows a command:
    ///
    ///   x' = w q,   q' = w (u - x) - 2 zeta w q,   and so x'' + 2 zeta w x' + w^2 x = w^2 u
    ///
    /// u     command             Pa
    /// w     natural frequency   rad/s
    /// zeta  damping ratio       -
    pub struct SecondOrder {
        numbers { command, natural_frequency, damping_ratio }
        laws {}
        same {
            /// Where x stands among the signals.
            signal: usize,
        }
    }
}

impl<P: Real> Part<P> for SecondOrder<P> {
    fn states(&self) -> Vec<State> {
        vec![
            State { name: "set pressure", unit: "Pa", scale: 1e5 },
            State { name: "its rate over w", unit: "Pa", scale: 1e5 },
        ]
    }

    fn inputs(&self) -> &'static [Input] {
        const { &[Input { name: "command", unit: "Pa", bounds: physics::above(0.0) }] }
    }

    fn input(&self, _input: usize) -> P {
        self.command
    }

    fn input_mut(&mut self, _input: usize) -> &mut P {
        &mut self.command
    }

    #[inline(always)]
    fn place<S: Over<P>>(&self, y: Own<S>, net: &mut Net<S>, _common: &Common<P>) {
        let [x] = y.first();
        net.signal[self.signal] = x;
    }

    #[inline(always)]
    fn rate<S: Over<P>>(&self, y: Own<S>, mut dy: OwnMut<S>, _net: &mut Net<S>, _common: &Common<P>) {
        let ([x, q], w) = (y.first(), S::from(self.natural_frequency));
        let damping = S::from(P::c(2.0) * self.damping_ratio);
        dy.set([w * q, w * (S::from(self.command) - x - damping * q)]);
    }

    fn begin(&self, _given: &Given<P>, mut y: OwnMut<P>, _net: &Net<P>, _common: &Common<P>) {
        y.set([self.command, P::zero()]);
    }
}
