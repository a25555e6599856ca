//! Course that a law follows: a reference or a place of rest, and the path to it from the present state.

use crate::number::Number;
use crate::reference::{PEAKS, Reference, Wanted, series};
use crate::thresholds::{RETURN_LEAST_TIME, STOP_LEAST_TIME};

/// A path that starts with a distance, a speed and an acceleration and ends with all three at zero. It has three
/// continuous derivatives. With the fraction s of its duration T, it is
///
///   x_0 (1-s)^4 (1 + 4 s + 10 s^2 + 20 s^3) + v_0 T s (1-s)^4 (1 + 4 s + 10 s^2) + a_0 T^2 s^2/2 (1-s)^4 (1 + 4 s)
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Fade<S = f64> {
    /// Time at which it begins, s.
    pub begin: S,
    /// Duration, s.
    pub duration: S,
    /// Distance, m, speed, m/s, and acceleration, m/s2, at the start.
    pub from: [S; 3],
}

/// Returns (1 - s)^4 p(s) for the coefficients of p, and three derivatives.
fn faded<S: Number>(p: [S; 4], s: S) -> [S; 4] {
    let [p0, p1, p2, p3] = series(&p, s);
    let r = S::one() - s;
    let square = r * r;
    let [q0, q1, q2, q3] = [square * square, (square * r).times(-4.0), square.times(6.0), r.times(-4.0)];
    // Products of series, then the factorials.
    [
        p0 * q0,
        p1 * q0 + p0 * q1,
        (p2 * q0 + p1 * q1 + p0 * q2).times(2.0),
        (p3 * q0 + p2 * q1 + p1 * q2 + p0 * q3).times(6.0),
    ]
}

impl<S: Number> Fade<S> {
    /// Returns distance and derivatives at a time, s. All are zero after its end.
    pub fn at(&self, t: S) -> Wanted<S> {
        let s = ((t - self.begin) / self.duration).within(0.0, 1.0);
        let [x, v, a] = self.from;
        let (v, a) = (v * self.duration, (a * self.duration * self.duration).times(0.5));
        let p = [
            x,
            x.times(4.0) + v,
            x.times(10.0) + v.times(4.0) + a,
            x.times(20.0) + v.times(10.0) + a.times(4.0),
        ];
        Wanted::at_rate(faded(p, s), S::one() / self.duration)
    }

    /// Returns the time at which the path ends, s.
    pub fn end(&self) -> S {
        self.begin + self.duration
    }

    /// Returns a path to rest, and the place where it ends, m. The path begins with a position, a speed and an
    /// acceleration. The deceleration, m/s2, is increased if the path would need more than `room`, m.
    pub fn stop(begin: S, [x, v, a]: [S; 3], deceleration: S, room: S) -> (Self, S) {
        let a = a.max(-deceleration).min(deceleration);
        let (zero, least) = (S::zero(), S::c(STOP_LEAST_TIME));
        // The speed falls as 1 - 10 s^3 + 15 s^4 - 6 s^5. The distance is half of v T, and the steepest fall is 1.875
        // v/T.
        let way = |a: S, duration: S| duration * (v.times(0.5) + (a * duration).times(0.1));
        let usual = (v.abs().times(STEEPEST) / deceleration).max(least);
        let sign = S::select(v.lt(zero), S::c(-1.0), S::one());
        let is_short = room.lt(way(a, usual) * sign);
        let shorter = room.max(zero).times(2.0) / v.abs().max(S::c(f64::MIN_POSITIVE));
        let duration = S::select(is_short, shorter.max(least).min(usual), usual);
        let a = S::select(is_short, zero, a);
        let end = x + way(a, duration);
        (Fade { begin, duration, from: [x - end, v, a] }, end)
    }
}

impl Fade {
    /// Returns a path back to a reference, with a limited acceleration, m/s2. The path starts with a distance, a speed
    /// and an acceleration relative to the reference.
    pub fn back(begin: f64, from: [f64; 3], acceleration: f64) -> Self {
        let [x, v, _] = from;
        let duration = (PEAKS[1] * x.abs() / acceleration).sqrt().max(STEEPEST * v.abs() / acceleration);
        Fade { begin, duration: duration.max(RETURN_LEAST_TIME), from }
    }
}

/// Largest deceleration of a path to rest, relative to the mean deceleration.
const STEEPEST: f64 = 1.875;

/// Course that a law follows.
#[derive(Clone, Copy, Debug)]
pub struct Course<'a> {
    /// The reference; `None` if the drive is at rest.
    pub(crate) reference: Option<&'a Reference>,
    /// Place at which a path ends without a reference, m.
    pub(crate) stands_at: f64,
    /// A path to that place, or back to the reference, which fades out.
    pub(crate) fade: Option<Fade>,
}

impl<'a> From<&'a Reference> for Course<'a> {
    fn from(reference: &'a Reference) -> Self {
        Course { reference: Some(reference), stands_at: 0.0, fade: None }
    }
}

impl<'a> Course<'a> {
    /// Returns the reference, if no path is added to it.
    pub fn reference(&self) -> Option<&'a Reference> {
        self.reference.filter(|_| self.fade.is_none())
    }

    /// Returns the wanted state at a time, s.
    pub fn at(&self, t: f64) -> Wanted {
        let base = match self.reference {
            Some(reference) => reference.at(t),
            None => Wanted { position: self.stands_at, ..Wanted::default() },
        };
        let Some(fade) = self.fade else { return base };
        base.zip(&fade.at(t), |base, own| base + own)
    }

    /// Returns the growth of the load from one time to another, s, and the rate of the load then: N and N/s.
    pub fn load_growth(&self, from: f64, to: f64) -> [f64; 2] {
        let Some(reference) = self.reference else { return [0.0; 2] };
        let at = |t: f64| reference.effort(t).map(|own| [own.load, own.load_rate]);
        at(from).zip(at(to)).map_or([0.0; 2], |([before, _], [load, rate])| [load - before, rate])
    }

    /// Returns whether the course is at rest for `span` s from a time on.
    pub fn stands(&self, t: f64, span: f64) -> bool {
        self.fade.is_none_or(|fade| fade.end() <= t)
            && self.reference.is_none_or(|reference| reference.stands(t, span))
    }
}
