use crate::ground::{Between, Net, Part, gathered, one_path};
use math::{Lane, Over};
use physics::flow::Laminar;

gathered! {
    /// A narrow gap with a leak. See [`Laminar`].
    pub struct Gap {
        numbers {}
        laws { law: Laminar }
        same { path: Between }
    }
}

impl<P: Lane> Part<P> for Gap<P> {
    one_path!(path);

    #[inline(always)]
    fn flow<S: Over<P>>(&self, _path: usize, net: &Net<S>) -> (S, S::Mask) {
        let (one, two) = (&net[self.path.from], &net[self.path.to]);
        self.law.mass_flow([one.p, one.t], [two.p, two.t])
    }
}
