//! A law with its observer: from samples to commands.

use crate::adaptation::Adaptation;
use crate::gains::{Gain, Gains};
use crate::law::{Fuzzy, Inversion, Law, Nmpc, Pid, Plant, Pva, Sliding, SuperTwisting, Tick, Tuned};
use crate::model::Model;
use crate::number::{Memory, Number};
use crate::observer::{Noise, Observer, Sample, State};
use crate::own::{Own, Seen};
use crate::reference::{Reference, Wanted};

macro_rules! laws {
    ($($name:ident),* $(,)?) => {
        /// Any law.
        #[derive(Clone, Debug)]
        pub enum AnyLaw {
            $(#[doc = concat!("See [`", stringify!($name), "`].")] $name($name),)*
            /// One of a user.
            Own(Own),
        }

        /// The words of all laws.
        pub const LAWS: &[&str] = &[$(<$name as Tuned>::KEY),*];

        impl AnyLaw {
            /// The law called so, with gains that follow from the drive.
            pub fn tuned(key: &str, model: &Model, plant: &Plant) -> Option<Self> {
                $(if key == <$name as Tuned>::KEY {
                    return Some(AnyLaw::$name(<$name as Tuned>::tuned(model, plant)));
                })*
                (key == Own::KEY).then(|| AnyLaw::Own(Own::default()))
            }

            /// Its word in a controller file.
            pub fn key(&self) -> &'static str {
                match self { $(AnyLaw::$name(_) => <$name as Tuned>::KEY,)* AnyLaw::Own(_) => Own::KEY }
            }

            /// Its gains with their values.
            pub fn gains(&mut self) -> impl Iterator<Item = (&'static Gain, &mut f64)> {
                match self {
                    $(AnyLaw::$name(law) => $name::GAINS.iter().zip(law.gains_mut()),)*
                    AnyLaw::Own(_) => [].iter().zip(vec![]),
                }
            }
        }

        impl Memory<f64> for AnyLaw {
            fn each(&mut self, see: &mut dyn FnMut(&mut f64)) {
                match self { $(AnyLaw::$name(law) => law.each(see),)* AnyLaw::Own(_) => () }
            }
        }

        impl Law for AnyLaw {
            fn predicts(&self) -> bool {
                match self { $(AnyLaw::$name(law) => law.predicts(),)* AnyLaw::Own(_) => false }
            }

            fn push(&self) -> f64 {
                match self { $(AnyLaw::$name(law) => law.push(),)* AnyLaw::Own(_) => 0.0 }
            }

            fn step(&mut self, tick: &Tick) -> f64 {
                match self { $(AnyLaw::$name(law) => law.step(tick),)* AnyLaw::Own(_) => 0.0 }
            }

            fn given(&mut self, asked: f64, tick: &Tick) {
                match self { $(AnyLaw::$name(law) => law.given(asked, tick),)* AnyLaw::Own(_) => () }
            }
        }
    };
}

laws!(Pid, Pva, Fuzzy, Sliding, SuperTwisting, Inversion, Nmpc);

/// Share of opening within which the inverse of the overlap passes from one edge to the other (assumed).
const OVERLAP_WIDTH: f64 = 0.004;

/// Standing still: the force at which the seal rests is kept.
#[derive(Clone, Debug)]
pub struct Hold<S = f64> {
    /// Error below which it is entered, m.
    pub band: f64,
    /// For how long before, s.
    pub after: f64,
    waited: S,
    /// Whether it holds, 0 or 1, and the force that it keeps, N.
    holds: S,
    force: S,
}

/// Speed below which a drive may hold, m/s.
const REST: f64 = 1e-3;
/// Rates at which the elastic contact is drawn to where it is to be, and at which the gas follows the force that is kept, 1/s
/// (assumed).
const CREEP: f64 = 3.0;
const SETTLE: f64 = 4.0;
/// Bands at which it is left.
const LEAVE: f64 = 2.5;

impl<S: Number> Hold<S> {
    /// With a band, m, entered after a time, s.
    pub fn new(band: f64, after: f64) -> Self {
        Hold { band, after, waited: S::zero(), holds: S::zero(), force: S::zero() }
    }

    /// Whether it holds, and the rate of the force of the gas then, N/s: a contact of this stiffness, N/m, gives way by
    /// what is missing. `stands` is 1 while the reference stands, else 0.
    fn rate(&mut self, stands: S, [e, v]: [S; 2], gas: S, (stiffness, period): (f64, f64)) -> (S::Mask, S) {
        let zero = S::zero();
        let held = zero.lt(self.holds);
        let limit = S::select(held, S::c(LEAVE * self.band), S::c(self.band));
        let near = S::select(limit.lt(e.abs()), zero, stands);
        let near = S::select(S::c(REST).lt(v.abs()), near * self.holds, near);
        self.waited = S::select(zero.lt(near), self.waited + S::c(period), zero);
        let force = S::select(held, self.force, gas);
        let creep = e.times(CREEP * stiffness);
        self.force = force + creep.times(period);
        self.holds = S::select(self.waited.lt(S::c(self.after)), zero, near);
        (zero.lt(self.holds), creep + (self.force - gas).times(SETTLE))
    }
}

/// A law, what it believes, and what it remembers.
#[derive(Clone, Debug)]
pub struct Controller<L = AnyLaw, S = f64> {
    /// What it believes.
    pub model: Model,
    /// What the drive is about mid-stroke.
    pub plant: Plant,
    /// The law.
    pub law: L,
    /// Standing still, if it may.
    pub hold: Option<Hold<S>>,
    /// What it learns of its drive, if it does.
    pub adaptation: Option<Adaptation>,
    /// The period, s.
    pub period: f64,
    pub(crate) noise: Noise,
    pub(crate) observer: Option<Observer<S>>,
    pub(crate) friction: Option<S>,
    /// The force that breaks a resting drive away, N.
    pub(crate) push: S,
}

/// Where a drive is to be now and when a command of now will act, whether it stands between them, and the reference.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Ahead<'r, S> {
    pub now: Wanted<S>,
    pub then: Wanted<S>,
    /// 1 while the reference stands, else 0.
    pub stands: S,
    pub preview: &'r Reference,
}

/// What a law with its observer makes of a sample.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Decided<S: Number> {
    pub command: S,
    pub velocity: S,
    pub disturbance: S,
    pub holds: S::Mask,
}

/// Bound of that force as a share of the Coulomb friction (assumed).
const PUSH_BOUND: f64 = 1.5;

/// What a sample gave.
#[derive(Clone, Copy, Debug)]
pub struct Answer {
    /// The command, -1 .. 1.
    pub command: f64,
    /// Where the drive is to be now.
    pub wanted: Wanted,
    /// Velocity, m/s, and disturbance, N, as the observer has them.
    pub velocity: f64,
    /// N.
    pub disturbance: f64,
    /// It holds.
    pub holds: bool,
}

impl Controller {
    /// Of a law called so, by the model alone: sampled with a period, s, by a position sensor of this deviation, m.
    pub fn tuned(key: &str, model: &Model, period: f64, deviation: f64) -> Option<Self> {
        let middle = 0.5 * (model.supply.pressure + model.ambient.pressure);
        let plant = Plant::of(model, 0.5 * model.stroke, [middle; 2], period);
        let noise = Noise { disturbance: 0.5 * plant.coulomb, position: deviation };
        Some(Controller {
            law: AnyLaw::tuned(key, model, &plant)?,
            hold: Some(Hold::new(30e-6, 20e-3)),
            adaptation: Some(Adaptation::new(model)),
            model: model.clone(),
            plant,
            period,
            noise,
            observer: None,
            friction: None,
            push: 0.0,
        })
    }

    /// The command for a sample, on the way along a reference, given to the valve as it is.
    pub fn step(&mut self, sample: &Sample, reference: &Reference) -> Answer {
        let answer = self.decide(sample, reference);
        self.told(sample.time, answer.command);
        answer
    }

    /// What sensors and the observer say at the last sample.
    pub fn seen(&self, sample: &Sample) -> Seen {
        self.observer.as_ref().map(|observer| Seen::of(&self.model, sample, observer)).unwrap_or_default()
    }

    /// The command for a sample, on the way along a reference; [`Controller::told`] comes next.
    pub fn decide(&mut self, sample: &Sample, reference: &Reference) -> Answer {
        self.observe(sample);
        let (Some(observer), period) = (&self.observer, self.period) else {
            unreachable!("it has just been made")
        };
        if let (Some(adaptation), true) = (&mut self.adaptation, sample.pressures.is_some()) {
            adaptation.learn(&mut self.model, &observer.state, observer.spool.state(), period);
        }
        let now = reference.at(sample.time);
        if let AnyLaw::Own(own) = &self.law {
            let State { velocity, disturbance, .. } = observer.state;
            let command = own.step(&Seen::of(&self.model, sample, observer), reference);
            return Answer { command, wanted: now, velocity, disturbance, holds: false };
        }
        let stands = f64::from(u8::from(reference.stands(sample.time, self.plant.lag)));
        let then = reference.at(sample.time + self.ahead());
        let ahead = Ahead { now, then, stands, preview: reference };
        let Decided { command, velocity, disturbance, holds } = self.command(sample, &ahead);
        Answer { command, wanted: now, velocity, disturbance, holds }
    }
}

impl<S: Number, L: Law<S>> Controller<L, S> {
    /// Takes over a sample.
    pub(crate) fn observe(&mut self, sample: &Sample<S>) {
        let Controller { model, period, noise, .. } = self;
        let observer = self.observer.get_or_insert_with(|| Observer::new(model, sample, *period, *noise));
        observer.update(model, sample);
        self.friction.get_or_insert(observer.state.friction);
    }

    /// Shows each number of what it remembers.
    pub(crate) fn numbers(&mut self, see: &mut dyn FnMut(&mut S)) {
        if let Some(observer) = &mut self.observer {
            observer.numbers(see);
        }
        self.friction.iter_mut().chain([&mut self.push]).for_each(&mut *see);
        if let Some(Hold { waited, holds, force, .. }) = &mut self.hold {
            [waited, holds, force].into_iter().for_each(&mut *see);
        }
        self.law.each(see);
    }

    /// Time after which a command acts as far as the law is concerned, s.
    pub(crate) fn ahead(&self) -> f64 {
        if self.law.predicts() { self.model.valve.delay } else { self.plant.lag }
    }

    /// The command for a sample that was taken over.
    pub(crate) fn command(&mut self, sample: &Sample<S>, ahead: &Ahead<'_, S>) -> Decided<S> {
        let acts = sample.time + self.ahead();
        let period = self.period;
        let (Some(observer), Some(along), model) = (&self.observer, &mut self.friction, &self.model) else {
            unreachable!("a sample comes first")
        };
        let (mut state, spool) = observer.predict(model, acts, period);
        let wanted = ahead.then;
        let place = [wanted.position, wanted.velocity];
        let [level, viscous] = model.friction_levels(place, state.pressures);
        let rate = model.stick_rate(wanted.velocity, *along, level, period);
        *along += rate.times(period);
        let e = ahead.now.position - observer.state.position;
        let gas = model.gas_force(state.pressures);
        let seen = [e, observer.state.velocity];
        let never = (S::zero().lt(S::zero()), S::zero());
        let (holds, held) = self
            .hold
            .as_mut()
            .map_or(never, |hold| hold.rate(ahead.stands, seen, gas, (model.stick_stiffness, period)));
        let bandwidth = self.plant.bandwidth();
        let rate_of_push = self.law.push() * bandwidth * period;
        let bound = PUSH_BOUND * self.plant.coulomb;
        let grown =
            (self.push + e.times(rate_of_push * model.mass * bandwidth * bandwidth)).within(-bound, bound);
        let fallen = self.push.times(1.0 - rate_of_push);
        let stands = S::select(S::zero().lt(ahead.stands), grown, fallen);
        self.push = S::select(holds, fallen, stands);
        state.disturbance -= self.push;
        let tick = Tick {
            model,
            plant: &self.plant,
            period,
            acceleration: state.acceleration(model),
            state,
            wanted,
            friction: [
                *along + rate.times(model.stick_damping_time) + viscous * wanted.velocity,
                rate + viscous * wanted.acceleration,
            ],
            now: (sample.position, ahead.now),
            acts,
            spool: &spool,
            preview: ahead.preview,
        };
        let of_law = |law: &mut L| {
            let asked = law.step(&tick);
            law.given(asked, &tick);
            asked.limited()
        };
        let share = S::either(holds, &mut self.law, |_| tick.opening_for(held), of_law);
        let overlap = model.valve.overlap;
        let inverse = (share / S::c(OVERLAP_WIDTH)).tanh().times(overlap);
        let command = (share.times(1.0 - overlap) + inverse).limited();
        let State { velocity, disturbance, .. } = observer.state;
        Decided { command, velocity, disturbance, holds }
    }

    /// Takes over the command that was given at a sample.
    pub fn told(&mut self, time: f64, command: S) {
        if let Some(observer) = &mut self.observer {
            observer.spool.command(time + self.model.valve.delay, command);
        }
    }
}
