use super::restriction::{CHANNELS, post, throttling};
use super::{Common, Given, Input, Own, OwnMut, Part, State};
use crate::ledger::Kind;
use crate::net::Net;
use math::{Lane, Over, Real};
use physics::flow::Iso6358;

physics::parameters! {
    /// A pressure regulator: a seat from node 1 to node 2 that the pressure behind it closes, with a lag, and a relief
    /// from node 2 to node 3:
    ///
    ///   y'  = (clip((p_set - p2)/dp_full, 0, 1) - y)/tau
    ///   y_r = clip((p2 - p_set - dp_on)/dp_relief, 0, 1)
    ///
    /// y, y_r  shares of the conductances that are open   -
    /// p_set   set pressure, absolute                     Pa
    /// dp_full drop below it at which the seat is open    Pa
    /// tau     time constant of the seat                  s
    pub struct Regulator {
        /// Set pressure, absolute
        set_pressure: "Pa", physics::above(0.0);
        /// Drop below the set pressure at which the seat is fully open
        full_opening_drop: "Pa", physics::above(0.0);
        /// Time constant of the seat
        time_constant: "s", physics::above(0.0);
        /// Rise above the set pressure from which on it relieves
        relief_offset: "Pa", physics::at_least(0.0);
        /// Further rise at which the relief is fully open
        relief_rise: "Pa", physics::above(0.0);
    } with {
        /// Where the seat's share stands among the signals.
        signal: usize,
        /// Nodes 1, 2 and 3.
        nodes: [usize; 3],
        /// Those of them that are reservoirs: what passes them crosses the boundary.
        boundary: [bool; 3],
    }
}

/// A regulator with the laws of its two paths.
#[derive(Clone, Debug)]
pub struct Regulating<P> {
    pub own: Regulator<P>,
    pub seat: Iso6358<P>,
    pub relief: Iso6358<P>,
}

impl<R: Lane> Regulating<R> {
    pub(crate) fn gather(each: &[&Regulating<f64>]) -> Self {
        Regulating {
            own: Regulator::gather(&each.iter().map(|part| &part.own).collect::<Vec<_>>()),
            seat: Iso6358::gather(&each.iter().map(|part| &part.seat).collect::<Vec<_>>()),
            relief: Iso6358::gather(&each.iter().map(|part| &part.relief).collect::<Vec<_>>()),
        }
    }
}

/// A part's two paths, as places of their ends.
const PATHS: [[usize; 2]; 2] = [[0, 1], [1, 2]];

fn clip<S: Real>(share: S) -> S {
    share.max(S::zero()).min(S::one())
}

impl<P: Real> Regulating<P> {
    /// The share to which the seat opens at a pressure behind it, Pa.
    fn target<S: Over<P>>(&self, p: S) -> S {
        clip((S::from(self.own.set_pressure) - p) / S::from(self.own.full_opening_drop))
    }

    /// Mass flow through the seat (0) or the relief (1), kg/s, and where it goes backward.
    #[inline(always)]
    pub(crate) fn flow<S: Over<P>>(&self, path: usize, net: &Net<S>) -> (S, S::Mask) {
        let [one, two] = PATHS[path].map(|end| &net.gas[self.own.nodes[end]]);
        let (law, share) = if path == 0 {
            (&self.seat, net.signal[self.own.signal])
        } else {
            let above = S::from(self.own.set_pressure) + S::from(self.own.relief_offset);
            (&self.relief, clip((one.p - above) / S::from(self.own.relief_rise)))
        };
        law.mass_flow(share, one.p, one.inverse_sqrt_t, two.p, two.inverse_sqrt_t)
    }

    pub(crate) fn ends(&self, path: usize) -> ((usize, usize), [bool; 2]) {
        let [from, to] = PATHS[path];
        let (nodes, boundary) = (self.own.nodes, self.own.boundary);
        ((nodes[from], nodes[to]), [boundary[from], boundary[to]])
    }
}

impl<P: Real> Part<P> for Regulating<P> {
    fn states(&self) -> Vec<State> {
        vec![State { name: "seat", unit: "-", scale: 1.0 }]
    }

    fn inputs(&self) -> &'static [Input] {
        const { &[Input { name: "set pressure", unit: "Pa", bounds: physics::above(0.0) }] }
    }

    fn input(&self, _input: usize) -> P {
        self.own.set_pressure
    }

    fn input_mut(&mut self, _input: usize) -> &mut P {
        &mut self.own.set_pressure
    }

    #[inline(always)]
    fn place<S: Over<P>>(&self, y: Own<S>, net: &mut Net<S>, _common: &Common<P>) {
        let [seat] = y.first();
        net.signal[self.own.signal] = seat;
    }

    #[inline(always)]
    fn exchange<S: Over<P>>(&self, net: &mut Net<S>, _common: &Common<P>) {
        for path in 0..PATHS.len() {
            let (m_dot, backward) = self.flow(path, net);
            let ((from, to), boundary) = self.ends(path);
            let t = S::select(backward, net.gas[to].t, net.gas[from].t);
            post(net, (from, to), boundary, m_dot, m_dot * (net.cp * t));
        }
    }

    #[inline(always)]
    fn rate<S: Over<P>>(&self, y: Own<S>, mut dy: OwnMut<S>, net: &mut Net<S>, _common: &Common<P>) {
        let [seat] = y.first();
        let target = self.target(net.gas[self.own.nodes[1]].p);
        dy.set([(target - seat) / S::from(self.own.time_constant)]);
    }

    fn begin(&self, given: &Given<P>, mut y: OwnMut<P>, _net: &Net<P>, _common: &Common<P>) {
        let behind = given.gas(self.own.nodes[1]).map_or(self.own.set_pressure, |[p, _]| p);
        y.set([self.target::<P>(behind)]);
    }

    fn channels(&self) -> Vec<(&'static str, Kind)> {
        [CHANNELS, CHANNELS].concat()
    }

    fn account<S: Over<P>>(&self, _y: Own<S>, _dy: Own<S>, net: &Net<S>, common: &Common<P>, out: &mut [S]) {
        for (path, own) in out.chunks_exact_mut(CHANNELS.len()).enumerate() {
            let (ends, boundary) = self.ends(path);
            throttling(net, ends, boundary, self.flow(path, net), common, own);
        }
    }
}
