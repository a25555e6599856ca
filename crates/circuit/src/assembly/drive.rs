use super::friction_law;
use crate::circuit::{AxisId, Circuit, GasId, PistonSide, RestrictionId};
use crate::net::Net;
use crate::part::ChamberLaw;
use crate::run::{Error, Recorder, Run, States, advance, sample_times};
use crate::specification::{self, ChamberLawName, CylinderKind, Initial, Valve};
use ode::{Options, Output, Statistics, Stepper, System};
use physics::IdealGas;
use physics::flow::Iso6358;
use physics::mechanics::EndStop;
use std::f64::consts::PI;

/// A double-acting cylinder on a 5/3 proportional valve.
#[derive(Clone, Debug)]
pub struct Drive {
    circuit: Circuit<f64>,
    axis: AxisId,
    a: GasId,
    b: GasId,
    /// Edges of the valve: supply to a, a to exhaust, supply to b, b to exhaust.
    edges: [RestrictionId; 4],
    columns: Vec<String>,
    warnings: Vec<String>,
    citations: Vec<&'static str>,
}

/// Area and walls of a chamber with a rod of diameter `rod` (0: none). Heat passes the barrel, both
/// end faces and the rod's surface; the dead volume has no surface of its own.
fn side(bore: f64, rod: f64) -> PistonSide {
    let area = 0.25 * PI * (bore * bore - rod * rod);
    PistonSide { area, perimeter: PI * (bore + rod), end_wall: 2.0 * area }
}

/// A stop so soft that supply pressure pushes the piston through the dead volume before it.
fn stop_warning(cylinder: &specification::Cylinder, sides: &[PistonSide; 2], gauge: f64) -> Option<String> {
    let depth = |side: &PistonSide| gauge * side.area / cylinder.end_stop.stiffness_n_m;
    let room = [cylinder.dead_volume_a_m3 / sides[0].area, cylinder.dead_volume_b_m3 / sides[1].area];
    // Chamber a pushes towards b's end, and the other way round.
    let (into_b, into_a) = (depth(&sides[0]), depth(&sides[1]));
    let (end, depth, room) = if into_b > room[1] { ("b", into_b, room[1]) } else { ("a", into_a, room[0]) };
    (depth > room).then(|| {
        format!(
            "supply pressure pushes the piston {:.3} mm into the end stop, but the dead volume of chamber {end} is only {:.3} mm long: \
             a larger cylinder.end_stop.stiffness or cylinder.dead_volume.{end} keeps the chamber from vanishing",
            1e3 * depth, 1e3 * room
        )
    })
}

impl Drive {
    /// Assembles the drive; with `ledger`, its accounts are integrated along.
    pub fn assemble(spec: &specification::Drive, ledger: bool) -> Result<Self, Error> {
        let cylinder = &spec.cylinder;
        let gas = IdealGas::new(spec.gas.heat_capacity_ratio, spec.gas.gas_constant_j_kg_k);
        let friction = friction_law(&spec.friction)?;
        let rod = |has_rod: bool| {
            if has_rod { cylinder.rod_diameter_m } else { 0.0 }
        };
        let mut sides = [
            side(cylinder.bore_m, rod(cylinder.kind == CylinderKind::ThroughRod)),
            side(cylinder.bore_m, rod(cylinder.kind != CylinderKind::Rodless)),
        ];
        let chamber_law = match cylinder.chamber_law {
            ChamberLawName::EnergyBalance => ChamberLaw::EnergyBalance,
            ChamberLawName::AsPrinted => {
                // pi (D x + 0.25 D^3) as printed, in metres: the second term is no area at all.
                for side in &mut sides {
                    (side.perimeter, side.end_wall) =
                        (PI * cylinder.bore_m, 0.25 * PI * cylinder.bore_m.powi(3));
                }
                ChamberLaw::AsPrinted
            }
        };
        if ledger && chamber_law == ChamberLaw::AsPrinted {
            return Err(Error::Specification(
                "chamber law \"as-printed\" has no ledger: it does not conserve energy".into(),
            ));
        }
        let gauge = spec.supply.pressure_pa - spec.ambient.pressure_pa;
        let mut warnings = friction.warnings(gauge, cylinder.stroke_m);
        warnings.extend(stop_warning(cylinder, &sides, gauge));
        if chamber_law == ChamberLaw::AsPrinted {
            warnings.push(
                "chamber law \"as-printed\" breaks the energy balance; it is for reproducing the paper only"
                    .into(),
            );
        }
        let inner = friction.states();
        let mut citations = friction.sources();
        citations.extend(["iso6358-2013", "bejan2016", "steinebach2023", "hairer1996"]);
        if chamber_law == ChamberLaw::AsPrinted {
            citations.push("bracha");
        }
        if cylinder.incline_rad != 0.0 {
            citations.push("bipm2019");
        }

        let mut circuit = Circuit::new(&gas, spec.ambient.pressure_pa, spec.ambient.temperature_k);
        let supply = circuit.reservoir(spec.supply.pressure_pa, spec.supply.temperature_k);
        let exhaust = circuit.reservoir(spec.ambient.pressure_pa, spec.ambient.temperature_k);
        let mut chamber = |dead_volume: f64| {
            circuit.volume(
                chamber_law,
                dead_volume,
                0.0,
                cylinder.heat_transfer_w_m2_k,
                cylinder.wall_temperature_k,
            )
        };
        let (a, b) = (chamber(cylinder.dead_volume_a_m3), chamber(cylinder.dead_volume_b_m3));
        let mass = cylinder.moving_mass_kg + spec.load.mass_kg;
        let axis = circuit.axis(mass, cylinder.incline_rad, spec.load.force_n, Some(friction));
        for (gas, side, grows) in [(a, sides[0], true), (b, sides[1], false)] {
            circuit.face(gas, axis, grows, cylinder.stroke_m, side);
        }
        let stop = &cylinder.end_stop;
        let stop = EndStop {
            stiffness: stop.stiffness_n_m,
            damping: stop.damping_n_s_m,
            damping_depth: stop.damping_depth_m,
        };
        circuit.end_stops(axis, stop, cylinder.stroke_m);
        if let Some(spring) = &spec.load.spring {
            circuit.spring(axis, spring.stiffness_n_m, spring.rest_position_m);
        }
        let Valve::Proportional53(valve) = &spec.valve;
        let edge_law = Iso6358::for_gas(
            valve.conductance_m3_s_pa,
            valve.critical_pressure_ratio,
            valve.subsonic_index,
            valve.linear_above,
            valve.subsonic_index == 0.5,
            &gas,
            gas.is_air(),
        );
        let mut edge = |from, to| circuit.restriction(edge_law.clone(), from, to);
        let edges = [edge(supply, a), edge(a, exhaust), edge(supply, b), edge(b, exhaust)];
        let mut columns: Vec<String> = COLUMNS.iter().map(ToString::to_string).collect();
        columns.extend(inner.iter().map(|state| state.name.to_string()));
        Ok(Drive { circuit: circuit.build(ledger), axis, a, b, edges, columns, warnings, citations })
    }

    /// Names of the columns of a run.
    pub fn columns(&self) -> &[String] {
        &self.columns
    }

    /// Number of states.
    pub fn n_states(&self) -> usize {
        self.circuit.n_states()
    }

    /// What the user should know about this description.
    pub fn warnings(&self) -> &[String] {
        &self.warnings
    }

    /// Keys in references.bib of the laws and methods that this drive uses.
    pub fn citations(&self) -> &[&'static str] {
        &self.citations
    }

    /// The drive's equations, and their state at `initial` with the command `u`.
    pub fn start(&self, initial: &Initial, u: f64) -> (Circuit<f64>, Vec<f64>) {
        let mut circuit = self.circuit.clone();
        self.set_command(&mut circuit, 0, u);
        let y = circuit.initial_aged(
            &[
                (self.a, initial.pressure_a_pa, initial.temperature_a_k),
                (self.b, initial.pressure_b_pa, initial.temperature_b_k),
            ],
            &[(self.axis, initial.position_m, initial.velocity_m_s)],
            &[(self.axis, initial.contact_age_s)],
        );
        (circuit, y)
    }

    /// Opens the valve of one lane: u > 0 supply to a and b to exhaust with the share u, u < 0 the mirror.
    pub fn set_command<R: math::Lane>(&self, circuit: &mut Circuit<R>, lane: usize, u: f64) {
        let (extend, retract) = (u.max(0.0), (-u).max(0.0));
        for (edge, opening) in self.edges.iter().zip([extend, retract, retract, extend]) {
            circuit.set_opening(*edge, lane, opening);
        }
    }

    /// Opens each edge of the valve by itself: supply to a, a to exhaust, supply to b, b to exhaust.
    pub(super) fn set_openings(&self, circuit: &mut Circuit<f64>, openings: [f64; 4]) {
        for (edge, opening) in self.edges.iter().zip(openings) {
            circuit.set_opening(*edge, 0, opening);
        }
    }

    pub(super) fn circuit(&self) -> &Circuit<f64> {
        &self.circuit
    }

    pub(super) fn axis_id(&self) -> AxisId {
        self.axis
    }

    pub(super) fn chamber_ids(&self) -> [GasId; 2] {
        [self.a, self.b]
    }

    /// Simulates a command that is constant from each of `times` to the next (the first at 0).
    pub fn simulate(
        &self,
        times: &[f64],
        commands: &[f64],
        sampling: (f64, f64),
        initial: &Initial,
        options: Options,
        interrupted: &mut dyn FnMut() -> bool,
    ) -> Result<Run, Error> {
        let (duration, rate) = sampling;
        let (circuit, y) = self.start(initial, commands[0]);
        let command = std::cell::Cell::new(commands[0]);
        let mut recorder =
            Recorder::new(&circuit, sample_times(duration, rate), self.columns.len(), |c, t, y, net, row| {
                self.row(c, t, command.get(), y, net, row);
            });
        let mut stepper = Stepper::new(circuit, 0.0, &y, options);
        let plan = (times, commands, duration);
        self.follow(plan, &mut stepper, &mut recorder, |u| command.set(u), interrupted)?;
        recorder.finish(stepper.system(), stepper.state());
        let balance = recorder.balance(stepper.system());
        Ok(Run { columns: recorder.columns, statistics: stepper.statistics(0), balance })
    }

    /// The same run, but only its states as they are integrated: one row of x, v, m_a, U_a, m_b, U_b and
    /// inner states for each sample.
    pub fn states(
        &self,
        times: &[f64],
        commands: &[f64],
        sampling: (f64, f64),
        initial: &Initial,
        options: Options,
        interrupted: &mut dyn FnMut() -> bool,
    ) -> Result<Vec<f64>, Error> {
        let (circuit, y) = self.start(initial, commands[0]);
        let mut recorder = States::new(sample_times(sampling.0, sampling.1), y.len());
        let mut stepper = Stepper::new(circuit, 0.0, &y, options);
        let plan = (times, commands, sampling.0);
        self.follow(plan, &mut stepper, &mut recorder, |_| {}, interrupted)?;
        Ok(recorder.finish(stepper.state()))
    }

    /// Advances through the segments of a plan (times, commands, duration), the stepper starting with
    /// the first command.
    pub(super) fn follow(
        &self,
        (times, commands, duration): (&[f64], &[f64], f64),
        stepper: &mut Stepper<f64, Circuit<f64>>,
        output: &mut impl Output<f64, Circuit<f64>>,
        note: impl Fn(f64),
        interrupted: &mut dyn FnMut() -> bool,
    ) -> Result<(), Error> {
        for (i, &u) in commands.iter().enumerate() {
            if times[i] >= duration {
                break;
            }
            note(u);
            if i > 0 {
                self.set_command(stepper.system_mut(), 0, u);
            }
            let until = times.get(i + 1).map_or(duration, |&t| t.min(duration));
            advance(stepper, until, output, interrupted)?;
        }
        Ok(())
    }

    /// (p_a, T_a, p_b, T_b) at each of the states, one after the other.
    pub fn chambers(&self, states: impl Iterator<Item = Vec<f64>>) -> Vec<f64> {
        let mut net = self.circuit.work::<f64>();
        let mut gas = Vec::new();
        for y in states {
            self.circuit.observe(&y, &mut net);
            gas.extend([self.a, self.b].iter().flat_map(|&id| [net[id].p, net[id].t]));
        }
        gas
    }

    /// A sampled servo loop: every 1/rate seconds the command is computed from position and velocity
    /// and held. Returns the states at the samples, rows as of [`Drive::states`], the commands, the work.
    pub fn servo(
        &self,
        servo: &Servo,
        sampling: (f64, f64),
        initial: &Initial,
        options: Options,
        interrupted: &mut dyn FnMut() -> bool,
    ) -> Result<(Vec<f64>, Vec<f64>, Statistics), Error> {
        let times = sample_times(sampling.0, sampling.1);
        let (circuit, y) = self.start(initial, 0.0);
        let mut recorder = States::new(times.clone(), y.len());
        let mut commands = Vec::with_capacity(times.len());
        let mut stepper = Stepper::new(circuit, 0.0, &y, options);
        for pair in times.windows(2) {
            let u = servo.command(pair[0], stepper.state()[0], stepper.state()[1]);
            commands.push(u);
            self.set_command(stepper.system_mut(), 0, u);
            advance(&mut stepper, pair[1], &mut recorder, interrupted)?;
        }
        commands.extend(commands.last().copied());
        Ok((recorder.finish(stepper.state()), commands, stepper.statistics(0)))
    }

    pub(super) fn row(
        &self,
        circuit: &Circuit<f64>,
        t: f64,
        u: f64,
        y: &[f64],
        net: &mut Net<f64>,
        row: &mut [f64],
    ) {
        circuit.observe(y, net);
        let (axis, a, b) = (&net.axis[self.axis.0], &net.gas[self.a.0], &net.gas[self.b.0]);
        let values = [
            t,
            axis.x,
            axis.v,
            axis.a,
            a.p,
            a.t,
            b.p,
            b.t,
            axis.friction,
            -axis.end_stop,
            u,
            a.m_dot,
            b.m_dot,
        ];
        row[..values.len()].copy_from_slice(&values);
        row[values.len()..].copy_from_slice(circuit.inner_states(self.axis, y));
    }
}

/// Columns of a trajectory, before the inner states.
const COLUMNS: [&str; 13] = [
    "time_s",
    "position_m",
    "velocity_m_s",
    "acceleration_m_s2",
    "pressure_a_pa",
    "temperature_a_k",
    "pressure_b_pa",
    "temperature_b_k",
    "friction_force_n",
    "end_stop_force_n",
    "command",
    "mass_flow_a_kg_s",
    "mass_flow_b_kg_s",
];

/// Proportional-derivative position control of a sine, u clipped to [-1, 1].
#[derive(Clone, Copy, Debug)]
pub struct Servo {
    /// Gains, 1/m and s/m.
    pub kp: f64,
    pub kd: f64,
    /// Middle, amplitude, m, and frequency, Hz, of the reference.
    pub middle: f64,
    pub amplitude: f64,
    pub frequency: f64,
}

impl Servo {
    fn command(&self, t: f64, x: f64, v: f64) -> f64 {
        let omega = 2.0 * PI * self.frequency;
        let reference = self.middle + self.amplitude * math::elementary::sin(omega * t);
        let rate = self.amplitude * omega * math::elementary::cos(omega * t);
        (self.kp * (reference - x) + self.kd * (rate - v)).clamp(-1.0, 1.0)
    }
}
