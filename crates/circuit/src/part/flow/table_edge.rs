use crate::ground::{Between, Net, Part, gathered, one_path};
use math::{Lane, Over};
use physics::curve::Curve;
use physics::flow::Iso6358;

gathered! {
    /// An edge of a valve whose conductance and critical pressure ratio are given over the position x of the spool:
    ///
    ///   `C = C_max s(x),   b = b(x)`
    ///
    /// * `C_max`: largest given conductance, which is the one of the law, m3/(s Pa).
    /// * `s`: fraction of C_max, a curve through points.
    /// * `b`: critical pressure ratio, a curve through points.
    pub struct TableEdge {
        numbers {}
        laws { law: Iso6358, share: Curve, ratio: Curve }
        same { signal: usize, path: Between }
    }
}

impl<P: Lane> Part<P> for TableEdge<P> {
    one_path!(path);

    fn flow<S: Over<P>>(&self, _path: usize, net: &Net<S>) -> (S, S::Mask) {
        let (one, two) = (&net[self.path.from], &net[self.path.to]);
        let x = net.signal[self.signal];
        let law = self.law.with_ratio(self.ratio.value(x));
        law.flow(self.share.value(x), &one.end(), &two.end())
    }
}
