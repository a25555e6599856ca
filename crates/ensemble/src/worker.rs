//! One member at a time: its numbers, its start and its run.

use crate::plan::Planned;
use crate::reduction::Reducer;
use circuit::{Assembly, Circuit, Error, Look, Members, Session};
use math::Lane;
use ode::Options;
use std::sync::atomic::{AtomicBool, Ordering};

/// Outcome of a member.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum MemberStatus {
    /// The run reached its end.
    Done = 0,
    /// The run failed, and its numbers are not finite.
    Stopped = 1,
    /// The numbers of the member are inconsistent. It did not run.
    Refused = 2,
}

/// Result of a member.
pub(crate) struct Came {
    pub row: Vec<f64>,
    pub failure: Option<(MemberStatus, String)>,
    pub attempts: u64,
}

impl Came {
    pub fn refused(error: &Error) -> Self {
        Came { row: Vec::new(), failure: Some((MemberStatus::Refused, error.to_string())), attempts: 0 }
    }
}

/// A thread's worker for the members of a chunk.
pub(crate) struct Worker<'a, R: Lane> {
    pub planned: &'a Planned<'a>,
    pub members: Members,
    pub follower: Reducer<'a, f64>,
    /// Follower of several members side by side, if the circuit allows it.
    pub side_by_side: Option<Reducer<'a, R>>,
    pub width: usize,
}

impl<R: Lane> Worker<'_, R> {
    pub fn run(&mut self, member: usize, stop: &AtomicBool) -> Came {
        match self.member(member) {
            Ok(assembly) => self.run_alone(&assembly, member, stop),
            Err(error) => Came::refused(&error),
        }
    }

    /// Returns the assembly of a member with its numbers.
    pub fn member(&mut self, member: usize) -> Result<Assembly, Error> {
        let k = self.planned.ensemble.members.names.len();
        self.members.member(&self.planned.asked.values[member * k..][..k])
    }

    /// Returns the start of a member with these equations.
    pub fn start(
        &self,
        circuit: Circuit<f64>,
        assembly: &Assembly,
        member: usize,
    ) -> (Circuit<f64>, Vec<f64>) {
        let Planned { asked, inputs, .. } = self.planned;
        let plans = inputs.iter().zip(&asked.plans);
        let first: Vec<_> = plans.map(|(&input, plan)| (input, plan.values.row(member)[0])).collect();
        assembly.stand_in(circuit, &first, asked.initial.row(member), asked.contact_age)
    }

    /// Runs a member without neighbours.
    pub fn run_alone(&mut self, assembly: &Assembly, member: usize, stop: &AtomicBool) -> Came {
        self.follower.init(0);
        let duration = self.planned.asked.duration.row(member)[0];
        let start = self.start(Circuit::clone(&assembly.circuit), assembly, member);
        let options = Options { max_attempts: self.planned.budget(member), ..self.planned.options };
        let mut session = Session::new(assembly, 0.0, start, options);
        for (time, input, value) in self.planned.due(member) {
            session.plan(input, [(time, value)]);
        }
        session.settle_schedule();
        let mut stopped = |_| stop.load(Ordering::Relaxed);
        let outcome = session.advance(duration, &mut self.follower, &mut Look::new(&mut stopped));
        let attempts = session.statistics().factorisations;
        let mut row = vec![f64::NAN; self.width];
        let failure = match outcome {
            Ok(()) => {
                self.follower.finish(0, (duration, &session.settled()), session.circuit(), &mut row);
                None
            }
            Err(error) => Some((MemberStatus::Stopped, error.to_string())),
        };
        Came { row, failure, attempts }
    }
}
