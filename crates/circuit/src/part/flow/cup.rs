use crate::ground::{Between, GasId, Net, Part, clip, gathered, one_path};
use math::{Lane, Over};
use physics::flow::Iso6358;

gathered! {
    /// The cup of a quick exhaust valve: a flow path that opens as the pressure before it rises above that at `pilot`:
    ///
    ///   `s = 3 u^2 - 2 u^3,   u = clip((p_from - p_pilot)/dp, 0, 1)`
    ///
    /// * `dp`: difference at which it is fully open, Pa.
    pub struct Cup {
        numbers { switching_pressure }
        laws { law: Iso6358 }
        same { pilot: GasId, path: Between }
    }
}

impl<P: Lane> Part<P> for Cup<P> {
    one_path!(path);

    #[inline(always)]
    fn flow<S: Over<P>>(&self, _path: usize, net: &Net<S>) -> (S, S::Mask) {
        let (pilot, one, two) = (&net[self.pilot], &net[self.path.from], &net[self.path.to]);
        let u = clip((one.p - pilot.p) / S::from(self.switching_pressure));
        let share = u * u * (S::c(3.0) - S::c(2.0) * u);
        self.law.flow(share, &one.end(), &two.end())
    }
}
