use super::Part;
use super::path::{Between, gathered};
use crate::net::Net;
use math::{Over, Real};
use physics::flow::{Iso6358, leaking, opened};
use std::slice;

gathered! {
    /// An edge of a valve that a position opens:
    ///
    ///   s = clip(offset + slope x, 0, 1) + l exp(-|x|/x_l)
    ///
    /// x    position of the spool or the armature, a signal   -
    /// l    share of the conductance that leaks at x = 0       -
    /// x_l  position over which the leak falls to 1/e          -
    pub struct Edge {
        numbers { offset, slope, leak, leak_width }
        laws { law: Iso6358 }
        same { signal: usize, path: Between, leaks: bool }
    }
}

impl<P: Real> Part<P> for Edge<P> {
    fn paths(&self) -> &[Between] {
        slice::from_ref(&self.path)
    }

    #[inline(always)]
    fn flow<S: Over<P>>(&self, _path: usize, net: &Net<S>) -> (S, S::Mask) {
        let (one, two) = (&net[self.path.from], &net[self.path.to]);
        let x = net.signal[self.signal];
        let mut share = opened(S::from(self.offset), S::from(self.slope), x);
        if self.leaks {
            share += leaking(S::from(self.leak), S::from(self.leak_width), x);
        }
        self.law.flow(share, &one.end(), &two.end())
    }
}
