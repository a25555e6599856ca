use crate::ground::{Between, Common, Net, Part, inputs, one_path, post, post_ideal};
use math::{Lane, Over, Real};
use physics::flow::Iso6358;

/// A component that throttles the flow between two gas nodes: an edge of a valve, a fitting, a leak.
/// `USUAL` states that its gas is ideal: the circuit then handles it itself while it is open.
#[derive(Clone, Debug)]
pub struct Restriction<P, const USUAL: bool = true> {
    /// The flow at full opening.
    pub law: Iso6358<P>,
    /// Opening, 0 to 1: the fraction of the full conductance. An input: it may change at any time.
    pub opening: P,
    /// Whether no flow passes in any lane.
    pub(crate) closed: bool,
    /// Its ends.
    pub path: Between,
}

/// A restriction with a real gas. The circuit handles it in the exchange of the other kinds.
pub type OtherRestriction<P> = Restriction<P, false>;

math::gather!(Restriction [const USUAL: bool] { law, opening } same { path } of {
    closed: |each: &[&Self]| each.iter().all(|part| part.closed),
});

/// Returns the flow with a gain. A restriction may be shut in this lane but open in another one. Its flow
/// is then exactly zero, even at a trial state whose flow is NaN.
#[inline(always)]
pub(crate) fn passing<P: Real, S: Over<P>>(m_dot: S, gain: P) -> S {
    let is_number = m_dot.abs().lt(S::c(f64::INFINITY));
    let none = S::select(is_number, m_dot, S::zero());
    S::select(S::zero().lt(S::from(gain)), m_dot, none)
}

impl<P: Lane, const USUAL: bool> Restriction<P, USUAL> {
    /// Gain of its law at its opening.
    #[inline(always)]
    pub(crate) fn gain(&self) -> P {
        self.opening * self.law.gain
    }

    #[inline(always)]
    pub(crate) fn pass<S: Over<P>>(&self, net: &mut Net<S>) {
        post_ideal(net, self.path, self.flow(0, net));
    }
}

impl<P: Lane, const USUAL: bool> Part<P> for Restriction<P, USUAL> {
    inputs! { opening: "opening", "1", physics::within(0.0, 1.0) }

    one_path!(path);

    #[inline(always)]
    fn flow<S: Over<P>>(&self, _path: usize, net: &Net<S>) -> (S, S::Mask) {
        let (one, two) = (&net[self.path.from], &net[self.path.to]);
        let (one, two) = (one.end(), two.end());
        let backward = one.p.lt(two.p);
        let choked = self.law.choked(backward, &one, &two).times(self.gain());
        let m_dot = choked * self.law.share(backward, &one, &two);
        (passing(m_dot, self.gain()), backward)
    }

    #[inline(always)]
    fn exchange<S: Over<P>>(&self, net: &mut Net<S>, _common: &Common<P>) {
        if !USUAL {
            post(net, self.path, self.flow(0, net));
        }
    }

    fn rests(&self) -> bool {
        self.closed
    }
}
