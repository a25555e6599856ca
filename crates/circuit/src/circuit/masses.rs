//! The moving masses of a circuit, and its volumes.

use super::Circuit;
use crate::ground::{AxisId, AxisNode, Place};
use crate::part::mechanics::axis::at;
use crate::part::mechanics::cylinder::{CHAMBERS, INNER};
use crate::part::{Axis, EndStops, InputId, PartId, PartKind, Platform, Volume};
use math::{Lane, Over};

/// A mass: its part, the indices of its states (x and v first), the mass, and the offset of the inner states of its
/// friction.
pub(super) type Mass<'c, P> = (PartId, Place, &'c Axis<P>, usize);

impl<P: Lane> Circuit<P> {
    /// Returns every mass.
    pub(super) fn masses(&self) -> impl Iterator<Item = Mass<'_, P>> {
        let id = |kind, index| PartId { kind, index };
        let axes = self.parts.axes.iter().enumerate();
        let usual = self.parts.cylinders.iter().enumerate();
        let others = self.parts.other_cylinders.iter().enumerate();
        let axes = axes.map(move |(i, (place, own))| (id(PartKind::Axis, i), *place, own, 2));
        let usual = usual.map(move |(i, (place, own))| (id(PartKind::Cylinder, i), *place, &own.axis, INNER));
        let others =
            others.map(move |(i, (place, own))| (id(PartKind::OtherCylinder, i), *place, &own.axis, INNER));
        axes.chain(usual).chain(others)
    }

    /// Returns the leg of a platform that is this axis: index of the platform, of the leg, and of its first state.
    pub(super) fn leg(&self, id: AxisId) -> Option<(usize, usize, usize, &Platform<P>)> {
        self.parts.platforms.iter().enumerate().find_map(|(index, (place, platform))| {
            let leg = platform.nodes.iter().position(|node| *node == id.0)?;
            Some((index, leg, place.first, platform))
        })
    }

    fn mass(&self, id: AxisId) -> Mass<'_, P> {
        self.masses().find(|(_, _, axis, _)| axis.node == id.0).expect("an axis of this circuit")
    }

    /// Returns the state index of an axis' position. Its velocity follows. `None` if the motion of the axis is
    /// commanded.
    pub fn position_state(&self, axis: AxisId) -> Option<usize> {
        let mut masses = self.masses();
        masses.find(|(.., own, _)| own.node == axis.0).map(|(_, place, ..)| place.first)
    }

    /// Returns the friction of steady sliding of an axis at the position, speed and pressures of a node, N.
    pub fn steady_friction<S: Over<P>>(&self, axis: AxisId, node: &AxisNode<S>) -> S {
        if let Some((_, leg, _, platform)) = self.leg(axis) {
            return platform.contacts[leg].as_ref().map_or(S::zero(), |own| own.steady(&at(node)));
        }
        self.mass(axis).2.steady_friction(node)
    }

    /// Returns all end stops, of cylinders and of other masses.
    pub(super) fn stops(&self) -> impl Iterator<Item = &EndStops<P>> {
        let usual = self.parts.cylinders.iter().map(|(_, cylinder)| &cylinder.stops);
        let others = self.parts.other_cylinders.iter().map(|(_, cylinder)| &cylinder.stops);
        usual.chain(others).chain(self.parts.end_stops.iter().map(|(_, stops)| stops))
    }

    /// Returns every volume with the index of its two states, and its name for users.
    pub(super) fn volumes(&self) -> impl Iterator<Item = (usize, &Volume<P>, &'static str)> {
        let tanks = self.parts.volumes.iter().map(|(place, volume)| (place.first, volume, "a volume"));
        let usual = self.parts.cylinders.iter().map(|(place, cylinder)| (place, &cylinder.volumes));
        let others = self.parts.other_cylinders.iter().map(|(place, cylinder)| (place, &cylinder.volumes));
        let chambers = usual.chain(others).flat_map(|(place, volumes)| {
            let sides = CHAMBERS.iter().zip(volumes).zip(["chamber a", "chamber b"]);
            sides.map(|((offset, volume), name)| (place.first + offset, volume, name))
        });
        tanks.chain(chambers)
    }
}

impl<R: Lane> Circuit<R> {
    /// Returns the mode of an axis' friction: -1, 0, +1. The friction of a leg has no mode.
    pub fn mode(&self, axis: AxisId) -> R {
        self.leg(axis).map_or_else(|| self.mass(axis).2.mode, |_| R::zero())
    }

    /// Returns the inner states of an axis' friction within `y`.
    pub fn inner_states<'y>(&self, axis: AxisId, y: &'y [R]) -> &'y [R] {
        if let Some((_, leg, first, platform)) = self.leg(axis) {
            return &y[first..][platform.inner_range(leg)];
        }
        let (_, place, _, inner) = self.mass(axis);
        &y[place.first + inner..place.first + place.count]
    }

    /// Returns the input for the external force on an axis, N in +x.
    pub fn external_force(&self, axis: AxisId) -> InputId {
        if let Some((index, input, ..)) = self.leg(axis) {
            return PartId { kind: PartKind::Platform, index }.input(input);
        }
        self.mass(axis).0.input(0)
    }

    /// Returns whether `meet` has added contacts far behind the end of a stroke, in any lane.
    pub fn has_met(&self) -> bool {
        let usual = self.parts.cylinders.iter().any(|(_, cylinder)| cylinder.met);
        usual || self.parts.other_cylinders.iter().any(|(_, cylinder)| cylinder.met)
    }

    /// Designs derived end stops for the highest pressure of a start, Pa absolute.
    pub(crate) fn lay_out_stops(&mut self, start: R) {
        let usual = self.parts.cylinders.iter_mut().map(|(_, cylinder)| &mut cylinder.stops);
        let others = self.parts.other_cylinders.iter_mut().map(|(_, cylinder)| &mut cylinder.stops);
        let each = usual.chain(others).chain(self.parts.end_stops.iter_mut().map(|(_, stops)| stops));
        each.for_each(|stops| stops.lay_out(start));
    }

    /// Returns the pressure for which they are designed, if any, Pa absolute.
    pub(crate) fn stops_laid_out_for(&self) -> Option<R> {
        self.stops().find_map(|stops| stops.follows.as_ref()).map(|follows| follows.start)
    }
}
