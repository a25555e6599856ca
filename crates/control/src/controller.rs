//! A law with its observer: from samples to commands.

use crate::adaptation::Adaptation;
use crate::gains::{Gain, Gains};
use crate::law::{Fuzzy, Inversion, Law, Nmpc, Pid, Plant, Pva, Sliding, SuperTwisting, Tick};
use crate::model::Model;
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
        pub const LAWS: &[&str] = &[$(<$name as Law>::KEY),*];

        impl AnyLaw {
            /// The law called so, with gains that follow from the drive.
            pub fn tuned(key: &str, model: &Model, plant: &Plant) -> Option<Self> {
                $(if key == <$name as Law>::KEY {
                    return Some(AnyLaw::$name($name::tuned(model, plant)));
                })*
                (key == Own::KEY).then(|| AnyLaw::Own(Own::default()))
            }

            /// Its word in a controller file.
            pub fn key(&self) -> &'static str {
                match self { $(AnyLaw::$name(_) => <$name as Law>::KEY,)* AnyLaw::Own(_) => Own::KEY }
            }

            /// Its gains with their values.
            pub fn gains(&mut self) -> impl Iterator<Item = (&'static Gain, &mut f64)> {
                match self {
                    $(AnyLaw::$name(law) => $name::GAINS.iter().zip(law.gains_mut()),)*
                    AnyLaw::Own(_) => [].iter().zip(vec![]),
                }
            }

            fn predicts(&self) -> bool {
                match self { $(AnyLaw::$name(_) => <$name as Law>::PREDICTS,)* AnyLaw::Own(_) => false }
            }

            fn push(&self) -> f64 {
                match self { $(AnyLaw::$name(_) => <$name as Law>::PUSH,)* AnyLaw::Own(_) => 0.0 }
            }

            fn step(&mut self, tick: &Tick) -> f64 {
                match self { $(AnyLaw::$name(law) => law.step(tick),)* AnyLaw::Own(_) => 0.0 }
            }

            fn given(&mut self, asked: f64, given: f64, tick: &Tick) {
                match self { $(AnyLaw::$name(law) => law.given(asked, given, tick),)* AnyLaw::Own(_) => () }
            }
        }
    };
}

laws!(Pid, Pva, Fuzzy, Sliding, SuperTwisting, Inversion, Nmpc);

/// Share of opening within which the inverse of the overlap passes from one edge to the other (assumed).
const OVERLAP_WIDTH: f64 = 0.004;

/// Standing still: the force at which the seal rests is kept.
#[derive(Clone, Debug)]
pub struct Hold {
    /// Error below which it is entered, m.
    pub band: f64,
    /// For how long before, s.
    pub after: f64,
    waited: f64,
    force: Option<f64>,
}

/// Speed below which a drive may hold, m/s.
const REST: f64 = 1e-3;
/// Rates at which the elastic contact is drawn to where it is to be, and at which the gas follows the force that is kept, 1/s
/// (assumed).
const CREEP: f64 = 3.0;
const SETTLE: f64 = 4.0;
/// Bands at which it is left.
const LEAVE: f64 = 2.5;

impl Hold {
    /// With a band, m, entered after a time, s.
    pub fn new(band: f64, after: f64) -> Self {
        Hold { band, after, waited: 0.0, force: None }
    }

    /// It holds no more.
    fn leave(&mut self) -> Option<f64> {
        (self.force, self.waited) = (None, 0.0);
        None
    }

    /// The rate of the force of the gas while it holds, N/s: a contact of this stiffness, N/m, gives way by what is missing.
    fn rate(&mut self, [e, v]: [f64; 2], gas: f64, (stiffness, period): (f64, f64)) -> Option<f64> {
        let limit = if self.force.is_some() { LEAVE * self.band } else { self.band };
        if e.abs() > limit || (self.force.is_none() && v.abs() > REST) {
            return self.leave();
        }
        self.waited += period;
        if self.waited < self.after {
            return None;
        }
        let force = self.force.get_or_insert(gas);
        let creep = CREEP * stiffness * e;
        *force += creep * period;
        Some(creep + SETTLE * (*force - gas))
    }
}

/// A law, what it believes, and what it remembers.
#[derive(Clone, Debug)]
pub struct Controller {
    /// What it believes.
    pub model: Model,
    /// What the drive is about mid-stroke.
    pub plant: Plant,
    /// The law.
    pub law: AnyLaw,
    /// Standing still, if it may.
    pub hold: Option<Hold>,
    /// What it learns of its drive, if it does.
    pub adaptation: Option<Adaptation>,
    /// The period, s.
    pub period: f64,
    noise: Noise,
    observer: Option<Observer>,
    friction: Option<f64>,
    /// The force that breaks a resting drive away, N.
    push: f64,
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

    /// Takes over the command that was given at a sample.
    pub fn told(&mut self, time: f64, command: f64) {
        if let Some(observer) = &mut self.observer {
            observer.spool.command(time + self.model.valve.delay, command);
        }
    }

    /// What sensors and the observer say at the last sample.
    pub fn seen(&self, sample: &Sample) -> Seen {
        self.observer.as_ref().map(|observer| Seen::of(&self.model, sample, observer)).unwrap_or_default()
    }

    /// The command for a sample, on the way along a reference; [`Controller::told`] comes next.
    pub fn decide(&mut self, sample: &Sample, reference: &Reference) -> Answer {
        let period = self.period;
        let observer =
            self.observer.get_or_insert_with(|| Observer::new(&self.model, sample, period, self.noise));
        observer.update(&self.model, sample);
        if let (Some(adaptation), true) = (&mut self.adaptation, sample.pressures.is_some()) {
            adaptation.learn(&mut self.model, &observer.state, observer.spool.state(), period);
        }
        let model = &self.model;
        if let AnyLaw::Own(own) = &self.law {
            let State { velocity, disturbance, .. } = observer.state;
            let command = own.step(&Seen::of(model, sample, observer), reference);
            return Answer { command, wanted: reference.at(sample.time), velocity, disturbance, holds: false };
        }
        let lag = if self.law.predicts() { model.valve.delay } else { self.plant.lag };
        let acts = sample.time + lag;
        let (mut state, spool) = observer.predict(model, acts, period);
        let wanted = reference.at(acts);
        let place = [wanted.position, wanted.velocity];
        let [level, viscous] = model.friction_levels(place, state.pressures);
        let along = self.friction.get_or_insert(observer.state.friction);
        let rate = model.stick_rate(wanted.velocity, *along, level, period);
        *along += period * rate;
        let stands = reference.stands(sample.time, self.plant.lag);
        let now = reference.at(sample.time);
        let e = now.position - observer.state.position;
        let gas = model.gas_force(state.pressures);
        let held = self.hold.as_mut().and_then(|hold| {
            let seen = [e, observer.state.velocity];
            if stands { hold.rate(seen, gas, (model.stick_stiffness, period)) } else { hold.leave() }
        });
        let bandwidth = self.plant.bandwidth();
        let rate_of_push = self.law.push() * bandwidth * period;
        if stands && held.is_none() {
            let bound = PUSH_BOUND * self.plant.coulomb;
            let grown = self.push + rate_of_push * model.mass * bandwidth * bandwidth * e;
            self.push = grown.clamp(-bound, bound);
        } else {
            self.push *= 1.0 - rate_of_push;
        }
        state.disturbance -= self.push;
        let tick = Tick {
            model,
            plant: &self.plant,
            period,
            acceleration: state.acceleration(model),
            state,
            wanted,
            friction: [
                *along + model.stick_damping_time * rate + viscous * wanted.velocity,
                rate + viscous * wanted.acceleration,
            ],
            now: (sample.position, now),
            acts,
            spool: &spool,
            preview: reference,
        };
        let share = match held {
            Some(rate) => tick.opening_for(rate),
            None => {
                let asked = self.law.step(&tick);
                let given = asked.clamp(-1.0, 1.0);
                self.law.given(asked, given, &tick);
                given
            }
        };
        let overlap = model.valve.overlap;
        let command = (share * (1.0 - overlap) + overlap * (share / OVERLAP_WIDTH).tanh()).clamp(-1.0, 1.0);
        Answer {
            command,
            wanted: tick.now.1,
            velocity: observer.state.velocity,
            disturbance: observer.state.disturbance,
            holds: held.is_some(),
        }
    }
}
