"""Friction modifiers of a fit in addition to speed and pressure: direction, position, stops, temperature."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any

from pneudrive.describe.tables.friction import has_bristles


@dataclass(frozen=True)
class Dependences:
    """Measured friction modifiers in addition to the sliding law.

    Attributes
    ----------
    tables : dict
        Key in ``[friction]`` -> table of a drive file: ``direction``, ``position``, ``dwell``, ...
    values : dict
        Dotted name in the drive file -> value in SI, of values with an interval.
    intervals : dict
        Dotted name -> (lower, upper), 95 %, SI.
    sliding : dict
        ``coulomb`` and ``breakaway`` -> force in N from the age of a sliding contact. A measured sliding law includes
        it, and so does ``[friction.dwell]`` of a drive, so it is subtracted when both are combined.
    notes : tuple of str
        Measured effects that a drive cannot have, each with the reason; assumptions.
    source : str
        Campaign.
    """

    tables: dict[str, dict[str, Any]] = field(default_factory=dict)
    values: dict[str, float] = field(default_factory=dict)
    intervals: dict[str, tuple[float, float]] = field(default_factory=dict)
    sliding: dict[str, float] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
    source: str = ""

    def table(self) -> dict[str, Any]:
        """Return the table for fit.toml; empty if nothing was measured."""
        if not self.tables and not self.notes:
            return {}
        ends = {name: [self.values[name], *self.intervals[name]] for name in self.intervals}
        said = {"source": self.source, "notes": list(self.notes)}
        return said | {"sliding": self.sliding, "intervals": ends, "friction": self.tables}

    @classmethod
    def of_table(cls, content: dict[str, Any]) -> Dependences:
        """Return the modifiers from a table of :meth:`table`."""
        ends = {name: tuple(float(end) for end in three) for name, three in content.get("intervals", {}).items()}
        return cls(
            tables=dict(content.get("friction", {})),
            values={name: three[0] for name, three in ends.items()},
            intervals={name: (three[1], three[2]) for name, three in ends.items()},
            sliding={name: float(force) for name, force in content.get("sliding", {}).items()},
            notes=tuple(content.get("notes", ())),
            source=str(content.get("source", "")),
        )

    def for_law(self, law: str) -> Dependences:
        """Return the modifiers for a law; relaxation is left out if the law has no bristles."""
        return self if has_bristles(law) else self.without("relaxation")

    def without(self, key: str) -> Dependences:
        """Return the modifiers without one of them."""
        return replace(
            self,
            tables={name: table for name, table in self.tables.items() if name != key},
            intervals={n: ends for n, ends in self.intervals.items() if not n.startswith(f"friction.{key}.")},
        )
