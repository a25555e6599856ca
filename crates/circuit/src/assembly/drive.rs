use super::driven::{COMMAND, Driven, later};
use super::friction::{contact, friction_law};
use super::gas;
use super::own_law::COLUMNS;
use super::session::Session;
use super::wiring::{self, Joint, Joints, wire};
use crate::assembly::recorder::{Recorder, Run, sample_times};
use crate::assembly::variables::{Assembly, Settable, Variables};
use crate::assembly::warnings::{impact_warning, stop_warning, through_warning};
use crate::circuit::{Circuit, Impact, Look};
use crate::component::mechanics::end_stop::Taken;
use crate::component::{Acts, Instance, Node, Piston, Quantity, Starting};
use crate::ground::{AxisId, Error, GasId, Given, Lifted};
use crate::specification::{self, ChamberLawName, CylinderKind, Initial, Valve};
use math::{Deps, Lane, Over};
use ode::Options;
use physics::mechanics::EndStop;

/// A double-acting cylinder on a 5/3 proportional valve.
#[derive(Clone, Debug)]
pub struct Drive {
    wired: Wired<f64>,
    /// The stroke, m.
    stroke: f64,
    warnings: Vec<String>,
    citations: Vec<&'static str>,
}

/// The equations of a drive with its names, for numbers with or without derivatives.
#[derive(Clone, Debug)]
pub(super) struct Wired<P> {
    pub assembly: Assembly<P>,
    a: GasId,
    b: GasId,
    piston: Piston<P>,
}

impl Drive {
    /// Assembles the drive. With `ledger`, its balances are integrated as well.
    pub fn assemble(spec: &specification::Drive, ledger: bool) -> Result<Self, Error> {
        let printed = spec.cylinder.chamber_law == ChamberLawName::AsPrinted;
        if ledger && printed {
            return Err(Error::Specification(
                "chamber law \"as-printed\" has no ledger: it does not conserve energy".into(),
            ));
        }
        if printed && spec.gas.virial.is_some() {
            return Err(Error::Specification("chamber law \"as-printed\" needs an ideal gas".into()));
        }
        if spec.cylinder.leakage_m3_s_pa < 0.0 {
            return Err(Error::Specification(format!(
                "cylinder.leakage = {} m3/(s Pa) must not be negative",
                spec.cylinder.leakage_m3_s_pa
            )));
        }
        let wired = Wired::lifted(&Lifted::plain(spec), ledger, None)?;
        let friction = friction_law(&spec.friction)?;
        let gauge = spec.supply.pressure_pa - spec.ambient.pressure_pa;
        let mut warnings = friction.warnings(gauge, spec.cylinder.stroke_m);
        let dead_volumes = [spec.cylinder.dead_volume_a_m3, spec.cylinder.dead_volume_b_m3];
        let named = ["cylinder.end_stop.stiffness", "cylinder.dead_volume."];
        warnings.extend(stop_warning(
            wired.piston.ends.stop.stiffness,
            dead_volumes,
            wired.piston.areas,
            gauge,
            named,
        ));
        let gas = gas::gas(&Lifted::plain(&spec.gas));
        warnings.extend(gas::virial_warning(&gas, spec.supply.pressure_pa, spec.supply.temperature_k));
        let mut citations = friction.sources();
        citations.extend(["iso6358-2013", "bejan2016", "steinebach2023", "hairer1996"]);
        if printed {
            warnings.push(
                "chamber law \"as-printed\" violates the energy balance; use it only to reproduce the paper"
                    .into(),
            );
            citations.push("bracha");
        }
        citations.extend(spec.gas.virial.map(|_| gas::VIRIAL_SOURCE));
        if spec.cylinder.incline_rad != 0.0 {
            citations.push("bipm2019");
        }
        Ok(Drive { wired, stroke: spec.cylinder.stroke_m, warnings, citations })
    }
}

type Spec = specification::Drive;

fn valve(spec: &Spec) -> &specification::ProportionalValve {
    let Valve::Proportional53(valve) = &spec.valve;
    valve
}

/// Index of the cylinder among the components of a drive.
pub(super) const CYLINDER: usize = 2;

/// A drive as components and joints.
pub(super) fn components<P: Lane>(lifted: &Lifted<Spec>) -> Result<(Vec<Instance<P>>, Joints), Error> {
    let number = |f: fn(&Spec) -> f64| Some((lifted.number(f), lifted.is_free(f)));
    let stop = |f: fn(&specification::EndStop) -> Option<f64>| {
        f(&lifted.value.cylinder.end_stop)?;
        Some((lifted.number_or(0.0, |s| f(&s.cylinder.end_stop)), false))
    };
    let supply = Instance::new("supply", "reservoir", |key| match key {
        "pressure" => number(|s| s.supply.pressure_pa),
        "temperature" => number(|s| s.supply.temperature_k),
        _ => None,
    });
    let valve = Instance::new("valve", "valve/proportional-5/3", |key| match key {
        "conductance" => number(|s| valve(s).conductance_m3_s_pa),
        "critical_pressure_ratio" => number(|s| valve(s).critical_pressure_ratio),
        "subsonic_index" => number(|s| valve(s).subsonic_index),
        "linear_above" => number(|s| valve(s).linear_above),
        _ => None,
    });
    let kind = match lifted.value.cylinder.kind {
        CylinderKind::Rodless => "cylinder/rodless",
        CylinderKind::ThroughRod => "cylinder/through-rod",
        CylinderKind::SingleRod => "cylinder/single-rod",
    };
    let mut cylinder = Instance::new("cylinder", kind, |key| match key {
        "bore" => number(|s| s.cylinder.bore_m),
        "rod_diameter" => number(|s| s.cylinder.rod_diameter_m),
        "stroke" => number(|s| s.cylinder.stroke_m),
        "dead_volume_a" => number(|s| s.cylinder.dead_volume_a_m3),
        "dead_volume_b" => number(|s| s.cylinder.dead_volume_b_m3),
        "moving_mass" => number(|s| s.cylinder.moving_mass_kg),
        "incline" => number(|s| s.cylinder.incline_rad),
        "heat_transfer" => number(|s| s.cylinder.heat_transfer_w_m2_k),
        "wall_temperature" => number(|s| s.cylinder.wall_temperature_k),
        "leakage" => number(|s| s.cylinder.leakage_m3_s_pa),
        "end_stop_stiffness" => stop(|s| s.stiffness_n_m),
        "end_stop_damping" => stop(|s| s.damping_n_s_m),
        "end_stop_damping_depth" => stop(|s| s.damping_depth_m),
        _ => None,
    });
    cylinder.choices[0] = usize::from(lifted.value.cylinder.chamber_law == ChamberLawName::AsPrinted);
    cylinder.friction = Some(contact(&lifted.table(|spec| &spec.friction))?);
    let load = Instance::new("load", "load", |key| match key {
        "mass" => number(|s| s.load.mass_kg),
        "force" => number(|s| s.load.force_n),
        _ => None,
    });
    let spring = lifted.optional(|spec| spec.load.spring.as_ref()).map(|spring| {
        Instance::new("spring", "spring", |key| match key {
            "stiffness" => Some((spring.number(|s| s.stiffness_n_m), false)),
            "rest_position" => Some((spring.number(|s| s.rest_position_m), false)),
            _ => None,
        })
    });
    let mut rod = vec![(CYLINDER, 2), (3, 0)];
    rod.extend(spring.is_some().then_some((4, 0)));
    let ends = [vec![(0, 0), (1, 0)], vec![(1, 1), (CYLINDER, 0)], vec![(1, 2), (CYLINDER, 1)], rod];
    let mut joints: Vec<Joint> = ends.map(|ports| Joint { ports, ambient: false }).into();
    joints.push(Joint { ports: vec![(1, 3), (1, 4)], ambient: true });
    Ok(([supply, valve, cylinder, load].into_iter().chain(spring).collect(), joints.into()))
}

impl<P: Lane> Wired<P>
where
    Deps: Over<P>,
{
    /// Returns the circuit of a drive under its own names.
    /// If a drive with the same parts is given, the analysis is not repeated.
    pub fn lifted(lifted: &Lifted<Spec>, ledger: bool, like: Option<&Circuit<f64>>) -> Result<Self, Error> {
        let number = |f: fn(&Spec) -> f64| -> P { lifted.number(f) };
        let gas = gas::gas(&lifted.table(|spec| &spec.gas));
        let is_air = gas::gas::<f64>(&Lifted::plain(&lifted.value.gas)).is_air();
        let ambient = [number(|s| s.ambient.pressure_pa), number(|s| s.ambient.temperature_k)];
        let (each, joints) = components(lifted)?;
        let wiring::Wired { mut circuit, nodes, mut pistons, inputs, is_like, .. } =
            wire(&gas, is_air, ambient, (&each, &joints), ledger, like)?;
        if !is_like {
            circuit.call_states(short);
        }
        let command = inputs.iter().find_map(|(_, _, acts)| match acts {
            Acts::Command(edges) => Some(*edges),
            _ => None,
        });
        let (&[Node::Gas(a), Node::Gas(b), Node::Axis(axis)], &[Node::Gas(supply)], Some(edges)) =
            (&nodes[CYLINDER][..], &nodes[0][..], command)
        else {
            unreachable!("a drive has a supply, a valve and a cylinder")
        };
        let inner: Vec<String> = (each[CYLINDER].friction.iter())
            .flat_map(|friction| friction.states())
            .map(|state| state.name.to_string())
            .collect();
        let piston = pistons.remove(0);
        let [pressure, temperature] = circuit.boundary(supply);
        let input = |id, name, meaning| Settable::of(&circuit, id, name, meaning);
        let [to_a, from_a, to_b, from_b] = edges;
        let mut variables = Variables {
            inputs: vec![
                Settable::command(edges),
                input(to_a, "opening_supply_a", "opening of the edge from supply to chamber a"),
                input(from_a, "opening_a_exhaust", "opening of the edge from chamber a to exhaust"),
                input(to_b, "opening_supply_b", "opening of the edge from supply to chamber b"),
                input(from_b, "opening_b_exhaust", "opening of the edge from chamber b to exhaust"),
                input(circuit.external_force(axis), "load_force_n", "external force in +x"),
                input(pressure, "supply_pressure_pa", "absolute pressure of the supply"),
                input(temperature, "supply_temperature_k", "temperature of the supply"),
            ],
            starts: vec![
                (Starting::Axis(axis), ["position_m", "velocity_m_s"].map(Into::into).to_vec()),
                (Starting::Gas(a), ["pressure_a_pa", "temperature_a_k"].map(Into::into).to_vec()),
                (Starting::Gas(b), ["pressure_b_pa", "temperature_b_k"].map(Into::into).to_vec()),
                (Starting::Inner(axis), inner.clone()),
            ],
            ..Variables::default()
        };
        let quantities = [
            Quantity::Time,
            Quantity::Position(axis),
            Quantity::Velocity(axis),
            Quantity::Acceleration(axis),
            Quantity::Pressure(a),
            Quantity::Temperature(a),
            Quantity::Pressure(b),
            Quantity::Temperature(b),
            Quantity::Friction(axis),
            Quantity::EndStop(axis),
            Quantity::Command(edges),
            Quantity::MassFlow(a),
            Quantity::MassFlow(b),
        ];
        variables.read(COLUMNS.into_iter().zip(quantities));
        variables.read(inner.into_iter().enumerate().map(|(i, name)| (name, Quantity::Inner(axis, i))));
        Ok(Wired { assembly: Assembly::new(circuit, variables), a, b, piston })
    }
}

/// Returns a drive's name for a state of its cylinder: "cylinder.a.mass_kg" becomes "mass_a_kg".
fn short(state: &str) -> String {
    let name = state.strip_prefix("cylinder.").unwrap_or(state);
    match name.split_once('.').and_then(|(chamber, of)| Some((chamber, of.rsplit_once('_')?))) {
        Some((chamber, (what, unit))) => format!("{what}_{chamber}_{unit}"),
        None => name.into(),
    }
}

impl Drive {
    /// Names of the columns of a run.
    pub fn columns(&self) -> &[String] {
        self.assembly().columns()
    }

    /// The circuit with its names.
    pub fn assembly(&self) -> &Assembly {
        &self.wired.assembly
    }

    /// The axis of the piston.
    pub fn axis(&self) -> AxisId {
        self.wired.piston.axis
    }

    /// Number of states.
    pub fn n_states(&self) -> usize {
        self.circuit().n_states()
    }

    /// Opens the valve of one lane. For u > 0, supply to a and b to exhaust are open by the fraction u. u < 0 is the
    /// mirror image.
    pub fn set_command<R: Lane>(&self, circuit: &mut Circuit<R>, lane: usize, u: R) {
        self.assembly().set(circuit, COMMAND, lane, u);
    }

    /// Returns the end stops, as described or derived from the drive, and the design load of derived stops.
    pub fn end_stop(&self) -> (&EndStop<f64>, &Taken<f64>) {
        let ends = &self.wired.piston.ends;
        (&ends.stop, &ends.taken)
    }

    /// Returns warnings about this description.
    pub fn warnings(&self) -> &[String] {
        &self.warnings
    }

    /// Returns warnings about impacts that compress a stop fully, or are too hard for a cylinder of this size.
    pub fn impact_warnings(&self, impacts: &[Impact]) -> impl Iterator<Item = String> {
        let Piston { ends, areas, .. } = &self.wired.piston;
        let through = through_warning(ends.enough, "cylinder.end_stop.stiffness", impacts);
        through.into_iter().chain(impact_warning(areas[0].max(areas[1]), impacts))
    }

    /// Returns the keys in references.bib of the laws and methods in use.
    pub fn citations(&self) -> &[&'static str] {
        &self.citations
    }

    /// Returns the drive's equations, and their state at `initial` with the command `u`.
    pub fn start(&self, initial: &Initial, u: f64) -> (Circuit<f64>, Vec<f64>) {
        let mut circuit = self.circuit().clone();
        self.set_command(&mut circuit, 0, u);
        let y = self.begin(&mut circuit, initial);
        (circuit, y)
    }

    /// Returns the state of the drive's equations at `initial`, and sets the modes that belong to this state.
    pub(super) fn begin(&self, circuit: &mut Circuit<f64>, initial: &Initial) -> Vec<f64> {
        let axis = self.axis();
        circuit.begin(&Given {
            gas: &[
                (self.wired.a, initial.pressure_a_pa, initial.temperature_a_k),
                (self.wired.b, initial.pressure_b_pa, initial.temperature_b_k),
            ],
            axes: &[(axis, initial.position_m, initial.velocity_m_s)],
            ages: &[(axis, initial.contact_age_s)],
            inner: &[],
            signals: &[],
        })
    }

    /// Returns a session of the drive at `initial`, with a closed valve and all other values as described.
    pub fn session(&self, initial: &Initial, options: Options) -> Session {
        Session::new(self.assembly(), 0.0, self.start(initial, 0.0), options)
    }

    pub(super) fn circuit(&self) -> &Circuit<f64> {
        &self.assembly().circuit
    }

    /// Indices of the piston and its chambers.
    pub fn driven(&self) -> Result<Driven<'_>, Error> {
        Driven::of(self.assembly(), self.stroke)
    }

    /// Returns a session at time zero under a plan. The command is constant from each of `times` to the next.
    pub fn planned(
        &self,
        (times, commands): (&[f64], &[f64]),
        duration: f64,
        initial: &Initial,
        options: Options,
    ) -> Session {
        let mut session = Session::new(self.assembly(), 0.0, self.start(initial, commands[0]), options);
        session.plan(COMMAND, later(times, commands, 0.0, duration));
        session
    }

    /// Simulates a command that is constant from each of `times` to the next (the first at 0).
    pub fn simulate(
        &self,
        times: &[f64],
        commands: &[f64],
        (duration, rate): (f64, f64),
        initial: &Initial,
        options: Options,
        interrupted: &mut dyn FnMut(f64) -> bool,
    ) -> Result<Run, Error> {
        let mut session = self.planned((times, commands), duration, initial, options);
        let mut recorder = Recorder::new(self.assembly(), sample_times(duration, rate));
        session.advance(duration, &mut recorder, &mut Look::new(interrupted))?;
        Ok(recorder.finish(&session))
    }
}
