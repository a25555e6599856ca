//! A circuit of components as a user describes it: named components, and the joints of their ports.

use super::driven::Driven;
use super::friction_law;
use super::gas::{VIRIAL_SOURCE, gas, virial_warning};
use super::instance::instance;
use super::joints::{AMBIENT, Joint, Joints, one_of};
use super::names::Names;
use super::session::Session;
use super::variables::Assembly;
use super::wiring::wire;
use crate::assembly::recorder::{Recorder, Run, sample_times};
use crate::assembly::warnings::{HAZARD, impact_warning, stop_warning, through_warning};
use crate::circuit::{Impact, Look};
use crate::component::mechanics::end_stop::Taken;
use crate::component::{Instance, Piston, PortId, PortKind};
use crate::ground::{AxisId, Error, Lifted, check_bounds, refuse};
use crate::specification;
use ode::Options;
use physics::above;
use physics::mechanics::EndStop;
use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

/// Source of the interpolation of points, cited if a component has points.
const OF_POINTS: &str = "fritsch1984";
/// A circuit of components.
#[derive(Clone, Debug)]
pub struct Network {
    /// The circuit with its names.
    pub assembly: Assembly,
    pistons: Vec<Piston<f64>>,
    /// Warnings about the description.
    pub warnings: Vec<String>,
    /// Keys in references.bib of the laws and methods in use.
    pub citations: Vec<&'static str>,
    /// Gas joints whose volume belongs to no component: the first port of each, and the volume of its ports, m3.
    pub joint_volumes: Vec<(String, f64)>,
    pub(super) joints: Joints,
    pub(super) each: Vec<Instance<f64>>,
    names: Arc<Names>,
}

/// Returns the joints with their ports. Unconnected ports come last.
fn joints(spec: &specification::Circuit, each: &[Instance<f64>]) -> Result<Joints, Error> {
    let find = |name: &str| -> Result<PortId, Error> {
        let component = (0..each.len())
            .find(|&i| name.strip_prefix(&each[i].name).is_some_and(|rest| rest.starts_with('.')));
        let Some(component) = component else {
            return refuse!("joint of \"{name}\": there is no such component");
        };
        let port = &name[each[component].name.len() + 1..];
        let ports = each[component].table.ports;
        match ports.iter().position(|own| own.name == port) {
            Some(port) => Ok((component, port)),
            None => refuse!(
                "joint of \"{name}\": a {} has no port \"{port}\"; it has {}",
                each[component].table.key,
                one_of(ports.iter().map(|own| own.name))
            ),
        }
    };
    let mut joined = Vec::new();
    let mut joints = Vec::new();
    for names in &spec.joints {
        let mut joint = Joint::default();
        for name in names {
            if name == AMBIENT {
                joint.ambient = true;
                continue;
            }
            let port = find(name)?;
            if joined.contains(&port) {
                return refuse!("port {name} occurs twice in the joints");
            }
            joined.push(port);
            joint.ports.push(port);
        }
        let kind = |&(component, port): &PortId| each[component].table.ports[port].kind;
        let is_axis = |port: &PortId| kind(port) == PortKind::Axis;
        let axes = joint.ports.iter().filter(|port| is_axis(port)).count();
        if axes > 0 && (joint.ambient || axes < joint.ports.len()) {
            return refuse!("the joint of {} joins gas to an axis", names.join(", "));
        }
        // A joint has the name of its first gas port.
        joint.ports.sort_by_key(|port| kind(port) == PortKind::Pilot);
        joints.push(joint);
    }
    for (component, own) in each.iter().enumerate() {
        for (place, port) in own.table.ports.iter().enumerate() {
            if joined.contains(&(component, place)) {
                continue;
            }
            if !port.exhaust && !port.optional {
                return refuse!("port {}.{} is not joined", own.name, port.name);
            }
            // An unconnected rod still moves.
            joints.push(Joint { ports: vec![(component, place)], ambient: port.exhaust });
        }
    }
    Ok(Joints { each: joints, junctions: spec.junctions })
}

/// Ambient pressure and temperature, Pa and K.
fn ambient(spec: &specification::GasState) -> Result<[f64; 2], Error> {
    let each = [("pressure", spec.pressure_pa, "Pa"), ("temperature", spec.temperature_k, "K")];
    for (name, value, unit) in each {
        check_bounds(&format!("ambient.{name}"), value, unit, &above(0.0))?;
    }
    Ok([spec.pressure_pa, spec.temperature_k])
}

/// Warnings about a description, and the sources of its laws.
struct Said<'a> {
    names: &'a Names,
    /// Highest gauge pressure, Pa.
    gauge: f64,
    warnings: Vec<String>,
    citations: Vec<&'static str>,
}

impl Said<'_> {
    /// Adds what there is to say about a component, which may have a piston.
    fn component(
        &mut self,
        own: &Instance<f64>,
        spec: &specification::Component,
        piston: Option<&Piston<f64>>,
    ) -> Result<(), Error> {
        let names = self.names;
        let sources = own.table.sources.iter().copied();
        self.citations.extend(sources.filter(|key| *key != OF_POINTS || spec.points.is_some()));
        if own.chosen("chamber_law") == Some("as-printed") {
            let text =
                "chamber law \"as-printed\" breaks the energy balance; it is for reproducing the paper only";
            self.warnings.push(names.said(&own.name, text));
            self.citations.push("bracha");
        }
        if spec.numbers.get("incline").is_some_and(|incline| *incline != 0.0) {
            self.citations.push("bipm2019");
        }
        let Some(friction) = &spec.friction else { return Ok(()) };
        let law = friction_law(friction)?;
        self.citations.extend(law.sources());
        let stroke = spec.numbers.get("stroke").copied().unwrap_or_default();
        let dead_volume = names.key(&own.name, "dead_volume_a");
        let mut warnings = law.warnings(self.gauge, stroke);
        warnings.extend(piston.and_then(|piston| {
            stop_warning(
                piston.ends.stop.stiffness,
                piston.dead_volumes,
                piston.areas,
                self.gauge,
                [&names.key(&own.name, "end_stop_stiffness"), dead_volume.trim_end_matches('a')],
            )
        }));
        self.warnings.extend(warnings.iter().map(|text| names.said(&own.name, text)));
        Ok(())
    }
}

impl Network {
    /// Assembles the circuit. With `ledger`, its balances are integrated as well.
    pub fn assemble(spec: &specification::Circuit, ledger: bool) -> Result<Self, Error> {
        Network::called(spec, ledger, Arc::default())
    }

    /// Returns the same circuit under short names.
    pub fn called(spec: &specification::Circuit, ledger: bool, names: Arc<Names>) -> Result<Self, Error> {
        let each = spec.components.iter().map(instance).collect::<Result<Vec<_>, _>>()?;
        for (i, own) in each.iter().enumerate() {
            if own.name == AMBIENT || each[..i].iter().any(|other| other.name == own.name) {
                return refuse!("the name {} is taken", own.name);
            }
        }
        let joints = joints(spec, &each)?;
        let gas = gas(&Lifted::plain(&spec.gas));
        let ambient = ambient(&spec.ambient)?;
        if let Some(own) = each.iter().find(|own| own.chosen("chamber_law") == Some("as-printed")) {
            if ledger {
                return refuse!("{}: chamber law \"as-printed\" has no ledger", own.name);
            }
            if gas.virial.is_some() {
                return refuse!("{}: chamber law \"as-printed\" needs an ideal gas", own.name);
            }
        }
        let mut wired = wire(&gas, ambient, (&each, &joints), ledger, None)?;
        let joint_volumes = std::mem::take(&mut wired.joint_volumes);
        let (assembly, pistons) = wired.named();
        let gauge = assembly.highest_pressure() - ambient[0];
        let mut said = Said { names: &names, gauge, warnings: Vec::new(), citations: Vec::new() };
        said.warnings.extend(virial_warning(&gas, assembly.highest_pressure(), ambient[1]));
        for (own, spec) in each.iter().zip(&spec.components) {
            said.component(own, spec, pistons.iter().find(|piston| piston.name == own.name))?;
        }
        let Said { warnings, mut citations, .. } = said;
        citations.extend(gas.virial.map(|_| VIRIAL_SOURCE));
        citations.extend(["steinebach2023", "hairer1996"]);
        let mut seen = BTreeSet::new();
        citations.retain(|key| seen.insert(*key));
        let assembly = if names.table.is_empty() { assembly } else { assembly.called(&names) };
        Ok(Network { assembly, pistons, warnings, citations, joint_volumes, joints, each, names })
    }

    /// Returns each cylinder's name and end stops, and the design load of derived stops. Derived stops follow from the
    /// circuit and the highest start pressure, Pa absolute.
    pub fn end_stops(&self, start: f64) -> impl Iterator<Item = (&str, EndStop<f64>, Taken<f64>)> {
        self.pistons.iter().map(move |Piston { name, ends, areas: [a, b], stroke, .. }| {
            let (stop, taken) = ends.from(start, a.max(*b), *stroke);
            (&**name, stop, taken)
        })
    }

    /// Returns warnings about the impacts of a run.
    pub fn impact_warnings(&self, impacts: &[Impact]) -> Vec<String> {
        let each = self.pistons.iter().flat_map(|Piston { axis, name, ends, areas, .. }| {
            let own: Vec<Impact> = impacts.iter().filter(|impact| impact.axis == *axis).copied().collect();
            let key = self.names.key(name, "end_stop_stiffness");
            let through = through_warning(ends.enough, &key, &own);
            let all = through.into_iter().chain(impact_warning(areas[0].max(areas[1]), &own));
            all.map(|text| format!("{HAZARD}{}", self.names.said(name, &text))).collect::<Vec<_>>()
        });
        each.collect()
    }

    /// Returns the name of the cylinder on an axis.
    pub fn cylinder(&self, axis: AxisId) -> Option<&str> {
        self.pistons.iter().find(|piston| piston.axis == axis).map(|piston| piston.name.as_str())
    }

    /// Returns a session that starts at a time, s, with contacts of an age, s, and these values of the inputs. Valves
    /// begin at rest, and a command acts after its delay.
    pub fn session_at(
        &self,
        t: f64,
        inputs: &[(usize, f64)],
        start: &BTreeMap<String, f64>,
        age: f64,
        options: Options,
    ) -> Result<Session, Error> {
        let numbers = self.assembly.numbers(start)?;
        let mut session =
            Session::new(&self.assembly, t, self.assembly.stand(inputs, &numbers, age), options);
        inputs.iter().try_for_each(|&(input, value)| session.set(input, value))?;
        session.settle_schedule();
        Ok(session)
    }

    /// Returns the single piston between two chambers on a 5/3 valve under short names, if the circuit has one.
    pub fn driven(&self) -> Result<Driven<'_>, Error> {
        Driven::of(&self.assembly, self.pistons.first().map_or(f64::NAN, |piston| piston.stroke))
    }

    /// Returns a session under plans: an input, times, and the value from each time on.
    pub fn planned(
        &self,
        plans: &[(String, Vec<f64>, Vec<f64>)],
        duration: f64,
        start: &BTreeMap<String, f64>,
        options: Options,
    ) -> Result<Session, Error> {
        let places = plans.iter().map(|(name, ..)| self.assembly.variables.input(name));
        let places = places.collect::<Result<Vec<_>, _>>()?;
        let first: Vec<(usize, f64)> = (places.iter().zip(plans))
            .filter_map(|(&input, (_, times, values))| {
                Some((input, *values.get(times.partition_point(|time| *time <= 0.0).checked_sub(1)?)?))
            })
            .collect();
        let mut session = self.assembly.session_under(&first, start, options)?;
        for (input, (_, times, values)) in places.into_iter().zip(plans) {
            // As in a drive's run, a plan's entries at or after the end are ignored.
            let due = times.partition_point(|time| *time < duration);
            session.schedule(input, &times[..due], values.get(..due).unwrap_or(values))?;
        }
        session.settle_schedule();
        Ok(session)
    }

    /// Runs from a start under plans.
    pub fn simulate(
        &self,
        plans: &[(String, Vec<f64>, Vec<f64>)],
        (duration, rate): (f64, f64),
        start: &BTreeMap<String, f64>,
        options: Options,
        interrupted: &mut dyn FnMut(f64) -> bool,
    ) -> Result<Run, Error> {
        let mut session = self.planned(plans, duration, start, options)?;
        let mut recorder = Recorder::new(
            &self.assembly.circuit,
            self.assembly.variables.quantities.clone(),
            sample_times(duration, rate),
        );
        session.advance(duration, &mut recorder, &mut Look::new(interrupted))?;
        Ok(recorder.finish(&session))
    }
}
