//! Members side by side in the lanes of one register. Each has its own time, step and commands. A finished
//! member makes room for the next. No member depends on its neighbours.

use crate::reduction::Reducer;
use crate::worker::{Came, MemberStatus, Worker};
use circuit::{Circuit, failure_of};
use math::Lane;
use ode::{Output, Stepper};
use std::ops::Range;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// Step attempts between two checks of the stop flag.
const LOOK: u64 = 5000;

/// A member in a lane.
struct Seat {
    member: usize,
    /// Equations of the member, with the current inputs and modes.
    circuit: Circuit<f64>,
    /// Pending commands in reverse order: the first one is last.
    due: Vec<(f64, usize, f64)>,
    duration: f64,
}

impl Seat {
    /// Returns the next time to reach, s.
    fn target(&self) -> f64 {
        self.due.last().map_or(self.duration, |due| due.0)
    }
}

/// Waiting members, and the results of finished ones.
struct Queue<'w, 'a, R: Lane> {
    worker: &'w mut Worker<'a, R>,
    waiting: Range<usize>,
    first: usize,
    came: Vec<Option<Came>>,
}

impl<R: Lane> Queue<'_, '_, R> {
    fn enter(&mut self, member: usize, came: Came) {
        self.came[member - self.first] = Some(came);
    }

    /// Returns the next member whose circuit has the topology of the others, with its start. Members of another
    /// topology are run immediately, one at a time.
    fn next(&mut self, stop: &AtomicBool) -> Option<(Seat, Vec<f64>)> {
        loop {
            let member = self.waiting.next()?;
            let planned = self.worker.planned;
            let assembly = match self.worker.member(member) {
                Ok(assembly) => assembly,
                Err(error) => {
                    self.enter(member, Came::refused(&error));
                    continue;
                }
            };
            if !assembly.circuit.shares_analysis(&planned.ensemble.members.template.circuit) {
                let came = self.worker.run_alone(&assembly, member, stop);
                self.enter(member, came);
                continue;
            }
            let template = &planned.ensemble.members.template;
            let circuit = Arc::unwrap_or_clone(assembly.circuit);
            let (circuit, y) = self.worker.start(circuit, template, member);
            let mut due = planned.due(member);
            due.reverse();
            let mut seat = Seat { member, circuit, due, duration: planned.asked.duration.row(member)[0] };
            while let Some((_, input, value)) = seat.due.pop_if(|due| due.0 <= 0.0) {
                template.set(&mut seat.circuit, input, 0, value);
            }
            return Some((seat, y));
        }
    }
}

/// Runs members and returns their results in order. The list is shorter after a stop.
pub(crate) fn run<R: Lane>(
    worker: &mut Worker<'_, R>,
    follower: &mut Reducer<'_, R>,
    members: Range<usize>,
    stop: &AtomicBool,
) -> Vec<Came> {
    let came = members.clone().map(|_| None).collect();
    let mut queue = Queue { worker, first: members.start, waiting: members, came };
    while !stop.load(Ordering::Relaxed) {
        let begun: Vec<_> = std::iter::from_fn(|| queue.next(stop)).take(R::L).collect();
        if begun.is_empty() {
            break;
        }
        Group::new(&mut queue, follower, begun).run(stop);
    }
    queue.came.into_iter().map_while(|came| came).collect()
}

/// Running members.
struct Group<'g, 'w, 'a, 'f, R: Lane> {
    queue: &'g mut Queue<'w, 'a, R>,
    follower: &'g mut Reducer<'f, R>,
    stepper: Stepper<R, Circuit<R>>,
    seats: Vec<Option<Seat>>,
}

/// Circuit of the lanes. A lane without a member has the numbers of another lane.
fn gathered<R: Lane>(seats: &[Option<Seat>]) -> Circuit<R> {
    let any = seats.iter().flatten().next().expect("a member");
    let each: Vec<_> = seats.iter().map(|seat| &seat.as_ref().unwrap_or(any).circuit).collect();
    Circuit::gather(&each)
}

impl<'g, 'w, 'a, 'f, R: Lane> Group<'g, 'w, 'a, 'f, R> {
    fn new(
        queue: &'g mut Queue<'w, 'a, R>,
        follower: &'g mut Reducer<'f, R>,
        begun: Vec<(Seat, Vec<f64>)>,
    ) -> Self {
        let (seats, starts): (Vec<Seat>, Vec<Vec<f64>>) = begun.into_iter().unzip();
        let start = |lane: usize| starts.get(lane).unwrap_or(&starts[0]);
        let y: Vec<R> = (0..starts[0].len()).map(|i| R::from_lanes(|lane| start(lane)[i])).collect();
        let mut seats: Vec<Option<Seat>> = seats.into_iter().map(Some).collect();
        (0..seats.len()).for_each(|lane| follower.init(lane));
        seats.resize_with(R::L, || None);
        let planned = queue.worker.planned;
        let mut stepper = Stepper::new(gathered(&seats), 0.0, &y, planned.options);
        for (lane, seat) in seats.iter().enumerate() {
            stepper.allow_in(lane, seat.as_ref().map_or(0, |seat| planned.budget(seat.member)));
        }
        Group { queue, follower, stepper, seats }
    }

    /// Runs until no member is left or a stop is requested.
    fn run(mut self, stop: &AtomicBool) {
        while !stop.load(Ordering::Relaxed) {
            let target = |seat: &Option<Seat>| seat.as_ref().map_or(f64::NEG_INFINITY, Seat::target);
            let until: Vec<f64> = self.seats.iter().map(target).collect();
            if until.iter().all(|until| *until == f64::NEG_INFINITY) {
                return;
            }
            self.stepper.advance_each(&until, LOOK, self.follower);
            for lane in 0..R::L {
                self.attend(lane);
            }
            // Activated surfaces are stored for all lanes together, so running members finish first.
            if self.seats.iter().any(Option::is_none) && !self.stepper.system().has_met() {
                self.refill(stop);
            }
        }
    }

    /// Applies the next command of a lane that reached its time, or stores its result.
    fn attend(&mut self, lane: usize) {
        let Some(seat) = &mut self.seats[lane] else { return };
        let failure = failure_of(&self.stepper, lane);
        let now = self.stepper.time(lane);
        if failure.is_none() && now < seat.target() {
            return;
        }
        if failure.is_none() && !seat.due.is_empty() {
            let template = &self.queue.worker.planned.ensemble.members.template;
            self.follower.changes(lane, self.stepper.system());
            while let Some((_, input, value)) = seat.due.pop_if(|due| due.0 <= now) {
                template.set(&mut seat.circuit, input, 0, value);
                template.set(self.stepper.system_mut(), input, lane, R::c(value));
            }
            return;
        }
        let attempts = self.stepper.statistics(lane).factorisations;
        let mut row = Vec::new();
        if failure.is_none() {
            row.resize(self.queue.worker.width, f64::NAN);
            let mut y = self.stepper.state().to_vec();
            let circuit = self.stepper.system();
            ode::System::settle(circuit, &mut y);
            self.follower.finish(lane, (seat.duration, &y), circuit, &mut row);
        }
        let came = Came { row, failure: failure.map(|reason| (MemberStatus::Stopped, reason)), attempts };
        let member = seat.member;
        self.queue.enter(member, came);
        self.seats[lane] = None;
    }

    /// Puts the next members into empty lanes.
    fn refill(&mut self, stop: &AtomicBool) {
        let mut starts = Vec::new();
        for lane in 0..R::L {
            if self.seats[lane].is_none()
                && let Some((seat, y)) = self.queue.next(stop)
            {
                self.seats[lane] = Some(seat);
                starts.push((lane, y));
            }
        }
        if starts.is_empty() {
            return;
        }
        let system = self.stepper.system_mut();
        let mut modes = Vec::new();
        system.change_modes(|mode| modes.push(*mode));
        for (lane, seat) in self.seats.iter_mut().enumerate() {
            let is_new = starts.iter().any(|(new, _)| *new == lane);
            if let (Some(seat), false) = (seat, is_new) {
                let mut modes = modes.iter();
                seat.circuit.change_modes(|mode| *mode = modes.next().map_or(0.0, |mode| mode.get(lane)));
            }
        }
        *system = gathered(&self.seats);
        for (lane, y) in starts {
            self.stepper.load(lane, 0.0, &y);
            let member = self.seats[lane].as_ref().map(|seat| seat.member);
            let planned = self.queue.worker.planned;
            self.stepper.allow_in(lane, member.map_or(0, |member| planned.budget(member)));
            self.follower.init(lane);
        }
    }
}
