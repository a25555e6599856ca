use super::stribeck::stribeck_parameters;
use super::{At, Choices, Claims, Described, FLOOR, InnerState, Law, Levels, Sense, Shape, sliding};
use crate::Parameter;
use crate::parameter::{above, at_least};
use math::{Lane, Over, Real};
use serde::Deserialize;

/// Number of elements by default.
const USUAL_ELEMENTS: usize = 4;

/// Largest and smallest number of elements of a description.
pub const ELEMENTS: std::ops::RangeInclusive<usize> = 2..=10;

/// Lower limit of |v|/vc in steady sliding, where the slope at rest would be infinite. It changes the level by 1e-15.
const SMALLEST_RATIO: f64 = 1e-30;

const LOSS: InnerState = InnerState { name: "level_loss", unit: "-", scale: 1.0 };

const fn element(name: &'static str) -> InnerState {
    InnerState { name, unit: "m", scale: 1e-5 }
}

/// States of ten elements, in the order in which they slip. Fewer elements use the first of them.
const STATES: [InnerState; 11] = [
    LOSS,
    element("element_1_deflection_m"),
    element("element_2_deflection_m"),
    element("element_3_deflection_m"),
    element("element_4_deflection_m"),
    element("element_5_deflection_m"),
    element("element_6_deflection_m"),
    element("element_7_deflection_m"),
    element("element_8_deflection_m"),
    element("element_9_deflection_m"),
    element("element_10_deflection_m"),
];

/// One element: a spring in series with a slider.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Element<P> {
    /// Fraction of the stiffness sigma0, or in a description N/m.
    #[serde(rename = "stiffness_n_m")]
    pub stiffness: P,
    /// Fraction of the level.
    #[serde(rename = "share")]
    pub level: P,
}

impl Element<f64> {
    /// Creates `n` elements of equal stiffness. Their loading curve from rest is the polygon of n tangents around the
    /// loading curve of Dahl's law, F = Fs (1 - exp(-sigma0 x/Fs)):
    ///
    ///   `yield of element j at x sigma0/Fs = 1 + n (m' ln m' - m ln m),  m = 1 - (j - 1)/n, m' = 1 - j/n`
    ///
    /// The fractions of the level are those yields divided by n. The polygon has the initial stiffness sigma0 and is
    /// above the curve. With four elements, the difference is at most 9.2 % of Fs, at the last yield.
    pub fn tangents(n: usize) -> Vec<Self> {
        let count = n as f64;
        let entropy = |j: usize| {
            let slope = 1.0 - j as f64 / count;
            if j == n { 0.0 } else { slope * math::elementary::ln(slope) }
        };
        let each = |j| (1.0 + count * (entropy(j + 1) - entropy(j))) / count;
        (0..n).map(|j| Element { stiffness: 1.0 / count, level: each(j) }).collect()
    }
}

stribeck_parameters! {
    /// Parameters of [`MaxwellSlip`] shared by all its elements.
    pub struct SlipParameters {
        /// Stiffness sigma0 of all elements together; listed elements give it themselves
        bristle_stiffness: "N/m", at_least(f64::MIN_POSITIVE), default f64::INFINITY;
        /// Attraction C: how fast the level follows the Stribeck curve
        attraction: "N/s", above(0.0);
        /// Velocity vc at which the viscosity of slip would double the level
        slip_velocity: "m/s", above(0.0), default 1e5;
    }
}

/// Generalised Maxwell slip: parallel springs with sliders that slip one after the other, so that the force in
/// presliding remembers the points of reversal.
///
///   `F = sum_i k_i z_i + Fv v                                         [N], opposes v > 0`
///   `dz_i/dt = v - w_i,    w_i = vc max(0, q_i - 1)^2 sgn(z_i),    q_i = k_i |z_i|/(a_i G)`
///   `dG/dt = C (1 - G/s(v)),    s(v) = Fc + (Fs - Fc) exp(-|v/vs|^n)`
///
/// * `k_i`, `a_i`: stiffness of an element, N/m, and its fraction of the level, with sum a_i = 1.
/// * `w_i`: slip rate of an element, zero within its limit a_i G, m/s.
/// * `G`: level of slip, stored as the loss 1 - G/Fs, which is zero after a stop, N.
/// * `C`: attraction: G follows s(v) with the time constant s/C, N/s.
/// * `vc`: viscosity of slip, the only regularisation, m/s.
///
/// In stick, the source has dF_i/dt = k_i v until |F_i| = a_i s(v). In slip, it has sgn(v) C (a_i - F_i/s(v)) until v
/// changes sign. All elements in slip therefore obey one equation, that of G = F_i/a_i, which is written here once.
/// Sliding is that of the source. An element in stick has the limit a_i G instead of a_i s(v). The level then regains
/// Fs within a few Fs/C of a stop, not at once. No element needs a mode, and none produces energy. In the source an
/// element can produce energy if the attraction is faster than k_i v.
///
/// In sliding, the force exceeds the curve by the fraction sqrt(|v|/vc) of the level. The default gives 0.3 % at 1 m/s
/// and 0.01 % at 1 mm/s. A smaller value would be too stiff for error control. Within the limits the slip is zero.
/// Minor loops close, the material memory is erased after a full loop, and a load below Fs does not drift. Levels that
/// depend on the direction limit each element by the sign of that element's deflection, and G by the sign of v. Always
/// passive, as w_i has the sign of z_i. Sources: [albender2005], [lampaert2003].
#[derive(Clone, Debug)]
pub struct MaxwellSlip<P> {
    /// Parameters shared by all elements.
    pub common: SlipParameters<P>,
    /// Elements in the order in which they slip.
    pub elements: Vec<Element<P>>,
}

impl<P: Copy> MaxwellSlip<P> {
    /// Name, unit, bounds, default and meaning of each parameter.
    pub const PARAMETERS: &'static [Parameter] = SlipParameters::<P>::PARAMETERS;
}

impl<R: Lane> MaxwellSlip<R> {
    /// Creates the law from elements with stiffness in N/m and fractions of the level. Their sum is taken as one.
    pub fn set_elements(&mut self, mut elements: Vec<Element<R>>) {
        let sum = |of: fn(&Element<R>) -> R| elements.iter().map(of).fold(R::zero(), |sum, one| sum + one);
        let (stiffness, level) = (sum(|element| element.stiffness), sum(|element| element.level));
        elements.sort_by(|a, b| (a.level / a.stiffness).get(0).total_cmp(&(b.level / b.stiffness).get(0)));
        self.common.bristle_stiffness = stiffness;
        let share = |e: &Element<R>| Element { stiffness: e.stiffness / stiffness, level: e.level / level };
        self.elements = elements.iter().map(share).collect();
    }
}

impl Described for MaxwellSlip<f64> {
    fn build(values: &[f64], choices: &Choices) -> Self {
        let common = SlipParameters::from_values(values, Shape::of(choices, values[3]));
        MaxwellSlip { common, elements: Element::tangents(USUAL_ELEMENTS) }
    }
}

impl MaxwellSlip<f64> {
    /// Returns the same elements and shape with other numbers, in the order of `PARAMETERS`.
    pub fn lifted<P: Real>(&self, values: &[P]) -> MaxwellSlip<P> {
        let constant = |e: &Element<f64>| Element { stiffness: P::c(e.stiffness), level: P::c(e.level) };
        MaxwellSlip {
            common: self.common.lifted(values),
            elements: self.elements.iter().map(constant).collect(),
        }
    }
}

math::gather!(MaxwellSlip { common, elements });
math::gather!(Element { stiffness, level });

impl<P: Real> MaxwellSlip<P> {
    /// Returns k_i, N/m.
    fn stiffness(&self, element: &Element<P>) -> P {
        self.common.bristle_stiffness * element.stiffness
    }

    /// Returns the deflection, m, at which the element of an inner state slips in the level Fs.
    pub(super) fn limit(&self, state: usize) -> Option<P> {
        let element = self.elements.get(state.checked_sub(1)?)?;
        Some(element.level * self.common.breakaway / self.stiffness(element))
    }

    /// Returns w_i, m/s, under the force of the spring, with G.
    fn slip_rate<S: Over<P>>(&self, element: &Element<P>, elastic: S, level: S) -> S {
        let excess = (elastic.abs() / (S::from(element.level) * level) - S::one()).max(S::zero());
        let rate = S::from(self.common.slip_velocity) * excess * excess;
        S::select(elastic.lt(S::zero()), -rate, rate)
    }
}

impl<P: Real> Law<P> for MaxwellSlip<P> {
    const KEY: &'static str = "gms";
    const TITLE: &'static str = "Generalised Maxwell slip: presliding that remembers reversals";
    const SOURCE: &'static str = "albender2005";
    const STATES: &'static [InnerState] = STATES.split_at(USUAL_ELEMENTS + 1).0;
    const SENSE: Sense = Sense::Deflection;
    const ELEMENTS: bool = true;
    const CLAIMS: Claims = Claims { no_drift: true, always_passive: true, ..Claims::USUAL };

    fn levels(&self) -> Levels<P> {
        Levels::new(self.common.coulomb, self.common.breakaway, self.common.viscous)
    }

    fn states(&self) -> &'static [InnerState] {
        &STATES[..=self.elements.len()]
    }

    fn force<S: Over<P>>(&self, at: &At<S>, levels: &Levels<S>, z: &[S], dz: &mut [S], _mode: P) -> S {
        let left = (S::one() - z[0]).max(S::c(FLOOR));
        let along = levels.towards(at.v);
        let steady = along.at(self.common.weight(at.v)) / along.breakaway;
        dz[0] = S::from(self.common.attraction) * (left / steady - S::one()) / levels.breakaway;
        let mut sum = levels.viscous * at.v;
        for (i, element) in self.elements.iter().enumerate() {
            let elastic = S::from(self.stiffness(element)) * z[i + 1];
            dz[i + 1] = at.v - self.slip_rate(element, elastic, left * levels.towards(elastic).breakaway);
            sum += elastic;
        }
        sum
    }

    /// Returns the mean over the elements, weighted by stiffness: the mean for the deflection F/sigma0.
    fn slip<S: Over<P>>(&self, v: S, dz: &[S]) -> S {
        let elements = self.elements.iter().zip(&dz[1..]);
        elements.fold(v, |slip, (element, rate)| slip - S::from(element.stiffness) * *rate)
    }

    fn stored<S: Over<P>>(&self, z: &[S]) -> S {
        let energy = |(element, z): (&Element<P>, &S)| S::c(0.5) * S::from(self.stiffness(element)) * *z * *z;
        self.elements.iter().zip(&z[1..]).map(energy).fold(S::zero(), |sum, one| sum + one)
    }

    fn heat<S: Over<P>>(&self, v: S, force: S, z: &[S], dz: &[S]) -> S {
        let springs = self.elements.iter().zip(z[1..].iter().zip(&dz[1..]));
        springs.fold(force * v, |heat, (element, (z, rate))| {
            heat - S::from(self.stiffness(element)) * *z * *rate
        })
    }

    fn steady<S: Over<P>>(&self, v: S, levels: &Levels<S>) -> S {
        let more = S::one() + (v.abs() / S::from(self.common.slip_velocity)).max(S::c(SMALLEST_RATIO)).sqrt();
        sliding(v, levels.towards(v).at(self.common.weight(v)) * more, levels.viscous)
    }
}
