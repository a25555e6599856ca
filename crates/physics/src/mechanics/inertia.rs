use crate::curve::Curve;
use math::{Over, Real};

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
    /// A lever with a slot.
    Lever(SlottedLever<P>),
    /// A toggle of two links.
    Toggle(TwoLinks<P>),
}

/// A lever with a slot that a pin on the axis turns: tan(phi) = (x - x_0)/h, m = J (dphi/dx)^2 = J h^2/(h^2 + s^2)^2.
#[derive(Clone, Debug)]
pub struct SlottedLever<P> {
    /// Moment of inertia J about its pivot, kg m2.
    pub inertia: P,
    /// Distance h of the pivot from the line of the pin, m.
    pub distance: P,
    /// Position x_0 at which it is perpendicular to the line, m.
    pub centre: P,
}

/// A toggle of two links of length l whose knee the axis moves. The mass M at its end moves by 2 sqrt(l^2 - s^2),
/// so m = 4 M s^2/(l^2 - s^2).
#[derive(Clone, Debug)]
pub struct TwoLinks<P> {
    /// Mass M at the end, kg.
    pub mass: P,
    /// Length l of each link, m.
    pub link: P,
    /// Position x_0 at which it is stretched, m.
    pub centre: P,
}

impl<P: Real> Inertia<P> {
    /// Returns m(x), kg, and m'(x)/2, kg/m.
    #[inline(always)]
    pub fn at<S: Over<P>>(&self, x: S) -> [S; 2] {
        match self {
            Inertia::Table(curve) => [curve.value(x), S::c(0.5) * curve.slope(x)],
            Inertia::Lever(SlottedLever { inertia, distance, centre }) => {
                let [j, h, x0] = [*inertia, *distance, *centre].map(S::from);
                let s = x - x0;
                let q = S::one() / (h * h + s * s);
                let m = j * h * h * q * q;
                [m, S::c(-2.0) * m * s * q]
            }
            Inertia::Toggle(TwoLinks { mass, link, centre }) => {
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
            Inertia::Lever(lever) => lever.inertia / (lever.distance * lever.distance),
            Inertia::Toggle(toggle) => P::c(4.0) * toggle.mass,
        }
    }
}

math::gather_enum!(Inertia { Table, Lever, Toggle });
math::gather!(SlottedLever { inertia, distance, centre });
math::gather!(TwoLinks { mass, link, centre });
