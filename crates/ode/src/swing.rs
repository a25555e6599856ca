//! Count of the half swings of a mass at its present energy.

/// Half swings whose errors may add up at this relative tolerance or a looser one. Tighter tolerances allow
/// proportionally more. 99.9 % of typical drives lose their energy sooner (assumed).
const FREE_SWINGS: f64 = 20.0;
const LOOSE_RTOL: f64 = 3e-6;
/// Least fraction of the tolerance, because more work gains little (assumed).
const LEAST_SHARE: f64 = 0.2;
/// Half swings that are evaluated together. The largest speed of a single half swing is not known, because
/// steps may end anywhere.
const TOGETHER: f64 = 8.0;
/// A mass rests if its speed stays below this fraction of its largest speed for this fraction of a half
/// swing.
const RESTING_SPEED: f64 = 0.01;
const RESTING_TIME: f64 = 0.1;

/// Follows one velocity. A bouncing mass keeps its energy and the errors of all steps, which mostly have one
/// sign. The half swings since the last energy input are therefore counted. The weight of each is its
/// remaining energy relative to the energy that the system declares, at most one.
#[derive(Clone, Debug)]
pub(crate) struct Swing {
    pub state: usize,
    /// Inverse of the speed at the declared energy, s/m.
    inverse_speed: f64,
    free: f64,
    pub memory: SwingMemory,
}

/// History of a `Swing`.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct SwingMemory {
    /// Weighted number of half swings.
    pub count: f64,
    /// Largest speed of the last evaluated half swings, and of those since then.
    pub before: f64,
    pub peak: f64,
    /// Number of half swings since then.
    pub turns: f64,
    /// A velocity in the present direction.
    pub towards: f64,
    /// Duration of the present half swing, and rest time of the mass in it, s.
    pub time: f64,
    pub resting: f64,
}

impl Swing {
    pub fn new(state: usize, speed: f64, rtol: f64) -> Self {
        let free = FREE_SWINGS * (LOOSE_RTOL / rtol).max(1.0);
        Swing { state, inverse_speed: 1.0 / speed, free, memory: SwingMemory::default() }
    }

    /// Updates the count after a step of length `h` from velocity `v0` to `v`. Returns true if the count may
    /// have changed.
    #[inline(always)]
    pub fn step(&mut self, h: f64, v0: f64, v: f64) -> bool {
        let SwingMemory { peak, towards, time, resting, .. } = &mut self.memory;
        let slow = RESTING_SPEED * *peak;
        let rests = v.abs() <= slow;
        *time += h;
        *resting += if rests && v0.abs() <= slow { h } else { 0.0 };
        *peak = peak.max(v.abs());
        // A resting mass moves back and forth only by the errors of the steps. This is not a turn.
        let turns = !rests && v * *towards <= 0.0;
        if turns {
            self.turn(v);
        }
        turns
    }

    #[inline(never)]
    fn turn(&mut self, v: f64) {
        let was = self.memory;
        let now = SwingMemory { turns: was.turns + 1.0, towards: v, time: 0.0, resting: 0.0, ..was };
        self.memory = if was.resting > RESTING_TIME * was.time {
            SwingMemory { count: 0.0, before: 0.0, peak: v.abs(), turns: 0.0, ..now }
        } else if now.turns < TOGETHER {
            now
        } else {
            let kept = if was.before > 0.0 { (was.peak / was.before).powi(2).min(1.0) } else { 0.0 };
            let own = (was.peak * self.inverse_speed).powi(2).min(1.0);
            SwingMemory {
                count: kept * was.count + TOGETHER * own,
                before: was.peak,
                peak: v.abs(),
                turns: 0.0,
                ..now
            }
        };
    }

    /// Returns the fraction of the tolerance for each step. It falls with the root of the number of half
    /// swings, so that errors of one sign add up no faster than other errors.
    pub fn share(&self) -> f64 {
        (self.free / self.memory.count).sqrt().clamp(LEAST_SHARE, 1.0)
    }
}

#[cfg(test)]
#[path = "../tests/unit/swing.rs"]
mod tests;
