//! A law with its observer: from samples to commands.

mod takeover;

use crate::adaptation::Adaptation;
use crate::course::Course;
use crate::gains::{FACTOR_BOUNDS, FACTORS};
use crate::hold::{Hold, Resting};
use crate::law::{AnyLaw, Law, Tick};
use crate::model::Model;
use crate::number::{Memory, Number};
use crate::observer::{Noise, Observer};
use crate::own::Seen;
use crate::reference::{Effort, Reference, Wanted};
use crate::thresholds::{COUNT_DEVIATIONS, FARTHEST, LEAST_UNKNOWN, PUSH_BOUND, PUSH_SLIPS};
use crate::types::{Coupled, Edges, Plant, Sample, State};
use crate::valves::{Commands, Valves};
pub(crate) use takeover::Takeover;

/// A law that follows a course, with its observer, its model of the drive, and its state. A
/// [`Controller`](crate::Controller) adds a supervisor.
#[derive(Clone, Debug)]
pub struct Follower<L = AnyLaw, S = f64> {
    /// Model of the drive.
    pub model: Model<S>,
    /// Linear model of the drive at mid-stroke.
    pub plant: Plant,
    /// The law.
    pub law: L,
    /// Valves that receive the command.
    pub valves: Valves,
    /// Holding at the target, if it is on.
    pub hold: Option<Hold<S>>,
    /// Adaptation of the model, if it is on.
    pub adaptation: Option<Adaptation<S>>,
    /// The period, s.
    pub period: f64,
    pub(crate) takeover: Takeover,
    pub(crate) noise: Noise,
    /// Speed of the reference at the last sample, m/s.
    pub(crate) speed: S,
    pub(crate) observer: Option<Observer<S>>,
    pub(crate) friction: Option<S>,
    /// Force that breaks a resting drive away, N.
    pub(crate) push: S,
    /// Influence of other axes of the run. It needs a reference with efforts.
    pub coupled: Option<Coupled>,
}

/// Wanted state now and when the command acts, whether the drive rests in between, and the reference.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Ahead<'r, S> {
    pub now: Wanted<S>,
    pub then: Wanted<S>,
    /// 1 while the reference is at rest, else 0.
    pub stands: S,
    pub preview: &'r Course<'r>,
}

/// Result of one sample.
#[derive(Clone, Copy, Debug)]
pub struct Answer<S: Number = f64> {
    /// The command, -1 .. 1.
    pub command: S,
    /// Wanted state now.
    pub wanted: Wanted<S>,
    /// Estimated velocity, m/s, and disturbance, N.
    pub velocity: S,
    /// Disturbance, N.
    pub disturbance: S,
    /// It holds.
    pub holds: S::Mask,
    /// See [`Law::feedback`].
    pub feedback: [S; 2],
}

impl Follower {
    /// Returns the controller with the law of this key and gains from the model alone. The period is in s and the
    /// deviation of the position sensor in m.
    pub fn tuned(key: &str, model: &Model, period: f64, deviation: f64) -> Option<Self> {
        let middle = 0.5 * (model.supply.pressure + model.ambient.pressure);
        let plant = Plant::of(model, 0.5 * model.stroke, [middle; 2], period);
        let full =
            (model.supply.pressure - model.ambient.pressure) * model.sides[0].area.min(model.sides[1].area);
        let unknown = plant.coulomb.max(LEAST_UNKNOWN * full);
        let noise = Noise { disturbance: 0.5 * unknown, position: deviation };
        Some(Follower {
            law: AnyLaw::tuned(key, model, &plant)?,
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
            coupled: None,
        })
    }

    /// Returns the commands of the valves for the command of a sample, with its true time.
    pub fn give(&mut self, time: f64, command: f64) -> Commands {
        let Follower { valves, model, observer, period, .. } = self;
        match observer {
            Some(observer) => valves.open(model, observer, [time, *period], command),
            None => valves.shut(command),
        }
    }

    /// Passes a sample to the observer, and the learned values to the model.
    pub(crate) fn learn(&mut self, sample: &Sample, measured: bool) {
        self.take(sample);
        let lost = self.state().is_some_and(|mut own| {
            let mut is_lost = !(own.position.abs() < FARTHEST && own.velocity.abs() < FARTHEST);
            own.each(&mut |number| is_lost |= !number.is_finite());
            is_lost
        });
        if lost {
            // The sample is much later than the last one, or far from the model: the observer starts again.
            self.observer = None;
            self.take(sample);
        }
        self.adapt(measured && sample.pressures.is_some());
    }

    /// Passes a sample to the observer. The first one starts it.
    fn take(&mut self, sample: &Sample) {
        let Follower { model, period, noise, law, .. } = self;
        let noise = Noise { disturbance: law.features().wander * noise.disturbance, ..*noise };
        self.observer.get_or_insert_with(|| Observer::new(model, sample, *period, noise));
        self.observe(sample);
    }

    /// Returns the law's command for a sample that the observer has processed.
    pub(crate) fn ask(&mut self, sample: &Sample, course: &Course) -> Answer {
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
            self.command(sample, &ahead)
        };
        answer.command = self.takeover.smooth(sample.time, answer.command);
        answer
    }

    /// Changes to another law without a bump: its first command equals the last one of the previous law.
    pub fn switch(&mut self, law: AnyLaw) {
        self.law = law;
        self.takeover.begins = true;
    }

    /// Multiplies the gains of a law that has not started by [`FACTORS`](crate::FACTORS). Factors out of bounds, or
    /// unused by this law, are rejected. Nothing changes then.
    pub fn scale(&mut self, factors: [f64; FACTORS.len()]) -> Result<(), String> {
        let law = self.law.key();
        let known: Vec<&str> = self.law.gains().iter().flat_map(|(gain, _)| gain.factors).copied().collect();
        for (key, factor) in FACTORS.iter().zip(factors) {
            if !factor.is_finite() || !FACTOR_BOUNDS.contain(factor) {
                return Err(format!("factors.{key} = {factor} is out of bounds: it must be {FACTOR_BOUNDS}"));
            }
            if factor != 1.0 && !known.contains(key) {
                let has = if known.is_empty() { "none".into() } else { known.join(", ") };
                return Err(format!(
                    "factors.{key} = {factor}: the law {law} does not use it; its factors are {has}. Leave it out"
                ));
            }
        }
        for (gain, value) in self.law.gains() {
            let own = FACTORS.iter().zip(factors).filter(|(key, _)| gain.factors.contains(key));
            own.for_each(|(_, factor)| *value *= factor);
        }
        Ok(())
    }

    /// Continues from a command without a bump. Holding and breakaway begin anew.
    pub(crate) fn begin_anew(&mut self, command: f64) {
        self.push = 0.0;
        self.friction = self.observer.as_ref().map(|own| own.state.friction);
        (self.takeover.last, self.takeover.begins) = (command, true);
        if let Some(hold) = &mut self.hold {
            *hold = Hold::new(hold.band, hold.after);
        }
    }

    /// Returns the deviation of the force of gas less friction from the plan of a reference with efforts, N in +x. It is
    /// predicted half way to the next sample, and half way from that to the time at which its command acts.
    pub fn deviations(&self, reference: &Reference) -> Option<[f64; 2]> {
        let (observer, model) = (self.observer.as_ref()?, &self.model);
        let at = |time: f64| {
            let Effort { mass, load, .. } = reference.effort(time)?;
            let (own, _) = observer.predict(model, time, self.period, 0.0);
            let [_, viscous] = model.friction_levels([own.position, own.velocity], own.pressures);
            let planned = mass * reference.at(time).acceleration - load;
            Some(model.gas_force(own.pressures) - own.friction - viscous * own.velocity - planned)
        };
        let next = observer.time + self.period;
        Some([at(next - 0.5 * self.period)?, at(next + 0.5 * self.ahead())?])
    }

    /// Returns the state at the last sample.
    pub(crate) fn state(&self) -> Option<State> {
        self.observer.as_ref().map(|observer| observer.state)
    }

    /// Returns the distance by which the drive has left its rest at the last sample, m, if it did.
    pub(crate) fn rest_left(&mut self) -> Option<f64> {
        self.hold.as_mut().map(|hold| std::mem::take(&mut hold.left)).filter(|&left| left > 0.0)
    }

    /// Returns the predicted state at the next sample, and the openings of the edges halfway.
    pub(crate) fn foresee(&self, time: f64) -> Option<(State, Edges<f64>)> {
        let observer = self.observer.as_ref()?;
        let (state, _) = observer.predict(&self.model, time, self.period, 0.0);
        Some((state, observer.spool.clone().edges(&self.model, observer.time, time)))
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
        Answer { command, wanted, velocity, disturbance, holds: false, feedback: [0.0; 2] }
    }
}

impl<S: Number, L: Law<S>> Follower<L, S> {
    /// Corrects the observer by a sample.
    pub(crate) fn observe(&mut self, sample: &Sample<S>) {
        let Some(observer) = &mut self.observer else { unreachable!("a sample starts it") };
        observer.update(&self.model, sample);
        self.friction.get_or_insert(observer.state.friction);
    }

    /// Adapts the model to the drive after a sample. Its pressures may be `measured`.
    pub(crate) fn adapt(&mut self, measured: bool) {
        let (Some(adaptation), Some(observer)) = (&mut self.adaptation, &mut self.observer) else { return };
        adaptation.learn_mass(&mut self.model, &observer.state, self.speed, self.period);
        if measured {
            let spool = matches!(self.valves, Valves::One).then(|| observer.spool.state);
            adaptation.learn(&mut self.model, &mut observer.state, spool, self.period);
        }
    }

    /// Visits each number of the state.
    pub(crate) fn numbers(&mut self, see: &mut dyn FnMut(&mut S)) {
        self.observer.each(see);
        self.friction.each(see);
        self.push.each(see);
        self.hold.each(see);
        if let Some(adaptation) = &mut self.adaptation {
            adaptation.learned(&mut self.model, see);
            adaptation.signals(see);
            see(&mut self.speed);
        }
        self.law.each(see);
    }

    /// Returns the time after which a command acts, as the law assumes it, s.
    pub(crate) fn ahead(&self) -> f64 {
        if self.law.features().predicts { self.model.valve.delay } else { self.plant.lag }
    }

    /// Returns the command for the stored sample.
    pub(crate) fn command(&mut self, sample: &Sample<S>, ahead: &Ahead<'_, S>) -> Answer<S> {
        let (acts, period) = (sample.time + self.ahead(), self.period);
        let (Some(observer), Some(along), model) = (&self.observer, &mut self.friction, &self.model) else {
            unreachable!("a sample comes first")
        };
        let coming = self.coupled.map_or(0.0, |own| own.loads[1] - own.loads[0]);
        let (mut state, spool) = observer.predict(model, acts, period, coming);
        let wanted = ahead.then;
        let [level, viscous] = model.friction_levels([wanted.position, wanted.velocity], state.pressures);
        let rate = model.stick_rate(wanted.velocity, *along, level, period);
        *along += rate.times(period);
        let along = *along;
        let (error, velocity) = (ahead.now.position - observer.state.position, observer.state.velocity);
        let gas = model.gas_force(state.pressures);
        let seen = Resting { stands: ahead.stands, error, velocity, gas, level };
        let never = (S::zero().lt(S::zero()), S::zero());
        let (holds, held) = self.hold.as_mut().map_or(never, |hold| hold.rate(&seen, model, period));
        self.push = self.pushed(&seen, holds);
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
            acceleration: model.acceleration(&state),
            state,
            wanted,
            friction: [along + rate.times(model.stick_damping_time) + viscous * wanted.velocity, force_rate],
            now: (sample.position, ahead.now),
            acts,
            spool: &spool,
            preview: ahead.preview,
            coupled: self.coupled,
        };
        let of_law = |law: &mut L| {
            let asked = law.step(&tick);
            law.given(asked, &tick);
            asked.limited()
        };
        let share = S::either(holds, &mut self.law, |_| tick.opening_for(held), of_law);
        let feedback = self.law.feedback(&tick).map(|own| S::select(holds, S::zero(), own));
        let command = model.command_for(share);
        let State { velocity, disturbance, .. } = observer.state;
        Answer { command, wanted: ahead.now, velocity, disturbance, holds, feedback }
    }

    /// Returns the force that breaks a resting drive away, N, a period later:
    ///
    ///   F' = r M b^2 e within +-c F_C   while the reference is at rest
    ///   F' = -b F                       after the contact has slipped
    ///   F' = -r F                       along a reference that moves, and during holding
    ///
    /// with the error e, m, the bandwidth b, 1/s, r = [`Features::push`](crate::law::Features::push) b, and c = [`PUSH_BOUND`].
    fn pushed(&self, seen: &Resting<S>, holds: S::Mask) -> S {
        let bandwidth = self.plant.bandwidth();
        let share = self.law.features().push * bandwidth * self.period;
        let bound = PUSH_BOUND * self.plant.coulomb;
        let stiffness = self.model.mass.times(share).times(bandwidth).times(bandwidth);
        let grown = (self.push + seen.error * stiffness).within(-bound, bound);
        let fallen = self.push.times(1.0 - share);
        // After the contact slips, the full breakaway force would drive the piston past its target.
        let slips = S::c(PUSH_SLIPS).lt(seen.velocity.abs());
        let grown = S::select(slips, self.push.times(1.0 - bandwidth * self.period), grown);
        let stands = S::select(S::zero().lt(seen.stands), grown, fallen);
        S::select(holds, fallen, stands)
    }
}
