use crate::ground::{AxisNode, Common, GasNode, Kind, Net, Own, Part};
use math::{Lane, Over, Real};
use std::f64::consts::PI;

physics::parameters! {
    /// One side of a piston: joins a gas node to an axis.
    ///
    ///   `V += A l,  l = x or stroke - x,  wall += perimeter l + ends,  F = +-(p - p_ambient) A`
    ///
    /// The gauge pressure pushes. The sum over both faces is p_a A_a - p_b A_b - p_ambient (A_a - A_b), because the
    /// ambient pressure acts on the rods' ends. Source: [bejan2016].
    pub struct Face {
        /// Area on which the pressure acts
        area: "m2", physics::above(0.0);
        /// Wetted perimeter of barrel and rod, per length of the chamber
        perimeter: "m", physics::at_least(0.0);
        /// Wetted end faces
        end_wall: "m2", physics::at_least(0.0);
        /// Derived: 1 if the chamber grows with x (side a), -1 if it shrinks
        sign: "-", physics::any();
        /// Stroke at which the chamber's length is zero (side b), or zero (side a)
        offset: "m", physics::at_least(0.0);
    } with {
        /// Index among the gas nodes of the net
        gas: usize,
        /// Index among the axes of the net
        axis: usize,
        /// Whether the chamber grows with x (side a)
        grows: bool,
        /// Whether the gas is a reservoir that the piston does not change
        held: bool,
    }
}

impl<P: Real> Face<P> {
    #[inline(always)]
    fn signed<S: Over<P>>(&self, value: S) -> S {
        value.times(self.sign)
    }
}

impl<P: Real> Face<P> {
    /// Adds the free volume in front of the piston.
    #[inline(always)]
    pub(crate) fn enlarge<S: Over<P>>(&self, axis: &AxisNode<S>, node: &mut GasNode<S>) {
        let length = S::from(self.offset) + self.signed(axis.x);
        node.volume = length.times_plus(self.area, node.volume);
        node.volume_rate += self.signed(axis.v.times(self.area));
        node.wall = length.times_plus(self.perimeter, node.wall + S::from(self.end_wall));
    }

    /// Adds the force of gas at `p`, Pa absolute, to the axis.
    #[inline(always)]
    pub(crate) fn push<S: Over<P>>(&self, p: S, axis: &mut AxisNode<S>, common: &Common<P>) {
        let gauge = p - S::from(common.ambient_pressure);
        axis.force += self.signed(gauge.times(self.area));
        if self.grows {
            axis.gauge_a = gauge;
        } else {
            axis.gauge_b = gauge;
        }
    }
}

impl<R: Lane> Face<R> {
    /// Returns the free volume of a chamber with the piston at `x` and with this dead volume, m3.
    #[inline(always)]
    pub(crate) fn room(&self, x: R::Plain, dead_volume: R::Plain) -> R::Plain {
        self.area.plain().fma(self.offset.plain() + self.sign.plain() * x, dead_volume)
    }
}

impl<P: Lane> Part<P> for Face<P> {
    #[inline(always)]
    fn shape<S: Over<P>>(&self, net: &mut Net<S>) {
        if self.held {
            return;
        }
        let node = &mut net.gas[self.gas];
        self.enlarge(&net.axis[self.axis], node);
        // Far behind the end of its stroke, a piston has swept the whole wall.
        node.wall = node.wall.max(S::zero());
    }

    #[inline(always)]
    fn exchange<S: Over<P>>(&self, net: &mut Net<S>, common: &Common<P>) {
        self.push(net.gas[self.gas].p, &mut net.axis[self.axis], common);
    }

    fn channels(&self) -> Vec<(&'static str, Kind)> {
        vec![("ambient work", Kind::Energy)]
    }

    fn account<S: Over<P>>(&self, _y: Own<S>, _dy: Own<S>, net: &Net<S>, common: &Common<P>, out: &mut [S]) {
        let work = |pressure: S| self.signed(pressure * S::from(self.area) * net.axis[self.axis].v);
        out[0] = -work(S::from(common.ambient_pressure));
        // A reservoir works on the piston from outside.
        if self.held {
            out[0] += work(net.gas[self.gas].p);
        }
    }
}

/// Geometry of one side of a piston and of its chamber.
#[derive(Clone, Copy, Debug)]
pub struct PistonSide<P = f64> {
    /// Area on which the gas presses, m2.
    pub area: P,
    /// Wetted perimeter of barrel and rod, m.
    pub perimeter: P,
    /// Wetted end faces, m2.
    pub end_wall: P,
}

impl<P> PistonSide<P> {
    /// Creates a face with an area, m2, a perimeter, m, and end faces, m2.
    pub fn new(area: P, perimeter: P, end_wall: P) -> Self {
        PistonSide { area, perimeter, end_wall }
    }
}

impl<P: Real> PistonSide<P> {
    /// Creates the face of a bore, m, with a rod of this diameter, m (0: no rod). Heat passes through the barrel, both
    /// end faces and the rod. The dead volume has no additional surface.
    pub fn of_bore(bore: P, rod: P) -> Self {
        let area = P::c(0.25 * PI) * (bore * bore - rod * rod);
        PistonSide { area, perimeter: P::c(PI) * (bore + rod), end_wall: P::c(2.0) * area }
    }
}
