use super::friction_law;
use crate::circuit::{AxisId, CarriageId, Circuit, PistonSide};
use crate::net::Net;
use crate::run::{Error, Recorder, Run, advance};
use crate::specification;
use ode::{Options, Stepper};
use physics::IdealGas;

/// A friction rig: a servo carriage drags the piston through a force sensor, both chambers at held
/// pressure.
#[derive(Clone, Debug)]
pub struct Rig {
    circuit: Circuit<f64>,
    axis: AxisId,
    carriage_axis: AxisId,
    carriage: CarriageId,
    sensor: usize,
    columns: Vec<String>,
}

const COLUMNS: [&str; 8] = [
    "time_s",
    "carriage_position_m",
    "carriage_velocity_m_s",
    "position_m",
    "velocity_m_s",
    "acceleration_m_s2",
    "sensor_force_n",
    "friction_force_n",
];

impl Rig {
    pub fn assemble(spec: &specification::Rig) -> Result<Self, Error> {
        let (law, lips) = friction_law(&spec.friction)?;
        let inner = law.meta().states;
        let air = IdealGas::air();
        let room_k = physics::flow::T_0;
        let mut circuit = Circuit::new(&air, spec.ambient_pressure_pa, room_k);
        let axis = circuit.axis(spec.moving_mass_kg, spec.incline_rad, 0.0, Some(law), lips);
        for (pressure, area, grows) in
            [(spec.pressure_a_pa, spec.area_a_m2, true), (spec.pressure_b_pa, spec.area_b_m2, false)]
        {
            let chamber = circuit.reservoir(pressure, room_k);
            circuit.face(chamber, axis, grows, spec.stroke_m, PistonSide::new(area, 0.0, 0.0));
        }
        let (carriage_axis, carriage) = circuit.carriage();
        let sensor = circuit.link(carriage_axis, axis, spec.sensor_stiffness_n_m, spec.sensor_damping_n_s_m);
        let mut columns: Vec<String> = COLUMNS.iter().map(ToString::to_string).collect();
        columns.extend(inner.iter().map(|state| state.name.to_string()));
        Ok(Rig { circuit: circuit.build(false), axis, carriage_axis, carriage, sensor, columns })
    }

    pub fn columns(&self) -> &[String] {
        &self.columns
    }

    /// Runs a motion of constant `jerks` m/s3 for `durations` s each, from rest at `position` m with
    /// the sensor unstressed; samples at `times` s (ascending, within the motion).
    pub fn run(
        &self,
        durations: &[f64],
        jerks: &[f64],
        times: &[f64],
        position: f64,
        options: Options,
        interrupted: &mut dyn FnMut() -> bool,
    ) -> Result<Run, Error> {
        let mut circuit = self.circuit.clone();
        let y = circuit.initial(&[], &[(self.axis, position, 0.0), (self.carriage_axis, position, 0.0)]);
        let mut recorder =
            Recorder::new(&circuit, times.to_vec(), self.columns.len(), |c, t, y, net, row| {
                self.row(c, t, y, net, row);
            });
        let mut stepper = Stepper::new(circuit, 0.0, &y, options);
        let mut until = 0.0;
        for (&duration, &jerk) in durations.iter().zip(jerks) {
            until += duration;
            stepper.system_mut().set_jerk(self.carriage, 0, jerk);
            advance(&mut stepper, until, &mut recorder, interrupted)?;
        }
        recorder.finish(stepper.system(), stepper.state());
        Ok(Run { columns: recorder.columns, statistics: stepper.statistics(0), balance: None })
    }

    fn row(&self, circuit: &Circuit<f64>, t: f64, y: &[f64], net: &mut Net<f64>, row: &mut [f64]) {
        circuit.observe(y, net);
        let (axis, carriage) = (&net.axis[self.axis.0], &net.axis[self.carriage_axis.0]);
        let force = circuit.link_force(self.sensor, net);
        let values = [t, carriage.x, carriage.v, axis.x, axis.v, axis.a, force, axis.friction];
        row[..values.len()].copy_from_slice(&values);
        row[values.len()..].copy_from_slice(circuit.inner_states(self.axis, y));
    }
}
