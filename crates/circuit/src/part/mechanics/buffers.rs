//! Buffers that a mass hits from one side.

use crate::ground::{Common, Net, Own, Part, clip, gathered};
use crate::part::mechanics::damper;
use math::{Lane, Over};

/// Position of a contact that a mass hits from one side.
#[derive(Clone, Debug)]
pub struct Meets<P> {
    /// Position of the first touch, m.
    pub position: P,
    /// Whether it is hit in +x.
    pub ahead: bool,
    pub axis: usize,
}

math::gather!(Meets { position } same { ahead, axis });

impl<P: Lane> Meets<P> {
    /// Returns the penetration of the mass, m, and its rate, m/s.
    pub(crate) fn contact<S: Over<P>>(&self, net: &Net<S>) -> (S, S) {
        let axis = &net.axis[self.axis];
        let depth = axis.x - S::from(self.position);
        if self.ahead { (depth, axis.v) } else { (-depth, -axis.v) }
    }

    /// Converts a restoring force to a force in -x, N.
    pub(crate) fn force<S: Over<P>>(&self, pushes: S) -> S {
        if self.ahead { pushes } else { -pushes }
    }
}

/// Implements `Part` for a part that a mass hits. The part has a contact `meets`, a restoring force `pushes` at a
/// penetration and its rate, and springs.
macro_rules! hit_by_a_mass {
    ($part:ident) => {
        impl<P: Lane> Part<P> for $part<P> {
            fn force<S: Over<P>>(&self, net: &Net<S>) -> S {
                self.meets.force(self.pushes(self.meets.contact(net)))
            }

            #[inline(always)]
            fn exchange<S: Over<P>>(&self, net: &mut Net<S>, _common: &Common<P>) {
                let force = self.force(net);
                net.axis[self.meets.axis].force -= force;
            }

            damper::springs!(spring_energy);

            fn account<S: Over<P>>(
                &self,
                _y: Own<S>,
                _dy: Own<S>,
                net: &Net<S>,
                common: &Common<P>,
                out: &mut [S],
            ) {
                let contact = self.meets.contact(net);
                damper::account(self.pushes(contact) * contact.1, common, out);
            }
        }
    };
}

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

hit_by_a_mass!(Bumper);

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

hit_by_a_mass!(ShockAbsorber);
