//! Limits of a circuit: room and gas of a volume, reach of a leg.

use super::Circuit;
use crate::part::gas;
use math::Lane;
use ode::System;

/// Shortage of a volume.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Lacking {
    Room,
    Gas,
}

impl Lacking {
    /// Fraction at which a volume has none left.
    pub fn least(self) -> f64 {
        match self {
            Lacking::Room => gas::volume::LEAST_ROOM,
            Lacking::Gas => gas::volume::LEAST_GAS,
        }
    }
}

/// A volume with little room or gas left. The amount is relative to its dead volume, or to the gas in the dead volume
/// at standard conditions.
#[derive(Clone, Debug)]
pub struct Scarce {
    /// Name of the volume: "left.a", or "chamber a" of a drive.
    pub volume: String,
    pub what: Lacking,
    pub share: f64,
}

impl<R: Lane> Circuit<R> {
    /// Returns the volume that has relatively the least room or gas left at state `y` of one lane.
    pub fn scarcest(&self, y: &[R], lane: usize) -> Option<Scarce> {
        let mut net = self.work::<R>();
        self.evaluate(y, &mut net);
        let each = self.volumes().flat_map(|(first, volume, name)| {
            let named = self.topology.names[first].0.rsplit_once('.').map_or(name, |(of, _)| of);
            let scarce = move |what, share| Scarce { volume: named.into(), what, share };
            let share = |value: R, of: R| value.get(lane) / of.get(lane);
            let room = net.gas[volume.node].volume;
            [
                scarce(Lacking::Room, share(room, volume.dead_volume)),
                scarce(Lacking::Gas, share(y[first], self.scale[first])),
                scarce(Lacking::Gas, share(y[first + 1], self.scale[first + 1])),
            ]
        });
        // Visits the volumes with their distance from the least room or gas.
        let near = |scarce: &Scarce| scarce.share / scarce.what.least();
        each.min_by(|a, b| near(a).total_cmp(&near(b)))
    }

    /// Returns the leg of a platform at the end of its reach in a lane, and the pose, in words.
    pub(crate) fn stretched(&self, y: &[R], lane: usize) -> Option<String> {
        self.parts.platforms.iter().find_map(|(place, platform)| {
            let leg = platform.stretched(&y[place.first..place.first + place.count], lane)?;
            let states = place.first..place.first + platform.nodes.len();
            let each = states.map(|i| format!("{} = {:.6}", self.topology.names[i].0, y[i].get(lane)));
            Some(format!(
                "leg {} is at the end of its reach at {}",
                leg + 1,
                each.collect::<Vec<_>>().join(", ")
            ))
        })
    }
}
