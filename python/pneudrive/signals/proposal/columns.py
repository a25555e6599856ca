"""Columns of a foreign table as evidence: statements of the header, and properties of the numbers."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from pneudrive.signals.motion import local_slope, noise_level, turning_points
from pneudrive.signals.tables.column_units import HeaderUnit, header_unit, split_name
from pneudrive.signals.tables.names import NUMBERING, role_of, words_of

if TYPE_CHECKING:
    from collections.abc import Iterable

    from numpy.typing import NDArray

    from pneudrive.signals.tables.sniff import FileForm

    Array = NDArray[np.float64]

GROUPED = ("tdms", "mf4")  # formats with names group/channel
RAW = ("V", "mV", "mA", "count")  # units of sensors whose scale the file does not state
ONCE = 1.0  # added to the unevenness of a signal that moves in one direction only
HELD_SHARE = 0.9  # share of samples equal to the previous one: a held command, not a measured force
SAME_SIGNAL = 0.98  # least correlation of columns that may be one signal in two units
BINS = 20  # of the travel, in which both directions are compared
MOST_BINS = 0.75  # least share of them that agree on a direction
NAME, SECOND_NAME, UNIT, PHYSICS = 2, 1, 2, 1  # weights of the evidence (assumed): any two beat one
FEWEST = 3  # least number of values for a guess


@dataclass
class FileColumn:
    """A column of a foreign table.

    Attributes
    ----------
    index : int
        Number in the file.
    place : int or str
        Name or number by which a layout names it.
    name, bare : str
        Name in the header, and without its unit.
    unit : HeaderUnit or None
        Stated unit.
    unknown : str
        Stated unit that is not known.
    values : ndarray
        Numbers at the times of the table, after slow channels were filled and wraps of counters removed.
    """

    index: int
    place: int | str
    name: str
    bare: str
    unit: HeaderUnit | None
    unknown: str
    values: Array

    @property
    def role(self) -> str | None:
        """The role that the name states; a time also if the name is a unit of time."""
        return role_of(self.bare) or role_of(self.name)

    @property
    def is_raw(self) -> bool:
        """Whether the numbers are volts, milliamperes or counts of a sensor."""
        return self.unit is not None and self.unit.unit in RAW

    @property
    def may_be_pressure(self) -> bool:
        """Whether neither name nor unit exclude a pressure, and the numbers change."""
        fits = self.unit is None or self.unit.si == "Pa" or self.is_raw
        is_signal = np.nanmax(self.values) > np.nanmin(self.values) and not NUMBERING.search(words_of(self.name))
        return fits and self.role in (None, "pressure") and bool(is_signal)


class Candidate(NamedTuple):
    """A column that may have a role, with the weight of its evidence."""

    column: FileColumn
    score: float
    evidence: tuple[str, ...]

    def with_evidence(self, text: str) -> Candidate:
        """Return the candidate with evidence from the numbers."""
        return Candidate(self.column, self.score + PHYSICS, (*self.evidence, text))


def file_column(form: FileForm, index: int, values: Array) -> FileColumn:
    """Read the header of a column."""
    names = form.names
    name = names[index] if index < len(names) else ""
    short = name.rpartition("/")[2] if form.format in GROUPED else name
    bare, unit = split_name(short)
    cell = form.units[index].strip() if index < len(form.units) else ""
    opened = short.rpartition("[")[2].partition("]")
    is_unit = opened[1] and not opened[2].strip() and not opened[0].isdigit()
    unknown = opened[0] if unit is None and is_unit else ""
    if cell.strip("[]()- "):
        bare, unit = (short if unit is None else bare), header_unit(cell)
        unknown = "" if unit else cell
    elif unit is None and form.format in GROUPED and short == "time":
        unit = HeaderUnit("s", "s")
    is_unique = bool(name) and names.count(name) == 1 and (form.form.header or form.format != "csv")
    return FileColumn(index, name if is_unique else index, name, bare, unit, unknown, values)


def is_held(values: Array) -> bool:
    """Return whether a column is constant from sample to sample, with occasional steps."""
    steps = np.diff(values[np.isfinite(values)])
    return bool(steps.size and steps.any() and (steps == 0).mean() > HELD_SHARE)


def different_signals(columns: Iterable[FileColumn]) -> list[FileColumn]:
    """Return the last column of each signal, of columns such as volts and newtons of one sensor."""
    groups: list[list[FileColumn]] = []
    for column in columns:
        if not np.isfinite(column.values).all() or np.ptp(column.values) == 0:
            continue
        group = next((group for group in groups if same_signal(group[0].values, column.values)), None)
        if group is None:
            groups.append([column])
        else:
            group.append(column)
    return [group[-1] for group in groups]


def same_signal(first: Array, second: Array) -> bool:
    """Return whether two columns are one signal in two units: related by a straight line, except for rounding."""
    both = np.isfinite(first) & np.isfinite(second)
    first, second = first[both], second[both]
    if first.size < FEWEST or not np.ptp(first) or not np.ptp(second):
        return False
    if abs(np.corrcoef(first, second)[0, 1]) < SAME_SIGNAL:
        return False
    slope, intercept = np.polyfit(first, second, 1)
    rest = float(np.std(second - slope * first - intercept))
    steps = [float(np.min(s[s > 0], initial=np.inf)) for s in (np.diff(np.unique(v)) for v in (first, second))]
    return rest <= max(abs(slope) * steps[0], steps[1])


def unevenness(values: Array, *, is_one_of_many: bool) -> float:
    """Return the deviation of a signal from even strokes between turning points.

    The ratio is 1 for a triangle, and infinite without motion.
    """
    values = values[np.isfinite(values)]
    if values.size < FEWEST:
        return np.inf
    span = float(np.ptp(values))
    points = turning_points(values, 0.3 * span)
    if span == 0 or points.size < (2 if is_one_of_many else 3) or noise_level(values) > 0.02 * span:
        return np.inf
    once = ONCE if points.size < 3 else 0.0
    needed = float(np.abs(np.diff(values[points])).sum())
    middle = ((values > values.min() + 0.2 * span) & (values < values.min() + 0.8 * span)).mean()
    # An even stroke spends 60 % of its time in the middle 60 % of its travel. A switched signal spends almost no time
    # there.
    return float(np.abs(np.diff(values)).sum()) / needed + 5 * abs(middle - 0.6) + once


@dataclass(frozen=True)
class Directions:
    """Samples at which the piston moves: towards +x, towards -x, and their position along the travel."""

    up: NDArray[np.bool_]
    down: NDArray[np.bool_]
    bins: NDArray[np.int64]

    @classmethod
    def of(cls, position: Array) -> Directions:
        """Find the moving samples of a motion, without times."""
        good = np.isfinite(position)
        at = np.flatnonzero(good)
        velocity = np.zeros(position.size)
        bins = np.zeros(position.size, dtype=np.int64)
        if at.size >= FEWEST and np.ptp(position[good]) > 0:
            velocity[good] = local_slope(at.astype(float), position[good])
            away = (position[good] - position[good].min()) / np.ptp(position[good])
            bins[good] = np.minimum((away * BINS).astype(np.int64), BINS - 1)
        moving = np.abs(velocity)
        usual = float(np.median(moving[moving > 0])) if (moving > 0).any() else np.inf
        fast = moving > 0.5 * usual
        return cls(fast & (velocity > 0), fast & (velocity < 0), bins)

    def levels(self, values: Array) -> tuple[float, float] | None:
        """Return the median values of a channel towards +x and back; None if a direction is missing."""
        there = np.isfinite(values)
        up, down = values[self.up & there], values[self.down & there]
        return (float(np.median(up)), float(np.median(down))) if up.size and down.size else None

    def sign(self, values: Array) -> int:
        """Return whether a channel is larger towards +x (1) or back (-1) at equal positions; 0 if it is not clear."""
        there = np.isfinite(values)
        larger = []
        for number in range(BINS):
            inside = there & (self.bins == number)
            up, down = values[inside & self.up], values[inside & self.down]
            if up.size and down.size:
                larger.append(np.sign(np.median(up) - np.median(down)))
        if len(larger) < FEWEST:
            return 0
        for sign in (1, -1):
            if larger.count(sign) >= MOST_BINS * len(larger):
                return sign
        return 0

    def swing(self, values: Array) -> float:
        """Return how much a channel changes with the direction, relative to its level; 0 if it is not clear."""
        levels = self.levels(values)
        if levels is None or self.sign(values) == 0:
            return 0.0
        return abs(levels[0] - levels[1]) / max(abs(levels[0]) + abs(levels[1]), 1e-300)

    def correlation(self, force: Array, pressure: Array) -> float:
        """Return the correlation of force and pressure within one direction, where friction does not change sign."""
        parts: list[tuple[Array, Array]] = []
        for moving in (self.up, self.down):
            there = moving & np.isfinite(force) & np.isfinite(pressure)
            if there.sum() >= FEWEST:
                parts.append((force[there] - force[there].mean(), pressure[there] - pressure[there].mean()))
        if not parts:
            return 0.0
        first, second = (np.concatenate([part[at] for part in parts]) for at in (0, 1))
        return float(np.corrcoef(first, second)[0, 1]) if np.ptp(first) > 0 and np.ptp(second) > 0 else 0.0
