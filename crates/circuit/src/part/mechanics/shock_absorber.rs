use crate::ground::{Common, Net, Own, Part, clip, gathered};
use crate::part::mechanics::damper;
use crate::part::mechanics::damper::Meets;
use math::{Lane, Over};

gathered! {
    /// A shock absorber: oil through holes during compression, a return spring, and its body behind.
    ///
    ///   `F = (F_0 + c v^2 [v > 0]) min(s/s_0, 1) + k s + k_b (s - S) [s > S],   c = c_0 + (c_1 - c_0) s/S      [N]`
    ///
    /// * `s`: compression, from x_0 on in +x or in -x, m.
    /// * `v`: speed of compression, m/s.
    /// * `F_0`, `k`: preload and stiffness of its spring, N and N/m.
    /// * `s_0`: depth over which the force builds up at the first touch, m.
    /// * `c_0`, `c_1`: damping at the start and at the end of its stroke S, N s2/m2.
    /// * `k_b`: stiffness of its body, N/m.
    ///
    /// The mass is not attached to it. A mass that moves back leaves the absorber, which is extended again at the next
    /// contact.
    pub struct ShockAbsorber {
        numbers { stroke, preload, contact_depth, stiffness, damping, end_damping, body_stiffness }
        laws { meets: Meets }
    }
}

impl<P: Lane> ShockAbsorber<P> {
    /// Depth beyond its stroke.
    fn beyond<S: Over<P>>(&self, depth: S) -> S {
        (depth - S::from(self.stroke)).max(S::zero())
    }

    /// Returns the restoring force, N.
    fn pushes<S: Over<P>>(&self, (depth, closing): (S, S)) -> S {
        let (s, v) = (depth.max(S::zero()), closing.max(S::zero()));
        let [preload, k, c, c_end, body] =
            [self.preload, self.stiffness, self.damping, self.end_damping, self.body_stiffness].map(S::from);
        let along = clip(s / S::from(self.stroke));
        let first = clip(s / S::from(self.contact_depth));
        first * (preload + (c + (c_end - c) * along) * v * v) + k * s + body * self.beyond(s)
    }

    fn spring_energy<S: Over<P>>(&self, net: &Net<S>) -> S {
        let s = self.meets.contact(net).0.max(S::zero());
        let half = S::c(0.5);
        let [preload, k, body, w] =
            [self.preload, self.stiffness, self.body_stiffness, self.contact_depth].map(S::from);
        let first = s.min(w);
        let beyond = self.beyond(s);
        preload * (half * first * first / w + (s - first)) + half * (k * s * s + body * beyond * beyond)
    }
}

damper::hit_by_a_mass!(ShockAbsorber);
