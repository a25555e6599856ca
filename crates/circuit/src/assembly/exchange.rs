//! Interface of a session for an integrator of the caller: rates and event functions at trial times and states, and
//! mode changes at accepted ones.

use super::session::Session;
use crate::component::Starting;
use crate::ground::{AxisId, Error};
use ode::System;

/// Mode changes at one instant after which stick and slip count as alternating without end (assumed).
const MOST_CHANGES: usize = 64;

impl Session {
    /// Replaces the present time, s, and state. Pending commands stay pending.
    pub fn place(&mut self, t: f64, y: &[f64]) {
        self.stepper.load(0, t, y);
        // The end stops act from now on, because the caller does not check whether a step ends beyond them.
        self.stepper.system_mut().meet(0);
        self.is_read = false;
    }

    /// Returns the rates of the states. If a mass slides in one direction but its velocity has the other sign, the
    /// rates are those of velocity 0, the last state of the mode. With the same friction on both sides of zero, a step
    /// beyond the event could pass the breakaway peak unseen.
    pub fn rates(&mut self) -> Vec<f64> {
        let (circuit, mut y) = (self.stepper.system(), self.stepper.state().to_vec());
        circuit.settle(&mut y);
        circuit.renew(&mut self.net);
        let mut rates = vec![0.0; y.len()];
        circuit.rhs(self.stepper.time(0), &y, &mut rates, &mut self.net);
        self.is_read = false;
        rates
    }

    /// Returns event functions, positive while the present modes hold.
    pub fn events(&mut self) -> Vec<f64> {
        let (circuit, y) = (self.stepper.system(), self.stepper.state());
        circuit.renew(&mut self.net);
        let mut events = vec![0.0; System::<f64>::n_events(circuit)];
        circuit.events(self.stepper.time(0), y, &mut events, &mut self.net);
        for (event, value) in events.iter_mut().enumerate() {
            *value += System::<f64>::event_tolerance(circuit, event);
        }
        self.is_read = false;
        events
    }

    /// Changes every mode that is no longer valid, and returns whether a mode has changed.
    pub fn change_modes(&mut self) -> Result<bool, Error> {
        for changes in 0..MOST_CHANGES {
            let Some(event) = self.events().iter().position(|value| *value <= 0.0) else {
                return Ok(changes > 0);
            };
            let (t, mut y) = (self.stepper.time(0), self.stepper.state().to_vec());
            self.stepper.system_mut().switch(0, event, &mut y, &mut self.net);
            self.place(t, &y);
        }
        Err(Error::Stopped(format!(
            "stick and slip alternate without progress in time at t = {} s. Try law = \"lugre\", or a breakaway force \
             above the Coulomb force",
            self.time()
        )))
    }

    /// Returns the time of the next entry of the schedule, s.
    pub fn next_due(&self) -> Option<f64> {
        self.schedule.last().map(|entry| entry.0)
    }

    /// Returns the scales of the states, each in its unit. The absolute tolerance is a fraction of them.
    pub fn scale(&self) -> &[f64] {
        self.circuit().scale()
    }

    /// Returns the axis with this name of the start position, and the index of that position among the states.
    pub fn axis(&self, start: &str) -> Option<(AxisId, usize)> {
        let axis = self.assembly.variables.starts.iter().find_map(|(starting, names)| match *starting {
            Starting::Axis(id) if names[0] == start => Some(id),
            _ => None,
        })?;
        Some((axis, self.circuit().position_state(axis)?))
    }

    /// Returns the total force in +x on the mass of an axis, N.
    pub fn force_on(&mut self, axis: AxisId) -> f64 {
        self.stepper.system().observe(self.stepper.state(), &mut self.net);
        self.is_read = false;
        self.net[axis].force - self.net[axis].friction
    }
}
