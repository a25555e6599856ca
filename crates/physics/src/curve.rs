//! Curves through points.

use math::{Over, Real};

/// Returns slopes at increasing points, for the monotone cubic of Fritsch and Butland: smooth, without overshoot, level
/// at both ends. Source: [fritsch1984].
pub fn monotone_slopes<P: Real>(points: &[[P; 2]]) -> Vec<P> {
    let n = points.len();
    let width = |k: usize| points[k + 1][0] - points[k][0];
    let secant = |k: usize| (points[k + 1][1] - points[k][1]) / width(k);
    let slope = |k: usize| {
        if k == 0 || k + 1 == n {
            return P::zero();
        }
        let (before, after) = (secant(k - 1), secant(k));
        let (three, two) = (P::c(3.0), P::c(2.0));
        let weight = (width(k - 1) + two * width(k)) / (three * (width(k - 1) + width(k)));
        let product = before * after;
        let mean = product
            / P::select(P::zero().lt(product), weight * after + (P::one() - weight) * before, P::one());
        P::select(P::zero().lt(product), mean, P::zero())
    };
    (0..n).map(slope).collect()
}

/// A curve from the first to the last of some points, constant beyond them, with its slope and its integral.
#[derive(Clone, Debug)]
pub struct Curve<P> {
    pieces: Vec<Piece<P>>,
}

/// f = f_0 + t (c_1 + t (c_2 + t c_3)), t = (x - x_0)/h.
#[derive(Clone, Copy, Debug)]
struct Piece<P> {
    x: P,
    width: P,
    value: P,
    /// c_1, c_2 and c_3.
    rises: [P; 3],
    /// Integral from the first point on.
    before: P,
}

impl<P: Real> Curve<P> {
    /// Creates straight lines between increasing points.
    pub fn straight(points: &[[P; 2]]) -> Self {
        let zero = P::zero();
        Self::of(points, |k, _| [points[k + 1][1] - points[k][1], zero, zero])
    }

    /// Creates the monotone cubic through increasing points.
    pub fn smooth(points: &[[P; 2]]) -> Self {
        let slopes = monotone_slopes(points);
        Self::of(points, |k, h| {
            let (rise, [d0, d1]) = (points[k + 1][1] - points[k][1], [h * slopes[k], h * slopes[k + 1]]);
            let (two, three) = (P::c(2.0), P::c(3.0));
            [d0, three * rise - two * d0 - d1, d0 + d1 - two * rise]
        })
    }

    fn of(points: &[[P; 2]], rises: impl Fn(usize, P) -> [P; 3]) -> Self {
        let mut before = P::zero();
        let pieces = (0..points.len() - 1).map(|k| {
            let ([x, value], width) = (points[k], points[k + 1][0] - points[k][0]);
            let piece = Piece { x, width, value, rises: rises(k, width), before };
            before = piece.integral(P::one());
            piece
        });
        Curve { pieces: pieces.collect() }
    }

    /// Returns the piece that contains x, or the nearest one, and its t between 0 and 1.
    #[inline(always)]
    fn at<S: Over<P>>(&self, x: S) -> (Piece<S>, S) {
        let mut found = self.pieces[0].map(S::from);
        for piece in &self.pieces[1..] {
            let (piece, here) = (piece.map(S::from), x.lt(S::from(piece.x)));
            found = found.zip(&piece, |before, piece| S::select(here, before, piece));
        }
        (found, ((x - found.x) / found.width).max(S::zero()).min(S::one()))
    }

    /// Returns f(x).
    #[inline(always)]
    pub fn value<S: Over<P>>(&self, x: S) -> S {
        let (piece, t) = self.at(x);
        piece.value(t)
    }

    /// Returns f'(x).
    #[inline(always)]
    pub fn slope<S: Over<P>>(&self, x: S) -> S {
        let (piece, t) = self.at(x);
        let [c1, c2, c3] = piece.rises;
        let slope = (c1 + t * (S::c(2.0) * c2 + t * S::c(3.0) * c3)) / piece.width;
        let off = x - (piece.x + t * piece.width);
        // The curve is constant beyond the ends. Rounding does not count as a distance.
        let beyond = (piece.width * S::c(1e-12)).lt(off.abs());
        S::select(beyond, S::zero(), slope)
    }

    /// Returns the integral of f from the first point to x.
    #[inline(always)]
    pub fn integral<S: Over<P>>(&self, x: S) -> S {
        let (piece, t) = self.at(x);
        piece.integral(t) + piece.value(t) * (x - (piece.x + t * piece.width))
    }

    /// Returns the largest value at a point.
    pub fn largest(&self) -> P {
        let each = self.pieces.iter().flat_map(|piece| [piece.value(P::zero()), piece.value(P::one())]);
        each.reduce(Real::max).expect("a piece")
    }

    /// Returns the positions of the points.
    pub fn places(&self) -> impl DoubleEndedIterator<Item = P> + '_ {
        let last = self.pieces.last().map(|piece| piece.x + piece.width);
        self.pieces.iter().map(|piece| piece.x).chain(last)
    }
}

math::gather!(Curve { pieces });
math::gather!(Piece { x, width, value, rises, before });
math::mapped!(Piece { x, width, value, before } arrays { rises });

impl<S: Real> Piece<S> {
    #[inline(always)]
    fn value(&self, t: S) -> S {
        let [c1, c2, c3] = self.rises;
        self.value + t * (c1 + t * (c2 + t * c3))
    }

    #[inline(always)]
    fn integral(&self, t: S) -> S {
        let [c1, c2, c3] = self.rises;
        let mean = self.value + t * (S::c(0.5) * c1 + t * (S::c(1.0 / 3.0) * c2 + t * S::c(0.25) * c3));
        self.before + self.width * t * mean
    }
}
