use crate::ground::{Between, Net, Part, gathered};
use math::{Over, Real};
use physics::flow::Laminar;
use std::slice;

gathered! {
    /// A narrow gap with a leak. See [`Laminar`].
    pub struct Gap {
        numbers {}
        laws { law: Laminar }
        same { path: Between }
    }
}

impl<P: Real> Part<P> for Gap<P> {
    fn paths(&self) -> &[Between] {
        slice::from_ref(&self.path)
    }

    #[inline(always)]
    fn flow<S: Over<P>>(&self, _path: usize, net: &Net<S>) -> (S, S::Mask) {
        let (one, two) = (&net[self.path.from], &net[self.path.to]);
        self.law.mass_flow([one.p, one.t], [two.p, two.t])
    }
}
