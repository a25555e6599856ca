//! Components as sold by makers: cylinders, valves, tubes and others. Each has a table (ports, parameters, inputs,
//! outputs) and parts. A new component needs a file here and a word in `components!`.

mod build;
mod extra;
mod flow;
mod formula;
mod gas;
pub(crate) mod mechanics;
mod registry;
mod series;
mod symbol;
mod table;
mod valves;

use crate::circuit::{AxisId, GasId};
use crate::part::ChamberLaw;
use crate::run::Error;
use crate::table;
use math::{Deps, Lane, Over};
use physics::flow::Iso6358;
use physics::friction::Contact;
use table::WALL;

pub use formula::formula_kind;

pub use build::{Acts, Build, Leg, Piston};
pub(crate) use extra::Given;
pub use extra::{Extra, Points};
pub use registry::{kinds, register};
pub(crate) use series::{Chain, PortId};
pub use symbol::{Stroke, Symbol};
pub use table::{LINEAR_ABOVE, Row, SUBSONIC_INDEX, count, join};

/// Kind of a port.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PortKind {
    /// A gas port.
    Gas,
    /// A mass that moves along one line.
    Axis,
    /// A pilot port: it senses the pressure of the gas at its joint without any flow.
    Pilot,
}

/// Effect of a port on the state of its joint.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Holds {
    /// Restriction or mass: the port takes the gas or the motion of the joint.
    Nothing,
    /// A separate volume.
    Volume,
    /// A constant pressure.
    Pressure,
    /// A restriction that sets the pressure after it to the value of the component.
    Set,
    /// An axis with a commanded motion, independent of the connected components.
    Motion,
}

/// A port of a component.
#[derive(Clone, Copy, Debug)]
pub struct Port {
    /// Its name within the component.
    pub name: &'static str,
    /// Kinds of port that may be joined to it.
    pub kind: PortKind,
    /// Open to the ambient air if not joined.
    pub exhaust: bool,
    /// Shut if not joined.
    pub optional: bool,
    /// Source of the state at the port.
    pub holds: Holds,
    /// Volume that it adds to a joint without a separate volume, m3 (assumed).
    pub volume: f64,
}

/// Returns a gas port that adds the volume of a small fitting to its joint.
pub const fn gas(name: &'static str) -> Port {
    Port {
        name,
        kind: PortKind::Gas,
        exhaust: false,
        optional: false,
        holds: Holds::Nothing,
        volume: PORT_VOLUME,
    }
}

/// Returns the same port, open to the ambient air if nothing is joined to it.
pub const fn exhaust(name: &'static str) -> Port {
    Port { exhaust: true, ..gas(name) }
}

/// Returns a port that senses only pressure.
pub const fn pilot(name: &'static str) -> Port {
    Port { kind: PortKind::Pilot, volume: 0.0, ..gas(name) }
}

/// Returns a port of a volume, which includes the volume of the port.
pub const fn chamber(name: &'static str) -> Port {
    Port { holds: Holds::Volume, volume: 0.0, ..gas(name) }
}

/// Returns a port of a moving mass.
pub const fn axis(name: &'static str, optional: bool) -> Port {
    Port { name, kind: PortKind::Axis, exhaust: false, optional, holds: Holds::Nothing, volume: 0.0 }
}

/// Volume of a port of a fitting or a valve, m3 (assumed): a bore of 5 mm, 10 mm long.
const PORT_VOLUME: f64 = 2e-7;
/// Least volume of a joint, m3 (assumed).
const LEAST_VOLUME: f64 = 1e-7;

/// A choice of a component: its options, the first being the default.
#[derive(Clone, Copy, Debug)]
pub struct Choice {
    /// Its key in a description.
    pub name: &'static str,
    /// The options.
    pub options: &'static [&'static str],
    /// Meaning of the choice as text.
    pub meaning: &'static str,
}

/// A variable of a component: name, unit, meaning.
pub type Variable = (&'static str, &'static str, &'static str);

/// The table of a kind of component.
#[derive(Clone, Copy, Debug)]
pub struct Kind {
    /// Its key in a description.
    pub key: &'static str,
    /// Title for users.
    pub title: &'static str,
    /// Its description and equation.
    pub text: &'static str,
    /// Keys in references.bib.
    pub sources: &'static [&'static str],
    /// Its ports, in the order of the nodes in [`Terminals`].
    pub ports: &'static [Port],
    /// Its parameters.
    pub parameters: &'static [Row],
    /// Its choices, which are words and not numbers.
    pub choices: &'static [Choice],
    /// Its additional parameters: formula or points.
    pub extra: Extra,
    /// Whether gas can always pass between its ports.
    pub open: bool,
    /// Whether it accepts a friction table.
    pub friction: bool,
    /// Whether it requires a friction table.
    pub needs_friction: bool,
    /// Keys of numbers that only the schedule uses, or that are rounded. Derivatives by them do not exist.
    pub discrete: &'static [&'static str],
    /// Its inputs.
    pub inputs: &'static [Variable],
    /// Its outputs.
    pub outputs: &'static [Variable],
    /// Its symbol.
    pub symbol: Symbol,
}

impl Kind {
    /// Table with the default values of most kinds.
    pub const PLAIN: Kind = Kind {
        key: "",
        title: "",
        text: "",
        sources: &[],
        ports: &[],
        parameters: &[],
        choices: &[],
        extra: Extra::Nothing,
        open: false,
        friction: false,
        needs_friction: false,
        discrete: &[],
        inputs: &[],
        outputs: &[],
        symbol: Symbol::BOX,
    };

    /// Returns whether a word of its table is reserved, so that a formula cannot use it as a parameter.
    fn takes(&self, key: &str) -> bool {
        ["kind", "at", "use", "copies", "formula", "friction"].contains(&key)
            || self.choices.iter().map(|choice| choice.name).any(|name| name == key)
            || self.inputs.iter().any(|(name, ..)| *name == key)
    }
}

/// One component of a circuit, its numbers in the order of its kind's parameters.
#[derive(Clone, Debug)]
pub struct Instance<P> {
    /// Its name in the circuit.
    pub name: String,
    /// Index of the kind in [`kinds`].
    pub kind: usize,
    pub(crate) extra: Given<P>,
    /// `None` for a parameter that is left out and has no default.
    pub numbers: Vec<Option<P>>,
    /// Numbers by which any pass of directions differentiates.
    pub free: Vec<bool>,
    /// Selected option of each choice.
    pub choices: Vec<usize>,
    /// Its friction, if given.
    pub friction: Option<Contact<P>>,
}

impl<P> Instance<P> {
    /// Returns the option of a choice, if the component has this choice.
    pub(crate) fn chosen(&self, choice: &str) -> Option<&'static str> {
        let mut each = self.kind().choices.iter().zip(&self.choices);
        each.find(|(own, _)| own.name == choice).map(|(own, option)| own.options[*option])
    }

    /// Returns the table of its kind.
    pub fn kind(&self) -> &'static Kind {
        self.extra.kind(registry::kind(self.kind))
    }
}

impl<P: Lane> Instance<P> {
    /// Returns its contribution to the joint at one of its ports, for this temperature of the ambient air, K.
    pub fn brings(&self, port: usize, ambient_temperature: P) -> Brings<P> {
        bring(self, port, ambient_temperature)
    }

    /// Creates a component of a kind with this key, with numbers by the keys of its parameters.
    pub fn new(name: &str, kind: &str, number: impl Fn(&str) -> Option<(P, bool)>) -> Self {
        let kind = KINDS.iter().position(|own| own.key == kind).expect("a kind of component");
        let each = || KINDS[kind].parameters.iter().map(|parameter| number(parameter.key));
        Instance {
            name: name.into(),
            kind,
            extra: Given::Nothing,
            numbers: (each().zip(KINDS[kind].parameters))
                .map(|(number, row)| number.map(|(value, _)| value).or(row.default.map(P::c)))
                .collect(),
            free: each().map(|number| number.is_some_and(|(_, is_free)| is_free)).collect(),
            choices: vec![0; KINDS[kind].choices.len()],
            friction: None,
        }
    }

    fn place(&self, key: &str) -> usize {
        let place = self.kind().parameters.iter().position(|parameter| parameter.key == key);
        place.expect("a parameter of this kind")
    }

    /// Returns an optional number.
    pub fn given(&self, key: &str) -> Option<P> {
        self.numbers[self.place(key)]
    }

    /// Returns its points: rows in the order of its kind's columns, or `None` if its kind has no points.
    pub fn points(&self) -> &[Vec<P>] {
        if let Given::Points(rows) = &self.extra { rows } else { &[] }
    }

    /// Returns whether a number is differentiated.
    pub fn is_free(&self, key: &str) -> bool {
        self.free[self.place(key)]
    }

    /// Returns whether a number is differentiated, if the component has this number.
    fn varies(&self, key: &str) -> bool {
        self.kind().parameters.iter().any(|row| row.key == key) && self.is_free(key)
    }

    /// Returns a number that must exist, because it was checked before.
    pub fn number(&self, key: &str) -> P {
        self.given(key).expect("a number that was checked")
    }

    /// Returns the law of a flow path of this component with the named sonic conductance.
    pub fn path(&self, conductance: &str, build: &Build<P>) -> Iso6358<P> {
        self.path_of(self.number(conductance), build)
    }

    /// Returns the same for a sonic conductance, m3/(s Pa).
    pub fn path_of(&self, conductance: P, build: &Build<P>) -> Iso6358<P> {
        self.law(conductance, self.number("critical_pressure_ratio"), build)
    }

    /// Returns the contribution of a path with a sonic conductance to others in series. Such paths are merged by a rule
    /// for the subsonic index 0.5.
    pub fn in_series(&self, conductance: P) -> Option<[P; 2]> {
        let is_usual = self.number("subsonic_index").get(0) == 0.5;
        is_usual.then(|| [conductance, self.number("critical_pressure_ratio")])
    }

    /// Returns the law of a path to the exhaust. The default is the law of the supply path.
    fn exhaust_path(&self, build: &Build<P>) -> Iso6358<P> {
        let conductance = self.given("exhaust_conductance").unwrap_or_else(|| self.number("conductance"));
        let ratio = self.given("exhaust_critical_pressure_ratio");
        self.law(conductance, ratio.unwrap_or_else(|| self.number("critical_pressure_ratio")), build)
    }

    fn law(&self, conductance: P, ratio: P, build: &Build<P>) -> Iso6358<P> {
        let index = self.number("subsonic_index");
        Iso6358::for_gas(
            conductance,
            ratio,
            index,
            self.number("linear_above"),
            index.get(0) == 0.5 && !self.is_free("subsonic_index"),
            &build.gas,
            build.is_air,
        )
    }
}

/// Contribution of a component to the joint at one of its ports.
#[allow(missing_docs)] // of fields: each variant names its own, in their order
#[derive(Clone, Debug)]
pub enum Brings<P> {
    /// The volume of the port alone.
    Nothing,
    /// Gas of constant pressure, Pa absolute, and temperature, K.
    Reservoir { pressure: P, temperature: P },
    /// A volume.
    Volume(Vessel<P>),
    /// A volume, m3, that is added to that of the joint.
    Room { volume: P },
    /// A moving mass, kg, on an incline, rad, with an external force in +x, N, and with friction.
    Mass { mass: P, incline: Option<P>, force: P, friction: Option<Contact<P>> },
    /// A prescribed motion that no force changes.
    Motion,
    /// A leg of a mechanism, whose platform has this mass, kg.
    Guide { mass: P },
    /// A mass coupled to another by a ratio that depends on the position.
    Along,
}

/// A volume, m3, with a wall: m2, W/(m2 K), K.
#[derive(Clone, Debug)]
pub struct Vessel<P> {
    /// Mass and energy balance of the gas.
    pub law: ChamberLaw,
    /// Volume outside the stroke of a piston, m3.
    pub dead_volume: P,
    /// Wetted wall of that volume, m2.
    pub wall: P,
    /// Heat-transfer coefficient to the wall, W/(m2 K).
    pub heat_transfer: P,
    /// Temperature of the wall, K.
    pub wall_temperature: P,
}

/// The node at a port.
#[derive(Clone, Copy, Debug)]
pub enum Node {
    /// A gas node.
    Gas(GasId),
    /// A moving mass.
    Axis(AxisId),
    /// An unconnected port.
    Shut,
}

/// The nodes at the ports of a component.
pub struct Terminals<'a>(pub &'a [Node]);

impl Terminals<'_> {
    /// Returns the gas at a port.
    pub fn gas(&self, port: usize) -> Option<GasId> {
        if let Node::Gas(id) = self.0[port] { Some(id) } else { None }
    }

    /// Returns the mass at a port.
    pub fn axis(&self, port: usize) -> Option<AxisId> {
        if let Node::Axis(id) = self.0[port] { Some(id) } else { None }
    }
}

/// A kind of component.
pub trait Component: 'static {
    /// Its table.
    const KIND: Kind;

    /// Returns its contribution to the joint at a port.
    fn bring<P: Lane>(_own: &Instance<P>, _port: usize, _ambient_temperature: P) -> Brings<P> {
        Brings::Nothing
    }

    /// Returns sonic conductance, m3/(s Pa), and critical pressure ratio of a path between its first two ports. The
    /// path is always open and can be merged with others in series. Its outputs are flows along it.
    fn series<P: Lane>(_own: &Instance<P>) -> Option<[P; 2]> {
        None
    }

    /// Checks relations between its numbers.
    fn check(_own: &Instance<f64>) -> Result<(), Error> {
        Ok(())
    }

    /// Adds its parts.
    fn compose<P: Lane>(own: &Instance<P>, at: &Terminals, build: &mut Build<P>)
    where
        Deps: Over<P>;
}

macro_rules! components {
    ($($component:path),* $(,)?) => {
        /// Every kind of component.
        pub static KINDS: &[&Kind] = &[$(&<$component as Component>::KIND),*];

        pub(crate) fn bring<P: Lane>(own: &Instance<P>, port: usize, ambient_temperature: P) -> Brings<P> {
            let mut kind = 0..;
            $(if own.kind == kind.next().unwrap_or(0) {
                return <$component as Component>::bring(own, port, ambient_temperature);
            })*
            registry::at(own.kind).bring_as(own, port, ambient_temperature)
        }

        pub(crate) fn series<P: Lane>(own: &Instance<P>) -> Option<[P; 2]> {
            let mut kind = 0..;
            $(if own.kind == kind.next().unwrap_or(0) {
                return <$component as Component>::series(own);
            })*
            registry::at(own.kind).series_as(own)
        }

        pub(crate) fn check(own: &Instance<f64>) -> Result<(), Error> {
            let mut kind = 0..;
            $(if own.kind == kind.next().unwrap_or(0) {
                return <$component as Component>::check(own);
            })*
            registry::at(own.kind).check(own)
        }

        pub(crate) fn compose<P: Lane>(own: &Instance<P>, at: &Terminals, build: &mut Build<P>) where Deps: Over<P> {
            let mut kind = 0..;
            $(if own.kind == kind.next().unwrap_or(0) {
                return <$component as Component>::compose(own, at, build);
            })*
            registry::at(own.kind).compose(own, at, build);
        }
    };
}

components! {
    gas::reservoir::Reservoir,
    gas::tank::Tank,
    flow::fitting::Fitting,
    flow::orifice::Orifice,
    flow::leak::Leak,
    flow::silencer::Silencer,
    flow::tube::Tube,
    flow::line::Line,
    flow::lumped::Lumped,
    flow::lumped::Auto,
    flow::check_valve::CheckValve,
    valves::piloted::PilotedCheckValve,
    flow::flow_control::FlowControl,
    valves::soft_start::SoftStart,
    valves::regulator::PressureRegulator,
    valves::regulator::ElectroPneumatic,
    flow::quick_exhaust::QuickExhaust,
    gas::compressor::Compressor,
    gas::pulsating::Pulsating,
    gas::ejector::Ejector,
    valves::valve::Proportional53,
    valves::valve::Proportional32,
    valves::switching::Switching22,
    valves::switching::Switching32,
    valves::switching::Switching52,
    valves::switching::Switching53,
    valves::impulse::Impulse52,
    mechanics::load::Load,
    mechanics::load::Spring,
    mechanics::slide::Slide,
    mechanics::coupling::Coupling,
    mechanics::motor::Motor,
    mechanics::magnetic_coupling::MagneticCoupling,
    formula::Restriction,
    formula::Force,
    mechanics::rod_lock::RodLock,
    mechanics::carriage::Carriage,
    crate::mechanism::Platform3Rps,
    crate::mechanism::Platform3Upu,
    crate::mechanism::Platform6Ups,
    crate::mechanism::PlatformLinearDelta,
    crate::mechanism::PlatformDriven,
    mechanics::force_sensor::ForceSensor,
    mechanics::piston::Bare,
    mechanics::table_force::OverPosition,
    mechanics::table_force::OverVelocity,
    mechanics::table_force::OverTime,
    mechanics::inertia::Table,
    mechanics::inertia::Lever,
    mechanics::inertia::Toggle,
    mechanics::bumper::Bumper,
    mechanics::shock_absorber::ShockAbsorber,
    // Last, because the end stops of a cylinder depend on the components joined to it.
    mechanics::cylinder::Rodless,
    mechanics::cylinder::ThroughRod,
    mechanics::cylinder::SingleRod,
    mechanics::cylinder::SingleActing,
    mechanics::cylinder::Tandem,
}

/// Returns the least volume of a joint to which ports add `ports` m3.
pub(crate) fn joint_volume(ports: f64) -> f64 {
    ports.max(LEAST_VOLUME)
}
