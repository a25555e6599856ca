//! Flow paths without states.

use crate::ground::{Between, GasId, Net, Part, clip, gathered, inputs, one_path};
use math::{Lane, Over};
use physics::curve::Curve;
use physics::flow::{FlowFormula, Iso6358, Laminar, opened};

gathered! {
    /// A flow path that opens without a command in one direction. See [`Iso6358::one_way`].
    pub struct CheckValve {
        numbers {
            /// Pressure difference at which it opens, Pa.
            cracking_pressure,
        }
        laws { law: Iso6358 }
        same { path: Between }
    }
}

impl<P: Lane> Part<P> for CheckValve<P> {
    one_path!(path);

    #[inline(always)]
    fn flow<S: Over<P>>(&self, _path: usize, net: &Net<S>) -> (S, S::Mask) {
        let (one, two) = (&net[self.path.from], &net[self.path.to]);
        let m_dot = self.law.one_way(S::from(self.cracking_pressure), one.p, one.inverse_sqrt_t, two.p);
        (m_dot, m_dot.lt(S::zero())) // never backward
    }
}

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

gathered! {
    /// A narrow gap with a leak. See [`Laminar`].
    pub struct Gap {
        numbers {}
        laws { law: Laminar }
        same { path: Between }
    }
}

impl<P: Lane> Part<P> for Gap<P> {
    one_path!(path);

    #[inline(always)]
    fn flow<S: Over<P>>(&self, _path: usize, net: &Net<S>) -> (S, S::Mask) {
        let (one, two) = (&net[self.path.from], &net[self.path.to]);
        self.law.mass_flow([one.p, one.t], [two.p, two.t])
    }
}

gathered! {
    /// A flow path whose mass flow is given by a user's formula. See [`FlowFormula`].
    pub struct FormulaPath {
        numbers {
            /// Fraction that a command opens.
            opening,
        }
        laws { law: FlowFormula }
        same { path: Between }
    }
}

impl<P: Lane> Part<P> for FormulaPath<P> {
    inputs! { opening: "opening", "1", physics::within(0.0, 1.0) }

    one_path!(path);

    fn flow<S: Over<P>>(&self, _path: usize, net: &Net<S>) -> (S, S::Mask) {
        let (one, two) = (&net[self.path.from], &net[self.path.to]);
        let m_dot = self.law.mass_flow(S::from(self.opening), [one.p, one.t], [two.p, two.t]);
        (m_dot, m_dot.lt(S::zero()))
    }
}
