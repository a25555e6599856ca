//! Restrictions in a row that are merged into one flow path.

use super::{Brings, Build, Instance, Node, series};
use crate::component::{Quantity, tube_wall};
use crate::ground::{Error, refuse};
use crate::part::Series;
use math::{Deps, Lane, Over};
use physics::flow::in_series;
use std::collections::BTreeMap;

/// A component of a circuit, and one of its ports.
pub(crate) type PortId = (usize, usize);

/// Restrictions in a row, separated only by joints. Each has the port at which the row enters it.
#[derive(Clone, Debug)]
pub(crate) struct Chain(Vec<PortId>);

impl Chain {
    /// Returns the rows of a circuit, from the ports of its joints. A row needs an end: a closed ring is not included.
    pub fn find<'a, P: Lane>(each: &[Instance<P>], joints: impl Iterator<Item = &'a [PortId]>) -> Vec<Self> {
        let mut across = BTreeMap::new();
        for ports in joints {
            if let &[one, other] = ports
                && one.0 != other.0
                && [one, other].iter().all(|&(own, port)| port < 2 && series(&each[own]).is_some())
            {
                across.extend([(one, other), (other, one)]);
            }
        }
        let mut chains: Vec<Chain> = Vec::new();
        for start in 0..each.len() {
            let [one, two] = [0, 1].map(|port| across.contains_key(&(start, port)));
            if one == two || chains.iter().any(|chain| chain.has(start)) {
                continue;
            }
            let mut links = vec![(start, usize::from(one))];
            while let Some(&next) = links.last().and_then(|(own, entered)| across.get(&(*own, 1 - entered))) {
                links.push(next);
            }
            chains.push(Chain(links));
        }
        chains
    }

    pub fn has(&self, component: usize) -> bool {
        self.0.iter().any(|(own, _)| *own == component)
    }

    /// Returns the component that composes its flow path.
    pub fn first(&self) -> usize {
        self.0[0].0
    }

    pub fn ends(&self) -> [PortId; 2] {
        let (last, entered) = self.0[self.0.len() - 1];
        [self.0[0], (last, 1 - entered)]
    }

    /// Returns whether a port is between two of its restrictions.
    pub fn is_inside(&self, port: PortId) -> bool {
        port.1 < 2 && self.has(port.0) && !self.ends().contains(&port)
    }

    /// Returns the volume added to the joint at each end: half of the volume between its restrictions, m3.
    pub fn room<P: Lane>(&self, each: &[Instance<P>], ambient_temperature: P) -> Option<P> {
        let ports = self.0.iter().flat_map(|&(own, _)| [(own, 0), (own, 1)]);
        let inside = ports.filter(|port| self.is_inside(*port));
        let rooms = inside.filter_map(|(own, port)| match each[own].brings(port, ambient_temperature) {
            Brings::Room { volume } => Some(volume),
            _ => None,
        });
        rooms.reduce(|sum, room| sum + room).map(|sum| P::c(0.5) * sum)
    }

    /// Adds the flow path between the nodes at its ends, and the outputs of its components. The same flow passes all of
    /// them.
    pub fn compose<P: Lane>(
        &self,
        each: &[Instance<P>],
        ends: [Node; 2],
        build: &mut Build<P>,
    ) -> Result<(), Error>
    where
        Deps: Over<P>,
    {
        let [Node::Gas(from), Node::Gas(to)] = ends else { return Ok(()) };
        let members = || self.0.iter().map(|(own, _)| &each[*own]);
        if let Some(own) = members().find(|own| own.varies("subsonic_index")) {
            let what = "restrictions in series need 0.5: other values and derivatives by it are not possible";
            return refuse!("{}.subsonic_index: {what}", own.name);
        }
        let laws: Vec<[P; 2]> = members().filter_map(series).collect();
        let merged = |laws: &mut dyn Iterator<Item = [P; 2]>| laws.reduce(in_series).expect("two or more");
        let numbers = [merged(&mut laws.iter().copied()), merged(&mut laws.iter().rev().copied())];
        let above = members().map(|own| own.number("linear_above")).reduce(|one, other| one.min(other));
        let [forward, backward] = numbers.map(|law| build.usual_path(law, above.expect("two or more")));
        let path = build.circuit.between(from, to);
        let most = forward.conductance.max(backward.conductance);
        let ambient = build.ambient[1];
        let walls = members().filter_map(|own| tube_wall(own, ambient, &build.gas)).collect();
        let path = build.path_part(Series { forward, backward: Some(backward), walls, path }, most);
        for &(own, entered) in &self.0 {
            let path = if entered == 0 { path } else { path.backward() };
            for output in 0..each[own].table.outputs.len() {
                build.column(&each[own], output, Quantity::along(path));
            }
        }
        Ok(())
    }
}
