use super::{Common, Part, State};
use crate::ledger::Kind;
use crate::net::{AxisNode, Net};
use math::{Lane, Over, Real};
use physics::friction::{AnyLaw, At, Levels, SealLips};

/// A mass that moves along one line, with friction: piston, slide and load.
///
///   dx/dt = v,   m dv/dt = sum of forces - friction                   [N], +x
///
/// The weight m g sin(incline) and a constant external force act on it; pressures, springs and end
/// stops are parts of their own. In the stick mode of a law that has one, v = 0 exactly.
#[derive(Clone, Debug)]
pub struct Axis<P> {
    /// Moving mass m, kg.
    pub mass: P,
    /// Weight along the axis, N, positive where it pulls towards -x.
    pub weight: P,
    /// Constant external force in +x, N.
    pub external_force: P,
    pub friction: Option<AnyLaw<P>>,
    pub seal_lips: Option<SealLips<P>>,
    /// -1, 0 or +1: see [`physics::friction`].
    pub mode: P,
    pub node: usize,
}

impl<R: Lane> Axis<R> {
    pub(crate) fn gather(each: &[&Axis<f64>]) -> Self {
        let number = |f: &dyn Fn(&Axis<f64>) -> f64| R::from_lanes(|lane| f(each[lane]));
        let laws: Option<Vec<&AnyLaw<f64>>> =
            each.iter().map(|axis| axis.friction.as_ref()).collect();
        let lips: Option<Vec<&SealLips<f64>>> =
            each.iter().map(|axis| axis.seal_lips.as_ref()).collect();
        Axis {
            mass: number(&|axis| axis.mass),
            weight: number(&|axis| axis.weight),
            external_force: number(&|axis| axis.external_force),
            friction: laws.map(|laws| AnyLaw::gather(&laws)),
            seal_lips: lips.map(|lips| SealLips::gather(&lips)),
            mode: number(&|axis| axis.mode),
            node: each[0].node,
        }
    }
}

impl<P: Real> Axis<P> {
    /// Whether the law sticks by a mode, with an event of its own.
    pub fn sticks(&self) -> bool {
        self.friction.as_ref().is_some_and(|law| law.meta().sticks)
    }

    #[inline(always)]
    fn at<S: Over<P>>(&self, law: &AnyLaw<P>, node: &AxisNode<S>) -> (At<S>, Levels<S>) {
        let at = At {
            v: node.v,
            x: node.x,
            gauge_a: node.gauge_a,
            gauge_b: node.gauge_b,
            applied: node.force,
        };
        let base = law.levels();
        let base = Levels {
            coulomb: S::from(base.coulomb),
            breakaway: S::from(base.breakaway),
        };
        let levels = match &self.seal_lips {
            Some(lips) => lips.apply(&base, &at),
            None => base,
        };
        (at, levels)
    }

    /// The event function of the law's mode.
    pub(crate) fn event<S: Over<P>>(&self, net: &Net<S>) -> S {
        let law = self
            .friction
            .as_ref()
            .expect("an axis with events has a law");
        let (at, levels) = self.at(law, &net.axis[self.node]);
        law.event(&at, &levels, self.mode)
    }
}

impl<R: Lane> Axis<R> {
    /// Sets one lane's mode after its event, and its velocity to zero.
    pub(crate) fn switch(&mut self, lane: usize, v: &mut R, net: &Net<R>) {
        let law = self
            .friction
            .as_ref()
            .expect("an axis with events has a law");
        let (at, levels) = self.at(law, &net.axis[self.node]);
        let levels = Levels {
            coulomb: levels.coulomb.get(lane),
            breakaway: levels.breakaway.get(lane),
        };
        let mode = law.next_mode(self.mode.get(lane), at.applied.get(lane), &levels);
        self.mode.put(lane, mode);
        v.put(lane, 0.0);
    }
}

impl<P: Real> Part<P> for Axis<P> {
    fn states(&self) -> Vec<State> {
        let mut states = vec![
            State {
                name: "position",
                unit: "m",
                scale: 0.1,
            },
            State {
                name: "velocity",
                unit: "m/s",
                scale: 0.1,
            },
        ];
        if let Some(law) = &self.friction {
            states.extend(law.meta().states.iter().map(|s| State {
                name: s.name,
                unit: s.unit,
                scale: s.scale,
            }));
        }
        states
    }

    #[inline(always)]
    fn place<S: Over<P>>(&self, y: &[S], net: &mut Net<S>, _common: &Common<P>) {
        let node = &mut net.axis[self.node];
        (node.x, node.v) = (y[0], y[1]);
        node.force = S::from(self.external_force - self.weight);
        node.end_stop = S::zero();
    }

    #[inline(always)]
    fn rate<S: Over<P>>(&self, y: &[S], dy: &mut [S], net: &mut Net<S>, _common: &Common<P>) {
        let node = &mut net.axis[self.node];
        dy[0] = node.v;
        node.friction = match &self.friction {
            Some(law) => {
                let (at, levels) = self.at(law, node);
                law.force(&at, &levels, &y[2..], &mut dy[2..], self.mode)
            }
            None => S::zero(),
        };
        node.a = (node.force - node.friction) / S::from(self.mass);
        dy[1] = node.a;
    }

    fn stored<S: Over<P>>(&self, y: &[S], _net: &Net<S>, _common: &Common<P>) -> [S; 3] {
        let kinetic = S::c(0.5) * S::from(self.mass) * y[1] * y[1];
        let bristle = self
            .friction
            .as_ref()
            .map_or(S::zero(), |law| law.stored(&y[2..]));
        [
            S::zero(),
            kinetic + S::from(self.weight) * y[0] + bristle,
            S::zero(),
        ]
    }

    fn channels(&self) -> Vec<(&'static str, Kind)> {
        vec![
            ("external work", Kind::Energy),
            ("friction heat", Kind::Energy),
            ("friction", Kind::EntropyOfSolid),
        ]
    }

    fn account<S: Over<P>>(&self, y: &[S], net: &Net<S>, common: &Common<P>, out: &mut [S]) {
        let node = &net.axis[self.node];
        let heat = match &self.friction {
            Some(law) => {
                let (at, levels) = self.at(law, node);
                let mut dz = [S::zero(); 8];
                let force = law.force(&at, &levels, &y[2..], &mut dz[..y.len() - 2], self.mode);
                law.heat(node.v, force, &y[2..], &dz)
            }
            None => S::zero(),
        };
        out[0] = S::from(self.external_force) * node.v;
        out[1] = -heat;
        out[2] = heat / S::from(common.ambient_temperature);
    }
}
