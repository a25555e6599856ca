//! The usual drive, evaluated without nodes in memory: one cylinder whose chambers lead to reservoirs. The same
//! functions of the same parts run in the same order, so the bits are equal to those with nodes. Both chambers are one
//! computation on two numbers side by side. The Jacobian is taken by the inputs of chambers and axis.

pub(crate) mod glance;

use crate::ground::{AxisNode, Common, GasNode};
use crate::part::flow::restriction::passing;
use crate::part::gas::volume::wetted;
use crate::part::{ChamberLaw, Cylinder, Face, Parts, Volume};
use math::{Both, Dual, Lane, Over, Real, Work};
use ode::Dense;
use physics::flow::{End, Iso6358};
use physics::{Gas, IdealGas};

/// A restriction between a chamber and a reservoir: its index, its reservoir, and whether it is defined from reservoir
/// to chamber.
#[derive(Clone, Copy, Debug)]
struct Edge {
    restriction: usize,
    reservoir: usize,
    inward: bool,
}

/// One open restriction of each chamber, with flow counted from its reservoir.
#[derive(Clone, Debug)]
struct Ports<P> {
    law: Iso6358<Both<P>>,
    gain: Both<P>,
    reservoir: End<Both<P>>,
    temperature: Both<P>,
    /// Gas flows out of a chamber above this pressure, Pa: the pressure of the reservoir. At equal pressure, the flow
    /// counts as positive in the defined direction of the restriction.
    limit: Both<P>,
    restriction: [Option<usize>; 2],
}

/// A cylinder between reservoirs.
#[derive(Clone, Debug)]
pub(super) struct Fused<P> {
    edges: [Vec<Edge>; 2],
    volume: Volume<Both<P>>,
    face: Face<Both<P>>,
    common: Common<Both<P>>,
    ports: Vec<Ports<P>>,
}

/// A circuit without nodes: its evaluation, its cylinder and what the parts share.
#[derive(Clone, Copy)]
pub(super) struct Whole<'c, R: Lane> {
    pub fused: &'c Fused<R>,
    pub cylinder: &'c Cylinder<R>,
    pub common: &'c Common<R>,
}

/// Computes the right-hand side of a circuit without nodes at `y`, plus its known part.
pub(super) struct Rates<'c, R: Lane> {
    pub of: Whole<'c, R>,
    pub y: &'c [R],
    pub known: &'c [R],
    pub out: &'c mut [R],
}

impl<R: Lane> Work for Rates<'_, R> {
    type Out = ();
    #[inline(always)]
    fn work(self) {
        self.of.rates(self.y, self.known, self.out);
    }
}

/// Computes the same with its Jacobian.
pub(super) struct Linearised<'c, R: Lane> {
    pub of: Whole<'c, R>,
    pub y: &'c [R],
    pub f: &'c mut [R],
    pub jacobian: &'c mut Dense<R>,
}

impl<R: Lane> Work for Linearised<'_, R> {
    type Out = ();
    #[inline(always)]
    fn work(self) {
        let Linearised { of, y, f, jacobian } = self;
        if const { R::DIRECTIONS > 0 } {
            of.jacobian::<AXIS>(y, f, jacobian);
        } else {
            of.jacobian::<AXIS_OF_PLAIN>(y, f, jacobian);
        }
    }
}

/// Directions of differentiation for the axis: x, v, both pressures and an inner state. Three more directions, which
/// are zero, fill whole registers for plain numbers.
const AXIS: usize = 5;
const AXIS_OF_PLAIN: usize = 8;

/// Quantities that follow from the states of both chambers.
struct Chambers<S> {
    rates: [S; 2],
    node: GasNode<S>,
}

impl<R: Lane> Fused<R> {
    /// Returns the evaluation if the parts form such a drive and its laws can be evaluated side by side.
    pub fn of(parts: &Parts<R>, common: &Common<R>) -> Option<Self> {
        let [(_, cylinder)] = &parts.cylinders[..] else { return None };
        let few = cylinder.axis.friction.as_ref().is_none_or(|contact| contact.states().len() <= 1);
        let law = ChamberLaw::EnergyBalance;
        let [a, b] = &cylinder.volumes;
        if !parts.present.is_empty() || !few || a.law != law {
            return None;
        }
        let volume = a.beside(b)?;
        let mut edges = [Vec::new(), Vec::new()];
        for (restriction, (_, part)) in parts.restrictions.iter().enumerate() {
            let [from, to] = [part.path.from, part.path.to].map(|id| id.0);
            let chamber = |node: usize| cylinder.volumes.iter().position(|volume| volume.node == node);
            let (side, far, inward) = match (chamber(from), chamber(to)) {
                (None, Some(side)) => (side, from, true),
                (Some(side), None) => (side, to, false),
                _ => return None,
            };
            let reservoir = parts.reservoirs.iter().position(|(_, reservoir)| reservoir.node == far)?;
            if part.law.elliptic != parts.restrictions[0].1.law.elliptic {
                return None;
            }
            edges[side].push(Edge { restriction, reservoir, inward });
        }
        let [face_a, face_b] = &cylinder.faces;
        let Common { gas, ambient_pressure, ambient_temperature } = common;
        let ideal: IdealGas<Both<R>> = gas.beside(gas);
        let common = Common {
            gas: Gas::from(&ideal),
            ambient_pressure: Both::same(*ambient_pressure),
            ambient_temperature: Both::same(*ambient_temperature),
        };
        Some(Fused { edges, volume, face: face_a.beside(face_b), common, ports: Vec::new() })
    }

    /// Copies the open restrictions and the state of the reservoirs.
    pub fn connect(&mut self, open: &[usize], parts: &Parts<R>) {
        let is_open = |edge: &&Edge| open.binary_search(&edge.restriction).is_ok();
        let mut each = self.edges.each_ref().map(|edges| edges.iter().filter(is_open));
        self.ports.clear();
        loop {
            let edges = each.each_mut().map(Iterator::next);
            let of = |edge: Option<&Edge>| edge.map(|edge| &parts.restrictions[edge.restriction].1);
            // If one chamber has fewer restrictions, it uses a copy of the other chamber's with zero flow.
            let Some(any) = of(edges[0]).or(of(edges[1])) else { break };
            let [law_a, law_b] = edges.map(|edge| &of(edge).unwrap_or(any).law);
            let number = |f: &dyn Fn(&Edge) -> R, without: R| Both(edges.map(|edge| edge.map_or(without, f)));
            let state = |edge: &Edge| parts.reservoirs[edge.reservoir].1.state();
            let (zero, one) = (R::zero(), R::one());
            let ends = edges.map(|edge| edge.map(|edge| GasNode::at(state(edge)).end()));
            let of_end = |f: fn(&End<R>) -> R| Both(ends.each_ref().map(|end| end.as_ref().map_or(one, f)));
            let limit = |edge: &Edge| {
                let p = state(edge).p;
                let below = p.with_value(R::Plain::from_lanes(|lane| p.get(lane).next_down()));
                if edge.inward { p } else { below }
            };
            self.ports.push(Ports {
                law: law_a.beside(law_b),
                gain: number(&|edge| parts.restrictions[edge.restriction].1.gain(), zero),
                reservoir: End {
                    p: of_end(|end| end.p),
                    inverse_p: of_end(|end| end.inverse_p),
                    choked: of_end(|end| end.choked),
                },
                temperature: number(&|edge| state(edge).t, one),
                limit: number(&limit, one),
                restriction: edges.map(|edge| edge.map(|edge| edge.restriction)),
            });
        }
    }

    /// Copies the opening of a restriction.
    pub fn open(&mut self, restriction: usize, gain: R) {
        for ports in &mut self.ports {
            if let Some(side) = ports.restriction.iter().position(|own| *own == Some(restriction)) {
                ports.gain.0[side] = gain;
            }
        }
    }
}

impl<P: Real> Fused<P> {
    /// Returns both chambers at (x, v, m, U).
    #[inline(always)]
    fn chambers<S: Over<Both<P>>>(&self, least_wall: Both<P>, [x, v, m, u]: [S; 4]) -> Chambers<S> {
        let mut axis = AxisNode::at_rest();
        (axis.x, axis.v) = (x, v);
        let mut node = GasNode::empty();
        self.volume.reset(&mut node);
        self.face.enlarge(&axis, &mut node);
        node.wall = node.wall.max(S::from(least_wall));
        self.volume.fill([m, u], &mut node, &self.common);
        let own = node.end();
        let cp = S::from(self.common.gas.cp);
        for ports in &self.ports {
            let End { p, inverse_p, choked } = ports.reservoir;
            let reservoir = End { p: S::from(p), inverse_p: S::from(inverse_p), choked: S::from(choked) };
            let out = S::from(ports.limit).lt(node.p);
            let choked = ports.law.choked(out, &reservoir, &own).times(ports.gain);
            let m_dot = passing(choked * ports.law.share(out, &reservoir, &own), ports.gain);
            node.receive(m_dot, m_dot * (cp * S::select(out, node.t, S::from(ports.temperature))));
        }
        Chambers { rates: self.volume.rates(&mut node, &self.common), node }
    }
}

impl<P: Lane> Cylinder<P> {
    /// Returns the axis at (x, v). Call this function before the chambers: the exponential of a friction law takes as
    /// long as the
    /// chambers, and the two then run in parallel.
    #[inline(always)]
    fn stands<S: Over<P>>(&self, motion: [S; 2]) -> AxisNode<S> {
        let mut axis = AxisNode::at_rest();
        self.axis.stand(motion, &mut axis);
        axis
    }

    /// Returns the same axis with its forces and acceleration at the pressures of both chambers. Sets the rates of the
    /// inner states.
    #[inline(always)]
    fn moves<S: Over<P>>(
        &self,
        mut axis: AxisNode<S>,
        [a, b]: [S; 2],
        z: &[S],
        dz: &mut [S],
        common: &Common<P>,
    ) -> AxisNode<S> {
        self.faces[0].push(a, &mut axis, common);
        self.faces[1].push(b, &mut axis, common);
        self.stops.push(&mut axis);
        self.axis.accelerate::<S, true>(z, dz, &mut axis);
        axis
    }
}

impl<R: Lane> Cylinder<R> {
    /// Writes the rates of the velocity and of an inner state, if any, and their rows of the Jacobian. The axis is
    /// given at (x, v), which are directions 0 and 1. The slopes of both pressures by x and U are given.
    #[inline(always)]
    fn differentiate<const D: usize>(
        &self,
        axis: AxisNode<Dual<R, D>>,
        pressures: [R; 2],
        z: &[R],
        common: &Common<R>,
        [by_x, by_u]: [[R; 2]; 2],
        (f, jacobian): (&mut [R], &mut Dense<R>),
    ) {
        let seeded = std::array::from_fn(|i| Dual::variable(pressures[i], 2 + i));
        let inner = z.first().map_or(Dual::from(R::zero()), |z| Dual::variable(*z, 4));
        let mut d_inner = [Dual::from(R::zero())];
        let n = z.len().min(1);
        let acceleration = self.moves(axis, seeded, &[inner][..n], &mut d_inner[..n], common).a;
        let mut row = |row: usize, rate: &Dual<R, D>| {
            let [x, v, a, b, z] = std::array::from_fn(|i| rate.eps[i]);
            f[row] = rate.re;
            jacobian[row] = [
                a.fma(by_x[0], b.fma(by_x[1], x)),
                v,
                R::zero(),
                a * by_u[0],
                R::zero(),
                b * by_u[1],
                z,
                R::zero(),
            ];
        };
        row(1, &acceleration);
        if n > 0 {
            row(6, &d_inner[0]);
        }
    }
}

impl<R: Lane> Whole<'_, R> {
    /// Computes the right-hand side without nodes, plus `known`. The known part is added number by number before
    /// storing, so that the next reader need not wait for several stores.
    #[inline(always)]
    fn rates(&self, y: &[R], known: &[R], out: &mut [R]) {
        let Whole { fused, cylinder, common } = *self;
        let (outer, z) = y.split_first_chunk::<6>().expect("the states of a cylinder");
        let (known, known_z) = known.split_first_chunk::<6>().expect("as many");
        let (out, dz) = out.split_first_chunk_mut::<6>().expect("as many");
        let [x, v, m_a, u_a, m_b, u_b] = *outer;
        let axis = cylinder.stands([x, v]);
        let states = [Both::same(x), Both::same(v), Both([m_a, m_b]), Both([u_a, u_b])];
        let Chambers { rates, node } = fused.chambers(Both::same(cylinder.least_wall), states);
        let acceleration = cylinder.moves(axis, node.p.0, z, dz, common).a;
        let [m_dot, u_dot] = rates.map(|both| both.0);
        *out = [
            known[0] + v,
            known[1] + acceleration,
            known[2] + m_dot[0],
            known[3] + u_dot[0],
            known[4] + m_dot[1],
            known[5] + u_dot[1],
        ];
        for (dz, known) in dz.iter_mut().zip(known_z) {
            *dz += *known;
        }
    }

    /// Computes the same with its Jacobian, which has the shape that [`ode::System::linearise`] requires.
    #[inline(always)]
    fn jacobian<const D: usize>(&self, y: &[R], f: &mut [R], jacobian: &mut Dense<R>) {
        let Whole { fused, cylinder, common } = *self;
        let (outer, z) = y.split_first_chunk::<6>().expect("the states of a cylinder");
        let [x, v, m_a, u_a, m_b, u_b] = *outer;
        let axis = cylinder.stands::<Dual<R, D>>([Dual::variable(x, 0), Dual::variable(v, 1)]);
        let seeded: [Dual<Both<R>, 3>; 4] = [
            Dual::variable(Both::same(x), 0),
            Dual::from(Both::same(v)),
            Dual::variable(Both([m_a, m_b]), 1),
            Dual::variable(Both([u_a, u_b]), 2),
        ];
        let Chambers { rates, node } = fused.chambers(Both::same(cylinder.least_wall), seeded);
        let (pressure, growth) = (node.p, node.volume.eps[0]);
        // The velocity enters only through dV/dt, which is dV/dx times the velocity: the work -p dV/dt, and heat.
        let mut by_v = [Both::zero(), -(pressure.re * growth)];
        if let Some(slope) = fused.volume.heat.by_volume_rate(&wetted(&node).map(|number| number.re)) {
            by_v[1] += slope * growth;
        }
        // By reference, because iterating over an array by value copies it.
        for (side, first) in [2, 4].into_iter().enumerate() {
            let columns = [0, first, first + 1];
            for ((row, rate), by_v) in (first..).zip(&rates).zip(&by_v) {
                f[row] = rate.re.0[side];
                jacobian[row][1] = by_v.0[side];
                for (slope, column) in rate.eps.iter().zip(columns) {
                    jacobian[row][column] = slope.0[side];
                }
            }
        }
        // dp/dx and dp/dU of both chambers. A pressure depends on neither v nor m.
        let by = [pressure.eps[0].0, pressure.eps[2].0];
        cylinder.differentiate(axis, pressure.re.0, z, common, by, (f, jacobian));
        (f[0], jacobian[0][1]) = (v, R::one());
    }
}
