"""What an identification hands to a drive: values by their names in the drive file, intervals, recordings.

Fits of friction maps and fits of whole records both end here, so that a drive file says of each value where it is from.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from pneudrive import units
from pneudrive.describe.base import Quantity, StatedPressure
from pneudrive.describe.friction import friction_laws, parameter_quantities
from pneudrive.describe.provenance import marks as marks_of
from pneudrive.describe.provenance import values as values_of
from pneudrive.errors import FitError, nearest

if TYPE_CHECKING:
    from collections.abc import Mapping

    from pneudrive.describe import Drive

#: Digits of the bounds of an interval, which are rounded outwards.
DIGITS = 5
MOST_SOURCES = 6


@dataclass(frozen=True)
class Identified:
    """Identified values of a drive.

    Attributes
    ----------
    values : dict
        Dotted name in the drive file (``friction.coulomb``, ``cylinder.dead_volume.a``) -> SI, pressures absolute.
    intervals : dict
        Name -> (lower, upper), SI; infinite where nothing bounds it. A value without one gets no provenance.
    sources : dict
        Name -> recordings that it comes from.
    fit : str
        Hash by which the fit is found again.
    confidence : float
        Probability that the intervals are meant to cover with.
    """

    values: Mapping[str, float]
    intervals: Mapping[str, tuple[float, float]]
    sources: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    fit: str = ""
    confidence: float = 0.95

    def origins(self, marks: Mapping[str, Quantity | StatedPressure | None]) -> dict[str, dict[str, object]]:
        """Tables of provenance, with the units that `marks` give."""
        out = {}
        for name, (low, high) in self.intervals.items():
            if name not in self.values:
                continue
            mark = marks.get(name)
            ends = [_written(_outward(low, up=False), mark), _written(_outward(high, up=True), mark)]
            origin = {"interval": ends, "confidence": self.confidence, "source": _joined(self.sources.get(name, ()))}
            out[name] = origin | ({"fit": self.fit} if self.fit else {})
        return out


def apply_identified(found: Identified, drive: Drive, tables: Mapping[str, object] | None = None) -> Drive:
    """Return a drive with identified values, each with its interval and its recordings.

    Parameters
    ----------
    found : Identified
    drive : Drive
    tables : mapping, optional
        Further changes that go with the values, as of `Drive.replace`: a law, a shape.

    Raises
    ------
    FitError
        A value that the drive has not.
    DescriptionError
        A value that the drive refuses.
    """
    changes: dict[str, object] = dict(tables or {})
    known = marks_of(drive)
    law = changes.get("friction.law")
    entry = drive.friction.entry if law is None else friction_laws()[str(law)]
    known |= {f"friction.{key}": mark for key, mark in parameter_quantities(entry).items()}
    for name, value in found.values.items():
        table, _, last = name.rpartition(".")
        if last in ("a", "b"):
            changes[table] = _both(found, drive, table)
        elif name in known:
            changes[name] = _written(value, known[name])
        else:
            raise FitError(f"the fit has {name}, which this drive does not have", remedy=nearest(name, known))
    after = drive.replace(changes)
    return after.replace({"provenance": found.origins(marks_of(after))})


def _both(found: Identified, drive: Drive, table: str) -> dict[str, str]:
    """Values of both chambers, those that were not identified as they are, or none."""
    known = values_of(drive)
    keys = {c: f"{table}.{c}" for c in "ab"}
    marks = [known[key].mark for key in keys.values() if key in known]
    si_unit = marks[0].si_unit if marks and isinstance(marks[0], Quantity) else "N/Pa"
    kept = {c: known[key].si if key in known else 0.0 for c, key in keys.items()}
    return {c: units.write(found.values.get(key, kept[c]), si_unit) for c, key in keys.items()}


def _written(value: float, mark: Quantity | StatedPressure | None) -> str | float:
    if not math.isfinite(value):
        return "inf" if value > 0.0 else "-inf"
    if isinstance(mark, StatedPressure):
        return f"{units.write(value, 'Pa', 'bar')} abs"
    if isinstance(mark, Quantity) and mark.si_unit:
        return units.write(value, mark.si_unit, mark.written)
    return value


def _outward(value: float, *, up: bool) -> float:
    """Round a bound away from what it encloses."""
    if not math.isfinite(value) or value == 0.0:
        return value
    step = 10.0 ** (math.floor(math.log10(abs(value))) - DIGITS + 1)
    away = math.ceil(value / step) if up else math.floor(value / step)
    return float(f"{away * step:.{DIGITS}g}")


def _joined(names: tuple[str, ...]) -> str:
    if not names:
        return "not stated"
    more = len(names) - MOST_SOURCES
    return ", ".join(names[:MOST_SOURCES]) + (f" and {more} more" if more > 0 else "")
