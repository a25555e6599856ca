//! Observed quantities of a circuit at a state: nodes, flows, forces, stored quantities.

use super::fused::glance::Glance;
use super::{Circuit, Entry, Path};
use crate::ground::{AxisId, GasId, Net};
use crate::part::mechanics::cylinder::INNER;
use crate::part::valves::signal;
use crate::part::{PartId, PartKind, Platform};
use math::{Lane, Work};
use ode::System;

/// The nodes of a circuit at `y`.
struct Observe<'c, R: Lane> {
    circuit: &'c Circuit<R>,
    y: &'c [R],
    net: &'c mut Net<R>,
}

impl<R: Lane> Work for Observe<'_, R> {
    type Out = ();
    #[inline(always)]
    fn work(self) {
        self.circuit.look_at(self.y, self.net);
    }
}

impl<R: Lane> Circuit<R> {
    /// Evaluates the nodes at state `y`, with flows, forces and accelerations.
    pub fn observe(&self, y: &[R], net: &mut Net<R>) {
        R::within(Observe { circuit: self, y, net });
    }

    #[inline(always)]
    fn look_at(&self, y: &[R], net: &mut Net<R>) {
        self.renew(net);
        let mut rates = std::mem::take(&mut net.rates);
        rates.resize(self.topology.n_states, R::zero());
        self.evaluate(y, net);
        self.parts.rate(y, &mut rates, net, &self.common);
        net.rates = rates;
    }

    /// Returns the mass flow through a path at the nodes, kg/s.
    pub fn flow(&self, path: Path, net: &Net<R>) -> R {
        let flow = self.parts.flow(path, net);
        if path.is_backward { -flow } else { flow }
    }

    /// Returns every path over the boundary, positive inward: paths that end in a reservoir, and compressors.
    pub(crate) fn inlets(&self) -> impl Iterator<Item = Path> {
        let paths = self.parts.paths().filter_map(|(path, ends)| match ends.boundary {
            [true, false] => Some(path),
            [false, true] => Some(path.backward()),
            _ => None,
        });
        let compressors = self.parts.compressors.iter().enumerate();
        let compressors = compressors.filter(|(_, (_, own))| !own.boundary);
        paths
            .chain(compressors.map(|(index, _)| Path::along(PartId { kind: PartKind::Compressor, index }, 0)))
    }

    /// Returns the mass flow out of a node through all paths, kg/s, for a reservoir.
    pub fn flow_out_of(&self, node: GasId, net: &Net<R>) -> R {
        self.parts.paths().fold(R::zero(), |sum, (path, ends)| match (ends.from == node, ends.to == node) {
            (true, false) => sum + self.flow(path, net),
            (false, true) => sum - self.flow(path, net),
            _ => sum,
        })
    }

    /// Returns the force of a part at the nodes, N. For a link it is the force in +x on its second axis.
    pub fn force_of(&self, part: PartId, net: &Net<R>) -> R {
        self.parts.force(part, net)
    }

    /// Returns a platform of the circuit.
    pub(crate) fn platform(&self, part: PartId) -> &Platform<R> {
        &self.parts.platforms[part.index].1
    }

    /// Returns the motion of a platform, by the index of its output, at state `y` and the nodes.
    pub(crate) fn pose(&self, part: PartId, output: usize, y: &[R], net: &Net<R>) -> R {
        let (place, platform) = &self.parts.platforms[part.index];
        let own = place.first..place.first + place.count;
        platform.motion(&y[own.clone()], &net.rates[own], output)
    }

    /// Returns the first state of a part within `y`.
    pub(crate) fn part_state(&self, part: PartId, y: &[R]) -> R {
        y[self.parts.place_of(part).first]
    }

    /// Moves a valve on its own over a time `lapse`, s, under the command that acts, a time `left` before its position
    /// matters.
    pub(crate) fn coast(&self, part: PartId, y: &mut [R], lapse: f64, left: f64) {
        let at = self.parts.place_of(part).first;
        match part.kind {
            PartKind::Armature => y[at] += self.input(part.input(signal::ACTS)) * R::c(lapse),
            PartKind::Spool => {
                let spool = &self.parts.spools[part.index].1;
                [y[at], y[at + 1]] = spool.coasted([y[at], y[at + 1]], lapse, left);
            }
            _ => {}
        }
    }
}

impl Circuit<f64> {
    /// Returns the stored quantities at state `y` (balances included), and every balance.
    pub fn books(&self, y: &[f64]) -> Entry {
        let mut net = self.work::<f64>();
        self.observe(y, &mut net);
        let mut accounts = vec![0.0; self.channels().len()];
        self.parts.standing(&net, &self.common, &mut accounts);
        for (account, integral) in accounts.iter_mut().zip(&y[self.n_states()..]) {
            *account += *integral;
        }
        let stored = self.parts.stored(y, &net, &self.common);
        Entry { stored, accounts, stores: self.parts.stores(y, &net, &self.common) }
    }

    /// Axis and chambers of a circuit that has fast outputs.
    pub(crate) fn glanced(&self) -> Option<(AxisId, [GasId; 2])> {
        self.fused.as_ref()?;
        let (_, cylinder) = &self.parts.cylinders[0];
        Some((AxisId(cylinder.axis.node), cylinder.volumes.each_ref().map(|volume| GasId(volume.node))))
    }

    /// Returns the fast outputs of such a circuit at a state.
    #[inline(always)]
    pub(crate) fn glance(&self, y: &[f64]) -> Glance {
        let fused = self.fused.as_ref().expect("a circuit without nodes");
        self.whole(fused).glance(y, &y[INNER..self.topology.n_states])
    }
}
