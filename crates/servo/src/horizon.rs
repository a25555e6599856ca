//! The horizon of predictive control by the assumed circuit and the core's integrator, with derivatives by all moves.
//! It works for any circuit, and is the reference for the model's fixed steps.

use crate::belief::{Axis, number};
use crate::refuse;
use circuit::{Assembly, Circuit, Error, Foresight, Network, Starting, specification};
use control::nmpc::{ByMoves, MOVES, steps};
use control::{Model, Predictor, Tick};
use ode::{Options, System};
use physics::constants::STANDARD_GRAVITY;

/// Relative tolerance of the horizon, and attempts at a step after which it is given up (assumed).
const RTOL: f64 = 1e-3;
const MOST_ATTEMPTS: u64 = 100;
/// First step that is tried, s: the duration of the first move (assumed).
const FIRST_STEP: f64 = 1e-3;
/// Relative change of a learned number after which the circuit uses the new value (assumed).
const MOVED: f64 = 0.01;
/// Settling time of unmeasured states before the first sample, s (assumed).
const SETTLES: f64 = 0.05;

/// The horizon by a circuit. Its valve has neither dead time nor overlap nor play: the law accounts for them, and its
/// moves are fractions of opening. States that the observer does not estimate, such as the gas in a tube, are
/// simulated in parallel under the given commands.
#[derive(Clone)]
pub struct ByCircuit {
    belief: specification::Circuit,
    axis: Axis,
    /// Model as described, and the learned numbers that the circuit uses.
    described: Model,
    learned: [f64; 4],
    /// A new circuit with numbers that were learned since, and these numbers.
    next: Option<(Assembly, [f64; 4])>,
    /// Whether the predictor learns in this sample. During learning the built-in model predicts, because learning and
    /// this
    /// prediction together would take too long.
    learns: bool,
    places: Places,
    network: Network,
    assembly: Assembly,
    foresight: Foresight,
    /// The state from which the last horizon began.
    last: Option<(Circuit<f64>, Vec<f64>)>,
}

impl std::fmt::Debug for ByCircuit {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "ByCircuit({})", self.axis.cylinder)
    }
}

/// Places of states and inputs.
#[derive(Clone, Debug, Default)]
struct Places {
    /// The state that is the position of the piston.
    position: usize,
    /// Position and speed of each spool that has them.
    spools: Vec<[usize; 2]>,
    /// Inputs: the command of each valve with its sign, and the external force.
    commands: Vec<(usize, f64)>,
    force: usize,
    /// States of neither the cylinder nor a spool.
    hidden: Vec<usize>,
}

impl Places {
    fn foresight(&self, assembly: &Assembly) -> Foresight {
        let options = Options {
            rtol: RTOL,
            max_attempts: MOST_ATTEMPTS,
            least_first_step: FIRST_STEP,
            ..Options::default()
        };
        Foresight::new(assembly, self.position, self.commands.clone(), options)
    }
}

/// The ends of the steps of the horizon, s.
fn ends() -> Vec<f64> {
    let mut end = 0.0;
    steps().map(|(_, h)| (end += h, end).1).collect()
}

/// End time of each move, s.
fn held<S: Copy>(plan: &[S; MOVES]) -> Vec<(f64, S)> {
    let mut end = 0.0;
    let mut each: Vec<(f64, S)> = plan.iter().map(|&own| (0.0, own)).collect();
    for (block, h) in steps() {
        end += h;
        each[block].0 = end;
    }
    each
}

/// Visits the predicted rows, if any.
fn shown<S: Copy>(rows: Option<Vec<[S; 3]>>, see: &mut dyn FnMut([S; 3])) -> bool {
    rows.is_some_and(|rows| {
        rows.into_iter().for_each(see);
        true
    })
}

impl ByCircuit {
    /// Returns the predictor by the assumed circuit, with the controller's model.
    pub fn new(belief: &specification::Circuit, axis: &Axis, model: &Model) -> Result<Self, Error> {
        if axis.switches {
            return refuse(format!(
                "nmpc.predictor = \"circuit\": {} switches, and the moves of the plan are shares of opening. Leave the key out, \
                 or command a proportional valve",
                axis.valves.join(", ")
            ));
        }
        let rod = format!("{}.rod", axis.cylinder);
        let mut at_rod = belief.joints.iter().filter(|joint| joint.contains(&rod)).flatten();
        let other = at_rod.find(|port| {
            axis.left_out.iter().any(|name| port.rsplit_once('.').is_some_and(|own| own.0 == name))
        });
        if let Some(port) = other {
            return refuse(format!(
                "nmpc.predictor = \"circuit\": {port} is at the rod, and its force is in the unknown one that the observer finds, \
                 which would act twice. Leave the key out"
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
        let commands = axis.valves.iter().zip([1.0, -1.0]);
        let commands = commands.map(|(valve, way)| Some((input(format!("{valve}.command"))?, way)));
        let position = state(of_cylinder("position_m"));
        let found = (position, commands.collect::<Option<Vec<_>>>(), input(of_cylinder("load_force_n")));
        let (Some(position), Some(commands), Some(force)) = found else {
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
        let places = Places { position, spools, commands, force, hidden };
        Ok(ByCircuit {
            foresight: places.foresight(assembly),
            places,
            assembly: assembly.clone(),
            network,
            described: model.clone(),
            learned: [1.0; 4],
            next: None,
            learns: false,
            axis: axis.clone(),
            belief,
            last: None,
        })
    }

    /// Updates friction, mass and conductance to the learned values, and returns whether they changed. The circuit is
    /// built in one sample and used from the next on.
    fn learn(&mut self, model: &Model) -> bool {
        if let Some((assembly, learned)) = self.next.take() {
            if assembly.circuit.shares_analysis(&self.assembly.circuit) {
                self.foresight.renew(&assembly);
            } else {
                self.foresight = self.places.foresight(&assembly);
            }
            (self.assembly, self.learned) = (assembly, learned);
            return true;
        }
        let [level, viscous] = model.friction_shares;
        let mass = model.mass / self.described.mass;
        // The model attributes other restrictions in the gas path to the valve.
        let is_alone = self.axis.left_out.is_empty();
        let conductance = model.valve.flow.gain / self.described.valve.flow.gain;
        let now = [level, viscous, mass, if is_alone { conductance } else { 1.0 }];
        if self.learned.iter().zip(now).all(|(own, now)| (now - own).abs() <= MOVED * own.abs()) {
            return false;
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
        // Impossible numbers do not give a circuit: the last circuit is kept.
        self.next = self.network.renewed(&belief).ok().map(|assembly| (assembly, now));
        self.next.is_some()
    }

    /// Returns the circuit, and its state at the state of the drive that the law estimates.
    fn at(&self, tick: &Tick, hidden: Option<(&Circuit<f64>, &[f64])>) -> (Circuit<f64>, Vec<f64>) {
        let assembly = &self.assembly;
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
                    // Deflection under the friction force of the observer.
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

    /// Returns the force that the circuit does not contain: the disturbance, and the difference between the weights
    /// of circuit and law.
    fn force(&self, tick: &Tick) -> (usize, f64) {
        let cylinder = self.belief.components.iter().find(|own| own.name == self.axis.cylinder);
        let incline = cylinder.and_then(|own| number(own, "incline")).unwrap_or_default();
        let more = (self.learned[2] - 1.0) * self.described.mass;
        (self.places.force, tick.state.disturbance + more * STANDARD_GRAVITY * incline.sin())
    }

    /// Returns the states that no sensor measures, one period after the beginning of the last horizon.
    fn beside(&mut self, tick: &Tick, given: f64) -> Option<(Circuit<f64>, Vec<f64>)> {
        if self.places.hidden.is_empty() {
            return None;
        }
        let force = self.force(tick);
        let is_first = self.last.is_none();
        let mut from = self.last.take().unwrap_or_else(|| self.at(tick, None));
        let (share, time) = if is_first { (0.0, SETTLES) } else { (given, tick.period) };
        self.foresight.begin(&mut from, force);
        self.foresight.after(share, time)
    }
}

/// Least fraction of the described moving mass for which a circuit can be built (assumed).
const LEAST_MASS: f64 = 0.05;

impl Predictor for ByCircuit {
    fn begin(&mut self, tick: &Tick, given: f64) {
        self.learns = self.learn(tick.model);
        let beside = self.beside(tick, given);
        let mut now = self.at(tick, beside.as_ref().map(|(circuit, y)| (circuit, &y[..])));
        let force = self.force(tick);
        self.foresight.begin(&mut now, force);
        self.last = Some(now);
    }

    fn values(&mut self, plan: &[f64; MOVES], see: &mut dyn FnMut([f64; 3])) -> bool {
        !self.learns && shown(self.foresight.values(&held(plan), &ends()), see)
    }

    fn derivatives(&mut self, plan: &[ByMoves; MOVES], see: &mut dyn FnMut([ByMoves; 3])) -> bool {
        !self.learns && shown(self.foresight.derivatives(&held(plan), &ends()), see)
    }

    fn boxed(&self) -> Box<dyn Predictor> {
        Box::new(self.clone())
    }
}
