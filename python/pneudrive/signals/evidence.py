"""Evidence about the columns of a foreign table: headers, signals, and the time of each sample."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from pneudrive.signals.columns import INDEX, NUMBERING, HeaderUnit, header_unit, role_of, split_name, words_of
from pneudrive.signals.motion import local_slope, noise_level, turning_points
from pneudrive.signals.times import COUNTERS, DATE_TIME, clocks_of, rate_of_stamps, samples_of_a_stamp, unwrapped
from pneudrive.units import converter

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from numpy.typing import NDArray

    from pneudrive.arrays import Array
    from pneudrive.signals.text_table import FileForm

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
        """Find the samples that move, from the position alone."""
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


#: Units that a time without one may have, in s. What fits the bounds below in one of them only is that unit.
UNITS_S = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "day": 86400.0}
STEPS_S = (50e-6, 0.5)  # usual steps of samples of a motion (assumed)
SLOWEST_S = 3600.0  # the same without a motion: the longest step
SPEEDS_M_S = (5e-5, 5.0)  # usual speeds of pistons (assumed)
RISING = 0.999  # least share of steps of a time that do not fall
EVEN, EVEN_SHARE = 0.2, 0.9  # largest deviation of an even step; least share of even steps
INDEX_SHARE = 0.99  # least share of steps of exactly 1 of an index


@dataclass
class Times:
    """The time of a table.

    Samples at a rate have no ``index`` of a column, but ``rate_hz``; their ``values`` are numbers of samples.
    An unstated ``unit`` is empty. A time of day may have a ``date`` column. The keys of ``clocks`` are columns with
    another time, its values are the columns of that time. ``question`` asks the user.
    """

    index: int | None
    values: Array
    unit: str = ""
    rate_hz: float | None = None
    reason: str = ""
    date: int | None = None
    clocks: dict[int, int] = field(default_factory=dict)
    question: str = ""


def find_times(form: FileForm, columns: Sequence[FileColumn], taken: set[int]) -> Times:
    """Find the time of a table, and take its columns from the others."""
    candidates, dates, numbered = _candidates(form, columns, taken)
    taken |= {one.column.index for one in candidates if one.score >= NAME}
    taken |= {one.index for one in (*dates, *numbered)}
    if not candidates:
        return _without_column(form, columns[0].values.size, numbered)
    best = candidates[0]
    times = _time(form, best.column, dates)
    if best.score > PHYSICS:
        clocks = [one.column for one in candidates if one.score >= best.score]
        times.clocks = _clocks_of(form, columns, best.column, clocks)
    rank = f"next: column {candidates[1].column.place!r}" if len(candidates) > 1 else "no other candidate"
    times.reason = "; ".join(filter(None, [", ".join(best.evidence), times.reason, rank]))
    taken.add(best.column.index)
    return times


def _candidates(
    form: FileForm, columns: Sequence[FileColumn], taken: set[int]
) -> tuple[list[Candidate], list[FileColumn], list[FileColumn]]:
    """Return the columns that may be the time, the best first. Columns of dates only and row counters are separate."""
    found: list[Candidate] = []
    dates: list[FileColumn] = []
    numbered: list[FileColumn] = []
    for column in columns:
        values, unit = column.values, column.unit
        is_other = unit is not None and unit.si != "s"
        if column.index in taken or is_other or np.isfinite(values).sum() < FEWEST:
            continue
        is_date = column.index in form.dates
        if is_date and len(form.dates) > 1 and (values[np.isfinite(values)] % 86400.0 == 0).all():
            dates.append(column)
            continue
        is_named, has_unit = column.role == "time", is_date or unit is not None
        score = NAME * is_named + UNIT * has_unit
        evidence = ("name",) * is_named + ("unit",) * has_unit
        if _rises(values, clocks_of(form.dates[column.index]) if is_date else COUNTERS):
            if score == 0 and (_counts(values) or INDEX.match(words_of(column.name))):
                numbered.append(column)
                continue
            if score == 0 and not _is_even(values):
                continue
            score, evidence = score + PHYSICS, (*evidence, "even steps")
        elif score == 0 or not is_named:
            continue
        if column.role not in (None, "time") and not has_unit:
            continue
        # Among equal candidates, the finer one is better: fewer samples share a stamp.
        found.append(Candidate(column, score - 0.5 * (samples_of_a_stamp(values) > 1.0), evidence))
    # A column that only rises is the time if nothing has its name; without names the first one.
    return sorted(found, key=lambda one: -one.score), dates, numbered


def _rises(values: Array, moduli: Iterable[float]) -> bool:
    some = values[np.isfinite(values)]
    some, _ = unwrapped(some, moduli, forward=True)
    steps = np.diff(some)
    if steps.size < 2 or not steps.any():
        return False
    is_coarse = samples_of_a_stamp(some) > 1.0
    return bool((steps >= 0).mean() > RISING and (np.median(steps) > 0 or is_coarse))


def _is_even(values: Array) -> bool:
    """Return whether most steps are equal: a signal that drifts upwards is not a time."""
    steps = np.diff(values[np.isfinite(values)])
    usual = float(np.median(steps))
    return bool((np.abs(steps - usual) <= EVEN * usual).mean() > EVEN_SHARE)


def _counts(values: Array) -> bool:
    """Return whether a column numbers the rows."""
    steps = np.diff(values[np.isfinite(values)])
    return steps.size > 1 and bool((steps == 1.0).mean() >= INDEX_SHARE)


def _is_same_clock(form: FileForm, first: FileColumn, second: FileColumn) -> bool:
    """Return whether two columns show one clock, perhaps in other units or more coarsely."""
    a, b = first.values, second.values
    both = np.isfinite(a) & np.isfinite(b)
    if both.sum() < FEWEST or both.sum() < 0.9 * min(np.isfinite(a).sum(), np.isfinite(b).sum()):
        return False
    a, b = a[both], b[both]
    slope, start = np.polyfit(a - a[0], b - b[0], 1)
    quanta = [float(np.min(s[s > 0], initial=np.inf)) for s in (np.diff(v) for v in (a, b))]
    quantum = max(abs(slope) * quanta[0], quanta[1])
    rest = float(np.abs(b - b[0] - slope * (a - a[0]) - start).max())
    is_shifted = abs(slope - 1.0) < 0.01 and abs(b[0] - a[0]) > 1.01 * quantum
    is_number = not {first.index, second.index} & set(form.dates)
    return rest <= 1.01 * quantum and not (is_shifted and is_number)


def _clocks_of(
    form: FileForm, columns: Sequence[FileColumn], best: FileColumn, clocks: Sequence[FileColumn]
) -> dict[int, int]:
    """Return the clock of each column that does not use the best clock: the nearest clock to its left."""
    other = {one.index for one in clocks if one is not best and not _is_same_clock(form, best, one)}
    every = [one.index for one in clocks]
    nearest = {at: max((c for c in every if c < at), default=best.index) for at in range(len(columns))}
    return {at: clock for at, clock in nearest.items() if clock in other}


def _time(form: FileForm, column: FileColumn, dates: Sequence[FileColumn]) -> Times:
    """Return the time of a column."""
    unit, factor, moduli = "", 1.0, COUNTERS
    if column.index in form.dates:
        unit, moduli = DATE_TIME, clocks_of(form.dates[column.index])
    elif column.unit is not None:
        unit, factor = column.unit.unit, converter(column.unit.unit, "s")[0]
    times = Times(column.index, unwrapped(column.values, moduli, forward=True)[0], unit)
    if unit == DATE_TIME and dates:
        times.date = dates[0].index
        times.values = column.values + dates[0].values
    count = samples_of_a_stamp(times.values)
    if count > 1.0:  # stamps that many samples share are replaced by the rate of the samples, if it is even
        shared, rate = f"{count:g} samples share each stamp of column {column.place!r}", rate_of_stamps(times.values)
        if rate is None or not unit:
            times.question = f'{shared}: state the rate of the samples, time = {{ rate = "50 Hz" }}'
        else:
            times.rate_hz, times.reason = rate / factor, shared
        times.index = times.date = None
        times.values = np.arange(times.values.size, dtype=float)
    return times


def _without_column(form: FileForm, count: int, numbered: Sequence[FileColumn]) -> Times:
    """Return the time of a table without a column of times: from the rate in the file, otherwise a question."""
    preamble = form.preamble
    times = Times(None, np.arange(count, dtype=float))
    if len(set(preamble.steps_s)) > 1:
        shown = ", ".join(f"{step:g} s" for step in sorted(set(preamble.steps_s)))
        times.question = f"the channels have different rates ({shown}): resample them, or export one rate"
    elif preamble.step_s:
        times.rate_hz = 1.0 / preamble.step_s
        times.reason = f"the file states the rate: {' '.join(preamble.source.split())[:40]}"
    else:
        only = f", column {numbered[0].place!r} numbers the rows" if numbered else ""
        rate = 'state the rate of the samples, time = { rate = "50 Hz" }'
        times.question = f"no column increases like a time{only}: {rate}"
    return times


def unit_by_size(times: Times, position_m: Array | None) -> tuple[str, str]:
    """Return the unit of a time that states none, by the step of the samples and the speed of the piston.

    Returns
    -------
    str, str
        Unit and evidence; an empty unit, and a question.
    """
    steps = np.diff(times.values[np.isfinite(times.values)])
    step = float(np.median(steps)) if steps.size else 0.0
    speed = _usual_speed(times.values, position_m)
    fits = []
    longest = SLOWEST_S if speed is None else STEPS_S[1]
    for unit, factor in UNITS_S.items():
        is_speed = speed is None or SPEEDS_M_S[0] <= speed / factor <= SPEEDS_M_S[1]
        if STEPS_S[0] <= step * factor <= longest and is_speed:
            fits.append(unit)
    if len(fits) == 1:
        shown = "" if speed is None else f" and {speed / UNITS_S[fits[0]] * 1e3:.3g} mm/s"
        return fits[0], f"unit by the size of the steps: {step * UNITS_S[fits[0]]:.3g} s{shown}"
    which = " or ".join(fits) if fits else "none of s, ms and us fits usual steps and speeds"
    return "", f"the unit of the time is not stated ({which}): state it"


def _usual_speed(time: Array, position_m: Array | None) -> float | None:
    """Return the usual speed of the piston, m for each unit of the time."""
    if position_m is None:
        return None
    good = np.isfinite(time) & np.isfinite(position_m)
    path, span = np.abs(np.diff(position_m[good])), np.diff(time[good])
    moving = path > 0.2 * (np.quantile(path, 0.9) if path.size else 0.0)
    if not moving.any() or span[moving].sum() <= 0:
        return None
    return float(path[moving].sum() / span[moving].sum())
