//! What an integrator of the caller's own needs of a session: rates and event functions at the times and states that it
//! tries, and the changes of mode at those that it accepts.

use super::session::Session;
use super::variables::Starting;
use crate::circuit::AxisId;
use crate::run::Error;
use ode::System;

/// Changes of mode at one instant after which stick and slip are said to alternate for ever (assumed).
const MOST_CHANGES: usize = 64;

impl Session {
    /// Puts a time, s, and a state in place of the present ones. What is due by then stays due.
    pub fn place(&mut self, t: f64, y: &[f64]) {
        self.stepper.load(0, t, y);
        // The end stops act from now on, since nobody looks whether a step ends beyond them.
        self.stepper.system_mut().meet(0);
        self.is_read = false;
    }

    /// The rates of the states. Where a mass that slides in one direction has a velocity in the other, they are those
    /// of velocity 0, the last state of the mode: with the same friction on both sides of it, a step that ends beyond
    /// its event would pass over the breakaway peak before it unseen.
    pub fn rates(&mut self) -> Vec<f64> {
        let (circuit, mut y) = (self.stepper.system(), self.stepper.state().to_vec());
        circuit.settle(&mut y);
        circuit.renew(&mut self.net);
        let mut rates = vec![0.0; y.len()];
        circuit.rhs(self.stepper.time(0), &y, &mut rates, &mut self.net);
        self.is_read = false;
        rates
    }

    /// Event functions: positive while the present modes hold.
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

    /// Changes every mode that holds no longer; whether there was any.
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

    /// The time of the next entry of the schedule, s.
    pub fn next_due(&self) -> Option<f64> {
        self.schedule.last().map(|entry| entry.0)
    }

    /// Sizes of the states, each in its unit: the absolute tolerance is a share of them.
    pub fn scale(&self) -> &[f64] {
        self.circuit().scale()
    }

    /// The axis whose position at the start is called so, and the place of that position among the states.
    pub fn axis(&self, start: &str) -> Option<(AxisId, usize)> {
        let axis = self.starts().iter().find_map(|(starting, names)| match *starting {
            Starting::Axis(id) if names[0] == start => Some(id),
            _ => None,
        })?;
        Some((axis, self.circuit().position_state(axis)?))
    }

    /// The force in +x with which everything acts on the mass of an axis, N.
    pub fn force_on(&mut self, axis: AxisId) -> f64 {
        self.stepper.system().observe(self.stepper.state(), &mut self.net);
        self.is_read = false;
        self.net[axis].force - self.net[axis].friction
    }
}
