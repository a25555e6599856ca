//! The reference axis of the tests: its circuit, its usual setup, and a loop around it (values assumed).

#![allow(dead_code)] // each test takes what it needs

use circuit::specification::{Circuit, Component};
use circuit::{Error, Look, Network, Session};
use control::{Reference, Rules};
use ode::Options;
use servo::specification::{Controller, Setup};
use servo::{Axis, COLUMNS, Encoder, Led, Rows, Sensor, Servo, Turn, controller, run_together};

/// Period of the laws, s.
pub const PERIOD: f64 = 1e-3;
/// Of both chambers at the start, Pa absolute.
pub const MEAN: f64 = 4e5;

/// Of a seal that is elastic up to a breakaway 11 N above its sliding friction: N, N s/m, m/s, N/m.
pub const STICKY: [(&str, f64); 6] = [
    ("coulomb", 33.0),
    ("breakaway", 44.0),
    ("viscous", 40.0),
    ("stribeck_velocity", 0.02),
    ("bristle_stiffness", 4.4e5),
    ("bristle_damping", 440.0),
];

/// A cylinder on a proportional 5/3 valve with a spool.
pub fn axis() -> Circuit {
    serde_json::from_str(include_str!("../data/reference_axis.json")).expect("a circuit")
}

/// The axis with a mass, kg, and another law of friction with these parameters.
pub fn rubbing(mass: f64, law: &str, parameters: &[(&str, f64)]) -> Circuit {
    let mut plant = axis();
    let cylinder = plant.components.iter_mut().find(|own| own.name == "cylinder").expect("a cylinder");
    cylinder.numbers.insert("moving_mass".into(), mass);
    let friction = cylinder.friction.as_mut().expect("friction");
    friction.law = law.into();
    friction.parameters = parameters.iter().map(|(key, value)| ((*key).into(), *value)).collect();
    plant
}

/// The axis behind tubes of 2 m.
pub fn behind_tubes() -> Circuit {
    let mut plant = axis();
    for (side, port, chamber) in [("a", "valve.4", "cylinder.a"), ("b", "valve.2", "cylinder.b")] {
        let name = format!("tube_{side}");
        plant.joints.retain(|joint| !joint.contains(&chamber.into()));
        plant.joints.push(vec![port.into(), format!("{name}.1")]);
        plant.joints.push(vec![format!("{name}.2"), chamber.into()]);
        let numbers = [("length".into(), 2.0), ("diameter".into(), 4e-3)].into();
        let (choices, kind) = (Default::default(), "tube".into());
        plant.components.push(Component {
            name,
            kind,
            numbers,
            choices,
            friction: None,
            formula: None,
            points: None,
        });
    }
    plant
}

/// A session under a controller.
pub struct Loop {
    session: Session,
    servo: Servo,
}

impl Loop {
    /// A session that has these components.
    pub fn new(mut session: Session, axis: &Axis, setup: &Setup) -> Result<Self, Error> {
        let servo = Servo::new(&mut session, axis, setup)?;
        Ok(Loop { session, servo })
    }

    /// Runs for a time, s: the [`COLUMNS`], sample by sample. A fault that stops the drive ends the run with an
    /// error.
    pub fn run(
        &mut self,
        controller: &mut control::Controller,
        reference: &Reference,
        duration: f64,
        look: &mut Look<'_>,
    ) -> Result<Rows, Error> {
        let mut axes = [Led { servo: &mut self.servo, controller, reference }];
        let (mut rows, _) = run_together(&mut self.session, &mut axes, &[], duration, look)?;
        Ok(rows.remove(0))
    }

    /// Mass of air from reservoirs and compressors, kg, if the session records it.
    pub fn air_drawn(&self) -> Option<f64> {
        self.session.drawn()
    }

    /// Advances to a sample, by its number, and calls the law; [`Loop::give`] comes next.
    pub fn observe(
        &mut self,
        tick: u64,
        controller: &mut control::Controller,
        reference: &Reference,
        look: &mut Look<'_>,
    ) -> Result<Turn, Error> {
        self.servo.observe(&mut self.session, tick, controller, reference, look)
    }

    /// The loop of its axis.
    pub fn servo(&self) -> &Servo {
        &self.servo
    }

    /// Gives a command, which may be another one than the law's: the [`COLUMNS`] of this sample.
    pub fn give(
        &mut self,
        controller: &mut control::Controller,
        turn: &Turn,
        command: f64,
    ) -> Result<[f64; COLUMNS.len()], Error> {
        self.servo.give(&mut self.session, controller, turn, command)
    }
}

pub fn session(plant: &Circuit, position: f64) -> Session {
    let network = Network::assemble(plant, false).expect("it can be assembled");
    let value = |name: &str| match name {
        _ if name.ends_with("pressure_pa") => MEAN,
        _ if name.ends_with("temperature_k") => 293.15,
        _ if name.ends_with("position_m") => position,
        _ => 0.0,
    };
    let start = network.assembly.given_names().iter().map(|name| (name.to_string(), value(name))).collect();
    network.assembly.session(&start, Options { rtol: 1e-5, ..Options::default() }).expect("a start")
}

/// Encoder, pressure sensors and converter of a usual axis, without jitter and faults.
pub fn setup(seed: u64) -> Setup {
    let sensor = |sign: f64| Sensor {
        range: [0.0, 1e6],
        bits: 12,
        noise: 200.0,
        zero: sign * 1500.0,
        gain_error: sign * 0.002,
        lag: 0.5e-3,
    };
    Setup {
        position: Encoder { resolution: 5e-6, noise: 1e-6 },
        pressures: Some([sensor(1.0), sensor(-1.0)]),
        command_bits: 12,
        computing_time_s: 0.0,
        forces: vec![],
        seed,
        member: 0,
        step_repeats: 1,
        jitter_s: [0.0; 4],
        switches_m: None,
        faults: vec![],
    }
}

/// A loop around a plant at `position`, under a law that believes in `belief`.
pub fn begin(
    belief: Circuit,
    plant: &Circuit,
    (law, supervision): (&str, Option<Rules>),
    setup: &Setup,
    position: f64,
) -> (Loop, control::Controller) {
    let spec = Controller {
        law: law.into(),
        period_s: PERIOD,
        gains: Default::default(),
        factors: [1.0; 3],
        adaptation: true,
        valves: Default::default(),
        hold: Some([3e-5, 0.02]),
        supervision: supervision.unwrap_or_default(),
        standby: None,
        belief,
    };
    let (controller, names) = controller(&spec, setup.position.deviation()).expect("a controller");
    let session = session(plant, position);
    (Loop::new(session, &names, setup).expect("the axis is there"), controller)
}
