use super::{At, InnerState};
use crate::parameter::{above, any, at_least, between};
use math::{Lane, Over, Real};

/// Growth of friction with the age phi of the contact.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Growth {
    /// 1 - exp(-(phi/tau)^m): bounded. Source: [kato1972].
    Saturating,
    /// ln(1 + phi/tau): without bound, so for the decades of age that were measured. Source: [dieterich1979].
    Logarithmic,
    /// phi/(phi + tau): bounded. Source: [armstrong1994].
    Hyperbolic,
}

impl Growth {
    /// Every growth that a description can name.
    pub const ALL: [Growth; 3] = [Growth::Saturating, Growth::Logarithmic, Growth::Hyperbolic];

    /// Its name in a description.
    pub const fn key(self) -> &'static str {
        match self {
            Growth::Saturating => "saturating",
            Growth::Logarithmic => "log",
            Growth::Hyperbolic => "hyperbolic",
        }
    }

    /// Key in references.bib.
    pub const fn source(self) -> &'static str {
        match self {
            Growth::Saturating => "kato1972",
            Growth::Logarithmic => "dieterich1979",
            Growth::Hyperbolic => "armstrong1994",
        }
    }

    /// Psi at phi/tau; the exponent is that of the saturating growth.
    #[inline(always)]
    pub fn at<S: Real>(self, ratio: S, exponent: S) -> S {
        match self {
            Growth::Saturating => S::one() - (-ratio.max(S::c(SMALLEST_RATIO)).pow(exponent)).exp(),
            Growth::Logarithmic => (S::one() + ratio.max(S::zero())).ln(),
            Growth::Hyperbolic => {
                let ratio = ratio.max(S::zero());
                ratio / (ratio + S::one())
            }
        }
    }
}

/// (phi/tau) below this is taken as this in the saturating growth, whose slope at zero would be infinite: it
/// changes the level by less than 2e-5 of the increment for exponents from 0.4.
const SMALLEST_RATIO: f64 = 1e-12;

/// The speed, m/s, up to which the age of sliding is resolved accurately enough for the level.
const FAST: f64 = 1.0;

/// The longest stop that warnings consider, s: a day.
pub(super) const LONGEST_STOP: f64 = 86_400.0;

/// Largest gap between bristles and their limit at breakaway, share of the increment: the
/// peak loses less than this of it. Assumed; a smaller one makes flatter peaks.
const LACKING: f64 = 0.04;

/// The least such gap, share of the limit, so that small increments do not make a kink.
const LEAST_LACKING: f64 = 1.5e-3;

/// Sliding slower than this, m/s, ages like this: a contact of a million years.
const SLOWEST: f64 = 1e-18;

crate::parameters! {
    /// Friction that grows with the age of the contact (dwell), on any law:
    ///
    ///   dphi/dt = (1 - phi |w|/L) r        age of the contact                 s
    ///   Fd = b0 (1 + b_a (p_a - p_amb) + b_b (p_b - p_amb)) Psi(phi)          [N], added to Fc and Fs
    ///   r = 1 while phi |w| < L; else from 0 to 1 (a smooth step) as w/v goes from 1 - e to 1,
    ///   e = max(0.04 Fd/Fs, 0.0015), with the Fs that holds at that age
    ///
    /// w is the plastic slip rate (v - dz/dt for bristles, v for a law that sticks exactly), so that the
    /// elastic motion before breakaway renews nothing. Nor does the creep of bristles that have not reached
    /// their limit: it stops the ageing, but only slip of the whole contact (w = v) makes it younger. In a
    /// stop phi grows as time; in steady sliding phi = L/|v|. The stiffness of bristles does not depend on
    /// phi: their store stays that of the law, and so does passivity, with Fs + Fd as breakaway force.
    /// Source: [dieterich1979] for phi; r is assumed (docs/theory/friction.md); for Psi see [`Growth`].
    pub struct Dwell {
        /// Increment b0
        increment: "N", at_least(0.0);
        /// Time tau of the growth
        time: "s", above(0.0);
        /// Exponent m of the saturating growth
        exponent: "-", between(0.0, 2.0), default 0.4;
        /// Sliding distance L that renews the contact
        distance: "m", above(0.0);
        /// Share b_a by which the increment grows with the gauge pressure in chamber a
        pressure_a: "1/Pa", any(), default 0.0;
        /// Share b_b by which the increment grows with the gauge pressure in chamber b
        pressure_b: "1/Pa", any(), default 0.0;
    } with {
        /// Psi, growth of the increment with phi
        growth: Growth,
        /// Absolute error scale of phi, s
        scale: f64,
    }
}

impl<R: Lane> Dwell<R> {
    /// From the values of [`Dwell::PARAMETERS`], in their order.
    pub fn new(
        growth: Growth,
        [increment, time, exponent, distance, pressure_a, pressure_b]: [R; 6],
    ) -> Self {
        // An error of phi must not cost more than the same share of b0: where Psi is nearly linear below
        // tau, tau itself; where it rises steeply from zero, the age at which m (phi/tau)^m is that share.
        let time_s = time.get(0);
        let scale = match growth {
            Growth::Logarithmic | Growth::Hyperbolic => time_s,
            Growth::Saturating => {
                let (youngest, exponent) = (distance.get(0) / FAST, exponent.get(0));
                time_s.min(youngest * (time_s / youngest).powf(exponent) / exponent)
            }
        };
        Dwell { increment, time, exponent, distance, pressure_a, pressure_b, growth, scale }
    }
}

impl Dwell<f64> {
    /// The greatest increment that a stop can leave, N, at these gauge pressures.
    pub(super) fn largest(&self, at: &At<f64>) -> f64 {
        self.increment(at, LONGEST_STOP)
    }
}

/// Its state.
pub(super) const STATE: &str = "contact_age_s";

impl<P: Real> Dwell<P> {
    pub(super) fn state(&self) -> InnerState {
        InnerState { name: STATE, unit: "s", scale: self.scale }
    }

    /// Psi(phi).
    #[inline(always)]
    fn growth<S: Over<P>>(&self, age: S) -> S {
        self.growth.at(age / S::from(self.time), S::from(self.exponent))
    }

    /// Fd at the age phi, N.
    #[inline(always)]
    pub fn increment<S: Over<P>>(&self, at: &At<S>, age: S) -> S {
        let pressed = S::from(self.pressure_a).fma(at.gauge_a, S::from(self.pressure_b) * at.gauge_b);
        S::from(self.increment) * (S::one() + pressed).max(S::zero()) * self.growth(age)
    }

    /// dphi/dt for the plastic slip rate w, and the share that the increment has of the breakaway force.
    #[inline(always)]
    pub fn rate<S: Over<P>>(&self, age: S, v: S, slip: S, share: S) -> S {
        let o = S::one();
        let left = o - age * slip.abs() / S::from(self.distance);
        // At rest nothing slips as a whole, whatever relaxes.
        let along = S::select(S::zero().lt(v), slip, S::zero());
        let forwards = S::select(v.lt(S::zero()), -slip, along) / v.abs().max(S::c(SLOWEST));
        let lacking = (S::c(LACKING) * share).max(S::c(LEAST_LACKING));
        let way = (o - (o - forwards) / lacking).max(S::zero()).min(o);
        left * S::select(left.lt(S::zero()), way * way * (S::c(3.0) - way - way), o)
    }

    /// Age in steady sliding at velocity v, s.
    pub fn steady<S: Over<P>>(&self, v: S) -> S {
        S::from(self.distance) / v.abs().max(S::c(SLOWEST))
    }
}
