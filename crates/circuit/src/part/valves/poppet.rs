use crate::ground::{Between, GasId, Net, Part, clip, gathered, one_path};
use math::{Lane, Over};
use physics::flow::Iso6358;

gathered! {
    /// The poppet of a piloted check valve: a flow path with the opening fraction
    ///
    ///   `s = clip((p1 - p2 + a max(p_x - p_amb, 0) - p_c)/dp_full, 0, 1)`
    ///
    /// * `a`: area of the pilot piston relative to the seat.
    /// * `p_x`: pressure at `pilot`, Pa. The other side of the pilot piston is open to the ambient air, and it only pushes.
    /// * `p_c`: cracking pressure, Pa.
    /// * `dp_full`: rise above it at which the poppet is fully open, Pa.
    pub struct Poppet {
        numbers { pilot_ratio, cracking_pressure, full_opening_rise, ambient_pressure }
        laws { law: Iso6358 }
        same { pilot: GasId, path: Between }
    }
}

impl<P: Lane> Part<P> for Poppet<P> {
    one_path!(path);

    #[inline(always)]
    fn flow<S: Over<P>>(&self, _path: usize, net: &Net<S>) -> (S, S::Mask) {
        let (pilot, one, two) = (&net[self.pilot], &net[self.path.from], &net[self.path.to]);
        let push = (pilot.p - S::from(self.ambient_pressure)).max(S::zero());
        let lift = one.p - two.p + S::from(self.pilot_ratio) * push - S::from(self.cracking_pressure);
        let share = clip(lift / S::from(self.full_opening_rise));
        self.law.flow(share, &one.end(), &two.end())
    }
}
