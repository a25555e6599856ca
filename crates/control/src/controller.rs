//! A law with its observer: from samples to commands.

use crate::adaptation::Adaptation;
use crate::course::Course;
use crate::gains::{FACTOR_BOUNDS, FACTORS, Gain, Gains};
use crate::hold::{Hold, Resting};
use crate::law::{FACTORED, Fuzzy, Inversion, Law, Nmpc, Pid, Sliding, SuperTwisting, Tick, Tuned};
use crate::model::Model;
use crate::number::{Memory, Number};
use crate::observer::{Noise, Observer};
use crate::own::{Own, Seen};
use crate::reference::{Effort, Reference, Wanted, blend};
use crate::supervisor::{Rules, Supervisor};
use crate::thresholds::{COUNT_DEVIATIONS, FARTHEST, LEAST_UNKNOWN, PUSH_BOUND, PUSH_SLIPS, TAKEOVER_TIME};
use crate::types::{Edges, Moment, Plant, Sample, State};
use crate::valves::{Commands, Valves};

macro_rules! laws {
    ($($name:ident),* $(,)?) => {
        /// Any law.
        #[derive(Clone, Debug)]
        pub enum AnyLaw {
            $(#[doc = concat!("See [`", stringify!($name), "`].")] $name($name),)*
            /// A custom law of a user.
            Own(Own),
        }

        /// Keys of all laws.
        pub const LAWS: &[&str] = &[$(<$name as Tuned>::KEY),*];

        impl AnyLaw {
            /// Returns the law of a key, with gains that are derived from the drive.
            pub fn tuned(key: &str, model: &Model, plant: &Plant) -> Option<Self> {
                $(if key == <$name as Tuned>::KEY {
                    return Some(AnyLaw::$name(<$name as Tuned>::tuned(model, plant)));
                })*
                (key == Own::KEY).then(|| AnyLaw::Own(Own::default()))
            }

            /// Key of the law in a controller file.
            pub fn key(&self) -> &'static str {
                match self { $(AnyLaw::$name(_) => <$name as Tuned>::KEY,)* AnyLaw::Own(_) => Own::KEY }
            }

            /// Gains of the law, with their values.
            pub fn gains(&mut self) -> impl Iterator<Item = (&'static Gain, &mut f64)> {
                match self {
                    $(AnyLaw::$name(law) => $name::GAINS.iter().zip(law.gains_mut()),)*
                    AnyLaw::Own(_) => [].iter().zip(vec![]),
                }
            }
        }

        impl AnyLaw {
            /// Whether it follows references only, and cannot follow a path back to a reference.
            pub(crate) fn needs_reference(&self) -> bool {
                matches!(self, AnyLaw::Own(_))
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

            fn wander(&self) -> f64 {
                match self { $(AnyLaw::$name(law) => law.wander(),)* AnyLaw::Own(_) => 1.0 }
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

laws!(Pid, Fuzzy, Sliding, SuperTwisting, Inversion, Nmpc);

/// A controller: its law, its model of the drive, and its state.
#[derive(Clone, Debug)]
pub struct Controller<L = AnyLaw, S = f64> {
    /// Model of the drive.
    pub model: Model,
    /// Linear model of the drive at mid-stroke.
    pub plant: Plant,
    /// The law.
    pub law: L,
    /// Valves that receive the command.
    pub valves: Valves,
    /// Holding at the target, if it is on.
    pub hold: Option<Hold<S>>,
    /// Adaptation of the model, if it is on.
    pub adaptation: Option<Adaptation>,
    /// The period, s.
    pub period: f64,
    /// Supervisor of the law, if there is one.
    pub supervisor: Option<Box<Supervisor>>,
    /// Factors, as in [`FACTORS`](crate::FACTORS), by which the gains are multiplied.
    pub(crate) factors: [f64; FACTORS.len()],
    pub(crate) takeover: Takeover,
    pub(crate) noise: Noise,
    /// Speed of the reference at the last sample, m/s.
    pub(crate) speed: f64,
    pub(crate) observer: Option<Observer<S>>,
    pub(crate) friction: Option<S>,
    /// Force that breaks a resting drive away, N.
    pub(crate) push: S,
    /// Load by which other axes of the run deviate from their plans, N in +x. It needs a reference with efforts.
    pub coupling: f64,
}

/// Handover from another law, and from other gains.
#[derive(Clone, Debug, Default)]
pub(crate) struct Takeover {
    /// The last command of the law.
    last: f64,
    bump: Option<Bump>,
    ramps: Vec<Ramp>,
}

/// Time at which a law took over, and the difference between its command and the previous law's.
#[derive(Clone, Copy, Debug)]
struct Bump {
    begin: Option<f64>,
    offset: f64,
}

/// A gain that changes from one value to another.
#[derive(Clone, Copy, Debug)]
struct Ramp {
    key: &'static str,
    begin: Option<f64>,
    from: f64,
    to: f64,
}

/// Standby law, unless the user names another one.
const STANDBY: &str = "inversion";

/// Wanted state now and when the command acts, whether the drive rests in between, and the reference.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Ahead<'r, S> {
    pub now: Wanted<S>,
    pub then: Wanted<S>,
    /// 1 while the reference is at rest, else 0.
    pub stands: S,
    pub preview: &'r Course<'r>,
}

/// Decision of a law with its observer for one sample.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Decided<S: Number> {
    pub command: S,
    pub velocity: S,
    pub disturbance: S,
    pub holds: S::Mask,
}

/// Result of one sample.
#[derive(Clone, Copy, Debug)]
pub struct Answer {
    /// The command, -1 .. 1.
    pub command: f64,
    /// Wanted state now.
    pub wanted: Wanted,
    /// Estimated velocity, m/s, and disturbance, N.
    pub velocity: f64,
    /// N.
    pub disturbance: f64,
    /// It holds.
    pub holds: bool,
}

impl Controller {
    /// Returns the controller with the law of this key and gains from the model alone. The period is in s and the
    /// deviation of the position sensor in m.
    pub fn tuned(key: &str, model: &Model, period: f64, deviation: f64) -> Option<Self> {
        let middle = 0.5 * (model.supply.pressure + model.ambient.pressure);
        let plant = Plant::of(model, 0.5 * model.stroke, [middle; 2], period);
        let full =
            (model.supply.pressure - model.ambient.pressure) * model.sides[0].area.min(model.sides[1].area);
        let unknown = plant.coulomb.max(LEAST_UNKNOWN * full);
        let noise = Noise { disturbance: 0.5 * unknown, position: deviation };
        let standby = AnyLaw::tuned(STANDBY, model, &plant)?;
        Some(Controller {
            law: AnyLaw::tuned(key, model, &plant)?,
            supervisor: Some(Box::new(Supervisor::new(Rules::default(), standby))),
            takeover: Takeover::default(),
            hold: Some(Hold::new(30e-6, 20e-3)),
            adaptation: Some(Adaptation::new(model)),
            valves: Valves::tuned(model, &plant, period),
            model: model.clone(),
            plant,
            period,
            noise,
            speed: 0.0,
            observer: None,
            friction: None,
            push: 0.0,
            coupling: 0.0,
            factors: [1.0; FACTORS.len()],
        })
    }

    /// Returns the command for a sample along a reference, and passes it to the valve unchanged.
    pub fn step(&mut self, sample: &Sample, reference: &Reference) -> Answer {
        let answer = self.decide(sample, reference);
        let time = self.supervisor.as_ref().map_or(sample.time, |own| own.corrected(sample.time));
        self.give(time, answer.command);
        answer
    }

    /// Returns the commands of the valves for the command of a sample, with its true time.
    pub fn give(&mut self, time: f64, command: f64) -> Commands {
        let Controller { valves, model, observer, period, .. } = self;
        match observer {
            Some(observer) => valves.open(model, observer, Moment { time, period: *period }, command),
            None => valves.shut(command),
        }
    }

    /// Returns the signals of sensors and observer at the last sample.
    pub fn seen(&self, sample: &Sample) -> Seen {
        self.observer.as_ref().map(|observer| Seen::of(&self.model, sample, observer)).unwrap_or_default()
    }

    /// Returns the command for a sample along a reference; [`Controller::give`] comes next. Without a supervisor, a
    /// sample that is not a number gives a command that is not a number.
    pub fn decide(&mut self, sample: &Sample, reference: &Reference) -> Answer {
        if let Some(Effort { mass, load, .. }) = reference.effort(sample.time) {
            // A law that predicts would let the deviations of now last through its horizon, and swing with the others.
            let load = if self.law.predicts() { load } else { load + self.coupling };
            match &mut self.adaptation {
                Some(adaptation) => adaptation.expect(&mut self.model, mass, load),
                None => (self.model.mass, self.model.load) = (mass, load),
            }
        }
        if let Some(mut supervisor) = self.supervisor.take() {
            let answer = supervisor.decide(self, sample, reference);
            self.supervisor = Some(supervisor);
            return answer;
        }
        let numbers = [sample.position].into_iter().chain(sample.pressures.into_iter().flatten());
        if numbers.into_iter().any(|own| !own.is_finite()) {
            return self.rest(reference.at(sample.time), f64::NAN);
        }
        self.learn(sample, true);
        self.ask(sample, &reference.into())
    }

    /// Passes a sample to the observer, and the learned values to the model.
    pub(crate) fn learn(&mut self, sample: &Sample, measured: bool) {
        self.observe(sample);
        let lost = self.state().is_some_and(|own| {
            let State { position, velocity, disturbance, friction, pressures: [a, b], temperatures: [c, d] } =
                own;
            [disturbance, friction, a, b, c, d].iter().any(|own| !own.is_finite())
                || !(position.abs() < FARTHEST && velocity.abs() < FARTHEST)
        });
        if lost {
            // The sample is much later than the last one, or far from the model: the observer starts again.
            self.restart();
            self.observe(sample);
        }
        let (Some(adaptation), Some(observer)) = (&mut self.adaptation, &mut self.observer) else { return };
        adaptation.learn_mass(&mut self.model, &observer.state, self.speed, self.period);
        if measured && sample.pressures.is_some() {
            let spool = matches!(self.valves, Valves::One).then(|| observer.spool.state());
            adaptation.learn(&mut self.model, &mut observer.state, spool, self.period);
        }
    }

    /// Returns the law's command for a sample that the observer has processed.
    pub(crate) fn ask(&mut self, sample: &Sample, course: &Course) -> Answer {
        self.go_on_tuning(sample.time);
        let now = course.at(sample.time);
        self.speed = now.velocity.abs();
        let Some(observer) = &self.observer else { return self.rest(now, f64::NAN) };
        let mut answer = if let AnyLaw::Own(own) = &self.law {
            let seen = Seen::of(&self.model, sample, observer);
            let command = course.reference().map_or(f64::NAN, |reference| own.step(&seen, reference));
            self.rest(now, command)
        } else {
            let stands = f64::from(u8::from(course.stands(sample.time, self.plant.lag)));
            let then = course.at(sample.time + self.ahead());
            let ahead = Ahead { now, then, stands, preview: course };
            let Decided { command, velocity, disturbance, holds } = self.command(sample, &ahead);
            Answer { command, wanted: now, velocity, disturbance, holds }
        };
        let Takeover { last, bump: slot, .. } = &mut self.takeover;
        if let (Some(bump), true) = (slot.as_mut(), answer.command.is_finite()) {
            let begin = *bump.begin.get_or_insert_with(|| {
                bump.offset = *last - answer.command;
                sample.time
            });
            let [gone, ..] = blend((sample.time - begin) / TAKEOVER_TIME);
            answer.command = (answer.command + bump.offset * (1.0 - gone)).clamp(-1.0, 1.0);
            if gone >= 1.0 {
                *slot = None;
            }
        }
        if answer.command.is_finite() {
            *last = answer.command;
        }
        answer
    }

    /// Changes to another law without a bump: its first command equals the last one of the previous law.
    pub fn switch(&mut self, law: AnyLaw) {
        self.law = law;
        self.factors = [1.0; FACTORS.len()];
        self.takeover.ramps.clear();
        self.takeover.bump = Some(Bump { begin: None, offset: 0.0 });
    }

    /// Changes a gain of the law to another value within 0.2 s. Returns false if the law has no such gain.
    pub fn retune(&mut self, key: &str, to: f64) -> bool {
        let found = self.law.gains().find(|(gain, _)| gain.key == key).map(|(gain, own)| (gain.key, *own));
        let Some((key, from)) = found else { return false };
        self.takeover.ramps.retain(|own| own.key != key);
        self.takeover.ramps.push(Ramp { key, begin: None, from, to });
        true
    }

    /// Changes the gains within 0.2 s to those of other [`FACTORS`](crate::FACTORS). Factors out of bounds, or unused
    /// by this law, are rejected. Nothing changes then.
    pub fn scale(&mut self, factors: [f64; FACTORS.len()]) -> Result<(), String> {
        let law = self.law.key();
        let mut changes = Vec::new();
        for ((key, before), now) in FACTORS.iter().zip(self.factors).zip(factors) {
            if !now.is_finite() || !FACTOR_BOUNDS.contain(now) {
                return Err(format!("factors.{key} = {now} is out of bounds: it must be {FACTOR_BOUNDS}"));
            }
            let own = FACTORED.iter().find(|own| own.law == law && own.key == *key);
            match own {
                Some(own) => changes.push((own.gain, now / before)),
                None if now == 1.0 => {}
                None => {
                    let known = FACTORED.iter().filter(|own| own.law == law).map(|own| own.key);
                    let known: Vec<_> = known.collect();
                    let has = if known.is_empty() { "none".into() } else { known.join(", ") };
                    return Err(format!(
                        "factors.{key} = {now}: the law {law} does not use it; its factors are {has}. Leave it out"
                    ));
                }
            }
        }
        for (gain, by) in changes {
            let on_its_way = self.takeover.ramps.iter().find(|own| own.key == gain).map(|own| own.to);
            let found = self.law.gains().find(|own| own.0.key == gain).map(|own| *own.1);
            if let Some(value) = on_its_way.or(found) {
                self.retune(gain, value * by);
            }
        }
        self.factors = factors;
        Ok(())
    }

    /// Changes all gains at once, for a law that has not started.
    pub fn arrive(&mut self) {
        for own in std::mem::take(&mut self.takeover.ramps) {
            self.law.gains().filter(|(gain, _)| gain.key == own.key).for_each(|(_, gain)| *gain = own.to);
        }
    }

    /// Updates the changing gains at a time, s.
    fn go_on_tuning(&mut self, time: f64) {
        for own in &mut self.takeover.ramps {
            let [share, ..] = blend((time - *own.begin.get_or_insert(time)) / TAKEOVER_TIME);
            let value = own.from + share * (own.to - own.from);
            self.law.gains().filter(|(gain, _)| gain.key == own.key).for_each(|(_, gain)| *gain = value);
        }
        self.takeover.ramps.retain(|own| own.begin.is_none_or(|begin| time - begin < TAKEOVER_TIME));
    }

    /// Restarts the observer with the next sample.
    pub(crate) fn restart(&mut self) {
        self.observer = None;
    }

    /// Continues from a command without a bump. Holding and breakaway begin anew.
    pub(crate) fn begin_anew(&mut self, command: f64) {
        (self.push, self.takeover.last) = (0.0, command);
        self.friction = self.observer.as_ref().map(|own| own.state.friction);
        self.takeover.bump = Some(Bump { begin: None, offset: 0.0 });
        if let Some(hold) = &mut self.hold {
            *hold = Hold::new(hold.band, hold.after);
        }
    }

    /// Returns the deviation of the force of gas less friction at the last sample from the plan of a reference with
    /// efforts, N in +x.
    pub fn deviation(&self, reference: &Reference) -> Option<f64> {
        let (observer, model) = (self.observer.as_ref()?, &self.model);
        let Effort { mass, load, .. } = reference.effort(observer.time())?;
        let State { position, velocity, friction, pressures, .. } = observer.state;
        let [_, viscous] = model.friction_levels([position, velocity], pressures);
        let planned = mass * reference.at(observer.time()).acceleration - load;
        Some(model.gas_force(pressures) - friction - viscous * velocity - planned)
    }

    /// Returns the state at the last sample.
    pub(crate) fn state(&self) -> Option<State> {
        self.observer.as_ref().map(|observer| observer.state)
    }

    /// Returns the predicted state at the next sample, and the openings of the edges halfway.
    pub(crate) fn foresee(&self, time: f64) -> Option<(State, Edges<f64>)> {
        let observer = self.observer.as_ref()?;
        let (state, _) = observer.predict(&self.model, time, self.period);
        Some((state, observer.spool.clone().edges(&self.model, observer.time(), time)))
    }

    /// Position resolution of the model one period ahead, m. It is the sensor resolution, or the distance by which
    /// unmodelled friction moves a resting piston.
    pub(crate) fn grain(&self) -> f64 {
        let way = 0.5 * self.plant.coulomb / self.model.mass * self.period * self.period;
        way.max(COUNT_DEVIATIONS * self.noise.position)
    }

    /// Returns the outputs for a given command, without the law: this command and the estimates of the observer.
    pub(crate) fn rest(&self, wanted: Wanted, command: f64) -> Answer {
        let (velocity, disturbance) = self.state().map_or((0.0, 0.0), |own| (own.velocity, own.disturbance));
        Answer { command, wanted, velocity, disturbance, holds: false }
    }
}

impl<S: Number, L: Law<S>> Controller<L, S> {
    /// Stores a sample.
    pub(crate) fn observe(&mut self, sample: &Sample<S>) {
        let Controller { model, period, noise, law, .. } = self;
        let noise = Noise { disturbance: law.wander() * noise.disturbance, ..*noise };
        let observer = self.observer.get_or_insert_with(|| Observer::new(model, sample, *period, noise));
        observer.update(model, sample);
        self.friction.get_or_insert(observer.state.friction);
    }

    /// Visits each number of the state.
    pub(crate) fn numbers(&mut self, see: &mut dyn FnMut(&mut S)) {
        if let Some(observer) = &mut self.observer {
            observer.numbers(see);
        }
        self.friction.iter_mut().chain([&mut self.push]).for_each(&mut *see);
        if let Some(hold) = &mut self.hold {
            hold.each(see);
        }
        self.law.each(see);
    }

    /// Returns the time after which a command acts, as the law assumes it, s.
    pub(crate) fn ahead(&self) -> f64 {
        if self.law.predicts() { self.model.valve.delay } else { self.plant.lag }
    }

    /// Returns the command for the stored sample.
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
        let seen = Resting {
            stands: ahead.stands,
            error: e,
            velocity: observer.state.velocity,
            gas: model.gas_force(state.pressures),
            level,
        };
        let never = (S::zero().lt(S::zero()), S::zero());
        let (holds, held) = self.hold.as_mut().map_or(never, |hold| hold.rate(&seen, model, period));
        let bandwidth = self.plant.bandwidth();
        let rate_of_push = self.law.push() * bandwidth * period;
        let bound = PUSH_BOUND * self.plant.coulomb;
        let grown =
            (self.push + e.times(rate_of_push * model.mass * bandwidth * bandwidth)).within(-bound, bound);
        let fallen = self.push.times(1.0 - rate_of_push);
        // After the contact slips, the full breakaway force would drive the piston past its target.
        let slips = S::c(PUSH_SLIPS).lt(observer.state.velocity.abs());
        let grown = S::select(slips, self.push.times(1.0 - bandwidth * period), grown);
        let stands = S::select(S::zero().lt(ahead.stands), grown, fallen);
        self.push = S::select(holds, fallen, stands);
        state.disturbance -= self.push;
        let mut force_rate = rate + viscous * wanted.acceleration;
        let [growth, load_rate] = ahead.preview.load_growth(sample.time, acts);
        if growth != 0.0 || load_rate != 0.0 {
            state.disturbance += S::c(growth);
            force_rate -= S::c(load_rate);
        }
        let tick = Tick {
            model,
            plant: &self.plant,
            period,
            acceleration: state.acceleration(model),
            state,
            wanted,
            friction: [*along + rate.times(model.stick_damping_time) + viscous * wanted.velocity, force_rate],
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
        let command = model.command_for(share);
        let State { velocity, disturbance, .. } = observer.state;
        Decided { command, velocity, disturbance, holds }
    }

    /// Stores the command of one 5/3 valve at a sample, with its true time.
    pub(crate) fn told(&mut self, time: f64, command: S) {
        if let Some(observer) = &mut self.observer {
            observer.spool.command(time + self.model.valve.delay, command);
        }
    }
}
