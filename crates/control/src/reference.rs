//! Reference of a drive: position with its derivatives over time.

use crate::number::{Number, memory};
use serde::Deserialize;
use std::f64::consts::TAU;

memory! {
    /// Wanted state of a drive at one time.
    #[derive(PartialEq)]
    pub struct Wanted<S> {
        /// Position, m.
        pub position: S,
        /// Velocity, m/s.
        pub velocity: S,
        /// Acceleration, m/s2.
        pub acceleration: S,
        /// Jerk, m/s3.
        pub jerk: S,
    }
}

math::mapped!(Wanted { position, velocity, acceleration, jerk });

/// Largest derivatives of a blend: 35/16, 84/(5 sqrt 5) and 105/2.
pub const PEAKS: [f64; 3] = [2.1875, 7.513188404399293, 52.5];

impl<S: Number> Wanted<S> {
    /// Returns position and derivatives in their order.
    pub fn numbers(&self) -> [S; 4] {
        [self.position, self.velocity, self.acceleration, self.jerk]
    }

    /// Converts derivatives over a fraction of time to derivatives over time; `rate` is one over the time, 1/s.
    pub fn at_rate([position, v, a, j]: [S; 4], rate: S) -> Self {
        Wanted { position, velocity: v * rate, acceleration: a * rate * rate, jerk: j * (rate * rate * rate) }
    }
}

/// Returns a polynomial and three derivatives over their factorials, by Horner's rule. The coefficients are those of
/// the powers 0, 1, ..
pub fn series<S: Number>(coefficients: &[S], at: S) -> [S; 4] {
    let [mut p0, mut p1, mut p2, mut p3] = [S::zero(); 4];
    for own in coefficients.iter().rev() {
        p3 = p3 * at + p2;
        p2 = p2 * at + p1;
        p1 = p1 * at + p0;
        p0 = p0 * at + *own;
    }
    [p0, p1, p2, p3]
}

/// Returns a blend from 0 to 1 over the time 0 .. 1 and its three continuous derivatives:
///
///   s = 35 t^4 - 84 t^5 + 70 t^6 - 20 t^7
///
/// Its largest derivatives are [`PEAKS`].
pub fn blend<S: Number>(t: S) -> [S; 4] {
    let t = t.within(0.0, 1.0);
    let r = S::one() - t;
    let (square, both, apart) = (t * t, t * r, r - t);
    [
        square * square * (S::c(35.0) + t * (S::c(-84.0) + t * (S::c(70.0) - t.times(20.0)))),
        (both * both * both).times(140.0),
        (both * both).times(420.0) * apart,
        t.times(840.0) * r * (apart * apart - both),
    ]
}

/// Returns the wanted state on a move, by its blend; `rate` is one over the duration, 1/s.
pub fn between<S: Number>([from, to]: [S; 2], [s, v, a, j]: [S; 4], rate: S) -> Wanted<S> {
    let way = to - from;
    Wanted {
        position: from + way * s,
        velocity: way * rate * v,
        acceleration: way * rate * rate * a,
        jerk: way * (rate * rate * rate) * j,
    }
}

/// A motion of a reference.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(tag = "kind", rename_all = "lowercase", deny_unknown_fields)]
pub enum Reference {
    /// Moves, one after the other. The reference rests at the start before the first move.
    Moves {
        /// Position at the start, m.
        #[serde(rename = "start_m")]
        start: f64,
        /// The entries in the order of their times.
        moves: Vec<Move>,
    },
    /// A sine about a centre. Its amplitude grows from zero within the first period.
    Sine {
        /// Centre, m.
        #[serde(rename = "centre_m")]
        centre: f64,
        /// Amplitude, m.
        #[serde(rename = "amplitude_m")]
        amplitude: f64,
        /// Frequency, Hz.
        #[serde(rename = "frequency_hz")]
        frequency: f64,
    },
    /// Polynomials, one after the other. Between two of them, the reference rests where the first one ends.
    Pieces {
        /// Position at the start, m.
        #[serde(rename = "start_m")]
        start: f64,
        /// The entries in the order of their times.
        pieces: Vec<Piece>,
        /// Moving mass and load along them; `None`: those of the model.
        #[serde(default)]
        efforts: Option<Efforts>,
    },
}

/// Moving mass and load of a drive at times at equal distances. The first one is at time zero.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Efforts {
    /// Distance of the times, s.
    #[serde(rename = "period_s")]
    pub period: f64,
    /// One entry for each time.
    pub rows: Vec<Effort>,
    /// For each time, two numbers for each axis j of the run. The first is the part of its force that acts on this axis as a
    /// load. The second is A_ij of [`Coupled`](crate::Coupled), kg. Empty: none.
    #[serde(default)]
    pub others: Vec<Vec<[f64; 2]>>,
}

/// Moving mass and load of a drive at one time. A file has mass, load and rate as a list.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
pub struct Effort {
    /// Moving mass, kg.
    pub mass: f64,
    /// Force in +x that neither gas nor friction gives, N.
    pub load: f64,
    /// Its rate, N/s.
    pub load_rate: f64,
}

impl Efforts {
    /// Returns mass and load at a time, s: between two entries the mass is linear and the load cubic. Outside, the
    /// nearest entry holds.
    fn at(&self, t: f64) -> Option<Effort> {
        let last = self.rows.len().checked_sub(1)?;
        let place = (t / self.period).clamp(0.0, last as f64);
        let one = self.rows.get(place as usize)?;
        let Some(next) = self.rows.get(place as usize + 1) else {
            return Some(Effort { load_rate: 0.0, ..*one });
        };
        let (s, h) = (place.fract(), self.period);
        let chord = next.load - one.load;
        let (bend, twist) = (h * one.load_rate - chord, chord - h * next.load_rate);
        let r = 1.0 - s;
        Some(Effort {
            mass: one.mass + s * (next.mass - one.mass),
            load: one.load + s * chord + s * r * (r * bend + s * twist),
            load_rate: (chord + (r - s) * (r * bend + s * twist) + s * r * (twist - bend)) / h,
        })
    }
}

/// Number of coefficients of a polynomial.
pub const COEFFICIENTS: usize = 10;

/// A polynomial: position, m, over the elapsed fraction of its duration.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(from = "[f64; 2 + COEFFICIENTS]")]
pub struct Piece {
    /// Time at which it begins, s.
    pub begin: f64,
    /// Duration, s.
    pub duration: f64,
    /// Coefficients of the powers 0, 1, .. of that fraction, m.
    pub coefficients: [f64; COEFFICIENTS],
}

impl From<[f64; 2 + COEFFICIENTS]> for Piece {
    fn from([begin, duration, coefficients @ ..]: [f64; 2 + COEFFICIENTS]) -> Self {
        Piece { begin, duration, coefficients }
    }
}

impl Piece {
    fn stands(&self) -> bool {
        self.coefficients[1..].iter().all(|own| *own == 0.0)
    }

    /// Returns position and three derivatives at a time, s. After the end, the reference rests.
    fn at(&self, t: f64) -> Wanted {
        let share = (t - self.begin) / self.duration;
        if share >= 1.0 {
            return Wanted { position: self.coefficients.iter().sum(), ..Wanted::default() };
        }
        let [x, v, a, j] = series(&self.coefficients, share);
        Wanted::at_rate([x, v, 2.0 * a, 6.0 * j], 1.0 / self.duration)
    }
}

/// A move to a position, from the end of the previous move. A file has begin, duration and target as a list.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
pub struct Move {
    /// Time at which it begins, s.
    pub begin: f64,
    /// Duration, s.
    pub duration: f64,
    /// Target, m.
    pub to: f64,
}

impl Reference {
    /// Returns the wanted state at a time, s.
    pub fn at(&self, t: f64) -> Wanted {
        match self {
            Reference::Moves { start, moves } => {
                let begun = moves.partition_point(|own| own.begin <= t);
                let Some(own) = begun.checked_sub(1).map(|last| moves[last]) else {
                    return Wanted { position: *start, ..Wanted::default() };
                };
                let from = begun.checked_sub(2).map_or(*start, |before| moves[before].to);
                between([from, own.to], blend((t - own.begin) / own.duration), 1.0 / own.duration)
            }
            Reference::Pieces { start, pieces, .. } => {
                let begun = pieces.partition_point(|own| own.begin <= t);
                match begun.checked_sub(1) {
                    Some(last) => pieces[last].at(t),
                    None => Wanted { position: *start, ..Wanted::default() },
                }
            }
            Reference::Sine { centre, amplitude, frequency } => {
                let w = TAU * frequency;
                let [s, s1, s2, s3] = blend(t * frequency);
                let [s1, s2, s3] = [s1 * frequency, s2 * frequency.powi(2), s3 * frequency.powi(3)];
                let (sin, cos) = (w * t).sin_cos();
                Wanted {
                    position: centre + amplitude * s * sin,
                    velocity: amplitude * (s1 * sin + s * w * cos),
                    acceleration: amplitude * (s2 * sin + 2.0 * s1 * w * cos - s * w * w * sin),
                    jerk: amplitude
                        * (s3 * sin + 3.0 * s2 * w * cos - 3.0 * s1 * w * w * sin - s * w.powi(3) * cos),
                }
            }
        }
    }

    /// Returns the reference slowed by a factor in time.
    pub fn slowed(&self, t: f64, factor: f64) -> Wanted {
        Wanted::at_rate(self.at(t / factor).numbers(), 1.0 / factor)
    }

    /// Returns the shortest duration of a move, polynomial or period, s.
    pub fn shortest(&self) -> f64 {
        match self {
            Reference::Moves { moves, .. } => {
                moves.iter().map(|own| own.duration).fold(f64::INFINITY, f64::min)
            }
            Reference::Sine { frequency, .. } => 1.0 / frequency,
            Reference::Pieces { pieces, .. } => {
                let moving = pieces.iter().filter(|own| !own.stands());
                moving.map(|own| own.duration).fold(f64::INFINITY, f64::min)
            }
        }
    }

    /// Whether the reference is at rest from a time on for `span` s.
    pub fn stands(&self, t: f64, span: f64) -> bool {
        match self {
            Reference::Moves { moves, .. } => {
                moves.iter().all(|own| own.begin + own.duration <= t || own.begin >= t + span)
            }
            Reference::Sine { .. } => false,
            Reference::Pieces { pieces, .. } => {
                let ended = pieces.partition_point(|own| own.begin + own.duration <= t);
                pieces[ended..].iter().take_while(|own| own.begin < t + span).all(Piece::stands)
            }
        }
    }

    /// Returns [`Efforts::others`] at a time, s.
    pub fn others(&self, t: f64) -> &[[f64; 2]] {
        match self {
            Reference::Pieces { efforts: Some(own), .. } => {
                let nearest = (t / own.period).round() as usize;
                own.others.get(nearest).or(own.others.last()).map_or(&[], Vec::as_slice)
            }
            _ => &[],
        }
    }

    /// Returns mass and load at a time, s; `None`: those of the model.
    pub fn effort(&self, t: f64) -> Option<Effort> {
        match self {
            Reference::Pieces { efforts, .. } => efforts.as_ref().and_then(|own| own.at(t)),
            _ => None,
        }
    }
}
