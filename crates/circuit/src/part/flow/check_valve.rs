use crate::ground::{Between, Net, Part, gathered, one_path};
use math::{Lane, Over};
use physics::flow::Iso6358;

gathered! {
    /// A flow path that opens without a command in one direction. See [`Iso6358::one_way`].
    pub struct CheckValve {
        numbers {
            /// Pressure difference at which it opens, Pa.
            cracking_pressure,
        }
        laws { law: Iso6358 }
        same { path: Between }
    }
}

impl<P: Lane> Part<P> for CheckValve<P> {
    one_path!(path);

    #[inline(always)]
    fn flow<S: Over<P>>(&self, _path: usize, net: &Net<S>) -> (S, S::Mask) {
        let (one, two) = (&net[self.path.from], &net[self.path.to]);
        let m_dot = self.law.one_way(S::from(self.cracking_pressure), one.p, one.inverse_sqrt_t, two.p);
        (m_dot, m_dot.lt(S::zero())) // never backward
    }
}
