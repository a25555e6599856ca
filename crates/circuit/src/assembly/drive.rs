use super::end_stop::{Ends, ends, impact_warning, stop_warning, through_warning};
use super::friction::{contact, friction_law};
use super::leak::leak;
use crate::circuit::{AxisId, Circuit, GasId, PistonSide};
use crate::impacts::Impact;
use crate::lifted::Lifted;
use crate::net::Net;
use crate::part::{ChamberLaw, Given, InputId};
use crate::run::{Error, Look, Recorder, Run, States, advance, sample_times};
use crate::specification::{self, ChamberLawName, CylinderKind, Initial, Valve};
use math::{Deps, Lane, Over, Real};
use ode::{Options, Output, Statistics, Stepper, System};
use physics::IdealGas;
use physics::flow::Iso6358;
use physics::friction::Contact;
use physics::mechanics::EndStop;
use std::f64::consts::PI;

/// A double-acting cylinder on a 5/3 proportional valve.
#[derive(Clone, Debug)]
pub struct Drive<P = f64> {
    circuit: Circuit<P>,
    axis: AxisId,
    a: GasId,
    b: GasId,
    /// Edges of the valve: supply to a, a to exhaust, supply to b, b to exhaust.
    edges: [InputId; 4],
    supply: GasId,
    ends: Ends<P>,
    /// The larger area of the piston, m2, and the stroke, m.
    area: P,
    stroke: P,
    columns: Vec<String>,
    warnings: Vec<String>,
    citations: Vec<&'static str>,
}

/// Area and walls of a chamber with a rod of diameter `rod` (0: none). Heat passes the barrel, both
/// end faces and the rod's surface; the dead volume has no surface of its own.
fn side<P: Real>(bore: P, rod: P) -> PistonSide<P> {
    let area = P::c(0.25 * PI) * (bore * bore - rod * rod);
    PistonSide { area, perimeter: P::c(PI) * (bore + rod), end_wall: P::c(2.0) * area }
}

impl Drive {
    /// Assembles the drive; with `ledger`, its accounts are integrated along.
    pub fn assemble(spec: &specification::Drive, ledger: bool) -> Result<Self, Error> {
        let printed = spec.cylinder.chamber_law == ChamberLawName::AsPrinted;
        if ledger && printed {
            return Err(Error::Specification(
                "chamber law \"as-printed\" has no ledger: it does not conserve energy".into(),
            ));
        }
        if spec.cylinder.leakage_m3_s_pa < 0.0 {
            return Err(Error::Specification(format!(
                "cylinder.leakage = {} m3/(s Pa) must not be negative",
                spec.cylinder.leakage_m3_s_pa
            )));
        }
        let lifted = Lifted::plain(spec);
        let mut drive = Drive::lifted(&lifted, ledger)?;
        let friction = friction_law(&spec.friction)?;
        let gauge = spec.supply.pressure_pa - spec.ambient.pressure_pa;
        drive.warnings = friction.warnings(gauge, spec.cylinder.stroke_m);
        let areas = sides::<f64>(&lifted).map(|side| side.area);
        drive.warnings.extend(stop_warning(&drive.ends.stop, &spec.cylinder, areas, gauge));
        drive.citations = friction.sources();
        drive.citations.extend(["iso6358-2013", "bejan2016", "steinebach2023", "hairer1996"]);
        if printed {
            drive.warnings.push(
                "chamber law \"as-printed\" breaks the energy balance; it is for reproducing the paper only"
                    .into(),
            );
            drive.citations.push("bracha");
        }
        if spec.cylinder.incline_rad != 0.0 {
            drive.citations.push("bipm2019");
        }
        Ok(drive)
    }
}

/// How far a command opens each edge of the valve.
pub(super) fn openings<R: Real>(u: R) -> [R; 4] {
    let (extend, retract) = (u.max(R::zero()), (-u).max(R::zero()));
    [extend, retract, retract, extend]
}

/// Both sides of the piston.
fn sides<P: Lane>(lifted: &Lifted<specification::Drive>) -> [PistonSide<P>; 2] {
    let bore: P = lifted.number(|s| s.cylinder.bore_m);
    let rod = |has_rod: bool| {
        if has_rod { lifted.number(|s| s.cylinder.rod_diameter_m) } else { P::zero() }
    };
    let kind = lifted.value.cylinder.kind;
    let mut sides =
        [side(bore, rod(kind == CylinderKind::ThroughRod)), side(bore, rod(kind != CylinderKind::Rodless))];
    if lifted.value.cylinder.chamber_law == ChamberLawName::AsPrinted {
        // pi (D x + 0.25 D^3) as printed, in metres: the second term is no area at all.
        for side in &mut sides {
            (side.perimeter, side.end_wall) = (P::c(PI) * bore, P::c(0.25 * PI) * (bore * bore * bore));
        }
    }
    sides
}

/// The law of the valve's edges.
fn edge_law<P: Lane>(lifted: &Lifted<specification::Drive>, gas: &IdealGas<P>) -> Iso6358<P> {
    fn valve(spec: &specification::Drive) -> &specification::ProportionalValve {
        let Valve::Proportional53(valve) = &spec.valve;
        valve
    }
    let index = |spec: &specification::Drive| valve(spec).subsonic_index;
    Iso6358::for_gas(
        lifted.number(|s| valve(s).conductance_m3_s_pa),
        lifted.number(|s| valve(s).critical_pressure_ratio),
        lifted.number(index),
        lifted.number(|s| valve(s).linear_above),
        index(lifted.value) == 0.5 && !lifted.is_free(index),
        gas,
        is_air(lifted.value),
    )
}

fn is_air(spec: &specification::Drive) -> bool {
    IdealGas::new(spec.gas.heat_capacity_ratio, spec.gas.gas_constant_j_kg_k).is_air()
}

impl<P: Lane> Drive<P>
where
    Deps: Over<P>,
{
    /// The equations, from numbers with or without derivatives.
    pub(crate) fn lifted(lifted: &Lifted<specification::Drive>, ledger: bool) -> Result<Self, Error> {
        let number = |f: fn(&specification::Drive) -> f64| -> P { lifted.number(f) };
        let gas = IdealGas::new(number(|s| s.gas.heat_capacity_ratio), number(|s| s.gas.gas_constant_j_kg_k));
        let friction: Contact<P> = contact(&lifted.table(|spec| &spec.friction))?;
        let mut columns: Vec<String> = COLUMNS.iter().map(ToString::to_string).collect();
        columns.extend(friction.states().iter().map(|state| state.name.to_string()));

        let ambient = [number(|s| s.ambient.pressure_pa), number(|s| s.ambient.temperature_k)];
        let mut circuit = Circuit::new(&gas, ambient[0], ambient[1]);
        let supply = circuit.reservoir(number(|s| s.supply.pressure_pa), number(|s| s.supply.temperature_k));
        let exhaust = circuit.reservoir(ambient[0], ambient[1]);
        let chamber_law = match lifted.value.cylinder.chamber_law {
            ChamberLawName::EnergyBalance => ChamberLaw::EnergyBalance,
            ChamberLawName::AsPrinted => ChamberLaw::AsPrinted,
        };
        let heat_transfer = number(|s| s.cylinder.heat_transfer_w_m2_k);
        let wall = number(|s| s.cylinder.wall_temperature_k);
        let mut chamber =
            |dead_volume: P| circuit.volume(chamber_law, dead_volume, P::zero(), heat_transfer, wall);
        let (a, b) = (
            chamber(number(|s| s.cylinder.dead_volume_a_m3)),
            chamber(number(|s| s.cylinder.dead_volume_b_m3)),
        );
        let mass = number(|s| s.cylinder.moving_mass_kg) + number(|s| s.load.mass_kg);
        let (incline, force) = (number(|s| s.cylinder.incline_rad), number(|s| s.load.force_n));
        let axis = circuit.axis(mass, incline, force, Some(friction));
        let stroke = number(|s| s.cylinder.stroke_m);
        let [side_a, side_b] = sides(lifted);
        circuit.face(a, axis, true, stroke, side_a);
        circuit.face(b, axis, false, stroke, side_b);
        let ends = ends(lifted, &[side_a, side_b]);
        let area = side_a.area.max(side_b.area);
        circuit.end_stops(axis, ends.stop.clone(), stroke);
        if let Some(covers) = &ends.covers {
            circuit.covers(axis, covers.clone());
        }
        if let Some(spring) = lifted.optional(|spec| spec.load.spring.as_ref()) {
            circuit.spring(axis, spring.number(|s| s.stiffness_n_m), spring.number(|s| s.rest_position_m));
        }
        let law = edge_law(lifted, &gas);
        let mut edge = |from, to| circuit.restriction(law.clone(), from, to);
        let edges = [edge(supply, a), edge(a, exhaust), edge(supply, b), edge(b, exhaust)];
        let leakage = |s: &specification::Drive| s.cylinder.leakage_m3_s_pa;
        let leaks = leakage(lifted.value) != 0.0 || lifted.is_free(leakage);
        let gap = leaks
            .then(|| circuit.restriction(leak(lifted.number(leakage), &gas, is_air(lifted.value)), a, b));
        let mut circuit = circuit.build(ledger);
        if let Some(gap) = gap {
            circuit.set_input(gap, 0, P::one());
        }
        let (warnings, citations) = (Vec::new(), Vec::new());
        Ok(Drive { circuit, axis, a, b, edges, supply, ends, area, stroke, columns, warnings, citations })
    }
}

impl<P: Lane> Drive<P> {
    /// Names of the columns of a run.
    pub fn columns(&self) -> &[String] {
        &self.columns
    }

    /// The axis of the piston.
    pub fn axis(&self) -> AxisId {
        self.axis
    }

    /// Number of states.
    pub fn n_states(&self) -> usize {
        self.circuit.n_states()
    }

    /// Opens the valve of one lane: u > 0 supply to a and b to exhaust with the share u, u < 0 the mirror.
    pub fn set_command<R: Lane>(&self, circuit: &mut Circuit<R>, lane: usize, u: R) {
        for (edge, opening) in self.edges.iter().zip(openings(u)) {
            circuit.set_input(*edge, lane, opening);
        }
    }

    /// One row of the columns.
    pub(crate) fn row<R: Lane>(
        &self,
        circuit: &Circuit<R>,
        (t, u): (f64, f64),
        y: &[R],
        net: &mut Net<R>,
        row: &mut [R],
    ) {
        circuit.observe(y, net);
        let (axis, a, b) = (&net.axis[self.axis.0], &net.gas[self.a.0], &net.gas[self.b.0]);
        let values = [
            R::c(t),
            axis.x,
            axis.v,
            axis.a,
            a.p,
            a.t,
            b.p,
            b.t,
            axis.friction,
            -axis.end_stop,
            R::c(u),
            a.m_dot,
            b.m_dot,
        ];
        row[..values.len()].copy_from_slice(&values);
        row[values.len()..].copy_from_slice(circuit.inner_states(self.axis, y));
    }

    /// The state as [`Drive::begin`] takes it.
    pub(crate) fn outside(&self, circuit: &Circuit<P>, y: &[P], net: &mut Net<P>) -> Vec<P> {
        circuit.observe(y, net);
        let (axis, a, b) = (&net[self.axis], &net[self.a], &net[self.b]);
        let mut state = vec![axis.x, axis.v, a.p, a.t, b.p, b.t];
        state.extend_from_slice(circuit.inner_states(self.axis, y));
        state
    }

    /// The start of a run with the command `u`: equations and state from position m, velocity m/s, pressure
    /// Pa and temperature K in a and b, then the inner states of friction.
    pub(crate) fn begin(&self, start: &[P], u: f64) -> (Circuit<P>, Vec<P>) {
        let mut circuit = self.circuit.clone();
        self.set_command(&mut circuit, 0, P::c(u));
        let y = circuit.begin(&Given {
            gas: &[(self.a, start[2], start[3]), (self.b, start[4], start[5])],
            axes: &[(self.axis, start[0], start[1])],
            ages: &[],
            inner: &[(self.axis, &start[CHAMBER_STATES..])],
        });
        (circuit, y)
    }
}

impl Drive {
    /// The end stops, as given or as they follow from the drive.
    pub fn end_stop(&self) -> &EndStop<f64> {
        &self.ends.stop
    }

    /// What the user should know about this description.
    pub fn warnings(&self) -> &[String] {
        &self.warnings
    }

    /// What to say of impacts that press a stop through, or are too hard for a cylinder of this size.
    pub fn impact_warnings(&self, impacts: &[Impact]) -> impl Iterator<Item = String> {
        through_warning(&self.ends, impacts).into_iter().chain(impact_warning(self.area, impacts))
    }

    /// Keys in references.bib of the laws and methods that this drive uses.
    pub fn citations(&self) -> &[&'static str] {
        &self.citations
    }

    /// The drive's equations, and their state at `initial` with the command `u`.
    pub fn start(&self, initial: &Initial, u: f64) -> (Circuit<f64>, Vec<f64>) {
        let mut circuit = self.circuit.clone();
        self.set_command(&mut circuit, 0, u);
        let y = circuit.begin(&Given {
            gas: &[
                (self.a, initial.pressure_a_pa, initial.temperature_a_k),
                (self.b, initial.pressure_b_pa, initial.temperature_b_k),
            ],
            axes: &[(self.axis, initial.position_m, initial.velocity_m_s)],
            ages: &[(self.axis, initial.contact_age_s)],
            inner: &[],
        });
        (circuit, y)
    }

    /// The inputs of each edge of the valve, of the external force, of the supply's pressure and temperature.
    pub(super) fn inputs(&self) -> [InputId; 7] {
        let [a, b, c, d] = self.edges;
        let [pressure, temperature] = self.circuit.boundary(self.supply);
        [a, b, c, d, self.circuit.external_force(self.axis), pressure, temperature]
    }

    /// Opens each edge of the valve by itself: supply to a, a to exhaust, supply to b, b to exhaust.
    pub(super) fn set_openings(&self, circuit: &mut Circuit<f64>, openings: [f64; 4]) {
        for (edge, opening) in self.edges.iter().zip(openings) {
            circuit.set_input(*edge, 0, opening);
        }
    }

    pub(super) fn stroke(&self) -> f64 {
        self.stroke
    }

    pub(super) fn circuit(&self) -> &Circuit<f64> {
        &self.circuit
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
        interrupted: &mut dyn FnMut(f64) -> bool,
    ) -> Result<Run, Error> {
        let (duration, rate) = sampling;
        let (circuit, y) = self.start(initial, commands[0]);
        let command = std::cell::Cell::new(commands[0]);
        let mut recorder =
            Recorder::new(&circuit, sample_times(duration, rate), self.columns.len(), |c, t, y, net, row| {
                self.row(c, (t, command.get()), y, net, row);
            });
        let mut stepper = Stepper::new(circuit, 0.0, &y, options);
        let plan = (times, commands, duration);
        self.follow(plan, &mut stepper, &mut recorder, |u| command.set(u), &mut Look::new(interrupted))?;
        recorder.finish(stepper.system(), stepper.state());
        let balance = recorder.balance(stepper.system());
        let impacts = recorder.take_impacts();
        Ok(Run { columns: recorder.columns, statistics: stepper.statistics(0), balance, impacts })
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
        interrupted: &mut dyn FnMut(f64) -> bool,
    ) -> Result<Vec<f64>, Error> {
        let (circuit, y) = self.start(initial, commands[0]);
        let mut recorder = States::new(sample_times(sampling.0, sampling.1), y.len());
        let mut stepper = Stepper::new(circuit, 0.0, &y, options);
        let plan = (times, commands, sampling.0);
        self.follow(plan, &mut stepper, &mut recorder, |_| {}, &mut Look::new(interrupted))?;
        Ok(recorder.finish(stepper.system(), stepper.state()))
    }

    /// Advances through the segments of a plan (times, commands, duration), the stepper starting with
    /// the first command.
    pub(super) fn follow(
        &self,
        (times, commands, duration): (&[f64], &[f64], f64),
        stepper: &mut Stepper<f64, Circuit<f64>>,
        output: &mut impl Output<f64, Circuit<f64>>,
        note: impl Fn(f64),
        look: &mut Look<'_>,
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
            advance(stepper, until, output, look)?;
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
        interrupted: &mut dyn FnMut(f64) -> bool,
    ) -> Result<(Vec<f64>, Vec<f64>, Statistics), Error> {
        let times = sample_times(sampling.0, sampling.1);
        let (circuit, y) = self.start(initial, 0.0);
        let mut recorder = States::new(times.clone(), y.len());
        let mut commands = Vec::with_capacity(times.len());
        let mut stepper = Stepper::new(circuit, 0.0, &y, options);
        let mut look = Look::new(interrupted);
        for pair in times.windows(2) {
            let u = servo.command(pair[0], stepper.state()[0], stepper.state()[1]);
            commands.push(u);
            self.set_command(stepper.system_mut(), 0, u);
            advance(&mut stepper, pair[1], &mut recorder, &mut look)?;
        }
        commands.extend(commands.last().copied());
        Ok((recorder.finish(stepper.system(), stepper.state()), commands, stepper.statistics(0)))
    }
}

/// States of a start before those of friction.
pub(crate) const CHAMBER_STATES: usize = 6;

/// Columns of a trajectory, before the inner states.
pub(crate) const COLUMNS: [&str; 13] = [
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
