"""Evidence for the roles of columns: names, units, and properties of the numbers."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from pneudrive.signals.motion import local_slope, noise_level, turning_points
from pneudrive.signals.tables.column_units import HeaderUnit, header_unit, split_name
from pneudrive.signals.tables.names import NUMBERING, SECONDARY, role_of, words_of

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from pneudrive.signals.tables.sniff import FileForm

    Array = NDArray[np.float64]

GROUPED = ("tdms", "mf4")  # formats with names group/channel
#: Role -> SI unit of its quantity; a column with the unit of another quantity is not a candidate.
QUANTITIES = {"time": "s", "position": "m", "force": "N", "pressure": "Pa"}
ELECTRICAL = ("V", "A")
RAW = ("V", "mV", "mA", "count")  # units of sensors whose scale the file does not state
NAME, SECOND_NAME, UNIT, PHYSICS = 2, 1, 2, 1  # weights of the evidence (assumed): any two beat one
ONCE = 1.0  # added to the unevenness of a signal that moves in one direction only
HELD_SHARE = 0.9  # share of samples equal to the previous one: a held command, not a measured force
SAME_SIGNAL = 0.98  # least correlation of columns that may be one signal in two units
BINS = 20  # of the travel, in which both directions are compared
MOST_BINS = 0.75  # least share of them that agree on a direction
FEWEST = 3  # least number of values for a guess


@dataclass(frozen=True)
class Header:
    """Name of a column without its unit, the unit, and an unknown stated unit."""

    name: str
    bare: str
    unit: HeaderUnit | None
    unknown: str = ""

    @property
    def role(self) -> str | None:
        """The role that the name states; a time also if the name is a unit of time."""
        return role_of(self.bare) or role_of(self.name)

    @property
    def is_raw(self) -> bool:
        """Whether the numbers are volts, milliamperes or counts of a sensor."""
        return self.unit is not None and self.unit.unit in RAW


@dataclass(frozen=True)
class Candidate:
    """A column that may have a role, with the weight of its evidence."""

    index: int
    score: float
    evidence: tuple[str, ...]


@dataclass
class TableSignals:
    """The columns of a table with their headers, after slow channels were filled and wraps of counters removed.

    ``taken`` has the columns whose role is decided, including those without a role.
    """

    reading: FileForm
    columns: list[Array]
    headers: list[Header]
    taken: set[int] = field(default_factory=set)

    @classmethod
    def of(cls, reading: FileForm, columns: list[Array]) -> TableSignals:
        """Read the headers of a table."""
        headers = [_header(reading, at) for at in range(len(columns))]
        return cls(reading, columns, headers, {*reading.words})

    def place(self, index: int) -> int | str:
        """Return how a layout names a column."""
        names = self.reading.names
        is_unique = bool(names) and names.count(names[index]) == 1 and bool(names[index])
        return names[index] if is_unique and (self.reading.form.header or self.reading.format != "csv") else index

    def candidates(self, role: str) -> list[Candidate]:
        """Return the columns that may have a role by name or unit, the best first."""
        quantity = QUANTITIES.get(role)
        found = []
        for index, header in enumerate(self.headers):
            if index in self.taken:
                continue
            score, evidence = 0.0, []
            if header.role == role:
                is_second = SECONDARY.search(words_of(header.bare)) is not None
                score, evidence = (SECOND_NAME if is_second else NAME), ["name"]
            if header.unit is not None:
                fits = header.unit.si in ELECTRICAL if role == "command" else header.unit.si == quantity
                is_raw = quantity is not None and header.is_raw
                if not (fits or is_raw or (role == "command" and header.unit.unit == "-")):
                    continue
                score += UNIT if (fits and quantity) or (fits and score) else 0
                evidence += ["unit"] if fits else []
            if score:
                found.append(Candidate(index, score, tuple(evidence)))
        return sorted(found, key=lambda one: -one.score)

    def may_be_pressure(self, at: int) -> bool:
        """Return whether neither name nor unit of a column exclude a pressure, and its numbers change."""
        header, values = self.headers[at], self.columns[at]
        fits = header.unit is None or header.unit.si == "Pa" or header.is_raw
        is_signal = np.nanmax(values) > np.nanmin(values) and not NUMBERING.search(words_of(header.name))
        return fits and header.role in (None, "pressure") and bool(is_signal)

    def without_role(self) -> list[int]:
        """Return the columns whose headers state no role and no quantity."""
        return [
            at
            for at, header in enumerate(self.headers)
            if at not in self.taken and header.role is None and (header.unit is None or header.unit.si == "count")
        ]


def _header(reading: FileForm, at: int) -> Header:
    name = reading.names[at] if at < len(reading.names) else ""
    own = name.rpartition("/")[2] if reading.format in GROUPED else name
    bare, unit = split_name(own)
    cell = reading.units[at].strip() if at < len(reading.units) else ""
    if cell.strip("[]()- "):
        return Header(name, own if unit is None else bare, header_unit(cell), "" if header_unit(cell) else cell)
    if unit is None and reading.format in GROUPED and own == "time":
        unit = HeaderUnit("s", "s")
    opened = own.rpartition("[")[2].partition("]")
    return Header(
        name,
        bare,
        unit,
        opened[0] if unit is None and opened[1] and not (opened[2].strip() or opened[0].isdigit()) else "",
    )


def is_held(values: Array) -> bool:
    """Return whether a column is constant from sample to sample, with occasional steps."""
    steps = np.diff(values[np.isfinite(values)])
    return bool(steps.size and steps.any() and (steps == 0).mean() > HELD_SHARE)


def groups_of(signals: TableSignals, indices: list[int]) -> list[list[int]]:
    """Group columns that hold one signal, such as volts and newtons of one sensor."""
    groups: list[list[int]] = []
    for index in indices:
        values = signals.columns[index]
        if not np.isfinite(values).all() or np.ptp(values) == 0:
            continue
        group = next((g for g in groups if same_signal(signals.columns[g[0]], values)), None)
        if group is None:
            groups.append([index])
        else:
            group.append(index)
    return groups


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
