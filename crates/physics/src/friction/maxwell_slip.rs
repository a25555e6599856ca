use super::stribeck::stribeck_parameters;
use super::{At, Choices, Claims, Described, FLOOR, InnerState, Law, Levels, Sense, Shape, sliding};
use crate::Parameter;
use crate::parameter::{above, at_least};
use math::{Lane, Over, Real};

/// Number of elements by default.
const USUAL_ELEMENTS: usize = 4;

/// The most and the fewest elements of a description.
pub const ELEMENTS: std::ops::RangeInclusive<usize> = 2..=10;

/// |v|/vc below this is taken as this in steady sliding, where the slope at rest would be infinite: it changes
/// the level by 1e-15.
const SMALLEST_RATIO: f64 = 1e-30;

const LOSS: InnerState = InnerState { name: "level_loss", unit: "-", scale: 1.0 };

const fn element(name: &'static str) -> InnerState {
    InnerState { name, unit: "m", scale: 1e-5 }
}

/// The states of ten elements, in the order in which they slip; fewer have the first of them.
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
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Element<P> {
    /// Share of the stiffness sigma0.
    pub stiffness: P,
    /// Share of the level.
    pub level: P,
}

impl Element<f64> {
    /// `n` elements of equal stiffness whose loading curve from rest is the polygon of n tangents around
    /// F = Fs (1 - exp(-sigma0 x/Fs)), the loading curve of Dahl's law:
    ///
    ///   yield of element j at x sigma0/Fs = 1 + n (m' ln m' - m ln m),  m = 1 - (j - 1)/n, m' = 1 - j/n
    ///
    /// The shares of the level are those yields over n. The polygon has the stiffness sigma0 at first and lies
    /// above the curve; with four by at most 9.2 % of Fs, at the last yield.
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
    pub struct Common {
        /// Stiffness sigma0 of all elements together; where elements are listed, it is theirs
        bristle_stiffness: "N/m", at_least(f64::MIN_POSITIVE), default f64::INFINITY;
        /// Attraction C: how fast the level follows the Stribeck curve
        attraction: "N/s", above(0.0);
        /// Velocity vc at which the viscosity of slip would double the level
        slip_velocity: "m/s", above(0.0), default 1e5;
    }
}

/// Generalised Maxwell slip: springs with sliders side by side that slip one after the other, so that
/// the force in presliding remembers the points of reversal.
///
///   F = sum_i k_i z_i + Fv v                                         [N], opposes v > 0
///   dz_i/dt = v - w_i,    w_i = vc max(0, q_i - 1)^2 sgn(z_i),    q_i = k_i |z_i|/(a_i G)
///   dG/dt = C (1 - G/s(v)),    s(v) = Fc + (Fs - Fc) exp(-|v/vs|^n)
///
/// k_i, a_i  stiffness of an element and its share of the level, sum a_i = 1      N/m, -
/// w_i       slip rate of an element: none within its limit a_i G                 m/s
/// G         level of slip, carried as the loss 1 - G/Fs, nought after a stop     N
/// C         attraction: G follows s(v) with the time constant s/C                N/s
/// vc        viscosity of slip, the only regularisation                           m/s
///
/// The source has dF_i/dt = k_i v in stick, until |F_i| = a_i s(v), and in slip sgn(v) C (a_i - F_i/s(v)), until v
/// changes sign. Elements in slip thus all obey one equation, that of G = F_i/a_i, written here once:
/// sliding is that of the source. An element in stick has the limit a_i G instead of a_i s(v), so that the
/// level regains Fs within some Fs/C of a stop, not at once. No element needs a mode then, and none
/// gives energy; in the source one can, where the attraction pulls faster than k_i v.
///
/// In sliding the force exceeds the curve by the share sqrt(|v|/vc) of the level, by default 0.3 % at 1 m/s and
/// 0.01 % at 1 mm/s; less would leave nothing for error control to hold on to. Within the limits nothing
/// slips: minor loops close, what is wiped out leaves no trace, and no load below Fs drifts.
/// Levels that depend on the direction limit each element by that of its own deflection, and G by that of v.
/// Always passive, as w_i has the sign of z_i. Sources: [albender2005], [lampaert2003].
#[derive(Clone, Debug)]
pub struct MaxwellSlip<P> {
    /// Parameters shared by all elements.
    pub common: Common<P>,
    /// In the order in which they slip.
    pub elements: Vec<Element<P>>,
}

impl<P: Copy> MaxwellSlip<P> {
    /// Name, unit, bounds, default and meaning of each parameter.
    pub const PARAMETERS: &'static [Parameter] = Common::<P>::PARAMETERS;
}

impl<R: Lane> MaxwellSlip<R> {
    /// Takes elements with stiffness in N/m and shares of the level, whose sum is taken as one.
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
        let common = Common::from_values(values, Shape::of(choices, values[3]));
        let mut law = MaxwellSlip { common, elements: Element::tangents(USUAL_ELEMENTS) };
        if !choices.elements.is_empty() {
            law.set_elements(choices.elements.clone());
        }
        law
    }
}

impl MaxwellSlip<f64> {
    /// The same elements and shape with other numbers, in the order of `PARAMETERS`.
    pub fn lifted<P: Real>(&self, values: &[P]) -> MaxwellSlip<P> {
        let constant = |e: &Element<f64>| Element { stiffness: P::c(e.stiffness), level: P::c(e.level) };
        MaxwellSlip {
            common: self.common.lifted(values),
            elements: self.elements.iter().map(constant).collect(),
        }
    }
}

impl<R: Lane> MaxwellSlip<R> {
    /// Lane `i` takes `each[i]`; all must have the same number of elements.
    pub fn gather(each: &[&MaxwellSlip<f64>]) -> Self {
        let element = |j: usize| Element {
            stiffness: R::from_lanes(|lane| each[lane].elements[j].stiffness),
            level: R::from_lanes(|lane| each[lane].elements[j].level),
        };
        MaxwellSlip {
            common: Common::gather(&math::field(each, |one| &one.common)),
            elements: (0..each[0].elements.len()).map(element).collect(),
        }
    }
}

impl<P: Real> MaxwellSlip<P> {
    /// k_i, N/m.
    fn stiffness(&self, element: &Element<P>) -> P {
        self.common.bristle_stiffness * element.stiffness
    }

    /// Deflection, m, at which the element of an inner state slips in the level Fs.
    pub(super) fn limit(&self, state: usize) -> Option<P> {
        let element = self.elements.get(state.checked_sub(1)?)?;
        Some(element.level * self.common.breakaway / self.stiffness(element))
    }

    /// w_i, m/s, under the force of the spring, with G.
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
        self.common.own_levels()
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

    /// The mean over the elements, by stiffness: that of the deflection F/sigma0.
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
