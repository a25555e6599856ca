use crate::ground::{Common, Kind, Net, Own, Part, force_on, gathered};
use crate::part::mechanics::damper;
use math::{Lane, Over};

gathered! {
    /// Spring and damper between two axes, without play: a force sensor, a coupling.
    ///
    ///   F = k (x_from - x_to) + c (v_from - v_to)              [N], in +x on `to`, -F on `from`
    pub struct Link {
        numbers { stiffness, damping }
        same { from: usize, to: usize }
    }
}

impl<P: Lane> Part<P> for Link<P> {
    /// Returns the force in +x on `to`, N.
    #[inline(always)]
    fn force<S: Over<P>>(&self, net: &Net<S>) -> S {
        let (stretch, rate) = net.apart(self.from, self.to);
        S::from(self.stiffness) * stretch + S::from(self.damping) * rate
    }

    force_on!(to, from);

    fn stored<S: Over<P>>(&self, _y: Own<S>, net: &Net<S>, _common: &Common<P>) -> [S; 3] {
        let (stretch, _) = net.apart(self.from, self.to);
        [S::zero(), S::c(0.5) * S::from(self.stiffness) * stretch * stretch, S::zero()]
    }

    fn channels(&self) -> Vec<(&'static str, Kind)> {
        damper::CHANNELS.to_vec()
    }

    fn account<S: Over<P>>(&self, _y: Own<S>, _dy: Own<S>, net: &Net<S>, common: &Common<P>, out: &mut [S]) {
        let (_, speed) = net.apart(self.from, self.to);
        damper::account(S::from(self.damping) * speed * speed, common, out);
    }
}
