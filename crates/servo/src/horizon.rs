//! The horizon of predictive control by the circuit that is believed in and the core's integrator, with derivatives by all
//! moves: for any circuit, and the yardstick of the model's fixed steps.

use crate::belief::{Axis, number};
use crate::refuse;
use circuit::{Assembly, Circuit, Error, Network, Starting, specification};
use control::nmpc::{ByMoves, MOVES, steps};
use control::{Model, Predictor, Tick};
use math::Lane;
use ode::{Accepted, NoOutput, Options, Output, Paused, Stepper, System};
use physics::constants::STANDARD_GRAVITY;

/// Relative tolerance of the horizon, and attempts at a step after which it is given up (assumed).
const RTOL: f64 = 1e-3;
const MOST_ATTEMPTS: u64 = 100;
/// Share by which a number that is learned may move before the circuit takes it over (assumed).
const MOVED: f64 = 0.01;
/// Time in which what no sensor sees settles before the first sample, s (assumed).
const SETTLES: f64 = 0.05;

/// The horizon by a circuit. Its valve has neither dead time nor overlap nor play: the law takes those for itself, and its
/// moves are shares of opening. What the observer does not know, such as the gas in a tube, runs beside it under the
/// commands that were given.
#[derive(Clone)]
pub struct ByCircuit {
    belief: specification::Circuit,
    axis: Axis,
    /// The model as it is described, and the learned numbers that the circuit has by now.
    described: Model,
    learned: [f64; 4],
    places: Places,
    values: Runner<f64>,
    derivatives: Runner<ByMoves>,
    /// The state from which the last horizon began.
    last: Option<(Circuit<f64>, Vec<f64>)>,
}

impl std::fmt::Debug for ByCircuit {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "ByCircuit({})", self.axis.cylinder)
    }
}

/// Where states and inputs stand.
#[derive(Clone, Debug, Default)]
struct Places {
    /// Position and velocity, and position and speed of each spool that has them.
    motion: [usize; 2],
    spools: Vec<[usize; 2]>,
    /// Inputs: the command of each valve with its sign, and the external force.
    commands: Vec<(usize, f64)>,
    force: usize,
    /// States of neither the cylinder nor a spool.
    hidden: Vec<usize>,
}

/// An integration that begins anew at each sample.
#[derive(Clone)]
struct Runner<R: Lane> {
    assembly: Assembly<R>,
    stepper: Stepper<R, Circuit<R>>,
}

/// Takes position, velocity and acceleration at the end of each step of the horizon.
struct Track<'s, R: Lane> {
    motion: [usize; 2],
    next: std::iter::Peekable<Box<dyn Iterator<Item = f64>>>,
    see: &'s mut dyn FnMut([R; 3]),
}

impl<R: Lane> Output<R, Circuit<R>> for Track<'_, R> {
    fn due(&self, _lane: usize) -> f64 {
        f64::INFINITY
    }

    fn sample(&mut self, _lane: usize, _t: f64, _y: &[R], _circuit: &Circuit<R>) {}

    fn step(&mut self, _lane: usize, t: f64, h: f64, states: &mut Accepted<'_, R>, _circuit: &Circuit<R>) {
        while let Some(time) = self.next.next_if(|time| *time <= t + h * (1.0 + ROUNDING)) {
            let share = ((time - t) / h).min(1.0);
            let [[x, _], [v, slope]] = self.motion.map(|state| states.state(state, share));
            (self.see)([x, v, slope * R::c(1.0 / h)]);
        }
    }
}

/// What rounding may do to the end of a step, as a share of it.
const ROUNDING: f64 = 1e-9;

impl<R: Lane> Runner<R> {
    fn new(assembly: &Assembly) -> Self {
        let circuit = Circuit::<R>::gather(&[&assembly.circuit]);
        let y = vec![R::zero(); circuit.n_states()];
        let options = Options { rtol: RTOL, ..Options::default() };
        let stepper = Stepper::new(circuit.clone(), 0.0, &y, options);
        let (variables, timings) = (assembly.variables.clone(), assembly.timings.clone());
        Runner { assembly: Assembly { circuit: circuit.into(), variables, timings }, stepper }
    }

    /// Begins at time zero from a state, with the modes of a circuit, under an external force.
    fn load(&mut self, (circuit, y): &mut (Circuit<f64>, Vec<f64>), (input, force): (usize, f64)) {
        let mut modes = Vec::new();
        circuit.change_modes(|mode| modes.push(*mode));
        let (own, mut modes) = (self.stepper.system_mut(), modes.into_iter());
        own.change_modes(|mode| *mode = R::c(modes.next().unwrap_or_default()));
        self.assembly.set(own, input, 0, R::c(force));
        self.stepper.load(0, 0.0, y);
        self.stepper.allow_in(0, MOST_ATTEMPTS);
    }

    /// Goes on to a time under a share of opening; whether it could.
    fn go(
        &mut self,
        commands: &[(usize, f64)],
        share: R,
        until: f64,
        output: &mut impl Output<R, Circuit<R>>,
    ) -> bool {
        let circuit = self.stepper.system_mut();
        for &(input, way) in commands {
            self.assembly.set(circuit, input, 0, share * R::c(way));
        }
        let paused = self.stepper.advance(until, MOST_ATTEMPTS, output);
        paused == Paused::Arrived && self.stepper.failure(0).is_none()
    }

    /// The horizon under a plan; whether it came to its end.
    fn follow(&mut self, places: &Places, plan: &[R; MOVES], see: &mut dyn FnMut([R; 3])) -> bool {
        let ends = steps().scan(0.0, |end, (_, h)| {
            *end += h;
            Some(*end)
        });
        let ends: Box<dyn Iterator<Item = f64>> = Box::new(ends);
        let mut track = Track { motion: places.motion, next: ends.peekable(), see };
        let mut end = 0.0;
        (0..MOVES).all(|block| {
            end += steps().filter(|step| step.0 == block).map(|step| step.1).sum::<f64>();
            self.go(&places.commands, plan[block], end, &mut track)
        }) && track.next.peek().is_none()
    }
}

impl ByCircuit {
    /// Of a circuit that is believed in, with what a law believes of it.
    pub fn new(belief: &specification::Circuit, axis: &Axis, model: &Model) -> Result<Self, Error> {
        if axis.switches {
            return refuse(format!(
                "nmpc.predictor = \"circuit\": {} switches, and the moves of the plan are shares of opening. Leave the key out, \
                 or command a proportional valve",
                axis.valves.join(", ")
            ));
        }
        let mut belief = belief.clone();
        for own in belief.components.iter_mut().filter(|own| axis.valves.contains(&own.name)) {
            own.numbers.insert("overlap".into(), 0.0);
        }
        let network = Network::assemble(&belief, false)?;
        let assembly = network.assembly();
        let circuit = &assembly.circuit;
        let state = |name: String| circuit.state_names().iter().position(|own| own.0 == name);
        let input = |name: String| assembly.variables.inputs.iter().position(|own| own.name == name);
        let of_cylinder = |what: &str| format!("{}.{what}", axis.cylinder);
        let motion = [state(of_cylinder("position_m")), state(of_cylinder("velocity_m_s"))];
        let commands = axis.valves.iter().zip([1.0, -1.0]);
        let commands = commands.map(|(valve, way)| Some((input(format!("{valve}.command"))?, way)));
        let found = (motion, commands.collect::<Option<Vec<_>>>(), input(of_cylinder("load_force_n")));
        let ([Some(x), Some(v)], Some(commands), Some(force)) = found else {
            return refuse(format!("{} has no state or input that a prediction needs", axis.cylinder));
        };
        let spools = axis.valves.iter().filter_map(|valve| {
            Some([state(format!("{valve}.position"))?, state(format!("{valve}.speed_1_s"))?])
        });
        let spools: Vec<[usize; 2]> = spools.collect();
        // A volume between valve and cylinder has the name of a port of the valve.
        let chamber = format!("{}.", axis.cylinder);
        let names = circuit.state_names().iter().enumerate();
        let hidden = names.filter(|(place, (name, _))| {
            !name.starts_with(&chamber) && !spools.as_flattened().contains(place)
        });
        let hidden = hidden.map(|(place, _)| place).collect();
        Ok(ByCircuit {
            places: Places { motion: [x, v], spools, commands, force, hidden },
            values: Runner::new(assembly),
            derivatives: Runner::new(assembly),
            described: model.clone(),
            learned: [1.0; 4],
            axis: axis.clone(),
            belief,
            last: None,
        })
    }

    /// Takes over what the model has learned by now: friction, mass and conductance.
    fn learn(&mut self, model: &Model) {
        let [level, viscous] = model.friction_shares;
        let mass = model.mass / self.described.mass;
        // What else lies in the way of the gas, the model takes for the valve's.
        let is_alone = self.axis.left_out.is_empty();
        let conductance = model.valve.flow.gain / self.described.valve.flow.gain;
        let now = [level, viscous, mass, if is_alone { conductance } else { 1.0 }];
        if self.learned.iter().zip(now).all(|(own, now)| (now - own).abs() <= MOVED * own.abs()) {
            return;
        }
        let mut belief = self.belief.clone();
        for own in &mut belief.components {
            if own.name == self.axis.cylinder {
                let described = number(own, "moving_mass").unwrap_or_default();
                let moving = described + model.mass - self.described.mass;
                own.numbers.insert("moving_mass".into(), moving.max(LEAST_MASS * described));
                for (key, share) in [("coulomb", level), ("breakaway", level), ("viscous", viscous)] {
                    let value = own.friction.as_mut().and_then(|own| own.parameters.get_mut(key));
                    value.into_iter().for_each(|value| *value *= share);
                }
            }
            if self.axis.valves.contains(&own.name) {
                for key in ["conductance", "exhaust_conductance"] {
                    own.numbers.get_mut(key).into_iter().for_each(|value| *value *= now[3]);
                }
            }
        }
        // One that cannot be has no circuit: the last one stays.
        if let Ok(network) = Network::assemble(&belief, false) {
            (self.values, self.derivatives) =
                (Runner::new(network.assembly()), Runner::new(network.assembly()));
            self.learned = now;
        }
    }

    /// The circuit and its state where the law has the drive.
    fn at(&self, tick: &Tick, hidden: Option<(&Circuit<f64>, &[f64])>) -> (Circuit<f64>, Vec<f64>) {
        let assembly = &self.values.assembly;
        let (state, cylinder) = (&tick.state, &self.axis.cylinder);
        let elsewhere = hidden.map(|(circuit, y)| assembly.outside(circuit, y, &mut circuit.work()));
        let mean = 0.5 * (state.pressures[0] + state.pressures[1]);
        let known = |name: &str| {
            let own = name.strip_prefix(cylinder.as_str())?.strip_prefix('.')?;
            Some(match own {
                "position_m" => state.position,
                "velocity_m_s" => state.velocity,
                "a.pressure_pa" => state.pressures[0],
                "b.pressure_pa" => state.pressures[1],
                "a.temperature_k" => state.temperatures[0],
                "b.temperature_k" => state.temperatures[1],
                _ => return None,
            })
        };
        let mut start = Vec::new();
        for (starting, names) in &assembly.variables.starts {
            for (place, name) in names.iter().enumerate() {
                let other = match *starting {
                    Starting::Gas(_) if place == 0 => mean,
                    Starting::Gas(_) => tick.model.wall_temperature,
                    // The deflection under the force that the observer has.
                    Starting::Inner(_) if place == 0 => state.friction / tick.model.stick_stiffness,
                    _ => 0.0,
                };
                let twin = elsewhere.as_ref().filter(|_| !matches!(starting, Starting::Inner(_)));
                let other = twin.map_or(other, |twin| twin[start.len()]);
                start.push(known(name).unwrap_or(other));
            }
        }
        let (circuit, mut y) = assembly.begin(&start, 0.0);
        if let Some((_, twin)) = hidden {
            self.places.hidden.iter().for_each(|&place| y[place] = twin[place]);
        }
        let [position, speed] = tick.spool.share(tick.model.valve.overlap);
        for (&[at, rate], &(_, way)) in self.places.spools.iter().zip(&self.places.commands) {
            (y[at], y[rate]) = (way * position, way * speed);
        }
        (circuit, y)
    }

    /// The force that the circuit does not have by itself: the unknown one, and the weight that it has beside the law's.
    fn force(&self, tick: &Tick) -> (usize, f64) {
        let cylinder = self.belief.components.iter().find(|own| own.name == self.axis.cylinder);
        let incline = cylinder.and_then(|own| number(own, "incline")).unwrap_or_default();
        let more = (self.learned[2] - 1.0) * self.described.mass;
        (self.places.force, tick.state.disturbance + more * STANDARD_GRAVITY * incline.sin())
    }

    /// What no sensor sees, a period on from the last horizon's beginning.
    fn beside(&mut self, tick: &Tick, given: f64) -> Option<(Circuit<f64>, Vec<f64>)> {
        if self.places.hidden.is_empty() {
            return None;
        }
        let force = self.force(tick);
        let is_first = self.last.is_none();
        let mut from = self.last.take().unwrap_or_else(|| self.at(tick, None));
        let (share, time) = if is_first { (0.0, SETTLES) } else { (given, tick.period) };
        self.values.load(&mut from, force);
        self.values.go(&self.places.commands, share, time, &mut NoOutput).then(|| {
            let stepper = &self.values.stepper;
            (stepper.system().clone(), stepper.state().to_vec())
        })
    }
}

/// Least share of the moving mass that is described, so that a circuit can be made (assumed).
const LEAST_MASS: f64 = 0.05;

impl Predictor for ByCircuit {
    fn begin(&mut self, tick: &Tick, given: f64) {
        self.learn(tick.model);
        let beside = self.beside(tick, given);
        let mut now = self.at(tick, beside.as_ref().map(|(circuit, y)| (circuit, &y[..])));
        let force = self.force(tick);
        self.values.load(&mut now, force);
        self.derivatives.load(&mut now, force);
        self.last = Some(now);
    }

    fn values(&mut self, plan: &[f64; MOVES], see: &mut dyn FnMut([f64; 3])) -> bool {
        self.values.follow(&self.places, plan, see)
    }

    fn derivatives(&mut self, plan: &[ByMoves; MOVES], see: &mut dyn FnMut([ByMoves; 3])) -> bool {
        self.derivatives.follow(&self.places, plan, see)
    }

    fn boxed(&self) -> Box<dyn Predictor> {
        Box::new(self.clone())
    }
}
