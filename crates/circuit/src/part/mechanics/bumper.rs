use crate::ground::{Common, Net, Own, Part, gathered};
use crate::part::mechanics::damper;
use crate::part::mechanics::damper::Meets;
use math::{Lane, Over};

gathered! {
    /// An elastomer that a mass hits, by Hunt and Crossley:
    ///
    ///   `F = F_r (d/d_r)^n (1 + lambda d'),  not below zero                    [N]`
    ///
    /// * `d`: depth, from x_0 on in +x or in -x, m.
    /// * `F_r`: static force at the depth d_r, N.
    /// * `n`: exponent.
    /// * `lambda`: damping, in proportion to the static force, s/m.
    pub struct Bumper {
        numbers { rated_force, rated_depth, exponent, damping }
        laws { meets: Meets }
    }
}

/// Least effective depth as a fraction of the rated depth. Its force is below any tolerance, and a power of this depth
/// still has a slope.
const LEAST_DEPTH: f64 = 1e-12;

impl<P: Lane> Bumper<P> {
    /// Static force at a depth, N.
    fn rests<S: Over<P>>(&self, depth: S) -> S {
        let share = (depth / S::from(self.rated_depth)).max(S::c(LEAST_DEPTH));
        let force = S::from(self.rated_force) * share.pow(S::from(self.exponent));
        S::select(S::zero().lt(depth), force, S::zero())
    }

    /// Force that pushes back, N.
    fn pushes<S: Over<P>>(&self, (depth, closing): (S, S)) -> S {
        self.rests(depth) * S::from(self.damping).fma(closing, S::one()).max(S::zero())
    }

    fn spring_energy<S: Over<P>>(&self, net: &Net<S>) -> S {
        let (depth, _) = self.meets.contact(net);
        self.rests(depth) * depth / (S::from(self.exponent) + S::one())
    }
}

damper::hit_by_a_mass!(Bumper);
