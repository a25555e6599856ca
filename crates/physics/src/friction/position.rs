use super::{At, FLOOR, Levels};
use math::{Lane, Over, Real};
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

/// Friction that depends on the position along the stroke, on any law: both levels times
///
///   1 + slope (x - x0) + sum_k a_k cos(2 pi (x - x0)/lambda_k + phi_k)
///
/// never less than a hundredth. The form is assumed; a straight line is what misalignment of the drive gives,
/// periods are those of profile, band or tube. Source: [assumed].
#[derive(Clone, Debug)]
pub struct Position<P> {
    pub harmonics: Vec<Harmonic<P>>,
    /// Linear trend, 1/m.
    pub slope: P,
    /// Position x0 at which the trend is nil, m.
    pub reference: P,
}

impl<R: Lane> Position<R> {
    /// Lane `i` takes `each[i]`; all must have the same number of harmonics.
    pub fn gather(each: &[&Position<f64>]) -> Self {
        Position {
            harmonics: (0..each[0].harmonics.len())
                .map(|k| Harmonic::gather(&each.iter().map(|one| &one.harmonics[k]).collect::<Vec<_>>()))
                .collect(),
            slope: R::from_lanes(|lane| each[lane].slope),
            reference: R::from_lanes(|lane| each[lane].reference),
        }
    }
}

impl Position<f64> {
    /// Bounds of the factor for positions between 0 and `stroke` m.
    pub(super) fn range(&self, stroke: f64) -> [f64; 2] {
        let waves: f64 = self.harmonics.iter().map(|wave| wave.amplitude.abs()).sum();
        let ends = [0.0, stroke].map(|x| 1.0 + self.slope * (x - self.reference));
        let low = ends[0].min(ends[1]) - waves;
        [low.max(FLOOR), (ends[0].max(ends[1]) + waves).max(FLOOR)]
    }
}

impl<P: Real> Position<P> {
    #[inline(always)]
    pub fn apply<S: Over<P>>(&self, base: &Levels<S>, at: &At<S>) -> Levels<S> {
        let x = at.x - S::from(self.reference);
        let mut factor = S::from(self.slope).fma(x, S::one());
        for wave in &self.harmonics {
            let angle = S::c(TAU) * x / S::from(wave.period) + S::from(wave.phase);
            factor = S::from(wave.amplitude).fma(angle.cos(), factor);
        }
        base.times(factor.max(S::c(FLOOR)))
    }
}
