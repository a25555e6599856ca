use crate::friction::{At, InnerState};
use crate::parameter::{above, any, at_least, between};
use math::{Lane, Over, Real};
use serde::Deserialize;

/// Growth of friction with the age phi of the contact.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Growth {
    /// 1 - exp(-(phi/tau)^m): bounded. Source: [kato1972].
    Saturating,
    /// ln(1 + phi/tau): without bound, and therefore for the measured decades of age only. Source: [dieterich1979].
    #[serde(rename = "log")]
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

    /// Returns Psi at phi/tau. The exponent belongs to the saturating growth.
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

/// Lower limit of phi/tau in the saturating growth, whose slope at zero would be infinite. It changes the level by less
/// than 2e-5 of the increment for exponents from 0.4.
const SMALLEST_RATIO: f64 = 1e-12;

/// Speed, m/s, up to which the age in sliding is resolved accurately enough for the level.
const FAST: f64 = 1.0;

/// Longest stop that warnings consider, s: a day.
pub(in crate::friction) const LONGEST_STOP: f64 = 86_400.0;

/// Largest distance of bristles from their limit at breakaway, relative to the increment. The peak loses less than this
/// fraction of the increment. Assumed: a smaller value makes flatter peaks.
const LACKING: f64 = 0.04;

/// Least such distance, relative to the limit, so that small increments do not cause a kink.
const LEAST_LACKING: f64 = 1.5e-3;

/// Lower limit of the sliding speed for ageing, m/s: a contact of a million years.
const SLOWEST: f64 = 1e-18;

crate::parameters! {
    /// Friction that grows with the age of the contact (dwell), on any law:
    ///
    ///   `dphi/dt = (1 - phi |w|/L) r        age of the contact                 s`
    ///   `Fd = b0 (1 + b_a (p_a - p_amb) + b_b (p_b - p_amb)) Psi(phi)          [N], added to Fc and Fs`
    ///   `r = 1 while phi |w| < L; else from 0 to 1 (a smooth step) as w/v goes from 1 - e to 1,`
    ///   `e = max(0.04 Fd/Fs, 0.0015), with the Fs at that age`
    ///
    /// Here w is the plastic slip rate: v - dz/dt for bristles, v for a law that sticks exactly. The elastic motion
    /// before breakaway therefore renews nothing. The creep of bristles below their limit does not renew the contact
    /// either. It stops the ageing, but only
    /// slip of the whole contact (w = v) makes the contact younger. During a stop, phi grows with time. In steady
    /// sliding,
    /// phi = L/|v|. The stiffness of bristles does not depend on phi. Their stored energy is therefore that of the law,
    /// which keeps passivity, with Fs + Fd as breakaway force. Sources: [dieterich1979] for phi. The factor r is
    /// assumed (docs/theory/friction.md). For Psi see [`Growth`].
    pub struct Dwell {
        /// Increment b0
        increment: "N", at_least(0.0);
        /// Time tau of the growth
        time: "s", above(0.0);
        /// Exponent m of the saturating growth
        exponent: "-", between(0.0, 2.0), default 0.4;
        /// Sliding distance L that renews the contact
        distance: "m", above(0.0);
        /// Relative growth b_a of the increment with the gauge pressure in chamber a
        pressure_a: "1/Pa", any(), default 0.0;
        /// Relative growth b_b of the increment with the gauge pressure in chamber b
        pressure_b: "1/Pa", any(), default 0.0;
    } with {
        /// Psi, growth of the increment with phi
        growth: Growth,
        /// Absolute error scale of phi, s
        scale: f64,
    }
}

impl<R: Lane> Dwell<R> {
    /// Creates it from the values of [`Dwell::PARAMETERS`], in their order.
    pub fn new(growth: Growth, values: &[R]) -> Self {
        // Returns the error scale of phi: an error of phi must not cost more than the same fraction of b0. If Psi is
        // nearly linear below tau, this is tau itself. If Psi rises steeply from zero, it is the age at which m
        // (phi/tau)^m equals that fraction.
        let mut dwell = Dwell::from_values(values, growth, values[1].get(0));
        if growth == Growth::Saturating {
            let (youngest, exponent) = (dwell.distance.get(0) / FAST, dwell.exponent.get(0));
            dwell.scale = dwell.scale.min(youngest * (dwell.scale / youngest).powf(exponent) / exponent);
        }
        dwell
    }
}

/// Name of its state.
pub(in crate::friction) const STATE: &str = "contact_age_s";

impl<P: Real> Dwell<P> {
    pub(in crate::friction) fn state(&self) -> InnerState {
        InnerState { name: STATE, unit: "s", scale: self.scale }
    }

    /// Returns Psi(phi).
    #[inline(always)]
    fn growth<S: Over<P>>(&self, age: S) -> S {
        self.growth.at(age / S::from(self.time), S::from(self.exponent))
    }

    /// Returns Fd at the age phi, N.
    #[inline(always)]
    pub fn increment<S: Over<P>>(&self, at: &At<S>, age: S) -> S {
        let pressed = S::from(self.pressure_a).fma(at.gauge_a, S::from(self.pressure_b) * at.gauge_b);
        S::from(self.increment) * (S::one() + pressed).max(S::zero()) * self.growth(age)
    }

    /// Returns dphi/dt for the plastic slip rate w, and the increment relative to the breakaway force.
    #[inline(always)]
    pub fn rate<S: Over<P>>(&self, age: S, v: S, slip: S, share: S) -> S {
        let o = S::one();
        let left = o - age * slip.abs() / S::from(self.distance);
        // At rest, the contact as a whole does not slip, even during relaxation.
        let along = S::select(S::zero().lt(v), slip, S::zero());
        let forwards = S::select(v.lt(S::zero()), -slip, along) / v.abs().max(S::c(SLOWEST));
        let lacking = (S::c(LACKING) * share).max(S::c(LEAST_LACKING));
        let way = (o - (o - forwards) / lacking).max(S::zero()).min(o);
        left * S::select(left.lt(S::zero()), way * way * (S::c(3.0) - way - way), o)
    }

    /// Returns the age in steady sliding at velocity v, s.
    pub fn steady<S: Over<P>>(&self, v: S) -> S {
        S::from(self.distance) / v.abs().max(S::c(SLOWEST))
    }
}
