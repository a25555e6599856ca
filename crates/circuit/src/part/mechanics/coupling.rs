use crate::ground::{Common, Net, Own, Part, force_on, gathered};
use crate::part::mechanics::damper;
use math::{Lane, Over};
use physics::mechanics::EndStop;

gathered! {
    /// A coupling with play between two axes. Within the play the force is zero. Beyond it, on either side, they meet
    /// as at an end stop.
    ///
    ///   F = f(z - g/2, z') - f(-z - g/2, -z'),   z = x_from - x_to          [N], in +x on `to`, -F on `from`
    pub struct Coupling {
        numbers {
            /// Play g between both sides, m.
            play,
        }
        laws { law: EndStop }
        same { from: usize, to: usize }
    }
}

impl<P: Lane> Coupling<P> {
    fn spring_energy<S: Over<P>>(&self, net: &Net<S>) -> S {
        let depth = (net.apart(self.from, self.to).0.abs() - S::c(0.5) * S::from(self.play)).max(S::zero());
        S::c(0.5) * S::from(self.law.stiffness) * depth * depth
    }
}

impl<P: Lane> Part<P> for Coupling<P> {
    fn force<S: Over<P>>(&self, net: &Net<S>) -> S {
        let (z, rate) = net.apart(self.from, self.to);
        let half = S::c(0.5) * S::from(self.play);
        self.law.force(z - half, rate) - self.law.force(-z - half, -rate)
    }

    force_on!(to, from);

    damper::springs!(spring_energy);

    fn account<S: Over<P>>(&self, _y: Own<S>, _dy: Own<S>, net: &Net<S>, common: &Common<P>, out: &mut [S]) {
        damper::account(self.force(net) * net.apart(self.from, self.to).1, common, out);
    }
}
