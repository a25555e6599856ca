use crate::ground::{Between, Net, Part, gathered, one_path};
use math::{Lane, Over};
use physics::flow::{Iso6358, opened};

gathered! {
    /// An edge of a valve that opens with a position:
    ///
    ///   `s = clip(offset + slope x, 0, 1) + leak`
    ///
    /// * `x`: position of the spool or the armature, a signal.
    /// * `leak`: leaking fraction of the conductance, a signal, if there is leakage.
    pub struct Edge {
        numbers { offset, slope }
        laws { law: Iso6358 }
        same { signal: usize, leak: Option<usize>, path: Between }
    }
}

impl<P: Lane> Part<P> for Edge<P> {
    one_path!(path);

    #[inline(always)]
    fn flow<S: Over<P>>(&self, _path: usize, net: &Net<S>) -> (S, S::Mask) {
        let (one, two) = (&net[self.path.from], &net[self.path.to]);
        let x = net.signal[self.signal];
        let mut share = opened(S::from(self.offset), S::from(self.slope), x);
        if let Some(leak) = self.leak {
            share += net.signal[leak];
        }
        self.law.flow(share, &one.end(), &two.end())
    }
}
