use crate::curve::monotone_slopes;
use crate::friction::{At, FLOOR, Levels};
use math::{Over, Real};
use std::f64::consts::TAU;

crate::parameters! {
    /// One period of the friction along the stroke.
    pub struct Harmonic {
        /// Period lambda
        period: "m", crate::parameter::above(0.0);
        /// Amplitude a
        amplitude: "-", crate::parameter::between(-1.0, 1.0);
        /// Phase phi at the reference position
        phase: "rad", crate::parameter::any(), default 0.0;
    }
}

/// A factor given at some positions, interpolated by the monotone cubic of Fritsch and Butland, without overshoot.
/// Beyond the first and the last position, the factor is constant. Source: [fritsch1984].
#[derive(Clone, Debug, Default)]
pub struct Table<P> {
    /// Position m, factor, slope 1/m at each point.
    points: Vec<[P; 3]>,
}

impl<P: Real> Table<P> {
    /// Creates the table from increasing positions, m, and their factors.
    pub fn new(points: &[[P; 2]]) -> Self {
        let slopes = monotone_slopes(points).into_iter().zip(points);
        Table { points: slopes.map(|(slope, [x, factor])| [*x, *factor, slope]).collect() }
    }

    /// Returns the factor at `x`, or one without a table.
    #[inline(always)]
    fn at<S: Over<P>>(&self, x: S) -> S {
        let (Some(first), Some(last)) = (self.points.first(), self.points.last()) else { return S::one() };
        let x = x.max(S::from(first[0])).min(S::from(last[0]));
        let mut factor = S::from(first[1]);
        for pair in self.points.windows(2) {
            let [[x0, f0, d0], [x1, f1, d1]] = [pair[0], pair[1]].map(|point| point.map(S::from));
            let h = x1 - x0;
            let t = (x - x0) / h;
            let (bend, twist) =
                (S::c(3.0) * (f1 - f0) - h * (S::c(2.0) * d0 + d1), h * (d0 + d1) - S::c(2.0) * (f1 - f0));
            let here = f0 + t * (h * d0 + t * (bend + t * twist));
            factor = S::select(x.lt(x0), factor, here);
        }
        factor
    }
}

/// Friction that depends on the position along the stroke, for any law. Both levels are multiplied by
///
///   `table(x) [1 + slope (x - x0) + sum_k a_k cos(2 pi (x - x0)/lambda_k + phi_k)]`
///
/// but never by less than a hundredth. The form is assumed. A straight line represents misalignment of the drive.
/// Periods represent the profile, band or tube. A table represents measured values. Source: [assumed].
#[derive(Clone, Debug)]
pub struct Position<P> {
    /// Measured factors. Without points, the factor is 1 everywhere.
    pub table: Table<P>,
    /// Periodic terms.
    pub harmonics: Vec<Harmonic<P>>,
    /// Linear trend, 1/m.
    pub slope: P,
    /// Position x0 at which the trend is zero, m.
    pub reference: P,
}

math::gather!(Position { table, harmonics, slope, reference });
math::gather!(Table { points });

impl Position<f64> {
    /// Returns bounds of the factor for positions between 0 and `stroke` m.
    pub(in crate::friction) fn range(&self, stroke: f64) -> [f64; 2] {
        let waves: f64 = self.harmonics.iter().map(|wave| wave.amplitude.abs()).sum();
        let ends = [0.0, stroke].map(|x| 1.0 + self.slope * (x - self.reference));
        let low = ends[0].min(ends[1]) - waves;
        let factors = || self.table.points.iter().map(|point| point[1]);
        let [least, most] = [factors().fold(f64::INFINITY, f64::min), factors().fold(0.0, f64::max)];
        let [least, most] = if self.table.points.is_empty() { [1.0; 2] } else { [least, most] };
        [(low * least).max(FLOOR), ((ends[0].max(ends[1]) + waves) * most).max(FLOOR)]
    }
}

impl<P: Real> Position<P> {
    #[inline(always)]
    pub(in crate::friction) fn apply<S: Over<P>>(&self, base: &Levels<S>, at: &At<S>) -> Levels<S> {
        let x = at.x - S::from(self.reference);
        let mut factor = S::from(self.slope).fma(x, S::one());
        for wave in &self.harmonics {
            let angle = S::c(TAU) * x / S::from(wave.period) + S::from(wave.phase);
            factor = S::from(wave.amplitude).fma(angle.cos(), factor);
        }
        if !self.table.points.is_empty() {
            factor *= self.table.at(at.x);
        }
        base.times(factor.max(S::c(FLOOR)))
    }
}
