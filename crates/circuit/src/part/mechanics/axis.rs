use crate::ground::{AxisNode, Common, Given, Kind, Net, Of, Own, OwnMut, Part, State, Switching, inputs};
use crate::part::mechanics::damper;
use math::{Lane, Over, Real};
use ode::Accepted;
use physics::friction::{At, Contact};
use physics::mechanics::Inertia;

/// A mass that moves along one line, with friction: piston, slide and load.
///
///   `dx/dt = v,   m dv/dt = sum of forces - friction                   [N], +x`
///
/// The weight m g sin(incline) and an external force act on it. Pressures, springs and end stops are separate parts. In
/// the stick mode of a law that has this mode, v = 0 exactly.
#[derive(Clone, Debug)]
pub struct Axis<P> {
    /// Moving mass m, kg.
    pub mass: P,
    /// Mass that friction adds to the acceleration term, kg. This mass moves with the piston.
    pub inertia: P,
    /// 1/(m + inertia), prepared.
    pub inverse_mass: P,
    /// Weight along the axis, N, positive if it pulls towards -x.
    pub weight: P,
    /// External force in +x, N: an input.
    pub external_force: P,
    /// `None`: no friction.
    pub friction: Option<Contact<P>>,
    /// A mass coupled by a ratio that depends on the position.
    pub(crate) moves: Vec<Inertia<P>>,
    /// Mode of friction, -1, 0 or +1: see [`physics::friction`].
    pub mode: P,
    /// Largest error scale of each inner state, in its unit: see [`largest_scales`].
    pub(crate) largest_scales: Vec<f64>,
    /// Index among the axes of the net.
    pub node: usize,
}

math::gather!(Axis { mass, inertia, inverse_mass, weight, external_force, friction, moves, mode } same { largest_scales, node });

/// The state of a law with one spring.
const DEFLECTION: &str = "bristle_deflection_m";
/// Largest error scale of a deflection, as a multiple of the deflection at which the spring carries the whole friction
/// force.
const DEFLECTION_SCALE: f64 = 100.0;
/// The same limit for the force of a deflection in sliding. At larger deflections, bristle damping may be much steeper
/// than the spring.
const SLIDING_SCALE: f64 = 1e4;
/// Speeds at which the friction is sampled, m/s.
const SLIDING: [f64; 4] = [1e-3, 1e-2, 1e-1, 1.0];

/// Returns the largest error scales for which the tolerance still resolves the springs of a law. Infinite for a state
/// that is not a deflection.
pub(crate) fn largest_scales<R: Lane>(contact: &Contact<R>) -> Vec<f64> {
    let mut scales = vec![f64::INFINITY; contact.states().len()];
    if contact.states().first().is_some_and(|state| state.name == DEFLECTION) {
        scales[0] = deflection_scale(contact);
    }
    for (i, scale) in scales.iter_mut().enumerate() {
        if let Some(limit) = contact.law.element_limit(i) {
            *scale = DEFLECTION_SCALE * limit.get(0);
        }
    }
    scales
}

/// Returns the inner states of the contact of an axis, with error scales within the largest ones.
pub(crate) fn inner_states<R: Lane>(
    contact: Option<&Contact<R>>,
    largest: &[f64],
    axis: usize,
) -> Vec<State> {
    let inner = contact.map_or(Vec::new(), Contact::states).into_iter().zip(largest);
    let each = inner.map(|(state, largest)| State::own(state.name, state.unit, state.scale.min(*largest)));
    each.map(|state| state.of(Of::Axis(axis))).collect()
}

/// Returns the scale of the single spring of a law, m.
fn deflection_scale<R: Lane>(contact: &Contact<R>) -> f64 {
    let states = contact.states();
    let mut z = vec![R::zero(); states.len()];
    z[0] = R::one();
    let stiffness = 2.0 * contact.stored(&z).get(0);
    let levels = contact.law.levels();
    let level = levels.coulomb.get(0).max(levels.breakaway.get(0));
    let steepness = SLIDING.map(|v| {
        let at = At { v: R::c(v), prepared: contact.law.prepare(R::c(v)), ..At::at_rest() };
        let (mut z, mut rates) = (z.clone(), z.clone());
        let [at_limit, beyond] = [1.0, 2.0].map(|share| {
            z[0] = R::c(share * level / stiffness);
            contact.force(&at, &z, &mut rates, R::one()).get(0)
        });
        (beyond - at_limit).abs() / level
    });
    let steepest = steepness.into_iter().fold(0.0, f64::max);
    let share = DEFLECTION_SCALE.min(if steepest > 0.0 { SLIDING_SCALE / steepest } else { f64::INFINITY });
    share * level / stiffness
}

/// Points and weights in [0, 1] that integrate a product of two states along a step exactly: a polynomial of order 7.
pub(crate) const GAUSS: [(f64, f64); 4] = [
    (0.069_431_844_202_973_71, 0.173_927_422_568_726_93),
    (0.330_009_478_207_571_87, 0.326_072_577_431_273_07),
    (0.669_990_521_792_428_1, 0.326_072_577_431_273_07),
    (0.930_568_155_797_026_3, 0.173_927_422_568_726_93),
];

/// Returns the values at which the friction law of a mass is evaluated.
#[inline(always)]
pub(crate) fn at<S: Real>(node: &AxisNode<S>) -> At<S> {
    At {
        v: node.v,
        x: node.x,
        gauge_a: node.gauge_a,
        gauge_b: node.gauge_b,
        applied: node.force,
        prepared: node.prepared,
    }
}

impl<P: Lane> Axis<P> {
    /// Returns whether its friction, if any, is evaluated inline (see [`Contact::is_usual`]), and its mass is constant.
    pub(crate) fn is_usual(&self) -> bool {
        self.friction.as_ref().is_none_or(|contact| contact.is_usual) && self.moves.is_empty()
    }

    /// Position, velocity and the constant forces.
    #[inline(always)]
    pub(crate) fn stand<S: Over<P>>(&self, y: [S; 2], node: &mut AxisNode<S>) {
        [node.x, node.v] = y;
        node.force = S::from(self.external_force - self.weight);
        node.end_stop = S::zero();
        if let Some(contact) = &self.friction {
            node.prepared = contact.law.prepare(node.v);
        }
    }

    /// Computes friction and acceleration from all other forces. Sets the rates of the inner states. `USUAL` states
    /// that the friction is usual, see [`Contact::is_usual`].
    #[inline(always)]
    pub(crate) fn accelerate<S: Over<P>, const USUAL: bool>(
        &self,
        z: &[S],
        dz: &mut [S],
        node: &mut AxisNode<S>,
    ) -> [S; 2] {
        node.friction = match &self.friction {
            Some(contact) if USUAL => contact.usual_force(&at(node), z, dz, self.mode),
            Some(contact) => contact.force(&at(node), z, dz, self.mode),
            None => S::zero(),
        };
        node.a = (node.force - node.friction) * S::from(self.inverse_mass);
        if !USUAL && !self.moves.is_empty() {
            let (mass, half) = self.moved(node.x);
            node.a = (node.force - node.friction - half * node.v * node.v) / mass;
        }
        if !USUAL {
            node.friction = S::from(self.inertia).fma(node.a, node.friction);
        }
        [node.v, node.a]
    }

    /// Returns the whole mass at a position, kg, and half of its slope, kg/m.
    fn moved<S: Over<P>>(&self, x: S) -> (S, S) {
        let own = (S::from(self.mass + self.inertia), S::zero());
        self.moves.iter().fold(own, |(mass, half), moves| {
            let [more, slope] = moves.at(x);
            (mass + more, half + slope)
        })
    }

    /// Returns the mass at a position, including coupled masses, kg.
    pub(crate) fn mass_at(&self, x: P) -> P {
        self.moves.iter().fold(self.mass, |mass, moves| mass + moves.at(x)[0])
    }

    /// Returns the friction of steady sliding (after any transient) at a node, N.
    pub(crate) fn steady_friction<S: Over<P>>(&self, node: &AxisNode<S>) -> S {
        self.friction.as_ref().map_or(S::zero(), |contact| contact.steady(&at(node)))
    }

    /// Returns kinetic and potential energy, and the energy of bristles with inner states `z`, J.
    pub(crate) fn stores_in<S: Over<P>>(&self, z: &[S], net: &Net<S>) -> [S; 3] {
        let node = &net.axis[self.node];
        let kinetic = S::c(0.5) * self.moved(node.x).0 * node.v * node.v;
        let bristles = self.friction.as_ref().map_or(S::zero(), |contact| contact.stored(z));
        [kinetic, S::from(self.weight) * node.x, bristles]
    }

    /// Returns the energy stored by the axis with inner states `z`, J.
    pub(crate) fn stored_in<S: Over<P>>(&self, z: &[S], net: &Net<S>) -> [S; 3] {
        let [kinetic, height, bristles] = self.stores_in(z, net);
        [S::zero(), kinetic + height + bristles, S::zero()]
    }

    /// Computes rates of the balances of the axis with inner states `z`, whose rates are `dz`. Work on the damping of
    /// bristles is not included: see [`Axis::damped_in`].
    pub(crate) fn account_in<S: Over<P>>(
        &self,
        z: &[S],
        dz: &[S],
        net: &Net<S>,
        common: &Common<P>,
        out: &mut [S],
    ) {
        let node = &net.axis[self.node];
        let friction = self.friction.as_ref();
        let heat = friction.map_or(S::zero(), |contact| heat_of(contact, self.inertia, node, (z, dz)));
        out[0] = S::from(self.external_force) * node.v;
        damper::account(heat, common, &mut out[1..]);
    }

    /// Returns whether the force contains the rate of a deflection.
    pub(crate) fn is_damped(&self) -> bool {
        self.friction.as_ref().is_some_and(|contact| contact.law.is_damped())
    }

    /// Returns the events of its law, by their tolerances: one if it has a stick mode.
    pub(crate) fn events_of_law(&self) -> &'static [f64] {
        let sticks = self.friction.as_ref().is_some_and(|contact| contact.law.meta().sticks);
        if sticks { &[EVENT_TOLERANCE] } else { &[] }
    }

    /// Returns whether an event of the law's mode leaves it at rest.
    fn stops(&self) -> bool {
        self.friction.as_ref().is_some_and(|contact| contact.law.meta().stops)
    }

    fn contact(&self) -> &Contact<P> {
        self.friction.as_ref().expect("an axis with events has a law")
    }

    /// The event function of the law's mode, with inner states `z`.
    pub(crate) fn event_in(&self, z: &[P], net: &Net<P>) -> P {
        self.contact().event(&at(&net.axis[self.node]), z, self.mode)
    }

    /// Sets position, velocity and the inner states of friction to given values.
    pub(crate) fn begin_in(&self, given: &Given<P>, (motion, z): (&mut [P], &mut [P])) {
        if let Some(start) = given.axis(self.node) {
            motion[..2].copy_from_slice(&start);
        }
        begin_inner(self.friction.as_ref(), self.node, given, z);
    }
}

/// Balances of a mass.
pub(crate) const CHANNELS: [(&str, Kind); 3] =
    [("external work", Kind::Energy), ("friction heat", Kind::Energy), ("friction", Kind::EntropyOfSolid)];

/// Returns the heat of the friction of a mass with inner states `z`, whose rates are `dz`, W. Work on the damping of
/// bristles is not included: see [`Axis::damped_in`].
pub(crate) fn heat_of<P: Lane, S: Over<P>>(
    contact: &Contact<P>,
    inertia: P,
    node: &AxisNode<S>,
    (z, dz): (&[S], &[S]),
) -> S {
    let force = S::from(-inertia).fma(node.a, node.friction);
    let heat = contact.heat(node.v, force, z, dz);
    if contact.law.is_damped() { heat - contact.law.damping(node.v) * node.v * dz[0] } else { heat }
}

/// Sets the inner states `z` of the friction of an axis to given values.
pub(crate) fn begin_inner<P: Lane>(contact: Option<&Contact<P>>, node: usize, given: &Given<P>, z: &mut [P]) {
    if let Some((_, age)) = given.ages.iter().find(|(id, _)| id.0 == node)
        && let Some(i) = contact.and_then(Contact::age_index)
    {
        z[i] = *age;
    }
    if let Some((_, states)) = given.inner.iter().find(|(id, _)| id.0 == node) {
        z.copy_from_slice(states);
    }
}

/// Depth of an event in its unit, N in stick and m/s in slip: 1e-9 is much less than any step resolves.
pub(crate) const EVENT_TOLERANCE: f64 = 1e-9;

impl<R: Lane> Axis<R> {
    /// Adds the work on the damping of bristles in a step to the balances of a mass. The states of the mass begin at
    /// `first`, and those of its friction `inner` further on.
    ///
    ///   `W = int sigma1(v) v dz                                                     [J]`
    ///
    /// An integral over time would be wrong. If bristles follow the velocity within a fraction of the step, dz/dt at
    /// the stages is not the true rate of z. The stage equations correct for this. The deflection along the step is
    /// that of the states, to their tolerance.
    pub(crate) fn damped_in(
        &self,
        first: usize,
        inner: usize,
        step: &mut Accepted<'_, R>,
        common: &Common<R>,
        accounts: &mut [R],
    ) {
        let Some(contact) = self.friction.as_ref().filter(|_| self.is_damped()) else { return };
        let mut work = R::zero();
        for (theta, weight) in GAUSS {
            let ([v, _], [_, dz]) = (step.state(first + 1, theta), step.state(first + inner, theta));
            work += R::c(weight) * contact.law.damping(v) * v * dz;
        }
        accounts[1] -= work;
        accounts[2] += work / common.ambient_temperature;
    }

    /// Sets one lane's mode after its event, and its inner states that remember events. If the event leaves the mass at
    /// rest, the velocity becomes zero, and the balance receives the kinetic energy.
    pub(crate) fn switch_in(&mut self, inner: usize, at: Switching<R>) {
        let Switching { lane, y, net, common, accounts, .. } = at;
        let ((motion, z), node) = (y.split(inner), &net.axis[self.node]);
        let (v, (mass, _)) = (node.v.get(lane), self.moved(node.x));
        if self.advance_mode(lane, z, net) {
            motion[1].put(lane, 0.0);
            if let [_, heat, entropy, ..] = accounts {
                let energy = 0.5 * mass.get(lane) * v * v;
                heat.put(lane, heat.get(lane) - energy);
                entropy.put(lane, entropy.get(lane) + energy / common.ambient_temperature.get(lane));
            }
        }
    }

    /// Returns the next mode of one lane, and its inner states that remember events. Also returns whether the mass is
    /// then at rest.
    fn advance_mode(&mut self, lane: usize, z: &mut [R], net: &Net<R>) -> bool {
        let node = &net.axis[self.node];
        let mut after = z.to_vec();
        let mode = self.contact().next_mode(self.mode, &at(node), &mut after);
        // A mass at rest under a further push in the same direction starts a new breakaway. Otherwise its event would
        // repeat at once.
        let goes_on = self.mode.get(lane) * mode.get(lane) > 0.0 && mode.get(lane) * node.v.get(lane) > 0.0;
        self.mode.put(lane, mode.get(lane));
        for (z, after) in z.iter_mut().zip(&after) {
            z.take(lane, after);
        }
        self.stops() && !goes_on
    }

    /// Sets the mode at these nodes, without a known mode: stick if the velocity is zero and the force too small. A
    /// mass in stick has no velocity and no derivative of the velocity.
    pub(crate) fn find_mode_in(&mut self, (motion, z): (&mut [R], &mut [R]), net: &Net<R>) {
        self.mode = self.contact().first_mode(&at(&net.axis[self.node]), z);
        for lane in 0..R::L {
            if self.mode.get(lane) == 0.0 && self.event_in(z, net).get(lane) < 0.0 {
                self.advance_mode(lane, z, net);
            }
            if self.stops() && self.mode.get(lane) == 0.0 {
                motion[1].put(lane, 0.0);
            }
        }
    }

    /// A mass that slides in one direction cannot have a velocity in the other. Between two checks, the error of a step
    /// may still produce one within the tolerance of the check.
    pub(crate) fn settle_in(&self, motion: &mut [R]) {
        if self.stops() {
            let (v, zero) = (&mut motion[1], R::Plain::zero());
            let backwards = (self.mode.plain() * v.plain()).lt(zero);
            *v = v.with_value(R::Plain::select(backwards, zero, v.plain()));
        }
    }
}

/// Inside `impl Part`: the events of a mass with friction, whose inner states begin at `$inner` among those of the
/// part.
macro_rules! events_of_a_mass {
    ($self:ident => $axis:expr, $inner:expr) => {
        fn events(&$self) -> &'static [f64] {
            $axis.events_of_law()
        }

        fn mode_mut(&mut $self, _event: usize) -> &mut P {
            &mut $axis.mode
        }

        fn event(&$self, _event: usize, y: Own<P>, net: &Net<P>) -> P {
            $axis.event_in(y.after($inner), net)
        }

        fn switch(&mut $self, at: Switching<P>) {
            $axis.switch_in($inner, at);
        }

        fn find_mode(&mut $self, _event: usize, y: OwnMut<P>, net: &Net<P>) {
            $axis.find_mode_in(y.split($inner), net);
        }

        fn settle(&$self, _event: usize, y: OwnMut<P>) {
            $axis.settle_in(y.split($inner).0);
        }
    };
}
pub(crate) use events_of_a_mass;

impl<P: Lane> Part<P> for Axis<P> {
    fn states(&self) -> Vec<State> {
        let motion = [State::own("position_m", "m", 0.1), State::own("velocity_m_s", "m/s", 0.1)];
        let motion = motion.map(|state| state.of(Of::Axis(self.node))).into_iter();
        motion.chain(inner_states(self.friction.as_ref(), &self.largest_scales, self.node)).collect()
    }

    inputs! { external_force: "external force", "N", physics::any() }

    #[inline(always)]
    fn place<S: Over<P>>(&self, y: Own<S>, net: &mut Net<S>, _common: &Common<P>) {
        self.stand(y.first(), &mut net.axis[self.node]);
    }

    #[inline(always)]
    fn rate<S: Over<P>>(&self, y: Own<S>, mut dy: OwnMut<S>, net: &mut Net<S>, _common: &Common<P>) {
        let rates = self.accelerate::<S, false>(y.after(2), dy.after(2), &mut net.axis[self.node]);
        dy.set(rates);
    }

    fn stored<S: Over<P>>(&self, y: Own<S>, net: &Net<S>, _common: &Common<P>) -> [S; 3] {
        self.stored_in(y.after(2), net)
    }

    fn stores<S: Over<P>>(&self, y: Own<S>, net: &Net<S>, _common: &Common<P>) -> Vec<S> {
        self.stores_in(y.after(2), net).to_vec()
    }

    fn channels(&self) -> Vec<(&'static str, Kind)> {
        CHANNELS.to_vec()
    }

    fn account<S: Over<P>>(&self, y: Own<S>, dy: Own<S>, net: &Net<S>, common: &Common<P>, out: &mut [S]) {
        self.account_in(y.after(2), dy.after(2), net, common, out);
    }

    fn begin(&self, given: &Given<P>, y: OwnMut<P>, _net: &Net<P>, _common: &Common<P>) {
        self.begin_in(given, y.split(2));
    }

    events_of_a_mass!(self => self, 2);
}
