"""The results of the stops of one series: breakaway against stop duration."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from pneudrive.estimate.groups import levels
from pneudrive.friction.campaign.stops.dwell_curve import SAME_DURATION
from pneudrive.repr_tables import Shown

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from pneudrive.estimate.estimates import Estimate
    from pneudrive.friction.campaign.stops.dwell_curve import DwellCurve
    from pneudrive.friction.campaign.stops.dwell_forms import DwellLawFit
    from pneudrive.friction.campaign.stops.stop import Stop
    from pneudrive.friction.conditions import Condition

    Array = NDArray[np.float64]


def inertia_of(stops: Sequence[Stop]) -> float:
    """Return the median of the largest contributions of the moving mass to the peaks, N."""
    return float(np.median([s.inertia_n for s in stops])) if stops else 0.0


def durations_of(stops: Sequence[Stop]) -> int:
    """Count the durations of some stops."""
    return np.unique(levels(np.log10([max(s.dwell_s, 1e-6) for s in stops]), SAME_DURATION)).size


@dataclass(frozen=True)
class DwellPressure:
    """Effect of the chamber pressures on ageing.

    Attributes
    ----------
    slope_a, slope_b, slope_sum : Estimate or None
        Change of the slope per decade with each pressure, N/Pa; `slope_sum` if both changed together.
    increment_a, increment_b, increment_sum : Estimate or None
        Change of the increment at the reference duration, N/Pa.
    statement : str
    """

    statement: str
    slope_a: Estimate | None = None
    slope_b: Estimate | None = None
    slope_sum: Estimate | None = None
    increment_a: Estimate | None = None
    increment_b: Estimate | None = None
    increment_sum: Estimate | None = None


@dataclass(frozen=True, eq=False, repr=False)
class DwellSeries(Shown):
    """Breakaway against stop duration for one set of levels, restart speed and axis (held, released).

    Attributes
    ----------
    levels : str
        Mounting, seal, drive; "" without levels.
    speed_m_s : float
        Speed of the restart.
    released : bool
    conditions : tuple of Condition
    stops : tuple of Stop
        Those used.
    left_out : int
        Stops of the series that were not used.
    reference_s : float
        Duration of the slopes.
    slopes : tuple of Estimate
        Slope per decade of the increment at the reference duration, at each condition, N. Law-free.
    mean_slopes : tuple of Estimate
        Mean slope per decade from the shortest to the longest duration, at each condition, N. Law-free.
    slope, mean_slope, increment : Estimate or None
        Means over the conditions; increment at the reference duration.
    share : Estimate or None
        `slope` over running friction.
    running_n : float
        Mean running friction of both directions; of one direction, with the offset.
    duration_s : ndarray, shape (m,)
        For the curves below.
    increment_n, low_n, high_n : ndarray, shape (C, m)
        Law-free curve with its pointwise 95 % band at each condition.
    laws : tuple of DwellLawFit
        Best first; empty if fewer than three durations were run.
    pressure : DwellPressure or None
    scatter_n, block_n : float
        Standard deviation from stop to stop, and of blocks.
    outlying : tuple of str
        Keys of outlying stops, which have less weight.
    curve : DwellCurve or None
    """

    levels: str
    speed_m_s: float
    released: bool
    conditions: tuple[Condition, ...]
    stops: tuple[Stop, ...]
    left_out: int
    reference_s: float
    running_n: float
    slopes: tuple[Estimate, ...] = ()
    mean_slopes: tuple[Estimate, ...] = ()
    slope: Estimate | None = None
    mean_slope: Estimate | None = None
    increment: Estimate | None = None
    share: Estimate | None = None
    duration_s: Array = field(default_factory=lambda: np.zeros(0))
    increment_n: Array = field(default_factory=lambda: np.zeros((0, 0)))
    low_n: Array = field(default_factory=lambda: np.zeros((0, 0)))
    high_n: Array = field(default_factory=lambda: np.zeros((0, 0)))
    laws: tuple[DwellLawFit, ...] = ()
    pressure: DwellPressure | None = None
    scatter_n: float = float("nan")
    block_n: float = float("nan")
    outlying: tuple[str, ...] = ()
    curve: DwellCurve | None = None

    @property
    def name(self) -> str:
        """Levels, speed and state of the axis (held, released) as text."""
        held = "released" if self.released else "held"
        parts = [self.levels, f"restart at {1e3 * self.speed_m_s:.3g} mm/s", held]
        return ", ".join(part for part in parts if part)

    @property
    def inertia_n(self) -> float:
        """Median of the largest contributions of the moving mass."""
        return inertia_of(self.stops)

    def slope_at(self, duration_s: float) -> tuple[Estimate, ...]:
        """Return the slope per decade at another duration, at each condition, N. Law-free."""
        if self.curve is None:
            return ()
        return tuple(self.curve.slopes(np.log10([duration_s])).estimates())
