"""Estimates with their intervals."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from pneudrive.arrays import Array

CONFIDENCE = 0.95  # confidence of every interval
#: Two-sided 95 % quantile of the normal distribution.
NORMAL_95 = 1.959963984540054
CHANCE = 0.05  # p below which an effect counts as beyond chance
MOST_FREEDOM = 1e6  # degrees of freedom above which Student's t counts as normal
CHANGED_SHARE = 0.05  # share of its mean; a quantity that varies by less counts as held constant (assumed)
SURE = 3.0  # standard errors of one value


def student(dof: float, confidence: float = CONFIDENCE) -> float:
    """Return the two-sided quantile of Student's t, by default 95 %.

    Without degrees of freedom, return the quantile of the normal distribution.

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
        """Return an estimate with the interval of Student's t and the p-value of zero.

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
        """Return the estimate multiplied by a positive number."""
        ends = {name: getattr(self, name) * factor for name in ("value", "low", "high", "stderr")}
        return replace(self, **ends, unit=self.unit if unit is None else unit)

    def widened(self, u: float) -> Estimate:
        """Return the estimate with a systematic standard uncertainty added."""
        if u == 0.0:
            return self
        below, above = (
            float(np.hypot(side, NORMAL_95 * u)) for side in (self.value - self.low, self.high - self.value)
        )
        stderr = float(np.hypot(self.stderr, u))
        p = _chance(self.value, stderr, self.degrees_of_freedom)
        return replace(self, low=self.value - below, high=self.value + above, stderr=stderr, p=p)

    def __sub__(self, other: Estimate) -> Estimate:
        """Subtract an independent estimate, with Welch's degrees of freedom."""
        variance = self.stderr**2 + other.stderr**2
        shares = [e.stderr**4 / e.degrees_of_freedom for e in (self, other) if e.degrees_of_freedom > 0]
        freedom = float(variance**2 / max(sum(shares), 1e-300)) if shares else np.inf
        return Estimate.of(self.value - other.value, float(np.sqrt(variance)), freedom, self.unit)

    def __format__(self, spec: str) -> str:
        """Format value, unit and interval, each number by the same specification.

        Examples
        --------
        >>> f"{Estimate(2.0, 1.0, 3.0, 0.5, 'N'):.2f}"
        '2.00 N (95 %: 1.00 .. 3.00)'
        """
        value, low, high = (format(number, spec) for number in (self.value, self.low, self.high))
        return f"{value} {self.unit} (95 %: {low} .. {high})"


def _chance(value: float, stderr: float, freedom: float) -> float:
    """Return the two-sided p-value of the hypothesis that the true value is zero."""
    from scipy.special import stdtr

    if not stderr > 0.0:
        return float(value == 0.0)
    return 2.0 * float(stdtr(min(freedom, MOST_FREEDOM), -abs(value) / stderr))


def mean_estimate(values: Array, unit: str = "N") -> Estimate:
    """Estimate the mean of repeats, with Student's t.

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
    return Estimate.of(float(values.mean()), float(values.std(ddof=1) / np.sqrt(n)), n - 1, unit)


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
    """Return whether a quantity was varied: by a relevant fraction of its mean, and by more than its scatter.

    If one of two quantities was not varied, their correlation is noise.

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
    """Return the standard deviation of normal residuals from their median absolute value, robust to outliers."""
    return float(np.median(np.abs(residual))) / 0.6745
