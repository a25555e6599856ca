use crate::ground::{Between, Net, Part, gathered};
use math::{Over, Real};
use physics::flow::Iso6358;
use std::slice;

gathered! {
    /// Restrictions in series as one flow path. The series rule depends on the order in which gas passes the
    /// restrictions, so each direction has a separate law.
    pub struct Series {
        numbers {}
        laws { forward: Iso6358, backward: Iso6358 }
        same { path: Between }
    }
}

impl<P: Real> Part<P> for Series<P> {
    fn paths(&self) -> &[Between] {
        slice::from_ref(&self.path)
    }

    #[inline(always)]
    fn flow<S: Over<P>>(&self, _path: usize, net: &Net<S>) -> (S, S::Mask) {
        let (one, two) = (&net[self.path.from], &net[self.path.to]);
        let through = |law: &Iso6358<P>| law.flow(S::one(), &one.end(), &two.end());
        let ((ahead, is_backward), (back, _)) = (through(&self.forward), through(&self.backward));
        (S::select(is_backward, back, ahead), is_backward)
    }
}
