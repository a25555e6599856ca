use crate::curve::Curve;
use math::{Gather, Lane, Over, Real};

/// Least fraction of l^2 that l^2 - s^2 keeps, so that a toggle of almost folded links stays finite.
const FOLDED: f64 = 1e-3;

/// A mass coupled to an axis by a ratio that depends on its position: a mass m(x) in addition to the mass M of the axis:
///
///   `(M + m(x)) x'' + m'(x) x'^2/2 = F                                  [N]`
///
/// The power of F is then exactly the rate of (M + m) x'^2/2.
#[derive(Clone, Debug)]
pub enum Inertia<P> {
    /// Measured or computed m(x), kg over m.
    Table(Curve<P>),
    /// A lever with a slot that a pin on the axis turns: tan(phi) = (x - x_0)/h, m = J (dphi/dx)^2 = J h^2/(h^2 + s^2)^2.
    Lever {
        /// Moment of inertia J about its pivot, kg m2.
        inertia: P,
        /// Distance h of the pivot from the line of the pin, m.
        distance: P,
        /// Position x_0 at which it is perpendicular to the line, m.
        centre: P,
    },
    /// A toggle of two links of length l whose knee the axis moves. The mass M at its end moves by 2 sqrt(l^2 - s^2),
    /// so m = 4 M s^2/(l^2 - s^2).
    Toggle {
        /// Mass M at the end, kg.
        mass: P,
        /// Length l of each link, m.
        link: P,
        /// Position x_0 at which it is stretched, m.
        centre: P,
    },
}

impl<P: Real> Inertia<P> {
    /// Returns m(x), kg, and m'(x)/2, kg/m.
    #[inline(always)]
    pub fn at<S: Over<P>>(&self, x: S) -> [S; 2] {
        match self {
            Inertia::Table(curve) => [curve.value(x), S::c(0.5) * curve.slope(x)],
            Inertia::Lever { inertia, distance, centre } => {
                let [j, h, x0] = [*inertia, *distance, *centre].map(S::from);
                let s = x - x0;
                let q = S::one() / (h * h + s * s);
                let m = j * h * h * q * q;
                [m, S::c(-2.0) * m * s * q]
            }
            Inertia::Toggle { mass, link, centre } => {
                let [m, l, x0] = [*mass, *link, *centre].map(S::from);
                let s = x - x0;
                let (left, least) = (l * l - s * s, S::c(FOLDED) * l * l);
                let q = S::one() / left.max(least);
                let bends = S::select(left.lt(least), S::zero(), s * s * q);
                let half = S::c(4.0) * m * s * q;
                [half * s, half * (S::one() + bends)]
            }
        }
    }

    /// Returns a typical value of m, kg, for the design of end stops. It is the largest value of a table or a lever, and that of a
    /// toggle with links at a right angle.
    pub fn usual(&self) -> P {
        match self {
            Inertia::Table(curve) => curve.largest(),
            Inertia::Lever { inertia, distance, .. } => *inertia / (*distance * *distance),
            Inertia::Toggle { mass, .. } => P::c(4.0) * *mass,
        }
    }
}

impl<R: Lane> Gather<R> for Inertia<f64> {
    type Lanes = Inertia<R>;

    fn gather(each: &[&Self]) -> Inertia<R> {
        let numbers = |of: &dyn Fn(&Inertia<f64>) -> [f64; 3]| {
            std::array::from_fn(|i| R::from_lanes(|lane| of(each[lane])[i]))
        };
        match each[0] {
            Inertia::Table(_) => {
                let curves: Vec<&Curve<f64>> = each.iter().filter_map(|own| own.curve()).collect();
                Inertia::Table(Curve::gather(&curves))
            }
            Inertia::Lever { .. } => {
                let [inertia, distance, centre] = numbers(&Inertia::numbers);
                Inertia::Lever { inertia, distance, centre }
            }
            Inertia::Toggle { .. } => {
                let [mass, link, centre] = numbers(&Inertia::numbers);
                Inertia::Toggle { mass, link, centre }
            }
        }
    }
}

impl Inertia<f64> {
    fn curve(&self) -> Option<&Curve<f64>> {
        if let Inertia::Table(curve) = self { Some(curve) } else { None }
    }

    fn numbers(&self) -> [f64; 3] {
        match *self {
            Inertia::Table(_) => [0.0; 3],
            Inertia::Lever { inertia: one, distance: two, centre }
            | Inertia::Toggle { mass: one, link: two, centre } => [one, two, centre],
        }
    }
}
