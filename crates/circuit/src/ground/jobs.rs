//! Runs jobs on several threads, while the caller checks whether to continue.

use crate::ground::Error;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::mpsc;
use std::time::{Duration, Instant};

/// Time between two checks for an interruption.
const LOOK: Duration = Duration::from_millis(20);
/// Stack of a thread, bytes. Numbers with second derivatives are large.
const STACK: usize = 16 << 20;

/// Runs the jobs 0 to `jobs - 1` on at most `threads` threads. Each thread makes its worker by `worker`. `work` runs a
/// job, and receives a flag that tells it to stop early. `take` receives each result on the caller's thread, in
/// any order. Returns false if `interrupted` has requested a stop. Results taken before then stay valid.
pub fn run_jobs<W, T: Send>(
    (threads, jobs): (usize, usize),
    worker: impl Fn() -> W + Sync,
    work: impl Fn(&mut W, usize, &AtomicBool) -> T + Sync,
    mut take: impl FnMut(usize, T) -> Result<(), Error>,
    interrupted: &mut dyn FnMut() -> bool,
) -> Result<bool, Error> {
    let (next, stop) = (AtomicUsize::new(0), AtomicBool::new(false));
    std::thread::scope(|scope| {
        let (sender, receiver) = mpsc::channel();
        for _ in 0..threads.clamp(1, jobs.max(1)) {
            let (sender, next, stop, worker, work) = (sender.clone(), &next, &stop, &worker, &work);
            let all = move || {
                let mut own = worker();
                loop {
                    let job = next.fetch_add(1, Ordering::Relaxed);
                    if job >= jobs || stop.load(Ordering::Relaxed) {
                        return;
                    }
                    let done = work(&mut own, job, stop);
                    if sender.send((job, done)).is_err() {
                        return;
                    }
                }
            };
            let thread = std::thread::Builder::new().stack_size(STACK);
            thread.spawn_scoped(scope, all).map_err(|e| Error::Stopped(format!("no thread: {e}")))?;
        }
        drop(sender);
        let mut looked = Instant::now();
        let done = loop {
            match receiver.recv_timeout(LOOK) {
                Ok((job, done)) => {
                    if let Err(error) = take(job, done) {
                        break Err(error);
                    }
                }
                Err(mpsc::RecvTimeoutError::Timeout) => {}
                Err(mpsc::RecvTimeoutError::Disconnected) => break Ok(()),
            }
            if looked.elapsed() >= LOOK {
                if interrupted() {
                    stop.store(true, Ordering::Relaxed);
                }
                looked = Instant::now();
            }
        };
        // A thread stops early if its piece is no longer needed.
        let stopped = stop.swap(true, Ordering::Relaxed);
        done.map(|()| !stopped)
    })
}
