//! The usual drive, one cylinder whose chambers lead to reservoirs, evaluated without nodes in memory: the same
//! functions of the same parts in the same order, so the bits are those of the parts joined by nodes. Both chambers
//! are one computation on two numbers side by side; the Jacobian is taken by what enters chambers and axis.

pub(crate) mod glance;

use super::{Circuit, GasId};
use crate::net::{AxisNode, GasNode};
use crate::part::restriction::passing;
use crate::part::*;
use math::{Both, Dual, Lane, Over, Real, Work};
use ode::Dense;
use physics::flow::{End, Iso6358};
use physics::{Gas, IdealGas};

/// A restriction between a chamber and a reservoir: which one, of which reservoir, and whether it is drawn towards the
/// chamber.
#[derive(Clone, Copy, Debug)]
struct Edge {
    restriction: usize,
    reservoir: usize,
    inward: bool,
}

/// One open restriction of each chamber, seen from its reservoir.
#[derive(Clone, Debug)]
struct Ports<P> {
    law: Iso6358<Both<P>>,
    gain: Both<P>,
    reservoir: End<Both<P>>,
    temperature: Both<P>,
    /// Gas flows out of a chamber above this pressure, Pa: that of the reservoir. At equal pressure a flow counts as
    /// one in the direction in which the restriction is drawn.
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

/// The right-hand side of a circuit without nodes at `y`, plus what is known of it.
pub(super) struct Rates<'c, R: Lane> {
    pub circuit: &'c Circuit<R>,
    pub fused: &'c Fused<R>,
    pub y: &'c [R],
    pub known: &'c [R],
    pub out: &'c mut [R],
}

impl<R: Lane> Work for Rates<'_, R> {
    type Out = ();
    #[inline(always)]
    fn work(self) {
        self.circuit.fused_rates(self.fused, self.y, self.known, self.out);
    }
}

/// The same with its Jacobian.
pub(super) struct Linearised<'c, R: Lane> {
    pub circuit: &'c Circuit<R>,
    pub fused: &'c Fused<R>,
    pub y: &'c [R],
    pub f: &'c mut [R],
    pub jacobian: &'c mut Dense<R>,
}

impl<R: Lane> Work for Linearised<'_, R> {
    type Out = ();
    #[inline(always)]
    fn work(self) {
        let Linearised { circuit, fused, y, f, jacobian } = self;
        if const { R::DIRECTIONS > 0 } {
            circuit.fused_jacobian::<AXIS>(fused, y, f, jacobian);
        } else {
            circuit.fused_jacobian::<AXIS_OF_PLAIN>(fused, y, f, jacobian);
        }
    }
}

/// Directions in which the axis is differentiated: by x, v, both pressures and an inner state. Of plain numbers three
/// more, which are zero, fill whole registers of a processor.
const AXIS: usize = 5;
const AXIS_OF_PLAIN: usize = 8;

/// What follows from the states of both chambers.
struct Chambers<S> {
    rates: [S; 2],
    volume: S,
    pressure: S,
    temperature: S,
}

impl<R: Lane> Fused<R> {
    /// Where the parts are those of such a drive, and its laws can be evaluated side by side.
    pub fn of(circuit: &Circuit<R>) -> Option<Self> {
        let parts = &circuit.parts;
        let [(_, cylinder)] = &parts.cylinders[..] else { return None };
        let few = cylinder.axis.friction.as_ref().is_none_or(|contact| contact.states().len() <= 1);
        let law = ChamberLaw::EnergyBalance;
        if parts.has_others() || !few || cylinder.volumes.iter().any(|volume| volume.law != law) {
            return None;
        }
        let mut edges = [Vec::new(), Vec::new()];
        for (restriction, (_, part)) in parts.restrictions.iter().enumerate() {
            let [from, to] = [part.path.from, part.path.to].map(GasId::index);
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
        let ([a, b], [face_a, face_b]) = (&cylinder.volumes, &cylinder.faces);
        let Common { gas, ambient_pressure, ambient_temperature } = &circuit.common;
        let ideal: IdealGas<Both<R>> = gas.beside(gas);
        let common = Common {
            gas: Gas::from(&ideal),
            ambient_pressure: Both::same(*ambient_pressure),
            ambient_temperature: Both::same(*ambient_temperature),
        };
        Some(Fused { edges, volume: a.beside(b), face: face_a.beside(face_b), common, ports: Vec::new() })
    }

    /// Takes over which restrictions are open, and what the reservoirs hold.
    fn connect(&mut self, open: &[usize], parts: &Parts<R>) {
        let is_open = |edge: &&Edge| open.binary_search(&edge.restriction).is_ok();
        let mut each = self.edges.each_ref().map(|edges| edges.iter().filter(is_open));
        self.ports.clear();
        loop {
            let edges = each.each_mut().map(Iterator::next);
            let of = |edge: Option<&Edge>| edge.map(|edge| &parts.restrictions[edge.restriction].1);
            // Where one chamber has fewer, nothing passes a copy of the other's.
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

    /// Takes over how far an open restriction is.
    fn open(&mut self, restriction: usize, gain: R) {
        for ports in &mut self.ports {
            if let Some(side) = ports.restriction.iter().position(|own| *own == Some(restriction)) {
                ports.gain.0[side] = gain;
            }
        }
    }
}

impl<P: Real> Fused<P> {
    /// Both chambers at (x, v, m, U).
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
            node.m_dot += m_dot;
            node.h_dot += m_dot * (cp * S::select(out, node.t, S::from(ports.temperature)));
        }
        let (volume, pressure, temperature) = (node.volume, node.p, node.t);
        Chambers { rates: self.volume.rates(&mut node, &self.common), volume, pressure, temperature }
    }
}

impl<P: Real> Cylinder<P> {
    /// The axis at (x, v). To be asked for before the chambers: the exponential of a friction law takes as long as they do,
    /// and neither waits for the other.
    #[inline(always)]
    fn stands<S: Over<P>>(&self, motion: [S; 2]) -> AxisNode<S> {
        let mut axis = AxisNode::at_rest();
        self.axis.stand(motion, &mut axis);
        axis
    }

    /// That axis with its forces and acceleration at the pressures of both chambers; sets the rates of the inner states.
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

impl<R: Real> Cylinder<R> {
    /// The rates of the velocity and of an inner state, where there is one, and their rows of the Jacobian, from the axis
    /// at (x, v), directions 0 and 1, and both pressures, of which the slopes by x and by U are given.
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

impl<R: Lane> Circuit<R> {
    /// Looks whether the circuit is one that is evaluated without nodes.
    pub(super) fn fuse(mut self) -> Self {
        self.fused = Fused::of(&self).map(Box::new);
        self.connect();
        self
    }

    /// Takes over open restrictions and reservoirs.
    pub(super) fn connect(&mut self) {
        if let Some(fused) = &mut self.fused {
            fused.connect(&self.open, &self.parts);
        }
    }

    /// Takes over how far an open restriction is.
    #[inline(always)]
    pub(super) fn widen(&mut self, restriction: usize) {
        if let Some(fused) = &mut self.fused {
            fused.open(restriction, self.parts.restrictions[restriction].1.gain());
        }
    }

    /// The right-hand side without nodes, plus `known`. It is added number by number, before they are stored: what
    /// reads them next need not wait until several are together.
    #[inline(always)]
    fn fused_rates(&self, fused: &Fused<R>, y: &[R], known: &[R], out: &mut [R]) {
        let (_, cylinder) = &self.parts.cylinders[0];
        let (outer, z) = y.split_first_chunk::<6>().expect("the states of a cylinder");
        let (known, known_z) = known.split_first_chunk::<6>().expect("as many");
        let (out, dz) = out.split_first_chunk_mut::<6>().expect("as many");
        let [x, v, m_a, u_a, m_b, u_b] = *outer;
        let axis = cylinder.stands([x, v]);
        let states = [Both::same(x), Both::same(v), Both([m_a, m_b]), Both([u_a, u_b])];
        let Chambers { rates, pressure, .. } = fused.chambers(Both::same(cylinder.least_wall), states);
        let acceleration = cylinder.moves(axis, pressure.0, z, dz, &self.common).a;
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

    /// The same with its Jacobian, which has the shape that [`ode::System::linearise`] asks for.
    #[inline(always)]
    fn fused_jacobian<const D: usize>(
        &self,
        fused: &Fused<R>,
        y: &[R],
        f: &mut [R],
        jacobian: &mut Dense<R>,
    ) {
        let (_, cylinder) = &self.parts.cylinders[0];
        let (outer, z) = y.split_first_chunk::<6>().expect("the states of a cylinder");
        let [x, v, m_a, u_a, m_b, u_b] = *outer;
        let axis = cylinder.stands::<Dual<R, D>>([Dual::variable(x, 0), Dual::variable(v, 1)]);
        let seeded: [Dual<Both<R>, 3>; 4] = [
            Dual::variable(Both::same(x), 0),
            Dual::from(Both::same(v)),
            Dual::variable(Both([m_a, m_b]), 1),
            Dual::variable(Both([u_a, u_b]), 2),
        ];
        let chambers = fused.chambers(Both::same(cylinder.least_wall), seeded);
        let Chambers { rates, volume, pressure, .. } = chambers;
        // The velocity enters by the work -p dV/dt alone, and dV/dt is dV/dx times it.
        let by_v = [Both::zero(), -(pressure.re * volume.eps[0])];
        // By reference: to iterate over an array of numbers itself is to copy it.
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
        // dp/dx and dp/dU of both chambers: a pressure depends on neither v nor m.
        let by = [pressure.eps[0].0, pressure.eps[2].0];
        cylinder.differentiate(axis, pressure.re.0, z, &self.common, by, (f, jacobian));
        (f[0], jacobian[0][1]) = (v, R::one());
    }
}
