use super::session::Session;
use super::variables::{Assembly, Quantity, Settable, Variables};
use super::{friction_law, leak::leak};
use crate::circuit::{AxisId, CarriageId, Circuit, GasId, PistonSide};
use crate::part::{Carriage, ChamberLaw, Given, InputId};
use crate::run::{Error, Look, Recorder, Run};
use crate::specification::{self, AirSupply, Orifice};
use ode::Options;
use physics::IdealGas;
use physics::flow::{Iso6358, LINEAR_ABOVE};

/// A friction rig: a servo carriage drags the piston through a force sensor.
#[derive(Clone, Debug)]
pub struct Rig {
    assembly: Assembly,
    axis: AxisId,
    carriage_axis: AxisId,
    carriage: CarriageId,
    /// Pressure, Pa, in every volume at rest, and the temperature of the room, K.
    filling: Vec<(GasId, f64)>,
    room_k: f64,
    initial_age: f64,
    /// What is always open, and what shutting off the supply closes.
    open: Vec<InputId>,
    supply: Vec<InputId>,
}

/// Input of a rig that the jerk of its carriage is.
const JERK: usize = 0;

/// Time constant with which an axis gives way, s, where nothing is said (assumed).
const RELEASE_TIME: f64 = 0.02;

/// Commanded speed below which a motion has ended at rest, m/s: what rounding leaves of a move.
const AT_REST: f64 = 1e-9;

/// One motion of a rig: constant jerks m/s3 for durations s each, and what else is different meanwhile.
#[derive(Clone, Copy, Debug)]
pub struct Motion<'a> {
    pub durations: &'a [f64],
    pub jerks: &'a [f64],
    /// The axis gives way until the sensor shows no force; then its command is where it stands.
    pub released: bool,
    /// The supply is shut off.
    pub shut: bool,
}

/// Where a run of a rig begins.
#[derive(Clone, Copy, Debug)]
pub enum Start<'a> {
    /// At rest at this position, m, the sensor unstressed, the chambers at their set pressures.
    Rest(f64),
    /// The state at the end of an earlier run of a rig of the same make.
    State(&'a [f64]),
}

/// The end of a run of a rig.
pub struct End {
    /// From which a further run can begin.
    pub state: Vec<f64>,
    /// Commanded position of the carriage, m.
    pub commanded: f64,
}

/// What [`Rig::assemble`] adds to the axes.
struct Air {
    gas: [GasId; 4],
    filling: Vec<(GasId, f64)>,
    open: Vec<InputId>,
    supply: Vec<InputId>,
}

impl Rig {
    /// Assembles the rig; with `ledger`, its accounts are integrated along.
    pub fn assemble(spec: &specification::Rig, ledger: bool) -> Result<Self, Error> {
        check(spec)?;
        let friction = friction_law(&spec.friction)?;
        let inner = friction.states();
        let gas = IdealGas::air();
        let room_k = spec.temperature_k.unwrap_or(physics::constants::T_0);
        let mut circuit = Circuit::new(&gas, spec.ambient_pressure_pa, room_k);
        let axis = circuit.axis(spec.moving_mass_kg, spec.incline_rad, 0.0, Some(friction));
        let air = match &spec.chambers {
            None => held(&mut circuit, spec, room_k),
            Some(chambers) => supplied(&mut circuit, spec, chambers, room_k),
        };
        let sides = spec.chambers.as_ref().map(|chambers| [chambers.a.perimeter_m, chambers.b.perimeter_m]);
        let areas = [spec.area_a_m2, spec.area_b_m2];
        for (i, (area, perimeter)) in areas.into_iter().zip(sides.unwrap_or_default()).enumerate() {
            let end_wall = if spec.chambers.is_some() { 2.0 * area } else { 0.0 };
            let side = PistonSide::new(area, perimeter, end_wall);
            circuit.face(air.gas[i], axis, i == 0, spec.stroke_m, side);
        }
        let release = spec.release_time_s.unwrap_or(RELEASE_TIME);
        let mut servo = Carriage::rigid().yielding(spec.sensor_stiffness_n_m, release);
        if let Some(axis) = &spec.servo {
            servo = servo.following(std::f64::consts::TAU * axis.bandwidth_hz, axis.damping_ratio);
        }
        if let Some(ripple) = spec.ripple.filter(|ripple| ripple.velocity > 0.0) {
            servo = servo.rippling(ripple.velocity, ripple.pitch_m);
        }
        let (carriage_axis, carriage) = circuit.servo(servo);
        let sensor = circuit.link(carriage_axis, axis, spec.sensor_stiffness_n_m, spec.sensor_damping_n_s_m);
        let Air { gas: [a, b, supply_a, supply_b], filling, open, supply } = air;
        let circuit = circuit.build(ledger);
        let jerk = Settable::of(&circuit, carriage.jerk(), "jerk", "jerk of the carriage's command");
        let mut variables = Variables { inputs: vec![jerk], ..Variables::default() };
        variables.read([
            ("time_s", Quantity::Time),
            ("carriage_position_m", Quantity::Position(carriage_axis)),
            ("carriage_velocity_m_s", Quantity::Velocity(carriage_axis)),
            ("position_m", Quantity::Position(axis)),
            ("velocity_m_s", Quantity::Velocity(axis)),
            ("acceleration_m_s2", Quantity::Acceleration(axis)),
            ("sensor_force_n", Quantity::Force(sensor)),
            ("friction_force_n", Quantity::Friction(axis)),
            ("pressure_a_pa", Quantity::Pressure(a)),
            ("temperature_a_k", Quantity::Temperature(a)),
            ("pressure_b_pa", Quantity::Pressure(b)),
            ("temperature_b_k", Quantity::Temperature(b)),
            ("supply_pressure_a_pa", Quantity::Pressure(supply_a)),
            ("supply_pressure_b_pa", Quantity::Pressure(supply_b)),
        ]);
        variables.read(inner.iter().enumerate().map(|(i, state)| (state.name, Quantity::Inner(axis, i))));
        Ok(Rig {
            assembly: Assembly::new(circuit, variables),
            axis,
            carriage_axis,
            carriage,
            filling,
            room_k,
            initial_age: spec.initial_age_s,
            open,
            supply,
        })
    }

    pub fn n_states(&self) -> usize {
        self.assembly.circuit.n_states()
    }

    pub fn columns(&self) -> &[String] {
        self.assembly.columns()
    }

    /// The rig's equations and their state at the start of `motion`.
    fn start(&self, from: Start, motion: &Motion) -> Result<(Circuit<f64>, Vec<f64>), Error> {
        let mut circuit = Circuit::clone(&self.assembly.circuit);
        for &id in &self.open {
            circuit.set_input(id, 0, 1.0);
        }
        for &id in &self.supply {
            circuit.set_input(id, 0, if motion.shut { 0.0 } else { 1.0 });
        }
        circuit.set_input(self.carriage.giving_way(), 0, f64::from(motion.released));
        let filled: Vec<_> = self.filling.iter().map(|&(id, p)| (id, p, self.room_k)).collect();
        let at = if let Start::Rest(position) = from { position } else { 0.0 };
        let axes = [(self.axis, at, 0.0), (self.carriage_axis, at, 0.0)];
        let ages = [(self.axis, self.initial_age)];
        let mut y =
            circuit.begin(&Given { gas: &filled, axes: &axes, ages: &ages, inner: &[], signals: &[] });
        if let Start::State(state) = from {
            let n = circuit.n_states();
            if state.len() != n {
                return Err(Error::Specification(format!(
                    "the initial state has {} values; this rig has {n} states: it is that of another make",
                    state.len()
                )));
            }
            y[..n].copy_from_slice(state);
            circuit.find_modes(&mut y);
        }
        Ok((circuit, y))
    }

    /// Runs a motion; samples at `times` s (ascending, within the motion).
    pub fn run(
        &self,
        motion: &Motion,
        times: &[f64],
        from: Start,
        options: Options,
        interrupted: &mut dyn FnMut(f64) -> bool,
    ) -> Result<(Run, End), Error> {
        let mut session = Session::new(&self.assembly, 0.0, self.start(from, motion)?, options);
        let ends = motion.durations.iter().scan(0.0, |until, duration| {
            *until += duration;
            Some(*until)
        });
        let ends: Vec<f64> = ends.collect();
        session.put(JERK, motion.jerks[0]);
        session.plan(JERK, ends.iter().copied().zip(motion.jerks[1..].iter().copied()));
        let mut recorder = Recorder::new(&self.assembly, times.to_vec());
        session.advance(ends[ends.len() - 1], &mut recorder, &mut Look::new(interrupted))?;
        let run = recorder.finish(&session);
        let circuit = session.circuit();
        let mut state = session.state()[..circuit.n_states()].to_vec();
        if motion.released {
            circuit.take_over(self.carriage, &mut state);
        }
        circuit.come_to_rest(self.carriage, &mut state, AT_REST);
        let commanded = circuit.commanded(self.carriage, &state);
        Ok((run, End { state, commanded }))
    }
}

/// Values without which nothing can be computed; the rig file's own checks say more.
fn check(spec: &specification::Rig) -> Result<(), Error> {
    let mut positive = vec![
        ("area_a_m2", spec.area_a_m2),
        ("area_b_m2", spec.area_b_m2),
        ("moving_mass_kg", spec.moving_mass_kg),
        ("ambient_pressure_pa", spec.ambient_pressure_pa),
        ("pressure_a_pa", spec.pressure_a_pa),
        ("pressure_b_pa", spec.pressure_b_pa),
        ("sensor_stiffness_n_m", spec.sensor_stiffness_n_m),
        ("temperature_k", spec.temperature_k.unwrap_or(1.0)),
        ("release_time_s", spec.release_time_s.unwrap_or(1.0)),
    ];
    if let Some(servo) = &spec.servo {
        positive.extend([
            ("servo.bandwidth_hz", servo.bandwidth_hz),
            ("servo.damping_ratio", servo.damping_ratio),
        ]);
    }
    if let Some(ripple) = &spec.ripple {
        positive.push(("ripple.pitch_m", ripple.pitch_m));
        if !(0.0..1.0).contains(&ripple.velocity) {
            return Err(Error::Specification(format!(
                "ripple.velocity = {} must be from 0 to below 1: the carriage may not turn round",
                ripple.velocity
            )));
        }
    }
    if let Some(chambers) = &spec.chambers {
        positive.extend([
            ("chambers.a.dead_volume_m3", chambers.a.dead_volume_m3),
            ("chambers.b.dead_volume_m3", chambers.b.dead_volume_m3),
        ]);
        if matches!(chambers.supply, AirSupply::Common { .. }) && spec.pressure_a_pa != spec.pressure_b_pa {
            return Err(Error::Specification(format!(
                "one regulator cannot give {} Pa and {} Pa: chambers on a common manifold have one pressure",
                spec.pressure_a_pa, spec.pressure_b_pa
            )));
        }
    }
    match positive.iter().find(|(_, value)| !(value.is_finite() && *value > 0.0)) {
        Some((name, value)) => Err(Error::Specification(format!("{name} = {value} must be above zero"))),
        None => Ok(()),
    }
}

/// Chambers whose pressure takes no notice of the piston.
fn held(circuit: &mut Circuit<f64>, spec: &specification::Rig, room_k: f64) -> Air {
    let [a, b] = [spec.pressure_a_pa, spec.pressure_b_pa].map(|p| circuit.reservoir(p, room_k));
    Air { gas: [a, b, a, b], filling: Vec::new(), open: Vec::new(), supply: Vec::new() }
}

/// Chambers that hold air, with what supplies them and what leaks out of them.
fn supplied(
    circuit: &mut Circuit<f64>,
    spec: &specification::Rig,
    chambers: &specification::Chambers,
    room_k: f64,
) -> Air {
    let heat = chambers.heat_transfer_w_m2_k;
    let ambient = circuit.reservoir(spec.ambient_pressure_pa, room_k);
    let each = [chambers.a, chambers.b]
        .map(|own| circuit.volume(ChamberLaw::EnergyBalance, own.dead_volume_m3, 0.0, heat, room_k));
    let [a, b] = each;
    let set = [spec.pressure_a_pa, spec.pressure_b_pa];
    let (mut open, mut supply) = (Vec::new(), Vec::new());
    let (sources, filling) = match &chambers.supply {
        AirSupply::Open { ports } => {
            for (chamber, port) in each.into_iter().zip(ports) {
                supply.push(circuit.restriction(path(port), ambient, chamber));
            }
            ([ambient; 2], each.map(|id| (id, spec.ambient_pressure_pa)).to_vec())
        }
        AirSupply::Common { regulator, manifold, lines } => {
            let source = circuit.reservoir(set[0], room_k);
            let volume = vessel(circuit, manifold, heat, room_k);
            supply.push(circuit.restriction(path(regulator), source, volume));
            for (chamber, line) in each.into_iter().zip(lines) {
                open.push(circuit.restriction(path(line), volume, chamber));
            }
            ([volume; 2], [a, b, volume].map(|id| (id, set[0])).to_vec())
        }
        AirSupply::Separate { regulator, manifold, lines } => {
            let mut filling = Vec::new();
            let mut one = |i: usize| {
                let source = circuit.reservoir(set[i], room_k);
                let volume = vessel(circuit, manifold, heat, room_k);
                supply.push(circuit.restriction(path(regulator), source, volume));
                open.push(circuit.restriction(path(&lines[i]), volume, each[i]));
                filling.extend([(each[i], set[i]), (volume, set[i])]);
                volume
            };
            ([one(0), one(1)], filling)
        }
    };
    let leaks = [
        (a, b, chambers.piston_leakage_m3_s_pa),
        (a, ambient, chambers.a.leakage_m3_s_pa),
        (b, ambient, chambers.b.leakage_m3_s_pa),
    ];
    for (from, to, conductance) in leaks {
        if conductance > 0.0 {
            open.push(circuit.restriction(leak(conductance, &IdealGas::air(), true), from, to));
        }
    }
    Air { gas: [a, b, sources[0], sources[1]], filling, open, supply }
}

fn path(orifice: &Orifice) -> Iso6358<f64> {
    let (c, b) = (orifice.conductance_m3_s_pa, orifice.critical_pressure_ratio);
    Iso6358::for_gas(c, b, 0.5, LINEAR_ABOVE, true, &IdealGas::air(), true)
}

fn vessel(circuit: &mut Circuit<f64>, manifold: &specification::Manifold, heat: f64, room_k: f64) -> GasId {
    circuit.volume(ChamberLaw::EnergyBalance, manifold.volume_m3, manifold.wall_m2, heat, room_k)
}
