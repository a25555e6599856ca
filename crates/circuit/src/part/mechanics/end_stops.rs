use crate::ground::{AxisNode, Common, Net, Own, Part};
use crate::part::mechanics::damper;
use math::{Gather, Lane, Over};
use physics::mechanics::EndStop;

/// An end stop at x = 0 and one at x = stroke.
#[derive(Clone, Debug)]
pub struct EndStops<P> {
    /// Parameters of the force of either stop.
    pub law: EndStop<P>,
    /// Covers behind stops that can be fully compressed.
    pub covers: Option<Covers<P>>,
    /// Stroke, m.
    pub stroke: P,
    /// Index of the axis of the piston in the net.
    pub axis: usize,
    /// Design data of stops without described values.
    pub(crate) follows: Option<Box<Follows<P>>>,
}

/// Growth of a default stop with a start pressure above the supply pressure.
#[derive(Clone, Debug)]
pub(crate) struct Follows<P> {
    /// The stop for a start without excess pressure.
    pub law: EndStop<P>,
    /// Whether the damping of the stop is derived, too.
    pub damped: bool,
    /// Highest pressure of the supplies, Pa absolute.
    pub supply: P,
    /// Stiffness for each Pa above it, N/(m Pa).
    pub rise: P,
    /// Highest pressure of the start if it is larger, Pa absolute.
    pub start: P,
}

impl<P: Lane> Follows<P> {
    /// Returns the stop for the highest pressure of a start, Pa absolute. The damping ratio does not change.
    pub fn law(&self, start: P) -> EndStop<P> {
        let EndStop { stiffness, damping, damping_depth } = self.law.clone();
        let more = self.rise * (start - self.supply).max(P::zero());
        let damping = if self.damped { damping * (P::one() + more / stiffness).sqrt() } else { damping };
        EndStop { stiffness: stiffness + more, damping, damping_depth }
    }
}

/// The covers of a cylinder: a second contact, in addition to the stop, at a greater depth. It is omitted from the
/// equations until a step would end there. In normal operation it has no cost and does not change results.
#[derive(Clone, Debug)]
pub struct Covers<P> {
    pub law: EndStop<P>,
    /// Depth at which the contact begins, m, behind the stops at x = 0 and at x = stroke.
    pub behind: [P; 2],
    /// Fraction of the dead volume that remains there, -.
    pub left: f64,
    /// The depths in the lanes with active covers. Infinite in the other lanes.
    met: [P; 2],
    awake: bool,
}

impl<P: Lane> Covers<P> {
    pub fn new(law: EndStop<P>, behind: [P; 2], left: f64) -> Self {
        Covers { law, behind, left, met: [P::c(f64::INFINITY); 2], awake: false }
    }
}

math::gather!(Follows { law, supply, rise, start } same { damped });

math::gather!(EndStops { law, stroke, follows } same { axis } of {
    covers: |each: &[&Self]| each.iter().any(|part| part.covers.is_some()).then(|| Covers::gather(each)),
});

impl<R: Lane> Covers<R> {
    /// Depth of a lane without covers.
    fn gather(each: &[&EndStops<f64>]) -> Self {
        let own: Vec<_> = each.iter().map(|part| part.covers.as_ref()).collect();
        let laws: Vec<_> =
            own.iter().zip(each).map(|(own, part)| own.map_or(&part.law, |covers| &covers.law)).collect();
        let behind = |lane: usize, end: usize| own[lane].map_or(f64::INFINITY, |covers| covers.behind[end]);
        let behind = [0, 1].map(|end| R::from_lanes(|lane| behind(lane, end)));
        let met = |lane: usize, end: usize| own[lane].map_or(f64::INFINITY, |covers| covers.met[end]);
        let left = own.iter().flatten().map(|covers| covers.left).next();
        Covers {
            met: [0, 1].map(|end| R::from_lanes(|lane| met(lane, end))),
            awake: own.iter().flatten().any(|covers| covers.awake),
            ..Covers::new(EndStop::gather(&laws), behind, left.expect("covers in some lane"))
        }
    }
}

impl<R: Lane> EndStops<R> {
    /// Designs a derived stop for the highest pressure of a start, Pa absolute.
    pub(crate) fn lay_out(&mut self, start: R) {
        if let Some(follows) = &mut self.follows {
            follows.start = follows.supply.max(start);
            self.law = follows.law(start);
        }
    }

    /// Adds the covers to the equations of a lane.
    pub(crate) fn meet(&mut self, lane: usize) {
        if let Some(covers) = &mut self.covers {
            for (met, behind) in covers.met.iter_mut().zip(&covers.behind) {
                met.take(lane, behind);
            }
            covers.awake = true;
        }
    }
}

impl<P: Lane> Covers<P> {
    /// Returns the penetration into the cover behind a stop, for a piston in contact with the stop.
    fn depth<S: Over<P>>(&self, depth: S, direction: S) -> S {
        let [at_a, at_b] = self.met.map(S::from);
        depth - S::select(direction.lt(S::zero()), at_b, at_a)
    }

    #[inline(never)]
    fn force<S: Over<P>>(&self, depth: S, closing: S, direction: S) -> S {
        self.law.force(self.depth(depth, direction), closing)
    }
}

impl<P: Lane> EndStops<P> {
    /// Returns (penetration, closing speed) of the nearer stop, and its direction of push.
    #[inline(always)]
    fn contact<S: Over<P>>(&self, x: S, v: S) -> (S, S, S) {
        let over = x - S::from(self.stroke);
        let far = (-x).lt(over);
        (S::select(far, over, -x), S::select(far, v, -v), S::select(far, -S::one(), S::one()))
    }

    fn spring_energy<S: Over<P>>(&self, net: &Net<S>) -> S {
        let node = &net.axis[self.axis];
        let (depth, _, direction) = self.contact(node.x, node.v);
        let energy = |law: &EndStop<P>, depth: S| {
            let depth = depth.max(S::zero());
            S::c(0.5) * S::from(law.stiffness) * depth * depth
        };
        let stop = energy(&self.law, depth);
        let cover = self.covers.as_ref().map(|covers| energy(&covers.law, covers.depth(depth, direction)));
        cover.map_or(stop, |cover| stop + cover)
    }

    /// Returns the restoring force, N, of the stop and of the cover behind it.
    #[inline(always)]
    fn force<S: Over<P>>(&self, (depth, closing, direction): (S, S, S)) -> S {
        let stop = self.law.force(depth, closing);
        match &self.covers {
            Some(covers) if covers.awake => stop + covers.force(depth, closing, direction),
            _ => stop,
        }
    }

    /// Returns the distance from `x` to each of the stops, m.
    pub(crate) fn ahead(&self, x: P) -> [P; 2] {
        [x, self.stroke - x]
    }

    /// Adds the force of the stops to the axis.
    #[inline(always)]
    pub(crate) fn push<S: Over<P>>(&self, node: &mut AxisNode<S>) {
        let contact = self.contact(node.x, node.v);
        node.end_stop = contact.2 * self.force(contact);
        node.force += node.end_stop;
    }
}

impl EndStops<f64> {
    /// Returns depth, m, and restoring force, N, of the touched stop.
    pub(crate) fn pressed(&self, x: f64, v: f64) -> (f64, f64) {
        let contact = self.contact(x, v);
        (contact.0.max(0.0), self.force(contact))
    }

    /// Returns whether a piston at this depth in the stop presses on the cover.
    pub(crate) fn in_cover(&self, depth: f64, at_b: bool) -> bool {
        self.covers.as_ref().is_some_and(|covers| depth > covers.behind[usize::from(at_b)])
    }
}

impl<P: Lane> Part<P> for EndStops<P> {
    #[inline(always)]
    fn exchange<S: Over<P>>(&self, net: &mut Net<S>, _common: &Common<P>) {
        self.push(&mut net.axis[self.axis]);
    }

    fn n_obstacles(&self) -> usize {
        2
    }

    fn obstacles(&self, _y: Own<P>, net: &Net<P>, out: &mut [P]) {
        out.copy_from_slice(&self.ahead(net.axis[self.axis].x));
    }

    damper::springs!(spring_energy);

    /// Writes the work done on the stop. A piston that leaves faster than the stop can follow has no contact, and
    /// steps may be long. The energy that the spring holds and gives to the damper is therefore not an integral.
    fn account<S: Over<P>>(&self, _y: Own<S>, _dy: Own<S>, net: &Net<S>, common: &Common<P>, out: &mut [S]) {
        let node = &net.axis[self.axis];
        let contact = self.contact(node.x, node.v);
        damper::account(self.force(contact) * contact.1, common, out);
    }
}
