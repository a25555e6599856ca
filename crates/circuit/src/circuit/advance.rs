//! Advancing a circuit in time: budget, interruptions, and the reason of a failure in words.

use super::Circuit;
use super::scarce::{Lacking, Scarce};
use crate::ground::Error;
use math::Lane;
use ode::{Failure, Output, Paused, Stepper, System};

/// Step attempts between two checks for an interruption, fewer with derivatives: about 20 ms of work.
const ATTEMPTS_PER_LOOK: u64 = 20_000;

/// Default limit on step attempts: for each second of motion, for each step of the command, and for the run itself.
/// Kinks and events cause most of the attempts, at any tolerance.
const BUDGET: [f64; 3] = [100_000.0, 100.0, 220_000.0];
/// Number of states for which the limit is defined, and the least factor on it. An attempt with more states costs more.
const BUDGET_STATES: f64 = 10.0;
const LEAST_BUDGET: f64 = 0.5;

/// Returns the limit on attempts for a run of `duration` s with this many commands and states.
pub fn budget(duration: f64, commands: usize, states: usize) -> u64 {
    let [second, command, run] = BUDGET;
    let dearer = (BUDGET_STATES / states as f64).clamp(LEAST_BUDGET, 1.0);
    (dearer * (second * duration + command * commands as f64 + run)) as u64
}

/// Called regularly with the simulated time; returns whether the user wants to stop.
pub struct Look<'a> {
    interrupted: &'a mut dyn FnMut(f64) -> bool,
    left: u64,
}

impl<'a> Look<'a> {
    /// Creates it with a function that receives the simulated time, s, and returns whether to stop.
    pub fn new(interrupted: &'a mut dyn FnMut(f64) -> bool) -> Self {
        Look { interrupted, left: ATTEMPTS_PER_LOOK }
    }
}

/// Takes the state at the end of a run as a sample.
pub(crate) fn settled<R: Lane>(circuit: &Circuit<R>, y: &[R]) -> Vec<R> {
    let mut y = y.to_vec();
    circuit.settle(&mut y);
    y
}

/// Advances to `until` and regularly checks whether to continue.
pub fn advance<R: Lane>(
    stepper: &mut Stepper<R, Circuit<R>>,
    until: f64,
    output: &mut impl Output<R, Circuit<R>>,
    look: &mut Look<'_>,
) -> Result<(), Error> {
    let most = ATTEMPTS_PER_LOOK / (1 + R::DIRECTIONS as u64);
    look.left = look.left.min(most);
    loop {
        let before = stepper.statistics(0).factorisations;
        let paused = stepper.advance(until, look.left, output);
        if let Some(failure) = (0..R::L).find_map(|lane| failure_of(stepper, lane)) {
            return Err(Error::Stopped(failure));
        }
        if paused == Paused::Arrived {
            look.left -= stepper.statistics(0).factorisations - before;
            look.left = look.left.max(1);
            return Ok(());
        }
        look.left = most;
        if (look.interrupted)(stepper.time(0)) {
            return Err(Error::Interrupted { t: stepper.time(0) });
        }
    }
}

/// Returns why a lane has stopped early, if it has: the time, the state, and a remedy.
pub fn failure_of<R: Lane>(stepper: &Stepper<R, Circuit<R>>, lane: usize) -> Option<String> {
    Some(in_words(stepper.failure(lane)?, lane, stepper))
}

/// Returns the message of a failed run: time, state, value and remedy.
fn in_words<R: Lane>(failure: Failure, lane: usize, stepper: &Stepper<R, Circuit<R>>) -> String {
    let (circuit, y) = (stepper.system(), stepper.state());
    let names = circuit.state_names();
    let state = |i: usize| {
        names.get(i).map_or("an account".to_string(), |(name, _)| format!("{name} = {:.6e}", y[i].get(lane)))
    };
    let (t, reason, remedy) = match failure {
        Failure::StepTooSmall { t, h, state: i } => (
            t,
            format!("the step fell to {h:.1e} s in {}", state(i)),
            "a looser rtol, a softer end stop or a larger dead volume",
        ),
        Failure::NotFinite { t, state: i } => (
            t,
            format!("a rate is not finite near {}", state(i)),
            "a larger dead volume or a stiffer end stop",
        ),
        Failure::Outside { t } => {
            (t, "no shorter step keeps the state valid".to_string(), "another start, or a tighter rtol")
        }
        Failure::Chatter { t, .. } => (
            t,
            "stick and slip alternate without progress in time".to_string(),
            "law = \"lugre\", or a breakaway force above the Coulomb force",
        ),
        Failure::TooManyAttempts { t, attempts } => (
            t,
            format!("the budget of {attempts} attempts at a step is used up"),
            "a larger budget (budget = ... in Python, --budget on the command line), a shorter duration or a looser rtol",
        ),
    };
    let (reason, remedy) = physical(circuit, y, lane).unwrap_or((reason, remedy.to_string()));
    let shown: Vec<String> = (0..circuit.n_states().min(SHOWN)).map(state).collect();
    format!(
        "the simulation cannot go on at t = {t:.6} s: {reason}. State: {}. Try {remedy}.",
        shown.join(", ")
    )
}

/// Returns the physical reason of a failed run, if there is one, and a remedy.
fn physical<R: Lane>(circuit: &Circuit<R>, y: &[R], lane: usize) -> Option<(String, String)> {
    let scarce = circuit.scarcest(y, lane).filter(|scarce| scarce.share < 2.0 * scarce.what.least());
    let Some(Scarce { volume, what, share }) = scarce else {
        let leg = circuit.stretched(y, lane)?;
        return Some((leg, "another start or command, shorter strokes or longer arms".into()));
    };
    Some(match what {
        Lacking::Room => (
            format!(
                "the piston has gone through the end stop to the cover of {volume}, where {:.2} % of the dead volume is left",
                100.0 * share
            ),
            match volume.split_once('.') {
                Some((of, end)) => {
                    format!(
                        "a larger {of}.end_stop_stiffness, a larger {of}.dead_volume_{end} or a slower approach"
                    )
                }
                None => {
                    "a larger cylinder.end_stop.stiffness, a larger cylinder.dead_volume or a slower approach"
                        .into()
                }
            },
        ),
        Lacking::Gas => (
            format!("no gas is left in {volume}"),
            if volume.starts_with("chamber ") {
                "another start or command, or a larger cylinder.dead_volume".into()
            } else {
                format!("another start or command, or more volume in {volume}")
            },
        ),
    })
}

/// Largest number of states in a message: those of one cylinder.
const SHOWN: usize = 7;
