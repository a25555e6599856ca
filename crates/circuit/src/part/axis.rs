use super::{Common, Own, OwnRates, Part, State};
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
    /// 1/m, prepared.
    pub inverse_mass: P,
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
        let laws: Option<Vec<&AnyLaw<f64>>> = each.iter().map(|axis| axis.friction.as_ref()).collect();
        let lips: Option<Vec<&SealLips<f64>>> = each.iter().map(|axis| axis.seal_lips.as_ref()).collect();
        Axis {
            mass: number(&|axis| axis.mass),
            inverse_mass: number(&|axis| axis.inverse_mass),
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
            prepared: node.prepared,
        };
        let base = law.levels();
        let base = Levels { coulomb: S::from(base.coulomb), breakaway: S::from(base.breakaway) };
        let levels = match &self.seal_lips {
            Some(lips) => lips.apply(&base, &at),
            None => base,
        };
        (at, levels)
    }

    /// Position, velocity and the forces that are always there.
    #[inline(always)]
    pub(super) fn stand<S: Over<P>>(&self, y: [S; 2], node: &mut AxisNode<S>) {
        [node.x, node.v] = y;
        node.force = S::from(self.external_force - self.weight);
        node.end_stop = S::zero();
        if let Some(law) = &self.friction {
            node.prepared = law.prepare(node.v);
        }
    }

    /// Friction and acceleration, once all other forces are known; sets the rates of the inner states.
    #[inline(always)]
    pub(super) fn accelerate<S: Over<P>>(&self, z: &[S], dz: &mut [S], node: &mut AxisNode<S>) -> [S; 2] {
        node.friction = match &self.friction {
            Some(law) => {
                let (at, levels) = self.at(law, node);
                law.force(&at, &levels, z, dz, self.mode)
            }
            None => S::zero(),
        };
        node.a = (node.force - node.friction) * S::from(self.inverse_mass);
        [node.v, node.a]
    }

    /// What the axis with inner states `z` stores.
    pub(super) fn stored_in<S: Over<P>>(&self, z: &[S], net: &Net<S>) -> [S; 3] {
        let node = &net.axis[self.node];
        let kinetic = S::c(0.5) * S::from(self.mass) * node.v * node.v;
        let bristle = self.friction.as_ref().map_or(S::zero(), |law| law.stored(z));
        [S::zero(), kinetic + S::from(self.weight) * node.x + bristle, S::zero()]
    }

    /// Rates of the accounts of the axis with inner states `z`.
    pub(super) fn account_in<S: Over<P>>(&self, z: &[S], net: &Net<S>, common: &Common<P>, out: &mut [S]) {
        let node = &net.axis[self.node];
        let heat = match &self.friction {
            Some(law) => {
                let (at, levels) = self.at(law, node);
                let mut dz = [S::zero(); 8];
                let force = law.force(&at, &levels, z, &mut dz[..z.len()], self.mode);
                law.heat(node.v, force, z, &dz)
            }
            None => S::zero(),
        };
        out[0] = S::from(self.external_force) * node.v;
        out[1] = -heat;
        out[2] = heat / S::from(common.ambient_temperature);
    }

    /// The event function of the law's mode.
    pub(crate) fn event<S: Over<P>>(&self, net: &Net<S>) -> S {
        let law = self.friction.as_ref().expect("an axis with events has a law");
        let (at, levels) = self.at(law, &net.axis[self.node]);
        law.event(&at, &levels, self.mode)
    }
}

impl<R: Lane> Axis<R> {
    /// Sets one lane's mode after its event, and its velocity to zero.
    pub(crate) fn switch(&mut self, lane: usize, v: &mut R, net: &Net<R>) {
        let law = self.friction.as_ref().expect("an axis with events has a law");
        let (at, levels) = self.at(law, &net.axis[self.node]);
        let levels = Levels { coulomb: levels.coulomb.get(lane), breakaway: levels.breakaway.get(lane) };
        let mode = law.next_mode(self.mode.get(lane), at.applied.get(lane), &levels);
        self.mode.put(lane, mode);
        v.put(lane, 0.0);
    }
}

impl<P: Real> Part<P> for Axis<P> {
    fn states(&self) -> Vec<State> {
        let mut states = vec![
            State { name: "position", unit: "m", scale: 0.1 },
            State { name: "velocity", unit: "m/s", scale: 0.1 },
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
    fn place<S: Over<P>>(&self, y: Own<S>, net: &mut Net<S>, _common: &Common<P>) {
        self.stand(y.first(), &mut net.axis[self.node]);
    }

    #[inline(always)]
    fn rate<S: Over<P>>(&self, y: Own<S>, mut dy: OwnRates<S>, net: &mut Net<S>, _common: &Common<P>) {
        let rates = self.accelerate(y.after(2), dy.after(2), &mut net.axis[self.node]);
        dy.set(rates);
    }

    fn stored<S: Over<P>>(&self, y: Own<S>, net: &Net<S>, _common: &Common<P>) -> [S; 3] {
        self.stored_in(y.after(2), net)
    }

    fn channels(&self) -> Vec<(&'static str, Kind)> {
        vec![
            ("external work", Kind::Energy),
            ("friction heat", Kind::Energy),
            ("friction", Kind::EntropyOfSolid),
        ]
    }

    fn account<S: Over<P>>(&self, y: Own<S>, net: &Net<S>, common: &Common<P>, out: &mut [S]) {
        self.account_in(y.after(2), net, common, out);
    }
}
