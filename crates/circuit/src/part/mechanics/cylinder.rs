use crate::ground::{Common, Given, Kind, Net, Own, OwnMut, Part, State, Switching, inputs};
use crate::part::gas::volume::LEAST_ROOM;
use crate::part::mechanics::axis::events_of_a_mass;
use crate::part::{Axis, ChamberLaw, EndStops, Face, Volume};
use math::{Lane, Over};
use physics::constants::P_0;

/// A double-acting cylinder: an axis between two chambers, with end stops. It has the same laws as its separate parts,
/// but the values between them stay in registers. This halves the work.
///
/// States: x, v, m_a, U_a, m_b, U_b, then the inner states of the friction law. `USUAL` states that its friction is
/// usual (see [`physics::friction::Contact::is_usual`]) and its gas ideal. Other cylinders are a separate kind, so that
/// an ordinary drive does not use registers for them.
#[derive(Clone, Debug)]
pub struct Cylinder<P, const USUAL: bool = true> {
    /// Piston, rod and load.
    pub axis: Axis<P>,
    /// Chambers a and b.
    pub volumes: [Volume<P>; 2],
    /// The sides of the piston in chambers a and b.
    pub faces: [Face<P>; 2],
    /// Contacts of the piston at both ends.
    pub stops: EndStops<P>,
    /// Least remaining fraction of each dead volume. Before the piston meets the covers far behind its stroke, it is
    /// the remaining fraction there.
    least_room: [P; 2],
    /// Least wall area of a chamber, m2, once the covers are active.
    pub(crate) least_wall: P,
    /// Whether they are active in any lane.
    pub(crate) met: bool,
}

/// First states of the two chambers and of the friction law.
pub(crate) const CHAMBERS: [usize; 2] = [2, 4];
pub(crate) const INNER: usize = 6;

/// A cylinder with other friction, or with a real gas.
pub type OtherCylinder<P> = Cylinder<P, false>;

math::gather!(Cylinder [const USUAL: bool] { axis, volumes, faces, stops, least_room, least_wall } of {
    met: |each: &[&Self]| each.iter().any(|own| own.met),
});

impl<R: Lane, const USUAL: bool> Cylinder<R, USUAL> {
    /// Far behind the end of its stroke, the piston meets the covers, if there are any, and has swept the whole wall.
    /// The wall area then stays at zero. A negative area would let heat flow from cold to hot. Covers and wall limit
    /// are omitted from the equations until a step would end there. They cost nothing and move no bit in normal
    /// operation.
    pub(crate) fn new(
        axis: Axis<R>,
        volumes: [Volume<R>; 2],
        faces: [Face<R>; 2],
        stops: EndStops<R>,
    ) -> Self {
        let least_room = [0, 1].map(|side| {
            let (volume, face) = (&volumes[side], &faces[side]);
            let swept = face.area * face.end_wall / (face.perimeter * volume.dead_volume);
            let bare = match volume.law {
                ChamberLaw::EnergyBalance if face.perimeter.get(0) > 0.0 => R::one() - swept,
                _ => R::zero(),
            };
            let covered = stops.covers.as_ref().map_or(0.0, |covers| covers.left);
            bare.max(R::c(covered)).max(R::c(LEAST_ROOM))
        });
        Cylinder { axis, volumes, faces, stops, least_room, least_wall: R::c(f64::NEG_INFINITY), met: false }
    }

    /// Adds the effects far behind the end of the stroke to the equations of a lane. Returns true if they were omitted
    /// before.
    pub(crate) fn meet(&mut self, lane: usize) -> bool {
        let left_out = self.least_room.iter().any(|least| least.get(lane) > LEAST_ROOM);
        if left_out {
            self.least_room.iter_mut().for_each(|least| least.put(lane, LEAST_ROOM));
            self.least_wall.put(lane, 0.0);
            self.stops.meet(lane);
            self.met = true;
        }
        left_out
    }
}

impl<R: Lane, const USUAL: bool> Cylinder<R, USUAL> {
    /// Returns `so_far` if both chambers have room and gas at every state within `spread` of `y`. A lane without room
    /// or gas in a chamber gets -1.
    #[inline(always)]
    pub(crate) fn holds(
        &self,
        y: Own<R>,
        spread: &[R::Plain; INNER],
        scale: Own<R>,
        so_far: R::Plain,
    ) -> R::Plain {
        let (y, scale): ([R; INNER], [R; INNER]) = (y.first(), scale.first());
        let least = |i: usize| y[i].plain() - spread[i];
        let mut so_far = so_far;
        for (i, (volume, face)) in self.sides().enumerate() {
            let first = CHAMBERS[i];
            let reach = face.area.plain() * spread[0];
            let room = face.room(y[0].plain(), volume.dead_volume.plain()) - reach;
            so_far = volume.holds(
                room,
                [least(first), least(first + 1)],
                [scale[first], scale[first + 1]],
                self.least_room[i].plain(),
                so_far,
            );
        }
        so_far
    }
}

impl<P: Lane, const USUAL: bool> Cylinder<P, USUAL> {
    fn sides(&self) -> impl Iterator<Item = (&Volume<P>, &Face<P>)> {
        self.volumes.iter().zip(&self.faces)
    }

    /// Returns the speed at which the mass has as much energy as the gas of the whole cylinder at standard pressure.
    pub(crate) fn swing_speed(&self, common: &Common<P>) -> P {
        let dead = self.volumes[0].dead_volume + self.volumes[1].dead_volume;
        let swept = P::c(0.5) * (self.faces[0].area + self.faces[1].area) * self.stops.stroke;
        let energy = P::c(P_0) * (dead + swept) * common.gas.cv / common.gas.gas_constant;
        (P::c(2.0) * energy / (self.axis.mass + self.axis.inertia)).sqrt()
    }

    /// Returns the energy stored in chamber a, chamber b and the stops.
    fn others_stored<S: Over<P>>(&self, y: Own<S>, net: &Net<S>, common: &Common<P>) -> [[S; 3]; 3] {
        let [a, b] = &self.volumes;
        [a.stored(y, net, common), b.stored(y, net, common), self.stops.stored(y, net, common)]
    }
}

impl<P: Lane, const USUAL: bool> Part<P> for Cylinder<P, USUAL> {
    fn states(&self) -> Vec<State> {
        let axis = Part::<P>::states(&self.axis);
        let mut states = axis[..2].to_vec();
        states.extend(self.volumes.iter().flat_map(Part::<P>::states));
        states.extend_from_slice(&axis[2..]);
        states
    }

    inputs! { axis.external_force: "external force", "N", physics::any() }

    #[inline(always)]
    fn place<S: Over<P>>(&self, y: Own<S>, net: &mut Net<S>, common: &Common<P>) {
        // By reference, because numbers with many derivatives take long to copy.
        let own = y.after(0);
        let axis = &mut net.axis[self.axis.node];
        self.axis.stand([own[0], own[1]], axis);
        for ((volume, face), first) in self.sides().zip(CHAMBERS) {
            let states = [own[first], own[first + 1]];
            let node = &mut net.gas[volume.node];
            volume.reset(node);
            face.enlarge(axis, node);
            if self.met {
                node.wall = node.wall.max(S::from(self.least_wall));
            }
            volume.fill(states, node, common);
            if !USUAL {
                volume.fill_real(states, node, &mut net.enthalpy, common);
            }
            face.push(node.p, axis, common);
        }
        self.stops.push(axis);
    }

    #[inline(always)]
    fn rate<S: Over<P>>(&self, y: Own<S>, dy: OwnMut<S>, net: &mut Net<S>, common: &Common<P>) {
        let axis = &mut net.axis[self.axis.node];
        let (own, inner) = dy.split(INNER);
        [own[0], own[1]] = self.axis.accelerate::<S, USUAL>(y.after(INNER), inner, axis);
        for (volume, first) in self.volumes.iter().zip(CHAMBERS) {
            [own[first], own[first + 1]] = volume.rates(&mut net.gas[volume.node], common);
        }
    }

    fn stored<S: Over<P>>(&self, y: Own<S>, net: &Net<S>, common: &Common<P>) -> [S; 3] {
        let mut sum = self.axis.stored_in(y.after(INNER), net);
        for own in self.others_stored(y, net, common) {
            for (sum, own) in sum.iter_mut().zip(own) {
                *sum += own;
            }
        }
        sum
    }

    fn stores<S: Over<P>>(&self, y: Own<S>, net: &Net<S>, common: &Common<P>) -> Vec<S> {
        let mut stores = self.axis.stores_in(y.after(INNER), net).to_vec();
        stores.extend(self.others_stored(y, net, common).map(|[_, energy, _]| energy));
        stores
    }

    fn channels(&self) -> Vec<(&'static str, Kind)> {
        let mut all = self.axis.channels();
        for (volume, face) in self.sides() {
            all.extend(volume.channels());
            all.extend(face.channels());
        }
        all.extend(self.stops.channels());
        all
    }

    fn account<S: Over<P>>(&self, y: Own<S>, dy: Own<S>, net: &Net<S>, common: &Common<P>, out: &mut [S]) {
        let (own, mut rest) = out.split_at_mut(3);
        self.axis.account_in(y.after(INNER), dy.after(INNER), net, common, own);
        for (volume, face) in self.sides() {
            let (own, more) = rest.split_at_mut(3);
            volume.account(y, dy, net, common, own);
            let (own, more) = more.split_at_mut(1);
            face.account(y, dy, net, common, own);
            rest = more;
        }
        self.stops.account(y, dy, net, common, rest);
    }

    fn standing<S: Over<P>>(&self, net: &Net<S>, common: &Common<P>, out: &mut [S]) {
        let stops = out.len() - Part::<P>::channels(&self.stops).len();
        self.stops.standing(net, common, &mut out[stops..]);
    }

    fn begin(&self, given: &Given<P>, y: OwnMut<P>, net: &Net<P>, common: &Common<P>) {
        let (own, z) = y.split(INNER);
        for (volume, first) in self.volumes.iter().zip(CHAMBERS) {
            if let Some(gas) = given.gas(volume.starts_as) {
                own[first..first + 2].copy_from_slice(&volume.start(gas, &net.gas[volume.node], common));
            }
        }
        self.axis.begin_in(given, (own, z));
    }

    fn n_obstacles(&self) -> usize {
        Part::<P>::n_obstacles(&self.stops)
    }

    fn obstacles(&self, y: Own<P>, _net: &Net<P>, out: &mut [P]) {
        let [x] = y.first();
        out.copy_from_slice(&self.stops.ahead(x));
    }

    events_of_a_mass!(self => self.axis, INNER);
}
