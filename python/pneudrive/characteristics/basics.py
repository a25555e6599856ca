"""Words of every result: the condition of a curve, a sentence on the data, a cycle that was not counted."""

from __future__ import annotations

from dataclasses import dataclass

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

    @property
    def levels(self) -> tuple[str, str, str]:
        """Mounting, seal, drive."""
        return self.mounting, self.seal, self.drive

    @property
    def title(self) -> str:
        """Levels that there are, in words."""
        return ", ".join(level for level in self.levels if level)

    def label(self, ambient_pressure_pa: float) -> str:
        """Name it as people say it: gauge pressures, then the levels that there are.

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
class Statement:
    """A sentence on what the data carry, or do not carry and what would.

    Attributes
    ----------
    topic : str
        curve, direction, pressure, air, position, stops, drift, repeatability, stick-slip, zero, range, data.
    text : str
    carried : bool
        Whether the data carry what was asked for.
    remedy : str
        Which cycles to add; "" where nothing is missing.
    """

    topic: str
    text: str
    carried: bool = True
    remedy: str = ""

    def __str__(self) -> str:
        """Text and remedy."""
        return f"{self.text} Remedy: {self.remedy}" if self.remedy else self.text


@dataclass(frozen=True)
class Skipped:
    """A cycle that was not counted, and why."""

    key: str
    file: str
    reason: str
