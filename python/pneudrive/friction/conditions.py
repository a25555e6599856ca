"""Condition of a curve, skipped cycles, and the slopes that pressure pairs determine."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

PA_PER_BAR = 1e5
TOLD = {"both": ("a", "b"), "a": ("a",), "b": ("b",)}  # chambers whose pressure has a separate effect
SAME_SLOPE = 1e-3  # of the largest pressure: pairs nearer to one line do not determine both effects
ALL_RECORDINGS = "all recordings"  # the group of recordings without labels of their assembly
LEVELS = ("mounting", "seal", "drive")  # labels of the assembly: different ones never share a curve
BOTH = 0  # `direction` of half the difference of both directions


@dataclass(frozen=True, order=True)
class Condition:
    """Condition of a curve, in addition to speed and direction.

    Attributes
    ----------
    pressure_a_pa, pressure_b_pa : float
        Absolute pressures, as planned.
    mounting, seal, drive : str
        Levels of the hard-to-change factors; "" if the campaign has none.
    """

    pressure_a_pa: float
    pressure_b_pa: float
    mounting: str = ""
    seal: str = ""
    drive: str = ""

    @property
    def levels(self) -> tuple[str, str, str]:
        """Mounting, seal, drive."""
        return self.mounting, self.seal, self.drive

    @property
    def title(self) -> str:
        """Present levels, as text."""
        return ", ".join(level for level in self.levels if level)

    def label(self, ambient_pressure_pa: float) -> str:
        """Return its name: gauge pressures, then the present levels.

        Examples
        --------
        >>> Condition(151325.0, 101325.0, seal="NBR").label(101325.0)
        'a 0.5 bar, b 0 bar, NBR'
        """
        a, b = ((p - ambient_pressure_pa) / PA_PER_BAR for p in (self.pressure_a_pa, self.pressure_b_pa))
        pressures = f"{_tidy(a)} bar in both" if abs(a - b) < 1e-3 else f"a {_tidy(a)} bar, b {_tidy(b)} bar"
        return f"{pressures}, {self.title}" if self.title else pressures


def _tidy(bar: float) -> str:
    return f"{bar:.3g}" if abs(bar) >= 5e-4 else "0"


@dataclass(frozen=True)
class Skipped:
    """A cycle that was left out, and the reason."""

    key: str
    file: str
    reason: str


def group_of(labels: Mapping[str, str]) -> str:
    """Return the name of the assembly, from the labels of mounting, seal and drive.

    Examples
    --------
    >>> group_of({"seal": "NBR", "run": "2"}), group_of({})
    ('NBR', 'all recordings')
    """
    return ", ".join(labels[name] for name in LEVELS if labels.get(name)) or ALL_RECORDINGS


def classify_pressures(pairs: NDArray[np.float64]) -> str:
    """Return the slopes that pressure pairs determine: both, one, their sum, or one along a line."""
    away = pairs - pairs.mean(axis=0)
    scale = max(float(np.abs(pairs).max()), 1e-12)
    spans = np.ptp(pairs, axis=0)
    if spans[1] < SAME_SLOPE * scale:
        return "a"
    if spans[0] < SAME_SLOPE * scale:
        return "b"
    if np.linalg.svd(away, compute_uv=False)[1] > SAME_SLOPE * scale:
        return "both"
    return "sum" if np.abs(pairs[:, 0] - pairs[:, 1]).max() < SAME_SLOPE * scale else "line"
