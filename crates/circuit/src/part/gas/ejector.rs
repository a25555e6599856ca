use crate::ground::{Between, Net, Part, clip, gathered};
use math::{Lane, Over};
use physics::flow::Iso6358;

gathered! {
    /// An ejector: a nozzle from node 1 to node 3. Its jet sucks gas from node 2 to node 3, as from a restriction in
    /// front of a pressure p_low:
    ///
    ///   `p_low = p3 + y (p_min - p3),   y = clip((p1 - p3)/dp_work, 0, 1)`
    ///
    /// * `p_min`: lowest pressure, reached without suction flow, Pa.
    /// * `dp_work`: pressure difference of the nozzle at which p_min is reached, Pa.
    pub struct Ejector {
        numbers { lowest_pressure, working_difference }
        laws { nozzle: Iso6358, suction: Iso6358 }
        same {
            /// Flow paths of the nozzle and the suction.
            paths: [Between; 2],
        }
    }
}

impl<P: Lane> Part<P> for Ejector<P> {
    fn paths(&self) -> &[Between] {
        &self.paths
    }

    #[inline(always)]
    fn flow<S: Over<P>>(&self, path: usize, net: &Net<S>) -> (S, S::Mask) {
        let (supply, out) = (&net[self.paths[0].from], &net[self.paths[0].to]);
        let one = S::one();
        if path == 0 {
            return self.nozzle.mass_flow(one, supply.p, supply.inverse_sqrt_t, out.p, out.inverse_sqrt_t);
        }
        let vacuum = &net[self.paths[1].from];
        let works = clip((supply.p - out.p) / S::from(self.working_difference));
        let low = out.p + works * (S::from(self.lowest_pressure) - out.p);
        self.suction.mass_flow(one, vacuum.p, vacuum.inverse_sqrt_t, low, out.inverse_sqrt_t)
    }
}
