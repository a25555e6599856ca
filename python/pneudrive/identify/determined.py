"""Results of a fit for its values: intervals, undetermined values, measured values compared with the model."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from pneudrive.estimate.estimates import NORMAL_95
from pneudrive.units import readable

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    from numpy.typing import NDArray

    Array = NDArray[np.float64]

#: Note of a fit of simulated data.
SIMULATED = "from simulated recordings"
#: Explanation of the numbers after "model ±".
MODEL_ERROR_WORDS = (
    "95 %: interval from noise; model ±: change of the value if each held number has an error of 1 % (assumed)"
)


@dataclass(frozen=True)
class Undetermined:
    """Parameter that the data do not determine.

    Attributes
    ----------
    parameter : str
    reason : str
        Reason in words.
    remedy : str
        Measurement that would determine it.
    """

    parameter: str
    reason: str
    remedy: str

    def __str__(self) -> str:
        return f"{self.parameter} cannot be determined: {self.reason}. Remedy: {self.remedy}."


@dataclass(frozen=True)
class FittedData:
    """Measured values and those of the model, SI, shape (n,) each.

    ``x`` and ``y`` name the columns: ``time_s``, ``speed_m_s`` or ``reversal``, and ``position_m``, ``friction_n``, ...
    """

    x: str
    y: str
    at: Array
    measured: Array
    model: Array


class Intervals(dict[str, tuple[float, float]]):
    """95 % intervals by name, SI; values that the data do not determine have none.

    Every result of a fit uses this type, so that no code can print, write or apply an interval of a value that the data
    do not determine.

    Parameters
    ----------
    ends : mapping
        Name -> (lower, upper).
    undetermined : iterable of str or Undetermined
        Undetermined values, by name.
    converged : bool
        False if the search did not converge: then no value has an interval.

    Examples
    --------
    >>> Intervals({"coulomb": (29.0, 31.0), "viscous": (0.0, 900.0)}, ["viscous"])
    {'coulomb': (29.0, 31.0)}
    """

    def __init__(
        self,
        ends: Mapping[str, tuple[float, float]],
        undetermined: Iterable[str | Undetermined] = (),
        *,
        converged: bool = True,
    ) -> None:
        lost = names_of(undetermined)
        super().__init__({n: (float(a), float(b)) for n, (a, b) in ends.items() if converged and n not in lost})

    def __missing__(self, name: str) -> tuple[float, float]:
        raise KeyError(f"{name} has no interval: the data do not determine it, or the search did not converge")


def names_of(undetermined: Iterable[str | Undetermined]) -> set[str]:
    """Return the names of undetermined values."""
    return {str(getattr(one, "parameter", one)) for one in undetermined}


def shown_in(si_unit: str) -> tuple[float, str]:
    """Return the common unit of a value, also of the square of a slope, with its size in SI."""
    return (1e-10, "N/bar2") if si_unit == "N/Pa2" else readable("1" if si_unit == "-" else si_unit)


def whole_interval(value: float, interval: tuple[float, float], systematic: float) -> tuple[float, float]:
    """Return a statistical interval widened by an independent standard uncertainty."""
    if systematic == 0.0:
        return interval
    reach = NORMAL_95 * systematic
    low, high = interval
    return value - float(np.hypot(value - low, reach)), value + float(np.hypot(high - value, reach))
