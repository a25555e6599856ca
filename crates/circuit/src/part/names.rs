//! Names of parts and of their states, and their indices within a circuit.

use crate::ground::{Channel, Kind, Of, Place, State};
use math::Gather;
use std::collections::BTreeMap;

/// Names of parts for users: every cylinder has the same name, independent of its friction.
#[derive(Default)]
pub(super) struct PartNames(BTreeMap<&'static str, usize>);

impl PartNames {
    /// Returns the name of the next part of this kind: "Cylinder 0", "Cylinder 1", ...
    pub(super) fn next(&mut self, kind: &'static str) -> String {
        let kind = kind.trim_start_matches("Other");
        let count = self.0.entry(kind).or_default();
        *count += 1;
        format!("{kind} {}", *count - 1)
    }
}

/// Names of the components and nodes of parts: the prefixes of their state names.
#[derive(Clone, Debug, Default)]
pub(crate) struct Called {
    pub owners: Vec<String>,
    pub gas: BTreeMap<usize, String>,
    pub axes: BTreeMap<usize, String>,
}

impl Called {
    /// Returns the prefix of the state names of the `i`-th part of a kind: its owner, with a number if the owner has
    /// several such parts.
    pub(super) fn part(&self, owners: &[usize], i: usize, name: &str) -> String {
        let kind = |name: &str| name.to_lowercase().replace(' ', "_");
        let own = |owner: &&usize| **owner == owners[i];
        match (owners[i], owners.iter().filter(own).count()) {
            (0, _) => kind(name),
            (owner, 1) => self.owners[owner - 1].clone(),
            (owner, _) => {
                let number = owners[..=i].iter().filter(own).count();
                format!(
                    "{}.{}_{number}",
                    self.owners[owner - 1],
                    kind(name.split(' ').next().unwrap_or(name))
                )
            }
        }
    }

    /// Returns the name of a state of a part.
    pub(super) fn state(&self, part: &str, state: &State) -> String {
        let node = |names: &BTreeMap<usize, String>, what: &str, node: usize| {
            names.get(&node).map_or_else(|| format!("{what}_{node}."), Clone::clone) + state.name
        };
        match state.of {
            Of::Part => format!("{part}.{}", state.name),
            Of::Gas(own) => node(&self.gas, "gas", own),
            Of::Axis(own) => node(&self.axes, "axis", own),
        }
    }
}

/// Returns the parts of a kind of lanes, from those of each lane.
pub(super) fn side_by_side<R, T: Gather<R>>(each: &[&Vec<(Place, T)>]) -> Vec<(Place, T::Lanes)> {
    let part = |i: usize| {
        let own: Vec<&T> = each.iter().map(|parts| &parts[i].1).collect();
        (each[0][i].0, T::gather(&own))
    };
    (0..each[0].len()).map(part).collect()
}

/// A part with its states and balances of a circuit.
pub(super) struct PartLayout<'p> {
    pub kind: &'static str,
    pub place: &'p mut Place,
    pub states: Vec<State>,
    pub channels: Vec<(&'static str, Kind)>,
}

/// Gives every part its indices: the states' names and scales in that order, then the balances.
pub(super) fn place(mut parts: Vec<PartLayout>, called: &Called) -> (Vec<(String, State)>, Vec<Channel>) {
    let (mut states, mut channels) = (Vec::new(), Vec::new());
    let (mut named, mut counted) = (PartNames::default(), PartNames::default());
    for of_kind in parts.chunk_by_mut(|one, next| one.kind == next.kind) {
        let owners: Vec<usize> = of_kind.iter().map(|part| part.place.owner).collect();
        for (i, part) in of_kind.iter_mut().enumerate() {
            let own = std::mem::take(&mut part.states);
            let name = called.part(&owners, i, &named.next(part.kind));
            *part.place = Place { first: states.len(), count: own.len(), ..*part.place };
            states.extend(own.into_iter().map(|state| (called.state(&name, &state), state)));
        }
    }
    for PartLayout { kind, place, channels: own, .. } in parts {
        let number = counted.next(kind);
        let name = place.owner.checked_sub(1).map_or(number, |owner| called.owners[owner].clone());
        (place.first_account, place.accounts) = (channels.len(), own.len());
        channels
            .extend(own.into_iter().map(|(what, kind)| Channel { name: format!("{name}: {what}"), kind }));
    }
    (states, channels)
}
