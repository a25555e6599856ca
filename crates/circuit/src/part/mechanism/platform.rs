//! The platform as a part of a circuit.

use crate::ground::{Common, Given, Input, Kind, Net, Own, OwnMut, Part, State};
use crate::part::mechanics::axis::{CHANNELS, GAUSS, at, begin_inner, heat_of, inner_states};
use crate::part::mechanics::damper;
use crate::part::mechanism::dynamics::{Accelerations, Cholesky, Places, forms, with_square, with_sum};
use crate::part::mechanism::{Geometry, MOST, Mechanism, MechanismKind};
use math::{Lane, MOST_ARGUMENTS, Map, Over, Real};
use ode::Accepted;
use physics::friction::Contact;

/// Steps of Newton's method from a near pose. Twelve suffice for the legs of usual machines (assumed).
const STEPS: usize = 24;
/// Change of a leg with a coordinate, m/m or m, beyond which it is at the end of its reach (assumed).
const STEEP: f64 = 50.0;
/// Length and speed of a coordinate for the error scale: m or 1.
const SCALE: f64 = 0.1;

/// A platform on legs. Its coordinates and their rates are states. The positions of its legs are not.
#[derive(Clone, Debug)]
pub struct Platform<P> {
    /// Its mechanism.
    pub kind: MechanismKind,
    /// Dimensions and masses.
    pub geometry: Geometry<P>,
    /// Index of each leg among the axes of the net.
    pub nodes: Vec<usize>,
    /// Friction of each leg.
    pub contacts: Vec<Option<Contact<P>>>,
    /// External force on each leg in +x, N: inputs.
    pub external: Vec<P>,
    /// Mass inside the friction of each leg, kg.
    pub inertia: Vec<P>,
    /// Mass that moves along each leg in addition to the points of the mechanism, kg: the mass inside its friction. A
    /// rod behind a coupling is subtracted, because it moves on a separate axis.
    pub moved: Vec<P>,
    /// Offset of the inner states of each leg.
    pub inner: Vec<usize>,
    /// Largest error scale of each inner state of each leg.
    pub(crate) largest_scales: Vec<Vec<f64>>,
    /// Prescribed velocity of the one axis, m/s: an input. The second state is then the impulse of its force, N s.
    pub velocity: Option<P>,
}

math::gather!(Platform { geometry, contacts, external, inertia, moved, velocity } same { kind, nodes, inner, largest_scales });

impl<R: Lane> Platform<R> {
    /// Returns one if every leg reaches the coordinates, in each lane.
    pub(crate) fn reaches(&self, own: &[R]) -> R::Plain {
        let n = self.nodes.len();
        let mut out = [R::zero(); 2 * MOST];
        Map::<R>::at(&Places(self.kind, &self.geometry), &own[..2 * n], &mut out[..2 * n]);
        let (far, one) = (R::Plain::c(f64::MAX), R::Plain::one());
        // A root of a negative number is NaN, which is less than nothing.
        out[..n].iter().fold(one, |sum, x| R::Plain::select(x.plain().abs().lt(far), sum, -one))
    }

    /// Returns a leg at the end of its reach in a lane: its position changes steeply.
    pub(crate) fn stretched(&self, own: &[R], lane: usize) -> Option<usize> {
        each!(self.kind, M, N => {
            let (q, u): ([R; N], [R; N]) = (std::array::from_fn(|k| own[k]), [R::zero(); N]);
            let legs = forms::<M, R, R, N>(&self.geometry, &q, &u).legs;
            let steepness = |i: usize| legs[i].by_q.iter().map(|slope| slope.get(lane).abs()).fold(0.0, f64::max);
            let steepest = (0..N).max_by(|a, b| steepness(*a).total_cmp(&steepness(*b)))?;
            (steepness(steepest) > STEEP).then_some(steepest)
        })
    }

    /// Returns position and velocity of a leg at a point of a step, whose platform has its first state at `first`.
    pub(crate) fn leg_in(&self, (first, leg): (usize, usize), state: &mut impl FnMut(usize) -> R) -> [R; 2] {
        let n = self.nodes.len();
        let (mut x, mut out) = ([R::zero(); 2 * MOST], [R::zero(); 2 * MOST]);
        for (k, x) in x[..2 * n].iter_mut().enumerate() {
            *x = state(first + k);
        }
        Map::<R>::at(&Places(self.kind, &self.geometry), &x[..2 * n], &mut out[..2 * n]);
        [out[leg], self.velocity.unwrap_or(out[n + leg])]
    }

    /// Adds the work on the damping of bristles in a step to the balances: see `Axis::damped_in`.
    pub(crate) fn damped_in(
        &self,
        first: usize,
        step: &mut Accepted<'_, R>,
        common: &Common<R>,
        accounts: &mut [R],
    ) {
        for (leg, contact) in self.contacts.iter().enumerate() {
            let Some(contact) = contact.as_ref().filter(|contact| contact.law.is_damped()) else { continue };
            let mut work = R::zero();
            for (theta, weight) in GAUSS {
                let [_, v] = self.leg_in((first, leg), &mut |i| step.state(i, theta)[0]);
                let [_, dz] = step.state(first + self.inner[leg], theta);
                work += R::c(weight) * contact.law.damping(v) * v * dz;
            }
            accounts[CHANNELS.len() * leg + 1] -= work;
            accounts[CHANNELS.len() * leg + 2] += work / common.ambient_temperature;
        }
    }
}

impl<P: Lane> Platform<P> {
    /// Returns an output of the motion at the part's states and their rates: coordinates, their rates, or their second
    /// rates. A number e of a quaternion is given as the angle 2 asin(e), rad.
    pub(crate) fn motion(&self, own: &[P], rates: &[P], output: usize) -> P {
        let n = self.n();
        let k = output % n;
        let (q, u, a) = (own[k], own[n + k], rates[n + k]);
        if !self.kind.names()[k][0].starts_with("tilt") {
            return [q, u, a][output / n];
        }
        let cosine = (P::one() - q * q).sqrt();
        let two = P::c(2.0);
        match output / n {
            0 => two * arcsine(q),
            1 => two * u / cosine,
            _ => two * (a / cosine + q * u * u / (cosine * cosine * cosine)),
        }
    }

    fn n(&self) -> usize {
        self.nodes.len()
    }

    /// Returns whether the force on a leg contains the rate of a deflection.
    pub(crate) fn is_damped(&self) -> bool {
        self.contacts.iter().flatten().any(|contact| contact.law.is_damped())
    }

    /// Returns the indices of the inner states of a leg's friction within the part.
    pub(crate) fn inner_range(&self, leg: usize) -> std::ops::Range<usize> {
        let count = self.contacts[leg].as_ref().map_or(0, |contact| contact.states().len());
        self.inner[leg]..self.inner[leg] + count
    }

    fn inner<'y, S: Copy>(&self, leg: usize, y: &Own<'y, S>) -> &'y [S] {
        &y.after(0)[self.inner_range(leg)]
    }

    /// Returns the energy of the moving masses and the rows of the legs, at these coordinates and rates.
    fn energy<S: Over<P>>(&self, own: &[S]) -> S {
        each!(self.kind, M, N => {
            let (q, u): ([S; N], [S; N]) = (std::array::from_fn(|k| own[k]), std::array::from_fn(|k| own[N + k]));
            let forms = forms::<M, P, S, N>(&self.geometry, &q, &u);
            let add = |sum: S, i: usize| sum + S::c(0.5) * S::from(self.moved[i]) * forms.legs[i].v * forms.legs[i].v;
            (0..N).fold(forms.energy, add)
        })
    }

    /// Returns coordinates and rates for positions and velocities of the legs.
    pub(crate) fn forward(&self, starts: &[[P; 2]]) -> Vec<P> {
        each!(self.kind, M, N => {
            let x: [P; N] = std::array::from_fn(|i| starts[i][0]);
            let mut q = <M as Mechanism<N>>::near(&self.geometry, &x);
            let mut u = [P::zero(); N];
            for _ in 0..STEPS {
                let legs = forms::<M, P, P, N>(&self.geometry, &q, &u).legs;
                let none = [P::zero(); N];
                let factor = Cholesky::of(with_square([none; N], &legs, &[P::one(); N]));
                let step = factor.solve(with_sum(none, &legs, &std::array::from_fn(|i| x[i] - legs[i].x)));
                u = factor.solve(with_sum(none, &legs, &std::array::from_fn(|i| starts[i][1])));
                for (q, step) in q.iter_mut().zip(step) {
                    *q += step;
                }
            }
            q.into_iter().chain(u).collect()
        })
    }
}

/// Returns the angle whose sine is `x`, below a right angle: by Newton's method.
fn arcsine<P: Real>(x: P) -> P {
    let half = x / (P::c(0.5) * (P::one() + (P::one() - x * x).sqrt())).sqrt() * P::c(0.5); // sine of half of it
    let step = |angle: P, _| angle - (angle.sin() - half) / angle.cos();
    P::c(2.0) * (0..5).fold(half, step)
}

impl<P: Lane> Part<P> for Platform<P> {
    fn states(&self) -> Vec<State> {
        let unit = |name: &str| match name {
            _ if name.ends_with("_m_s") => "m/s",
            _ if name.ends_with("_n_s") => "N s",
            _ if name.ends_with("_m") => "m",
            _ if name.ends_with("_1_s") => "1/s",
            _ => "1",
        };
        let names = self.kind.names();
        let of = |which: usize| names.iter().map(move |own| State::own(own[which], unit(own[which]), SCALE));
        let mut states: Vec<State> = of(0).chain(of(1)).collect();
        for (leg, contact) in self.contacts.iter().enumerate() {
            states.extend(inner_states(contact.as_ref(), &self.largest_scales[leg], self.nodes[leg]));
        }
        states
    }

    fn inputs(&self) -> &'static [Input] {
        const FORCE: Input = Input { name: "external force", unit: "N", bounds: physics::any() };
        const VELOCITY: Input = Input { name: "velocity", unit: "m/s", bounds: physics::any() };
        match self.velocity {
            Some(_) => const { &[FORCE, VELOCITY] },
            None => &(const { &[FORCE; MOST] })[..self.n()],
        }
    }

    fn input(&self, input: usize) -> P {
        self.velocity.filter(|_| input == 1).unwrap_or_else(|| self.external[input])
    }

    fn input_mut(&mut self, input: usize) -> &mut P {
        match &mut self.velocity {
            Some(velocity) if input == 1 => velocity,
            _ => &mut self.external[input],
        }
    }

    fn place<S: Over<P>>(&self, y: Own<S>, net: &mut Net<S>, _common: &Common<P>) {
        let n = self.n();
        let mut out = [S::zero(); 2 * MOST];
        let memory = &mut net.known[2 * self.nodes[0]];
        if let Some(velocity) = self.velocity {
            [out[0], out[1]] = [y.after(0)[0], S::from(velocity)];
        } else {
            S::mapped(&Places(self.kind, &self.geometry), &y.after(0)[..2 * n], &mut out[..2 * n], memory);
        }
        for (i, &node) in self.nodes.iter().enumerate() {
            let node = &mut net.axis[node];
            (node.x, node.v) = (out[i], out[n + i]);
            node.force = S::from(self.external[i]);
            node.end_stop = S::zero();
            if let Some(contact) = &self.contacts[i] {
                node.prepared = contact.law.prepare(node.v);
            }
        }
    }

    fn rate<S: Over<P>>(&self, y: Own<S>, dy: OwnMut<S>, net: &mut Net<S>, _common: &Common<P>) {
        let n = self.n();
        let (own, inner) = dy.split(2 * n);
        let mut x = [S::zero(); MOST_ARGUMENTS];
        x[..2 * n].copy_from_slice(&y.after(0)[..2 * n]);
        for (i, &node) in self.nodes.iter().enumerate() {
            let node = &mut net.axis[node];
            node.friction = self.contacts[i].as_ref().map_or(S::zero(), |contact| {
                let range = self.inner_range(i);
                let rates = &mut inner[range.start - 2 * n..range.end - 2 * n];
                contact.force(&at(node), self.inner(i, &y), rates, P::zero())
            });
            x[2 * n + i] = node.force - node.friction;
        }
        if let Some(velocity) = self.velocity {
            own.copy_from_slice(&[S::from(velocity), x[2]]);
            net.axis[self.nodes[0]].a = S::zero();
            return;
        }
        let mut out = [S::zero(); 2 * MOST];
        let rates = Accelerations { kind: self.kind, geometry: &self.geometry, inertia: &self.moved };
        S::mapped(&rates, &x[..3 * n], &mut out[..2 * n], &mut net.known[2 * self.nodes[0] + 1]);
        own[..n].copy_from_slice(&x[n..2 * n]);
        own[n..].copy_from_slice(&out[..n]);
        for (i, &node) in self.nodes.iter().enumerate() {
            let node = &mut net.axis[node];
            node.a = out[n + i];
            node.friction = S::from(self.inertia[i]).fma(node.a, node.friction);
        }
    }

    fn stored<S: Over<P>>(&self, y: Own<S>, _net: &Net<S>, _common: &Common<P>) -> [S; 3] {
        let mut energy = if self.velocity.is_some() { S::zero() } else { self.energy(y.after(0)) };
        for (i, contact) in self.contacts.iter().enumerate() {
            if let Some(contact) = contact {
                energy += contact.stored(self.inner(i, &y));
            }
        }
        [S::zero(), energy, S::zero()]
    }

    fn channels(&self) -> Vec<(&'static str, Kind)> {
        self.nodes.iter().flat_map(|_| CHANNELS).collect()
    }

    fn account<S: Over<P>>(&self, y: Own<S>, dy: Own<S>, net: &Net<S>, common: &Common<P>, out: &mut [S]) {
        for (i, &node) in self.nodes.iter().enumerate() {
            let node = &net.axis[node];
            let heat = self.contacts[i].as_ref().map_or(S::zero(), |contact| {
                heat_of(contact, self.inertia[i], node, (self.inner(i, &y), self.inner(i, &dy)))
            });
            let own = &mut out[CHANNELS.len() * i..];
            own[0] = S::from(self.external[i]) * node.v;
            if self.velocity.is_some() {
                own[0] -= (node.force - node.friction) * node.v;
            }
            damper::account(heat, common, &mut own[1..]);
        }
    }

    fn begin(&self, given: &Given<P>, y: OwnMut<P>, _net: &Net<P>, _common: &Common<P>) {
        let n = self.n();
        let starts: Vec<[P; 2]> =
            self.nodes.iter().map(|node| given.axis(*node).unwrap_or([P::zero(); 2])).collect();
        let (own, inner) = y.split(2 * n);
        own.copy_from_slice(&self.forward(&starts));
        if self.velocity.is_some() {
            own[1] = P::zero();
        }
        for (leg, node) in self.nodes.iter().enumerate() {
            let range = self.inner_range(leg);
            let z = &mut inner[range.start - 2 * n..range.end - 2 * n];
            begin_inner(self.contacts[leg].as_ref(), *node, given, z);
        }
    }
}

impl Platform<f64> {
    /// Returns the mass that a leg moves while the others carry no load, 1/(J M^-1 J^T), kg.
    pub(crate) fn mass_on(&self, (first, leg): (usize, usize), state: &mut impl FnMut(usize) -> f64) -> f64 {
        each!(self.kind, M, N => {
            let q: [f64; N] = std::array::from_fn(|k| state(first + k));
            let forms = forms::<M, f64, f64, N>(&self.geometry, &q, &[0.0; N]);
            let row = forms.legs[leg].by_q;
            let moved = forms.factor(&std::array::from_fn(|i| self.moved[i])).solve(row);
            1.0 / row.iter().zip(moved).map(|(one, other)| one * other).sum::<f64>()
        })
    }
}
