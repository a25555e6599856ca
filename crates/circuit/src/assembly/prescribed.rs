//! A session with an axis at a prescribed velocity (`platform/driven`): it returns the mean force over a step to a
//! program that computes the motion.

use super::session::Session;
use super::variables::Target;
use crate::circuit::{Circuit, Look};
use crate::ground::{Error, Sensitive};
use ode::{NoOutput, Options, Paused, Stepper, System};

/// Ends of the names of the velocity among the inputs, and of the impulse among the states.
const VELOCITY: &str = ".velocity_m_s";
const IMPULSE: &str = ".impulse_n_s";

/// Largest difference of two motions over a step that counts as none, m, and as a fraction of the motion. Positions do
/// not drift apart, because the next step begins at the true positions.
const CLOSED: [f64; 2] = [1e-13, 1e-8];
/// Trials of a step (assumed: usual steps take two).
const MOST_TRIALS: usize = 12;
/// Change of a velocity above which two forces give a derivative, relative to 1 m/s and to the velocity.
const LEAST_CHANGE: f64 = 1e-9;

/// An axis at a prescribed velocity, with a copy of its session that tries steps.
#[derive(Clone)]
pub struct Prescribed {
    /// Index of the velocity among the inputs, and of the impulse among the states.
    velocity: usize,
    impulse: usize,
    trial: Session,
    /// Whether the copy has the circuit of the session, apart from the velocity.
    is_same: bool,
}

/// Motion of a mechanism over a step, as a function of the forces on its axes: `end` under `forces`, and W, the
/// accelerations of the axes by the forces, row by row.
pub struct Mechanics<'m> {
    /// Positions at the beginning of the step, m.
    pub begin: &'m [f64],
    /// Positions at its end under `forces`, m.
    pub end: &'m [f64],
    /// Forces, N.
    pub forces: &'m [f64],
    /// Accelerations by the forces, 1/kg.
    pub mobility: &'m [f64],
}

impl Prescribed {
    /// Returns the axis of a session whose velocity is prescribed, if any.
    pub fn of(session: &Session) -> Option<Self> {
        let velocity = session.inputs().iter().position(|input| input.name.ends_with(VELOCITY))?;
        let impulse = session.circuit().state_names().iter().position(|(name, _)| name.ends_with(IMPULSE))?;
        Some(Prescribed { velocity, impulse, trial: session.clone(), is_same: false })
    }

    /// Takes over the circuit of the session before the next trial, because its inputs have changed.
    pub fn renew(&mut self) {
        self.is_same = false;
    }

    /// Tries a step to a time, s, at a constant velocity, m/s. Returns the mean of the force of the axis in +x, N. The
    /// work on the program is this mean times the distance.
    pub fn step(&mut self, session: &Session, velocity: f64, until: f64) -> Result<f64, Error> {
        if self.is_same {
            self.trial.follow(session);
        } else {
            self.trial.clone_from(session);
            // A step cannot change the circuit if nothing is scheduled and no law has modes.
            self.is_same = session.schedule.is_empty() && System::<f64>::n_events(session.circuit()) == 0;
        }
        let (trial, time) = (&mut self.trial, until - session.time());
        trial.set(self.velocity, velocity)?;
        trial.stepper.state_mut()[self.impulse] = 0.0;
        trial.go_on(until, &mut Look::new(&mut |_| false))?;
        Ok(trial.state()[self.impulse] / time)
    }

    /// Makes the end of the last trial the present state of the session.
    pub fn accept(&mut self, session: &mut Session) {
        std::mem::swap(session, &mut self.trial);
    }
}

/// Finds the motion of a mechanism under the forces that its axes give along this motion, from velocities `v`, m/s, and
/// derivatives of the forces, N s/m. Both are improved. `known` are the forces of the last trial, if it was made at `v`, or
/// empty. Returns the forces, N, and the number of trials.
///
///   `end + h^2 W (F(v) - forces) = begin + h v`
pub fn close(
    axes: &mut [(&Session, &mut Prescribed)],
    until: f64,
    mechanics: &Mechanics<'_>,
    v: &mut [f64],
    slopes: &mut [f64],
    known: Vec<f64>,
) -> Result<(Vec<f64>, usize), Error> {
    let n = axes.len();
    let Some(h) = axes.first().map(|(session, _)| until - session.time()) else { return Ok((Vec::new(), 0)) };
    let mut all = |v: &[f64]| -> Result<Vec<f64>, Error> {
        axes.iter_mut().zip(v).map(|((session, axis), v)| axis.step(session, *v, until)).collect()
    };
    let Mechanics { begin, end, forces: under, mobility } = *mechanics;
    let first = usize::from(known.is_empty());
    let mut forces = if known.is_empty() { all(v)? } else { known };
    for trials in first..MOST_TRIALS {
        // (1 - h W diag(S)) dv = missed/h by elimination: W is positive, and S rarely so.
        let mut rows = vec![vec![0.0; n + 1]; n];
        let (mut most, mut least) = (0.0_f64, CLOSED[0]);
        for (i, row) in rows.iter_mut().enumerate() {
            let moved: f64 = (0..n).map(|j| mobility[i * n + j] * (forces[j] - under[j])).sum();
            row[n] = (end[i] - begin[i]) / h + h * moved - v[i];
            most = most.max((h * row[n]).abs());
            least = least.max((CLOSED[1] * h * v[i]).abs());
            for j in 0..n {
                row[j] = f64::from(u8::from(i == j)) - h * mobility[i * n + j] * slopes[j];
            }
        }
        if most < least {
            return Ok((forces, trials));
        }
        for i in 0..n {
            let (above, below) = rows.split_at_mut(i + 1);
            for row in below {
                let factor = row[i] / above[i][i];
                for (own, pivot) in row[i..].iter_mut().zip(&above[i][i..]) {
                    *own -= factor * pivot;
                }
            }
        }
        let mut change = vec![0.0; n];
        for i in (0..n).rev() {
            let rest: f64 = (i + 1..n).map(|j| rows[i][j] * change[j]).sum();
            change[i] = (rows[i][n] - rest) / rows[i][i];
        }
        v.iter_mut().zip(&change).for_each(|(v, change)| *v += change);
        let other = all(v)?;
        for i in (0..n).filter(|&i| change[i].abs() > LEAST_CHANGE * (1.0 + v[i].abs())) {
            slopes[i] = (other[i] - forces[i]) / change[i];
        }
        forces = other;
    }
    Ok((forces, MOST_TRIALS))
}

impl Session {
    /// Continues from the state of another session with an equal circuit.
    fn follow(&mut self, other: &Session) {
        self.stepper.follow(&other.stepper);
        self.calls = other.calls;
        self.is_read = false;
    }

    /// Returns the mean force of such a step and its derivative by the velocity, N s/m, by dual numbers. The session
    /// itself does not continue, and its pending commands are not applied.
    pub fn drive_slope(
        &self,
        &Prescribed { velocity, impulse, .. }: &Prescribed,
        value: f64,
        until: f64,
    ) -> Result<[f64; 2], Error> {
        let mut circuit = Circuit::<Sensitive>::gather(&[self.circuit()]);
        if let Target::Input(id) = self.inputs()[velocity].target {
            circuit.set_input(id, 0, Sensitive::variable(value, 0));
        }
        let mut y: Vec<Sensitive> = self.state().iter().map(|y| Sensitive::from(*y)).collect();
        y[impulse] = Sensitive::from(0.0);
        let options = Options { rtol: self.rtol, ..Options::default() };
        let mut stepper = Stepper::new(circuit, self.time(), &y, options);
        let arrived = stepper.advance(until, options.max_attempts, &mut NoOutput) == Paused::Arrived;
        if !arrived || stepper.failure(0).is_some() {
            return Err(Error::Stopped(format!("no step to t = {until} s at {value} m/s")));
        }
        let Sensitive { re, eps } = stepper.state()[impulse];
        Ok([re, eps[0]].map(|own| own / (until - self.time())))
    }
}
