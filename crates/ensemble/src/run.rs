//! Members in chunks, chunks on threads.

use crate::lanes;
use crate::plan::{Ensemble, EnsembleRequest, Kernel, Planned};
use crate::reduction::Reducer;
use crate::worker::{Came, MemberStatus, Worker};
use circuit::{Error, run_jobs};
use math::{Lane, Task, with_eight};
use ode::System;
use std::ops::Range;
use std::sync::atomic::{AtomicBool, Ordering};

/// Largest number of members that a thread takes from the queue in one step.
const MOST: usize = 256;

/// Number of values in a register of every processor that this build supports.
#[cfg(target_feature = "avx2")]
type Base = math::V4;
#[cfg(not(target_feature = "avx2"))]
type Base = math::Lanes<2>;

/// Results of an ensemble.
#[derive(Clone, Debug)]
pub struct Outcome {
    /// For each output the numbers of all members, one member after the other.
    pub columns: Vec<Vec<f64>>,
    /// Outcome of each member: see [`MemberStatus`].
    pub status: Vec<u8>,
    /// Reasons why members have no numbers, by member.
    pub reasons: Vec<(usize, String)>,
    /// Step attempts of all members together.
    pub attempts: u64,
}

impl Ensemble {
    /// Runs all members. `interrupted` receives the number of finished members from time to time, and returns
    /// whether to stop.
    pub fn run(
        &self,
        asked: &EnsembleRequest,
        interrupted: &mut dyn FnMut(f64) -> bool,
    ) -> Result<Outcome, Error> {
        let plan = Planned::of(self, asked)?;
        let widths: Vec<usize> = asked.outputs.iter().map(|output| plan.width(output)).collect();
        let total: usize = widths.iter().sum();
        let mut outcome = Outcome {
            columns: widths.iter().map(|width| vec![f64::NAN; width * asked.members]).collect(),
            status: vec![MemberStatus::Done as u8; asked.members],
            reasons: Vec::new(),
            attempts: 0,
        };
        let circuit = &self.members.template.circuit;
        let run = EnsembleRun { plan: &plan, total, widths: &widths, outcome: &mut outcome, interrupted };
        let whole = match plan.kernel {
            Kernel::Eight if circuit.is_fused() && circuit.n_events() == 0 => with_eight(run),
            _ => run.run::<Base>(),
        };
        if !whole? {
            return Err(Error::Interrupted { t: 0.0 });
        }
        outcome.reasons.sort_by_key(|(member, _)| *member);
        Ok(outcome)
    }
}

/// A run of the members of a plan into an outcome. Counts are per member and per output.
struct EnsembleRun<'r, 'a> {
    plan: &'r Planned<'a>,
    total: usize,
    widths: &'r [usize],
    outcome: &'r mut Outcome,
    interrupted: &'r mut dyn FnMut(f64) -> bool,
}

impl Task for EnsembleRun<'_, '_> {
    type Out = Result<bool, Error>;

    fn run<R: Lane<Plain = R>>(self) -> Self::Out {
        let EnsembleRun { plan, total, widths, outcome, interrupted } = self;
        let asked = plan.asked;
        let done = std::cell::Cell::new(0);
        // A small number of members is divided among all threads.
        let chunk = asked.members.div_ceil(asked.threads.max(1)).clamp(1, MOST);
        let take = |at: usize, came: Vec<Came>| {
            let first = at * chunk;
            for (i, Came { row, failure, attempts }) in came.into_iter().enumerate() {
                let member = first + i;
                outcome.attempts += attempts;
                done.set(done.get() + 1);
                if let Some((status, reason)) = failure {
                    outcome.status[member] = status as u8;
                    outcome.reasons.push((member, reason));
                    continue;
                }
                let mut rest = &row[..];
                for (column, &width) in outcome.columns.iter_mut().zip(widths) {
                    let (own, others) = rest.split_at(width);
                    column[member * width..][..width].copy_from_slice(own);
                    rest = others;
                }
            }
            Ok(())
        };
        run_jobs(
            (asked.threads, asked.members.div_ceil(chunk)),
            || plan.worker::<R>(total),
            |worker, at, stop| worker.run_all(at * chunk..asked.members.min((at + 1) * chunk), stop),
            take,
            &mut || interrupted(done.get() as f64),
        )
    }
}

impl<'a> Planned<'a> {
    fn worker<R: Lane>(&self, width: usize) -> Worker<'_, R> {
        let (template, duration) = (&self.ensemble.members.template, self.asked.duration.row(0)[0]);
        // Timings that start with a command need a separate schedule for each member.
        let beside = self.kernel != Kernel::Scalar && template.timings.is_empty();
        Worker {
            planned: self,
            members: self.ensemble.members.clone(),
            follower: Reducer::new(template, &self.asked.outputs, duration),
            side_by_side: beside.then(|| Reducer::new(template, &self.asked.outputs, duration)),
            width,
        }
    }
}

impl<R: Lane> Worker<'_, R> {
    fn run_all(&mut self, members: Range<usize>, stop: &AtomicBool) -> Vec<Came> {
        if let Some(mut follower) = self.side_by_side.take() {
            let came = lanes::run(self, &mut follower, members, stop);
            self.side_by_side = Some(follower);
            return came;
        }
        members.map_while(|member| (!stop.load(Ordering::Relaxed)).then(|| self.run(member, stop))).collect()
    }
}
