use crate::ground::{Between, Common, Net, Part, clip, gathered, one_path, post};
use math::{Lane, Over, Real};
use physics::flow::Iso6358;

gathered! {
    /// A plunger on a piston that enters a bore in the cover and shuts the direct path out of the chamber. The volume
    /// that it displaces goes to the port behind the bore:
    ///
    ///   `V_chamber -= A_b (s - q),   V_port += A_b (s - q),   F_s = (p_port - p_chamber) A_b (1 - q')`
    ///
    /// * `s`: distance of the piston from the cover, m.
    /// * `A_b`: area of the plunger, m2.
    /// * `l`: length of the plunger: it enters at s = l, m.
    /// * `q`: distance of the plunger from the bore, s - l, m. Zero for s < l - w/2, and a parabola over the width w around s = l.
    /// * `F_s`: force on the piston away from the cover, in addition to the force of its face, N.
    ///
    /// The bore passes the fraction q/(q + w) of its conductance. The forces are the pressures times the derivatives of
    /// the same volumes, so that energy is conserved exactly.
    pub struct Cushion {
        numbers {
            area,
            length,
            /// Width w of the transition, m.
            transition,
            /// Position of the cover: zero, or the stroke, m.
            offset,
        }
        laws { bore: Iso6358 }
        same {
            axis: usize,
            /// Whether the chamber grows with x (side a).
            grows: bool,
            /// Path from the chamber to the port.
            path: Between,
        }
    }
}

impl<P: Lane> Cushion<P> {
    fn signed<S: Real>(&self, value: S) -> S {
        if self.grows { value } else { -value }
    }

    /// Returns (s, q, q') of the piston at a position.
    fn stands<S: Over<P>>(&self, x: S) -> [S; 3] {
        let (s, w) = (S::from(self.offset) + self.signed(x), S::from(self.transition));
        let half = S::c(0.5);
        let out = s - S::from(self.length);
        let slope = clip(out / w + half);
        [s, (half * w * slope).fma(slope, (out - half * w).max(S::zero())), slope]
    }
}

impl<P: Lane> Part<P> for Cushion<P> {
    #[inline(always)]
    fn shape<S: Over<P>>(&self, net: &mut Net<S>) {
        let axis = &net.axis[self.axis];
        let [s, q, slope] = self.stands(axis.x);
        let area = S::from(self.area);
        let (taken, rate) = (area * (s - q), area * (S::one() - slope) * self.signed(axis.v));
        let Between { from, to, .. } = self.path;
        for (node, sign) in [(from, -S::one()), (to, S::one())] {
            let node = &mut net.gas[node.0];
            node.volume = sign.fma(taken, node.volume);
            node.volume_rate = sign.fma(rate, node.volume_rate);
        }
    }

    one_path!(path);

    #[inline(always)]
    fn flow<S: Over<P>>(&self, _path: usize, net: &Net<S>) -> (S, S::Mask) {
        let (one, two) = (&net[self.path.from], &net[self.path.to]);
        let [_, q, _] = self.stands(net.axis[self.axis].x);
        let share = q / (q + S::from(self.transition));
        self.bore.flow(share, &one.end(), &two.end())
    }

    #[inline(always)]
    fn exchange<S: Over<P>>(&self, net: &mut Net<S>, _common: &Common<P>) {
        post(net, self.path, self.flow(0, net));
        let above = net[self.path.to].p - net[self.path.from].p;
        let axis = &mut net.axis[self.axis];
        let [_, _, slope] = self.stands(axis.x);
        axis.force += self.signed(above * S::from(self.area) * (S::one() - slope));
    }
}
