"""Words of every result: the condition of a curve, an estimate with its interval, a test."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from pneudrive.characterise.spread import student

if TYPE_CHECKING:
    from numpy.typing import NDArray

PA_PER_BAR = 1e5
BOTH = 0  # direction of a curve that is half the difference of both directions


@dataclass(frozen=True, order=True)
class Condition:
    """What a curve is for, beside speed and direction.

    Attributes
    ----------
    pressure_a_pa, pressure_b_pa : float
        Absolute pressures, as planned.
    mounting, seal, drive : str
        Levels of the hard-to-change factors; "" where the campaign has none.
    """

    pressure_a_pa: float
    pressure_b_pa: float
    mounting: str = ""
    seal: str = ""
    drive: str = ""

    def label(self, ambient_pressure_pa: float) -> str:
        """Name it as people say it: gauge pressures, then the levels that there are.

        Examples
        --------
        >>> Condition(151325.0, 101325.0, seal="NBR").label(101325.0)
        'a 0.5 bar, b 0 bar, NBR'
        """
        a, b = ((p - ambient_pressure_pa) / PA_PER_BAR for p in (self.pressure_a_pa, self.pressure_b_pa))
        pressures = f"{_tidy(a)} bar in both" if abs(a - b) < 1e-3 else f"a {_tidy(a)} bar, b {_tidy(b)} bar"
        return ", ".join([pressures, *(level for level in (self.mounting, self.seal, self.drive) if level)])


def _tidy(bar: float) -> str:
    return f"{bar:.3g}" if abs(bar) >= 5e-4 else "0"


@dataclass(frozen=True)
class Estimate:
    """A value with its 95 % interval.

    Attributes
    ----------
    value, low, high, stderr : float
        NaN where the data do not carry it.
    unit : str
    degrees_of_freedom : float
        Of Student's t behind the interval.
    p : float
        Probability of a value as far from zero by chance; NaN where zero is no question.
    """

    value: float
    low: float
    high: float
    stderr: float
    unit: str = "N"
    degrees_of_freedom: float = float("nan")
    p: float = float("nan")


def mean_estimate(values: NDArray[np.float64], unit: str = "N") -> Estimate:
    """Estimate the mean of repeats, with Student's t.

    Parameters
    ----------
    values : ndarray, shape (n,)
        Two or more, in `unit`.
    unit : str

    Returns
    -------
    Estimate

    Examples
    --------
    >>> import numpy as np
    >>> found = mean_estimate(np.array([1.0, 2.0, 3.0]))
    >>> round(found.value, 3), round(found.high, 3)
    (2.0, 4.484)
    """
    from scipy.special import stdtr

    n = values.size
    mean, stderr = float(values.mean()), float(values.std(ddof=1) / np.sqrt(n))
    half = student(n - 1) * stderr
    p = 2.0 * float(stdtr(n - 1, -abs(mean) / stderr)) if stderr > 0 else float(mean == 0.0)
    return Estimate(mean, mean - half, mean + half, stderr, unit, n - 1, p)


@dataclass(frozen=True)
class FTest:
    """An F-test: statistic, degrees of freedom of numerator and denominator, probability by chance."""

    f: float
    numerator: float
    denominator: float
    p: float
