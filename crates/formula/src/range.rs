/// Possible values of a quantity: an interval with open or closed ends.
///
/// It contains the values for every parameter within its bounds and every state and velocity. It may contain other
/// values too. Infinite ends are never included.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Range {
    low: Limit,
    high: Limit,
}

#[derive(Clone, Copy, Debug, PartialEq)]
struct Limit {
    at: f64,
    /// Whether the end itself is a value.
    reached: bool,
}

impl Limit {
    fn new(at: f64, reached: bool) -> Self {
        Limit { at, reached: reached && at.is_finite() }
    }

    fn map(self, f: impl Fn(f64) -> f64) -> Self {
        Limit::new(f(self.at), self.reached)
    }

    fn negative(self) -> Self {
        Limit { at: -self.at, ..self }
    }
}

impl Range {
    /// Any finite number.
    pub const ALL: Self = Range {
        low: Limit { at: f64::NEG_INFINITY, reached: false },
        high: Limit { at: f64::INFINITY, reached: false },
    };

    /// Creates a range from `low` to `high`, with each end included or not.
    pub fn new(low: f64, high: f64, reached: [bool; 2]) -> Self {
        Range { low: Limit::new(low, reached[0]), high: Limit::new(high, reached[1]) }
    }

    /// Both ends belong to the range.
    pub fn closed(low: f64, high: f64) -> Self {
        Range::new(low, high, [true; 2])
    }

    pub(crate) fn of(value: f64) -> Self {
        Range::closed(value, value)
    }

    pub(crate) fn contains(self, x: f64) -> bool {
        let above = x > self.low.at || (x == self.low.at && self.low.reached);
        above && (x < self.high.at || (x == self.high.at && self.high.reached))
    }

    /// All numbers above zero.
    pub(crate) fn positive(self) -> bool {
        self.low.at > 0.0 || (self.low.at == 0.0 && !self.low.reached)
    }

    pub(crate) fn within(self, low: f64, high: f64) -> bool {
        self.low.at >= low && self.high.at <= high
    }

    /// Returns the smallest range that contains both.
    pub(crate) fn or(self, other: Self) -> Self {
        Range { low: least(&[self.low, other.low]), high: greatest(&[self.high, other.high]) }
    }

    pub(crate) fn negative(self) -> Self {
        Range { low: self.high.negative(), high: self.low.negative() }
    }

    pub(crate) fn plus(self, other: Self) -> Self {
        let sum = |a: Limit, b: Limit, unknown: f64| {
            let at = a.at + b.at;
            Limit::new(if at.is_nan() { unknown } else { at }, a.reached && b.reached)
        };
        let (low, high) = (f64::NEG_INFINITY, f64::INFINITY);
        Range { low: sum(self.low, other.low, low), high: sum(self.high, other.high, high) }
    }

    pub(crate) fn times(self, other: Self) -> Self {
        let ends = [
            product(self.low, other.low),
            product(self.low, other.high),
            product(self.high, other.low),
            product(self.high, other.high),
        ];
        Range { low: least(&ends), high: greatest(&ends) }
    }

    /// Returns the range of x x.
    pub(crate) fn squared(self) -> Self {
        let size = self.size();
        size.times(size)
    }

    /// Returns the range of 1/x for a range without zero.
    pub(crate) fn inverse(self) -> Self {
        let one_over = |end: Limit, sign: f64| match end.at {
            0.0 => Limit::new(sign * f64::INFINITY, false),
            at if at.is_infinite() => Limit::new(0.0, false),
            at => Limit::new(1.0 / at, end.reached),
        };
        let sign = if self.low.at >= 0.0 { 1.0 } else { -1.0 };
        Range { low: one_over(self.high, sign), high: one_over(self.low, sign) }
    }

    /// Returns the range of |x|.
    pub(crate) fn size(self) -> Self {
        if self.low.at >= 0.0 {
            self
        } else if self.high.at <= 0.0 {
            self.negative()
        } else {
            Range { low: Limit::new(0.0, true), high: greatest(&[self.low.negative(), self.high]) }
        }
    }

    pub(crate) fn min(self, other: Self) -> Self {
        Range { low: least(&[self.low, other.low]), high: lower_of(self.high, other.high) }
    }

    pub(crate) fn max(self, other: Self) -> Self {
        self.negative().min(other.negative()).negative()
    }

    /// Returns the range of an increasing function.
    pub(crate) fn through(self, f: impl Fn(f64) -> f64) -> Self {
        Range { low: self.low.map(&f), high: self.high.map(&f) }
    }

    /// Returns the range of a function that can round to its limits, which are then included.
    pub(crate) fn saturating(self, f: impl Fn(f64) -> f64, low: f64, high: f64) -> Self {
        let end = |end: Limit| if end.at == low || end.at == high { Limit::new(end.at, true) } else { end };
        let own = self.through(f);
        Range { low: end(own.low), high: end(own.high) }
    }

    pub(crate) fn shown(self) -> String {
        let end =
            |end: Limit| if end.at.is_infinite() { "any size".to_string() } else { format!("{}", end.at) };
        match (self.low.at.is_infinite(), self.high.at.is_infinite()) {
            (true, true) => "any number".into(),
            (false, true) => format!("from {} on", end(self.low)),
            (true, false) => format!("up to {}", end(self.high)),
            (false, false) => format!("from {} to {}", end(self.low), end(self.high)),
        }
    }
}

fn product(a: Limit, b: Limit) -> Limit {
    // An included zero stays zero in every product. Zero times infinity is a limit.
    if a.at == 0.0 || b.at == 0.0 {
        let reached = (a.at == 0.0 && a.reached) || (b.at == 0.0 && b.reached);
        return Limit::new(0.0, reached);
    }
    let at = a.at * b.at;
    Limit::new(at, at == 0.0 || (a.reached && b.reached)) // what underflows is zero
}

fn least(ends: &[Limit]) -> Limit {
    let at = ends.iter().map(|end| end.at).fold(f64::INFINITY, f64::min);
    Limit::new(at, ends.iter().any(|end| end.at == at && end.reached))
}

fn greatest(ends: &[Limit]) -> Limit {
    let at = ends.iter().map(|end| end.at).fold(f64::NEG_INFINITY, f64::max);
    Limit::new(at, ends.iter().any(|end| end.at == at && end.reached))
}

/// Returns the lower of two upper ends.
fn lower_of(a: Limit, b: Limit) -> Limit {
    match a.at.total_cmp(&b.at) {
        std::cmp::Ordering::Less => a,
        std::cmp::Ordering::Greater => b,
        std::cmp::Ordering::Equal => Limit::new(a.at, a.reached && b.reached),
    }
}
