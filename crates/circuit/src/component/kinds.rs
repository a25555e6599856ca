//! Every kind of component.

use super::build::{Build, Component};
use super::instance::{Brings, Given, Instance, Terminals};
use super::kind::Kind;
use super::{flow, formula, gas, mechanics, valves};
use crate::ground::Error;
use math::{Deps, Lane, Over};
use physics::written::{Refusal, Text};

macro_rules! components {
    ($($component:path),* $(,)?) => {
        /// Every kind of component.
        pub static KINDS: &[&Kind] = &[$(&<$component as Component>::KIND),*];

        /// Evaluates an expression with the kind of a component as a type.
        macro_rules! with_kind {
            ($own:expr, $kind:ident => $value:expr) => {{
                let mut kind = 0..;
                $(if $own.kind == kind.next().unwrap_or(0) {
                    type $kind = $component;
                    return $value;
                })*
                unreachable!("a kind of component")
            }};
        }
    };
}

components! {
    gas::reservoir::ReservoirComponent,
    gas::tank::Tank,
    flow::fitting::Fitting,
    flow::orifice::Orifice,
    flow::leak::Leak,
    flow::silencer::Silencer,
    flow::tube::Tube,
    flow::line::Line,
    flow::lumped::Lumped,
    flow::lumped::Auto,
    flow::check_valve::CheckValveComponent,
    valves::piloted::PilotedCheckValve,
    flow::flow_control::FlowControl,
    valves::soft_start::SoftStart,
    valves::regulator::PressureRegulator,
    valves::regulator::ElectroPneumatic,
    flow::quick_exhaust::QuickExhaust,
    gas::compressor::CompressorComponent,
    gas::ejector::EjectorComponent,
    valves::valve::Proportional53,
    valves::valve::Proportional32,
    valves::switching::Switching22,
    valves::switching::Switching32,
    valves::switching::Switching52,
    valves::switching::Switching53,
    valves::impulse::Impulse52,
    mechanics::load::Load,
    mechanics::load::LoadSpring,
    mechanics::slide::Slide,
    mechanics::coupling::CouplingComponent,
    mechanics::motor::MotorComponent,
    mechanics::magnetic_coupling::MagneticCoupling,
    formula::FormulaRestriction,
    formula::Force,
    mechanics::rod_lock::RodLock,
    mechanics::carriage::CarriageComponent,
    mechanics::platform::Platform3Rps,
    mechanics::platform::Platform3Upu,
    mechanics::platform::Platform6Ups,
    mechanics::platform::PlatformLinearDelta,
    mechanics::platform::PlatformDriven,
    mechanics::force_sensor::ForceSensor,
    mechanics::piston::Bare,
    mechanics::table_force::OverPosition,
    mechanics::table_force::OverVelocity,
    mechanics::table_force::OverTime,
    mechanics::inertia::InertiaTable,
    mechanics::inertia::Lever,
    mechanics::inertia::Toggle,
    mechanics::bumper::BumperComponent,
    mechanics::shock_absorber::ShockAbsorberComponent,
    // Last, because the end stops of a cylinder depend on the components joined to it.
    mechanics::cylinder::Rodless,
    mechanics::cylinder::ThroughRod,
    mechanics::cylinder::SingleRod,
    mechanics::cylinder::SingleActing,
    mechanics::cylinder::Tandem,
}

pub(crate) fn series<P: Lane>(own: &Instance<P>) -> Option<[P; 2]> {
    with_kind!(own, Type => Type::series(own))
}

pub(crate) fn check(own: &Instance<f64>) -> Result<(), Error> {
    with_kind!(own, Type => Type::check(own))
}

pub(crate) fn compose<P: Lane>(own: &Instance<P>, at: &Terminals, build: &mut Build<P>)
where
    Deps: Over<P>,
{
    with_kind!(own, Type => Type::compose(own, at, build))
}

/// Returns the table of the components that a formula makes from a kind, and warnings to the author. `None` if the kind
/// does not exist or does not accept a formula.
pub fn formula_kind(
    kind: &str,
    formula: &Text,
) -> Option<Result<(&'static Kind, &'static [String]), Refusal>> {
    let base = KINDS.iter().find(|own| own.key == kind)?;
    let made = formula::written(base, base.formula?, formula);
    Some(made.map(|written| (&written.kind, &written.own.warnings[..])))
}

impl<P: Lane> Instance<P> {
    /// Returns its contribution to the joint at one of its ports, for this temperature of the ambient air, K.
    pub fn brings(&self, port: usize, ambient_temperature: P) -> Brings<P> {
        with_kind!(self, Type => Type::bring(self, port, ambient_temperature))
    }

    /// Creates a component of a kind with this key, with numbers by the keys of its parameters.
    pub fn new(name: &str, kind: &str, number: impl Fn(&str) -> Option<(P, bool)>) -> Self {
        let kind = KINDS.iter().position(|own| own.key == kind).expect("a kind of component");
        let each = || KINDS[kind].parameters.iter().map(|parameter| number(parameter.key));
        Instance {
            name: name.into(),
            kind,
            table: KINDS[kind],
            extra: Given::Nothing,
            numbers: (each().zip(KINDS[kind].parameters))
                .map(|(number, row)| number.map(|(value, _)| value).or(row.default.map(P::c)))
                .collect(),
            free: each().map(|number| number.is_some_and(|(_, is_free)| is_free)).collect(),
            choices: vec![0; KINDS[kind].choices.len()],
            friction: None,
        }
    }
}
