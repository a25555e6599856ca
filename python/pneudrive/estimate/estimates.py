"""Estimates with 95 % intervals, transforms of bounded values, and intervals by profile likelihood."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, TypeVar

import numpy as np
from numpy.typing import ArrayLike
from threadpoolctl import threadpool_limits

from pneudrive.arrays import Array, ArrayPair, Interval

CONFIDENCE = 0.95  # confidence of every interval
#: Two-sided 95 % quantile of the normal distribution.
NORMAL_95 = 1.959963984540054
CHANCE = 0.05  # p below which an effect counts as beyond chance
MOST_FREEDOM = 1e6  # degrees of freedom above which Student's t counts as normal
CHANGED_SHARE = 0.05  # share of its mean; a quantity that varies by less counts as held constant (assumed)
SURE = 3.0  # standard errors of one value


def student(dof: float, confidence: float = CONFIDENCE) -> float:
    """Return the two-sided quantile of Student's t for this confidence.

    For `dof` = 0, return the quantile of the normal distribution.

    Examples
    --------
    >>> round(student(10), 3)
    2.228
    """
    from scipy.special import ndtri, stdtrit

    upper = 0.5 * (1.0 + confidence)
    return float(stdtrit(dof, upper)) if dof > 0 else float(ndtri(upper))


@dataclass(frozen=True)
class Estimate:
    """Value with its 95 % interval.

    Attributes
    ----------
    value, low, high, stderr : float
        Value, interval and standard error; NaN if the data do not determine them.
    unit : str
    degrees_of_freedom : float
        Degrees of freedom of Student's t for the interval.
    p : float
        p-value of the hypothesis that the true value is zero; NaN if the test has no meaning.
    """

    value: float
    low: float
    high: float
    stderr: float
    unit: str = "N"
    degrees_of_freedom: float = np.nan
    p: float = np.nan

    @classmethod
    def of(cls, value: float, stderr: float, degrees_of_freedom: float, unit: str = "N") -> Estimate:
        """Return an estimate with the interval of Student's t and the p-value (hypothesis: zero).

        Examples
        --------
        >>> found = Estimate.of(2.0, 1.0, 10)
        >>> round(found.low, 3), round(found.p, 4)
        (-0.228, 0.0734)
        """
        half = student(min(degrees_of_freedom, MOST_FREEDOM)) * stderr
        p = _chance(value, stderr, degrees_of_freedom)
        return cls(value, value - half, value + half, stderr, unit, degrees_of_freedom, p)

    @property
    def verdict(self) -> str:
        """Statement on whether the value differs significantly from zero."""
        return f"{'beyond' if self.p < CHANCE else 'not beyond'} chance (p = {self.p:.2g})"

    @property
    def differs(self) -> bool:
        """Whether the interval excludes zero."""
        return self.low > 0.0 or self.high < 0.0

    def scaled(self, factor: float, unit: str | None = None) -> Estimate:
        """Return the estimate times a positive factor, in a new unit if one is given."""
        ends = {name: getattr(self, name) * factor for name in ("value", "low", "high", "stderr")}
        return replace(self, **ends, unit=self.unit if unit is None else unit)

    def widened(self, u: float) -> Estimate:
        """Return the estimate with the systematic standard uncertainty `u` added as root sum of squares."""
        if u == 0.0:
            return self
        low, high = whole_interval(self.value, (self.low, self.high), u)
        stderr = float(np.hypot(self.stderr, u))
        return replace(self, low=low, high=high, stderr=stderr, p=_chance(self.value, stderr, self.degrees_of_freedom))

    def __sub__(self, other: Estimate) -> Estimate:
        """Subtract an independent estimate, with Welch's degrees of freedom."""
        variance = self.stderr**2 + other.stderr**2
        shares = [e.stderr**4 / e.degrees_of_freedom for e in (self, other) if e.degrees_of_freedom > 0]
        freedom = float(variance**2 / max(sum(shares), 1e-300)) if shares else np.inf
        return Estimate.of(self.value - other.value, float(np.sqrt(variance)), freedom, self.unit)

    def __format__(self, spec: str) -> str:
        """Format value, unit and interval. `spec` applies to each number.

        Examples
        --------
        >>> f"{Estimate(2.0, 1.0, 3.0, 0.5, 'N'):.2f}"
        '2.00 N (95 %: 1.00 .. 3.00)'
        """
        value, low, high = (format(number, spec) for number in (self.value, self.low, self.high))
        return f"{value} {self.unit} (95 %: {low} .. {high})"


def whole_interval(value: float, interval: Interval, systematic: float) -> Interval:
    """Return the statistical interval of `value`, widened by an independent systematic standard uncertainty."""
    if systematic == 0.0:
        return interval
    reach = NORMAL_95 * systematic
    low, high = interval
    return value - float(np.hypot(value - low, reach)), value + float(np.hypot(high - value, reach))


def _chance(value: float, stderr: float, freedom: float) -> float:
    """Return the two-sided p-value of the hypothesis that the true value is zero."""
    from scipy.special import stdtr

    if not stderr > 0.0:
        return float(value == 0.0)
    return 2.0 * float(stdtr(min(freedom, MOST_FREEDOM), -abs(value) / stderr))


def mean_estimate(values: Array, unit: str = "N") -> Estimate:
    """Estimate the mean of repeats, with the interval of Student's t.

    Parameters
    ----------
    values : ndarray, shape (n,)
        Two or more values in `unit`.
    unit : str

    Returns
    -------
    Estimate

    Examples
    --------
    >>> found = mean_estimate(np.array([1.0, 2.0, 3.0]))
    >>> round(found.value, 3), round(found.high, 3)
    (2.0, 4.484)
    """
    n = values.size
    stderr = float(values.std(ddof=1) / np.sqrt(n))
    return Estimate.of(float(values.mean()), stderr, n - 1, unit)


def rms(values: ArrayLike) -> float:
    """Return the root mean square.

    Examples
    --------
    >>> rms([3.0, -4.0, 5.0, 0.0])
    3.5355339059327378
    """
    return float(np.sqrt(np.mean(np.square(values))))


@dataclass(frozen=True)
class FTest:
    """Result of an F-test: statistic, degrees of freedom of numerator and denominator, p-value."""

    f: float
    numerator: float
    denominator: float
    p: float


def changed(values: Array, stderr: float = 0.0) -> bool:
    """Return whether a quantity varies by a relevant fraction of its mean, and by more than its scatter.

    If one of two quantities does not vary in this sense, a correlation between both is only noise.

    Parameters
    ----------
    values
        Shape (n,).
    stderr
        Standard error of one value.

    Examples
    --------
    >>> changed(np.array([149.9995, 149.9954, 150.0031])), changed(np.array([100.0, 150.0]))
    (False, True)
    """
    span = float(np.ptp(values)) if values.size else 0.0
    return span > max(CHANGED_SHARE * float(np.abs(values).mean() if values.size else 0.0), SURE * stderr)


def robust_deviation(residual: Array) -> float:
    """Estimate the standard deviation of normal residuals by their median magnitude, which is robust to outliers."""
    return float(np.median(np.abs(residual))) / 0.6745


# --- Transforms between bounded values and the unbounded coordinates of a search.
#
#     signed                x = size q
#     above a bound         x = lower + exp(q)
#     between two bounds    x = lower + (upper - lower) / (1 + exp(-q))
#     an excess             x = base + exp(q), base another value or a number
#
# The Jacobians are exact. First-order intervals are computed on the scale of the coordinate: the logarithm of a
# positive value, the logit of a value between two bounds [bates1988].

#: Smallest distance from a bound, as a fraction of the range between two bounds.
MARGIN = 1e-6
#: Largest exponent in the factors of an interval, to avoid overflow.
MOST_EXPONENT = 700.0


class Transforms:
    """Transformation between p bounded values and unbounded coordinates.

    Parameters
    ----------
    lower, upper : array_like, shape (p,)
        Open bounds. A value without a lower bound may be negative.
    size : array_like, shape (p,)
        Typical change of a value that may be negative.
    excess : int, optional
        Index of a value that must exceed another value.
    over : int or float
        The other value, as an index or a constant.
    least_excess : float
        Smallest excess as a fraction of the other value. A smaller excess is increased to this one.

    Examples
    --------
    >>> scales = Transforms([0.0, 0.0], excess=1, over=0)
    >>> q = scales.internal([30.0, 40.0])
    >>> q.round(3), scales.natural(q).round(9)
    (array([3.401, 2.303]), array([30., 40.]))
    >>> scales.jacobian(q).round(9)
    array([[30.,  0.],
           [30., 10.]])
    """

    def __init__(
        self,
        lower: ArrayLike,
        upper: ArrayLike = np.inf,
        size: ArrayLike = 1.0,
        *,
        excess: int | None = None,
        over: float = 0,
        least_excess: float = 1e-9,
    ) -> None:
        lower = np.array(lower, dtype=float)
        alike = (np.broadcast_to(values, lower.shape) for values in (lower, upper, size))
        self.lower, self.upper, self.size = map(np.array, alike)
        self.excess, self.over, self.least_excess = excess, over, least_excess
        if excess is not None:
            self.lower[excess], self.upper[excess] = 0.0, np.inf
        self.signed = np.isinf(self.lower)
        self._odds = ~self.signed & np.isfinite(self.upper)
        self._log = ~self.signed & ~self._odds

    def _base(self, values: Array) -> Any:  # noqa: ANN401 - a number, or one for each point
        return values[..., self.over] if isinstance(self.over, int) else self.over

    def internal(self, values: ArrayLike) -> Array:
        """Return the coordinates (p,) of `values` (p,)."""
        x = np.array(values, dtype=float)
        if self.excess is not None:
            base = self._base(x)
            x[self.excess] = max(x[self.excess] - base, self.least_excess * max(abs(base), 1e-12))
        q = x / self.size
        q[self._log] = np.log((x - self.lower)[self._log])
        low, high = self.lower[self._odds], self.upper[self._odds]
        inside = np.clip(x[self._odds], low + MARGIN * (high - low), high - MARGIN * (high - low))
        q[self._odds] = np.log((inside - low) / (high - inside))
        return q

    def natural(self, q: Array) -> Array:
        """Return the values at the coordinates of one point, shape (p,), or of many points, shape (n, p)."""
        x = self.size * q
        x[..., self._log] = self.lower[self._log] + _exp(q[..., self._log])
        low, high = self.lower[self._odds], self.upper[self._odds]
        x[..., self._odds] = low + (high - low) * (1.0 / (1.0 + _exp(-q[..., self._odds])))
        if self.excess is not None:
            x[..., self.excess] += self._base(x)
        return x

    def jacobian(self, q: Array) -> Array:
        """Return the derivatives (p, p) of the values with respect to the coordinates."""
        slope = self.size.copy()
        slope[self._log] = _exp(q[self._log])
        share = 1.0 / (1.0 + _exp(-q[self._odds]))
        slope[self._odds] = (self.upper[self._odds] - self.lower[self._odds]) * share * (1.0 - share)
        out = np.diag(slope)
        if self.excess is not None and isinstance(self.over, int):
            out[self.excess, self.over] = slope[self.over]
        return out


def _exp(q: Array) -> Array:
    """Return exp(q). An overflow gives infinity without a warning."""
    with np.errstate(over="ignore"):
        return np.exp(q)


def intervals(values: Array, reach: Array, lower: ArrayLike, upper: ArrayLike = np.inf) -> ArrayPair:
    """Return the lower and upper ends (p,) of first-order intervals on the scales of the coordinates.

    Parameters
    ----------
    values, reach : ndarray, shape (p,)
        Values within their bounds, and half widths of their first-order intervals.
    lower, upper : array_like, shape (p,)
        Bounds, as for `Transforms`.

    Examples
    --------
    >>> low, high = intervals(np.array([10.0, -1.0]), np.array([2.0, 3.0]), [0.0, -np.inf])
    >>> low.round(3), high.round(3)
    (array([ 8.187, -4.   ]), array([12.214,  2.   ]))
    """
    lower, upper = (np.broadcast_to(bound, values.shape) for bound in (lower, upper))
    low, high = values - reach, values + reach
    for k in np.flatnonzero(np.isfinite(lower)):
        above = values[k] - lower[k]
        if np.isinf(upper[k]):
            factor = np.exp(min(reach[k] / above, MOST_EXPONENT))
            low[k], high[k] = lower[k] + above / factor, lower[k] + above * factor
            continue
        room, below = upper[k] - lower[k], upper[k] - values[k]
        factor = np.exp(min(reach[k] * room / (above * below), MOST_EXPONENT))
        odds = above / below
        shares = (o / (1.0 + o) for o in (odds / factor, odds * factor))
        low[k], high[k] = (lower[k] + room * share for share in shares)
    return low, high


# --- Intervals by profile likelihood: one coordinate is held, all others are fitted again [bates1988].

Point = TypeVar("Point")

#: Largest number of steps to find a bound, and tolerance of the square root of the cost increase at the bound.
STEPS, ROOT_ERROR = 12, 0.02
#: Distance from the estimate after which a side without sufficient cost increase counts as open.
FARTHEST = 50.0
#: Smallest distance of a step from the ends of the bracket, as a fraction of the bracket; largest growth factor of a
#: step.
INSET, GROWTH = 0.1, 3.0


def profile_interval(
    held: Callable[[float, Point], tuple[float, Point]],
    point: Point,
    estimate: float,
    step: float,
    least: float,
    allowed: float,
    farthest: float = FARTHEST,
) -> Interval:
    """Return the interval of one coordinate in which the cost increases by at most `allowed`.

    For a linear model, the square root of the cost increase is linear in the coordinate, so a secant method finds each
    bound. Steps stay in the bracket between the farthest point below the limit and the nearest point beyond the limit.
    The method is therefore robust to the scatter of incompletely minimised costs. A side is open only if no point is
    beyond the limit.

    Parameters
    ----------
    held : callable
        ``held(value, start)`` fixes the coordinate at a value, fits all others from a start, and returns the cost and
        the final point. A step starts from the last point below the limit. The cost may be infinite.
    point : object
        Point of the estimate, from which the first step to either side starts.
    estimate : float
        Coordinate at the estimate.
    step : float
        First step; the half width of the first-order interval.
    least, allowed : float
        Cost at the estimate, and allowed cost increase at the bounds.
    farthest : float
        Distance from the estimate beyond which a side is open.

    Returns
    -------
    float, float
        Ends of the interval; infinite if the cost does not increase by `allowed`.

    Examples
    --------
    The model 3 x, 6 x, 9 x fits the values 3, 6, 9 at x = 1. The cost increases by (3^2 + 6^2 + 9^2) (x - 1)^2.

    >>> low, high = profile_interval(lambda x, _: (126.0 * (x - 1.0) ** 2, None), None, 1.0, 0.1, 0.0, 126.0)
    >>> round(low, 6), round(high, 6)
    (0.0, 2.0)
    """
    first = min(step if step > 0.0 else 1.0, farthest)

    def end(sign: float) -> float:
        """Return the signed distance to one end; infinite if no point up to `farthest` is beyond the limit."""
        away, begin = first, point
        below, beyond = [(0.0, 0.0)], (np.inf, np.inf)  # distances, and roots of the cost's growth
        for _ in range(STEPS):
            cost, ended = held(estimate + sign * away, begin)
            root = float(np.sqrt(max(cost - least, 0.0) / allowed)) if np.isfinite(cost) else np.inf
            if abs(root - 1.0) < ROOT_ERROR:
                return sign * away
            if root < 1.0:
                below.append((away, root))
                begin = ended
            else:
                beyond = (away, root)
            last, root_last = below[-1]
            if np.isfinite(beyond[0]):
                share = (1.0 - root_last) / (beyond[1] - root_last) if np.isfinite(beyond[1]) else 0.5
                away = last + (beyond[0] - last) * float(np.clip(share, INSET, 1.0 - INSET))
            elif last >= farthest:
                break
            else:
                before, root_before = below[-2]
                slope = (root_last - root_before) / (last - before)
                away = last + (1.0 - root_last) / slope if slope > 0.0 else np.inf
                away = min(max(away, (1.0 + INSET) * last), GROWTH * last, farthest)
        return sign * (away if np.isfinite(beyond[0]) else np.inf)

    return estimate + end(-1.0), estimate + end(1.0)


def one_thread() -> threadpool_limits:
    """Return a context in which linear algebra uses one thread.

    The matrices are small. On a busy machine, waiting threads cost more time than they save: 47 s instead of 3 s on two
    busy processors.
    """
    return threadpool_limits(limits=1, user_api="blas")
