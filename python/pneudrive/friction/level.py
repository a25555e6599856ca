"""A speed level: friction, offset, uncertainty, flags and rows of the friction map from its strokes.

Processing: recording -> motion -> tables of strokes -> speed levels. Long recordings are processed part by part.

Only one part is in memory at a time. Parts overlap by one stroke, so that each stroke is counted once, with the dwell
before it. Speed classes are found from the strokes of all parts. The window comes from the layout, or is the middle of
the strokes of the first part. The samples of the part with the largest force are kept for figures and the uncertainty
budget.
"""

from __future__ import annotations

from collections import Counter
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from pneudrive.batching import in_advance
from pneudrive.errors import RecordingError
from pneudrive.friction.bins import MIDDLE, Profile, Spread, pair_stderr, profile_stderr, spread_of, within_stderr
from pneudrive.friction.friction_map import TABLES, group_of
from pneudrive.friction.sentences import sentence
from pneudrive.friction.stick_slip import RIPPLE_LIMIT, ReversalPeak, StickSlip
from pneudrive.friction.strokes import CLOCK_S, COVERED_SHARE, RecordedMotion, Strokes, StrokeUse, stroke_grid
from pneudrive.numbers import plain
from pneudrive.progress import Watch
from pneudrive.repr_tables import Card, Shown, brief
from pneudrive.signals.motion import Stroke, middle, speed_levels, speeds_differ, straight_line
from pneudrive.signals.recording import PRESSURES_PA, SLOWEST_M_S, SPEEDS_M_S, Recording, clean, pressure_delay

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Sequence

    from pneudrive.arrays import Array, Bools, Columns, Interval, NamedNumbers, Row
    from pneudrive.friction.strokes import MeasuredStroke, SampleChoice
    from pneudrive.signals.load import RecordingFile

    Part = tuple[RecordedMotion, tuple[Stroke, ...]]


NO_STROKES = spread_of(np.zeros(0))
BELOW_AMBIENT = 0.1  # of ambient pressure: lower ones are a vacuum, or gauge pressures written as absolute
UNFOLLOWED = 0.25  # of pressure times area: least unexplained part of the force
SMALLEST_N = 1e-3  # friction below the resolution of force sensors of piston drives
FULL_PRESSURE_PA = 10e5  # friction above the force of this pressure on the piston would stop any drive


@dataclass(frozen=True, eq=False, repr=False)  # holds arrays: equal only to itself
class Level(Shown):
    """One speed class of one recording.

    Attributes
    ----------
    motion : RecordedMotion
        Motion of the recording, with the samples that are in memory.
    index : int
        Index of the class in the recording, slowest first.
    window_m : tuple of float
        Positions between which friction is averaged.
    table : Strokes
        All strokes of the class, also unused ones.
    sides : dict
        Rows of the used strokes by direction, +1 or -1, see `Strokes.sides`.
    bins : ndarray of bool, shape (m,)
        Bins of the window covered by all directions.
    """

    motion: RecordedMotion
    index: int
    window_m: Interval
    table: Strokes
    sides: dict[int, Row]
    bins: Bools

    @property
    def recording(self) -> str:
        """Name of the recording."""
        return self.motion.recording.name

    @property
    def ambient_pressure_pa(self) -> float:
        """Absolute pressure around the rod, in Pa."""
        return self.motion.recording.ambient_pressure_pa

    def _card(self) -> Card:
        card = super()._card()
        rows = [*card.rows, ("budget", brief(self.budget))]
        return card._replace(title=f"speed level {self.index + 1} of {self.recording}", rows=rows)

    @property
    def kept(self) -> tuple[MeasuredStroke, ...]:
        """Strokes whose samples are in memory: all strokes, except in long recordings."""
        kept = set(map(id, self.motion.strokes))
        return tuple(row for row in self.table.rows if id(row.stroke) in kept)

    @cached_property
    def profile(self) -> Profile:
        """Both directions of all strokes, paired at equal position."""
        return self.table.profile

    @property
    def spreads(self) -> dict[int, Spread]:
        """Spread of the means of the used strokes, for both directions."""
        return {way: self.sides[way]["spread"] if way in self.sides else NO_STROKES for way in (1, -1)}

    @property
    def friction_n(self) -> float:
        """Half the difference of the force balances in +x and -x, in N.

        For a single direction, the balance, positive against the motion.
        """
        return sum(way * side["spread"].mean_n for way, side in self.sides.items()) / len(self.sides)

    @property
    def offset_n(self) -> float:
        """Half the sum of the force balances in +x and -x, in N; NaN for a single direction."""
        return sum(side["spread"].mean_n for side in self.sides.values()) / 2 if len(self.sides) == 2 else np.nan

    @cached_property
    def stderr_n(self) -> float:
        """Type A standard uncertainty of friction, in N; see `chance_n`.

        If no direction has two strokes, the uncertainty comes from the profile over position.
        """
        rows = [self.table.balance_n[rows][:, self.bins] for rows in self.table.directions.values()]
        if len(rows) == 1:
            (side,) = self.sides.values()
            scatter, single, inside = side["spread"].stderr_n, rows[0][0], within_stderr(rows[0])
        else:
            known = [(side["spread"].deviation_n, side["spread"].effective) for side in self.sides.values()]
            deviation, effective = np.array(known).T[:, None]
            scatter, single = pair_stderr(deviation, effective)[0], self.profile.friction_n[self.bins]
            inside = np.sqrt(sum(within_stderr(matrix) ** 2 for matrix in rows)) / 2
        return float(chance_n(scatter, inside if np.isfinite(scatter) else profile_stderr(single)))

    @cached_property
    def budget(self) -> tuple[BudgetEntry, ...]:
        """Systematic sources of the uncertainty. A missing direction is taken to be equal to the other one."""
        only, profile, bins = next(iter(self.sides.values())), self.profile, self.bins
        up, down = (self.sides.get(way, only) for way in (1, -1))
        known = bins & np.isfinite(profile.offset_n)
        slope = straight_line(profile.position_m[known], profile.offset_n[known])[0] if known.any() else 0.0
        recording, interval = self.motion.recording, middle(np.diff(self.motion.time_s))
        entries = systematic_budget(recording, up, down, slope, interval, self.motion.late_s)
        single = profile.up_n if 1 in self.sides else profile.down_n
        patterns = (profile.friction_n, profile.offset_n) if len(self.sides) == 2 else (single, single)
        coverage = float(bins.mean())
        friction, offset = (unseen_n(pattern[bins], coverage) for pattern in patterns)
        words = "standard deviation over the window times the share of the stroke outside it"
        window = BudgetEntry("choice of the window", 1.0 - coverage, "", "data", friction, offset, words)
        return (*entries, window)

    @cached_property
    def u_offset_n(self) -> float:
        """Systematic standard uncertainty of the offset."""
        return combined_n(entry.offset_n for entry in self.budget)

    @cached_property
    def u_systematic_n(self) -> float:
        """Systematic standard uncertainty of friction. For a single direction, it equals `u_offset_n`."""
        return combined_n(entry.friction_n for entry in self.budget) if len(self.sides) == 2 else self.u_offset_n

    @property
    def expanded_n(self) -> float:
        """Expanded uncertainty U (k = 2) of ``friction_n``."""
        return COVERAGE_FACTOR * float(np.hypot(np.nan_to_num(self.stderr_n), self.u_systematic_n))

    @cached_property
    def doubts(self) -> dict[str, str]:
        """Flag -> sentence with values and a check, for physically implausible values.

        Forces are not checked if the areas are zero, because the force of a trajectory is its friction.
        """
        recording, ambient, gauge = self.motion.recording, self.ambient_pressure_pa, self.gauge_pa
        areas = recording.area_a_m2, recording.area_b_m2
        lowest, highest = min(gauge.values()) + ambient, max(gauge.values()) + ambient
        pushed = gauge["b"] * areas[1] - gauge["a"] * areas[0] + recording.weight_n
        speed = self.speed_m_s
        friction, missed = abs(self.friction_n), abs(self.offset_n)  # the offset is NaN if one direction is missing
        unfollowed = missed > max(UNFOLLOWED * abs(pushed), friction, 3.0 * self.u_offset_n) and abs(pushed) > friction
        full = FULL_PRESSURE_PA * max(areas)
        beyond = [f"a pressure of {highest / 1e5:.3g} bar absolute"] if highest > PRESSURES_PA[1] else []
        beyond += [] if SLOWEST_M_S <= speed <= SPEEDS_M_S[1] else [f"a speed of {plain(1e3 * speed)} mm/s"]
        seen = {
            "below_ambient": lowest < (1.0 - BELOW_AMBIENT) * ambient,
            "beyond_usual": bool(beyond),
            "force_not_pressure": any(areas) and unfollowed,
            "friction_beyond_piston": any(areas) and friction > full,
            "no_friction": any(areas) and friction < SMALLEST_N,
        }
        values = {
            "lowest": lowest / 1e5,
            "beyond": " and ".join(beyond),
            "force_n": pushed + self.offset_n,
            "pushed_n": pushed,
            "friction_n": friction,
            "full_n": full,
        }
        return {flag: sentence(f"doubt.{flag}", **values) for flag, is_so in seen.items() if is_so}

    @cached_property
    def flags(self) -> tuple[str, ...]:
        """Names of all flags: of samples, of the level, and of doubtful values."""
        sides = list(self.sides.values())
        speeds = [abs(side["velocity_m_s"]) for side in sides]
        narrow = self.bins.sum() < 0.9 * self.profile.in_window.sum()
        stick_slip = any(side["stick_slip"] for side in sides)
        ripple = any(side["ripple"] > RIPPLE_LIMIT for side in sides)
        seen = {
            **self.motion.recording.flags,
            "unpaired": len(sides) < 2,
            "negative_friction": self.friction_n < -2 * self.expanded_n,
            "single_stroke": min(side["strokes"] for side in sides) == 1,
            "trend": any(side["spread"].has_trend for side in sides),
            "stick_slip": stick_slip,
            "speed_ripple": ripple and not stick_slip,
            "window_not_covered": self.motion.choice.uses_window and narrow,
            "pressure_moves": any(side["pressure_moves_n"] > 0.5 * abs(self.friction_n) for side in sides),
            "unequal_speeds": max(speeds) - min(speeds) > 0.1 * max(speeds),
            "mixed_speeds": any(speeds_differ(side["used"]) for side in sides),
            **self.doubts,
        }
        return tuple(name for name, is_so in seen.items() if is_so)

    @property
    def seal(self) -> str:
        """Assembly: mounting, seal and drive."""
        return group_of(self.motion.recording.labels)

    @property
    def run(self) -> str:
        """Label ``run`` of the recording, or "1" without this label."""
        return self.motion.recording.labels.get("run", "1")

    @property
    def peaks(self) -> tuple[ReversalPeak, ...]:
        """Friction peaks after the reversals at which the strokes in memory begin."""
        return tuple(row.peak for row in self.kept if row.peak)

    @property
    def stick_slip(self) -> tuple[StickSlip, ...]:
        """Stick-slip of the axis in each used stroke, except in very short ones."""
        used = (self.table.rows[i] for rows in self.table.directions.values() for i in rows)
        return tuple(row.slip[0] for row in used if row.slip)

    @property
    def speed_m_s(self) -> float:
        """Mean absolute speed of both directions in the window."""
        return float(np.mean([abs(side["velocity_m_s"]) for side in self.sides.values()]))

    @property
    def speed_stderr_m_s(self) -> float:
        """Standard error of ``speed_m_s`` from the scatter of stroke speeds; the larger one of both directions."""
        speeds = [[r.stroke.speed_m_s for r in self.table.rows if r.stroke.direction == d] for d in (1, -1)]
        errors = (float(np.std(v, ddof=1) / np.sqrt(len(v))) for v in speeds if len(v) > 1)
        return max(errors, default=0.0)

    @property
    def gauge_pa(self) -> NamedNumbers:
        """Gauge pressures in chambers ``a`` and ``b``, averaged over the directions."""
        means = {side: np.mean([s[f"pressure_{side}_pa"] for s in self.sides.values()]) for side in "ab"}
        return {side: float(mean) - self.ambient_pressure_pa for side, mean in means.items()}

    @property
    def pressure_pa(self) -> float:
        """Mean gauge pressure, in Pa, of the chamber with the larger absolute value."""
        return max(self.gauge_pa.values(), key=abs)

    @property
    def rows(self) -> tuple[Row, ...]:
        """Rows of the friction map, one per present direction, with the labels of the recording."""
        rows = []
        for way, side in self.sides.items():
            peaks = [row.peak for row in self.table.rows if row.peak and row.peak.direction == way]
            spoiled = ("breakaway_spoiled",) if peaks and all(peak.flags for peak in peaks) else ()
            own = {"recording": self.recording, "direction": way, "balance_n": side["spread"].mean_n}
            own |= {"position_from_m": self.window_m[0], "position_to_m": self.window_m[1]}
            columns = {name: getattr(self, name) for name in TABLES["lists"]["level"]}
            columns |= {name: side[name] for name in TABLES["lists"]["side"]}
            own |= {"labels": self.motion.recording.labels, "flags": ",".join((*self.flags, *spoiled))}
            rows.append(own | columns)
        return tuple(rows)


@dataclass(frozen=True, eq=False, repr=False)  # holds arrays: equal only to itself
class RecordingResult(RecordedMotion, Shown):
    """Motion, speed levels and stroke counts of one recording. ``recording`` is cleaned, and has counts of flags."""

    levels: tuple[Level, ...]
    stroke_use: StrokeUse


LONG_SAMPLES = 4_000_000  # samples above which a recording is read part by part
PART_SAMPLES = 1_000_000
LEAST_STROKES = 4  # strokes in a part: the one before, one that is counted, and two for the start of the next part
LARGEST_PART = 16  # multiple of the usual part: longer strokes cannot be separated


def extract(recording: Recording, choice: SampleChoice) -> RecordingResult:
    """Extract friction from one recording, after removing the delay of its pressures.

    Raises
    ------
    RecordingError
        The recording has no motion, too few samples, or no stroke with settled samples in the window.
    """
    recording = clean(recording)
    delay = pressure_delay(recording)
    if delay is not None and delay.is_clear:
        recording = delay.removed(recording)
    motion = RecordedMotion.of(recording, choice, delay=delay)
    window = window_of(motion)
    position, classes = motion.position_m, speed_levels(list(motion.strokes))
    tables = [Strokes.of(motion, members, window, stroke_grid(position, members, window)) for members in classes]
    return _result(motion, motion.strokes, tables, window)


def extract_long(file: RecordingFile, choice: SampleChoice, watch: Watch) -> RecordingResult:
    """Extract friction from a long recording.

    Parameters
    ----------
    file : RecordingFile
        A file that can be read in parts (`RecordingFile.span`).
    choice : SampleChoice
    watch : Watch
        Receives the number of rows done.

    Returns
    -------
    RecordingResult
        As from `extract`. Recording, strokes and samples come from one part; levels come from all parts.

    Raises
    ------
    RecordingError
        As in `extract`.
    """
    with ThreadPoolExecutor(1) as hashing:  # the samples are hashed on a thread while they are read
        sha256 = hashing.submit(file.sha256)
        kept: RecordedMotion | None = None  # the part with the largest force
        window: Interval | None = None
        strokes: list[Stroke] = []
        tables: list[Strokes] = []
        flags, largest_n = Counter[str](), -np.inf
        for motion, counted in _parts(file, choice, watch):
            window = window or window_of(motion)
            strokes += counted
            for members in speed_levels(list(counted)):
                bins = tables[0].grid.in_window if tables else None
                table = Strokes.of(motion, members, window, stroke_grid(motion.position_m, members, window, bins))
                tables += [table] if table.directions else []
            flags.update(motion.recording.flags)
            if (most := float(np.abs(motion.recording.force_n).max())) > largest_n:
                kept, largest_n = motion, most
        if kept is None or window is None:
            raise RecordingError.of("friction.motionless", where=file.name)
        motion = replace(kept, recording=replace(kept.recording, flags=dict(flags), sha256=sha256.result()))
    if not tables:
        return _result(motion, strokes, [], window)
    # The parts number their strokes separately: classes of the whole recording are found by place.
    whole = Strokes.joined(tables)
    classes = speed_levels([replace(s, index=i) for i, s in enumerate(strokes)])
    level_of_stroke = {id(strokes[s.index]): number for number, members in enumerate(classes) for s in members}
    numbers = [level_of_stroke[id(row.stroke)] for row in whole.rows]
    rows = ([row for row, at in enumerate(numbers) if at == number] for number in range(len(classes)))
    return _result(motion, strokes, [whole.at(some) for some in rows if some], window)


def _result(
    motion: RecordedMotion, strokes: Sequence[Stroke], tables: list[Strokes], window: Interval
) -> RecordingResult:
    """Make the levels of the speed classes, and count the used strokes.

    A speed class without usable strokes, or without a bin common to its directions, has no level.

    Raises
    ------
    RecordingError
        No speed class has settled samples in the window.
    """
    levels, used, apart, low_m, high_m = list[Level](), set[int](), set[int](), *window
    for table in tables:
        sides, bins = table.sides(uses_window=motion.choice.uses_window)
        levels += [Level(motion, len(levels), window, table, sides, bins)] if sides else []
        settled = {id(row.stroke) for row in table.rows if row.means}
        (used if sides else apart).update(settled)
    left_out = dict.fromkeys(("window", "unsettled", "apart"), 0)
    for stroke in strokes:
        low, high = sorted((stroke.from_m, stroke.to_m))
        if id(stroke) in apart:
            left_out["apart"] += 1
        elif id(stroke) not in used:
            is_narrow = min(high, high_m) - max(low, low_m) < COVERED_SHARE * (high_m - low_m)
            left_out["window" if is_narrow else "unsettled"] += 1
    use = StrokeUse(len(strokes), {reason: count for reason, count in left_out.items() if count})
    if not levels:
        low, high = (1e3 * end for end in window)
        raise RecordingError.of("friction.unsettled", where=motion.recording.name, low=low, high=high, use=use)
    return RecordingResult(**vars(motion), levels=tuple(levels), stroke_use=use)


def window_of(motion: RecordedMotion) -> Interval:
    """Return the positions between which friction is averaged: from the layout, or the middle of the strokes.

    Raises
    ------
    RecordingError
        The bounds of the layout are outside the motion.
    """
    recording, strokes = motion.recording, motion.strokes
    low = float(np.median([min(s.from_m, s.to_m) for s in strokes]))
    high = float(np.median([max(s.from_m, s.to_m) for s in strokes]))
    if not motion.choice.uses_window:
        return low, high
    if recording.window_m is None:
        return low + MIDDLE[0] * (high - low), low + MIDDLE[1] * (high - low)
    if recording.window_m[0] >= high or recording.window_m[1] <= low:
        window = [end * 1e3 for end in recording.window_m]
        raise RecordingError.of("friction.window", where=recording.name, window=window, low=low * 1e3, high=high * 1e3)
    return recording.window_m


def _parts(file: RecordingFile, choice: SampleChoice, watch: Watch) -> Iterator[Part]:
    """Yield the parts of a recording, each with its counted strokes. The next part is read in the background."""
    name, (first, count) = file.name, file.span
    blocks = [(begin, min(begin + PART_SAMPLES, count)) for begin in range(first, count, PART_SAMPLES)]
    left: Columns = {}
    is_first = True
    for block, read in zip(blocks, in_advance(file.rows, blocks, 1, ahead=1), strict=True):
        watch.tell(block[0], count, f"rows of {name}")
        raw = {channel: np.concatenate((left[channel], new)) if left else new for channel, new in read.items()}
        recording = file.read(raw)
        motion = RecordedMotion.of(clean(recording), choice)
        is_last, n = block is blocks[-1], len(motion.strokes)
        if not is_last and n < LEAST_STROKES:
            if len(recording) >= LARGEST_PART * PART_SAMPLES:
                sizes = {"samples": len(recording), "strokes": n, "most": LONG_SAMPLES, "least": LEAST_STROKES}
                raise RecordingError.of("friction.long_strokes", where=str(file.path), **sizes)
            left = raw
            continue
        counted = motion.strokes[0 if is_first else 1 : n if is_last else n - 1]
        if counted:
            yield motion, counted
        if not is_last:
            # The next part counts from the last stroke; the one before it, with its rest, is included.
            begin = float(motion.recording.time_s[motion.strokes[-3].stop - 1])
            rows = int(np.flatnonzero(recording.time_s >= begin)[0])
            left = {channel: values[rows:].copy() for channel, values in raw.items()}
            is_first = False
    watch.tell(count, count, f"rows of {name}")


# --- Uncertainty budget of one row of the friction map, term by term, as in the GUM.
#
# Measurand: friction, half the difference of the mean force balance in +x and in -x at equal positions. Terms are
# independent, so their standard uncertainties add as root sum of squares; the expanded uncertainty has k = 2.
# For a row of a recording (one speed level):
#
#     stderr_n        type A   `chance_n`: scatter of the strokes' means, at least the noise within the strokes
#     u_systematic_n  type B   `Level.budget`: for each source its sensitivity times its uncertainty
#
# For a row of a campaign (one cycle):
#
#     stderr_n        type A   `chance_n` of its strokes, and scatter from cycle to cycle
#     u_systematic_n  type B   `campaign.curves.systematic`: gain, hysteresis, mean over position
#                     type A   state of the campaign, and block or day
#
# The parts of gain, hysteresis and zero of a cycle come from the same `systematic_budget` (`stated_shares`). With zero
# runs and known weights, some of these parts are measured instead (``campaign/reading.py``).

COVERAGE_FACTOR = 2.0
BEYOND_SHARE = 0.05  # of the drive's stroke, at its ends, that the moves leave out (assumed)
CLOCKS = "clocks of several loggers"
# Assumed if the layout does not state it; the budget marks each as assumed.
ASSUMED_PRESSURE_OF_RANGE = 0.005 / float(np.sqrt(3.0))  # limits of 0.5 % of full scale, rectangular
ASSUMED_FORCE_OF_LARGEST = 0.002 / np.sqrt(3.0)  # limits of 0.2 % of the largest force, rectangular
ASSUMED_BORE = 0.002  # of the bore: 0.05 mm on 25 mm
ASSUMED_ALIGNMENT_RAD = np.deg2rad(1.0)
ASSUMED_DIRECTION_SHARE = 1.0 / 3.0  # of a sensor's accuracy: changes with direction, so it survives the pairing
SENSORS = ("pressure_a_pa", "pressure_b_pa", "force_n")  # in the order of the budget
USUAL_RANGES_PA = np.array([1, 1.6, 2.5, 4, 6, 10, 16, 25, 40, 100]) * 1e5


@dataclass(frozen=True)
class BudgetEntry:
    """One source of uncertainty: its standard uncertainty, and its contributions to friction and offset in N.

    ``basis`` is "layout" (the accuracy was given), "assumed" or "data"; ``kind`` "A" or "B" (GUM).
    """

    source: str
    standard_uncertainty: float
    unit: str
    basis: str
    friction_n: float
    offset_n: float
    note: str = ""
    kind: str = "B"


def systematic_budget(
    recording: Recording,
    up: Row,
    down: Row,
    offset_slope_n_m: float = 0.0,
    sample_interval_s: float = 0.0,
    late_s: float = 0.0,
) -> list[BudgetEntry]:
    """Return the contribution of each systematic source to friction (half difference) and offset (half sum).

    Parameters
    ----------
    recording : Recording
        Its ``accuracy`` entries are standard uncertainties.
    up, down : dict
        Rows of `Strokes.sides`: means in +x and -x over the window.
    offset_slope_n_m, sample_interval_s : float
        Slope of the offset over position, and interval within which all channels are sampled. A time skew between
        channels appears as friction.
    late_s : float
        Standard uncertainty of the times of the pressures.
    """
    entries = [entry for channel in SENSORS for entry in _sensor_entries(recording, channel, up, down)]
    # Areas of the piston.
    accuracy, basis, unit, note = recording.accuracy, "layout", "m", ""
    bore = np.sqrt(4 * max(recording.area_a_m2, recording.area_b_m2) / np.pi)
    if "area" in accuracy:
        relative, shown, unit = accuracy["area"], accuracy["area"], ""
    elif "bore_m" in accuracy and bore > 0:
        relative, shown = 2 * accuracy["bore_m"] / bore, accuracy["bore_m"]
    else:
        relative, shown, basis, note = 2 * ASSUMED_BORE, ASSUMED_BORE * bore, "assumed", "0.2 % of the bore"
    ambient = recording.ambient_pressure_pa
    half_difference = half_sum = 0.0
    for side, area in (("a", recording.area_a_m2), ("b", -recording.area_b_m2)):
        p_up, p_down = (m[f"pressure_{side}_pa"] - ambient for m in (up, down))
        half_difference += area * (p_up - p_down) / 2
        half_sum += area * (p_up + p_down) / 2
    friction, offset = abs(relative * half_difference), abs(relative * half_sum)
    entries.append(BudgetEntry("bore (area)", float(shown), unit, basis, friction, offset, note))
    angle = accuracy.get("alignment_rad", float(ASSUMED_ALIGNMENT_RAD))
    known = "layout" if "alignment_rad" in accuracy else "assumed"
    turned, shared = (half * angle**2 / 2 for half in _halves(up["force_n"], down["force_n"]))
    words = "cosine error; friction from a side load is friction of the rig and remains in the result"
    entries.append(BudgetEntry("alignment of the force axis", angle, "rad", known, turned, shared, words))
    skew, speed = sample_interval_s / np.sqrt(12.0), (abs(up["velocity_m_s"]) + abs(down["velocity_m_s"])) / 2
    turned, words = abs(offset_slope_n_m) * speed * skew, "rectangular over one sampling interval"
    entries.append(BudgetEntry("time skew between channels", skew, "s", "assumed", turned, 0.0, words))
    if recording.parallel:
        largest = max(f.uncertainty for f in recording.parallel)
        names = ", ".join(f.name for f in recording.parallel)
        area = _halves(up["parallel_n"], down["parallel_n"])
        entries.append(BudgetEntry("areas of parallel forces", largest, "", "layout", *area, names))
    if late_s != 0.0:  # the delay of several loggers, or as closed chambers show it
        basis = "assumed" if recording.parallel and late_s == CLOCK_S else "data"
        words = "delay of the pressures relative to the force"
        entries.append(BudgetEntry(CLOCKS, late_s, "s", basis, *_halves(up["late_n"], down["late_n"]), words))
    return entries


def _halves(up: float, down: float) -> Interval:
    """Return the absolute values of half the difference and half the sum of both directions."""
    return abs(up - down) / 2.0, abs(up + down) / 2.0


def unseen_n(pattern_n: Array, coverage: float) -> float:
    """Return the standard uncertainty, in N, if the mean over some bins is used as the mean of the whole stroke.

    The uncertainty is the standard deviation of `pattern_n`, the friction in each bin, times the fraction of the stroke
    outside the bins. The bins cover the fraction ``coverage`` of the travel.
    """
    known = pattern_n[np.isfinite(pattern_n)]
    return (1.0 - coverage * (1.0 - BEYOND_SHARE)) * float(known.std()) if known.size else 0.0


def _sensor_entries(recording: Recording, channel: str, up: Row, down: Row) -> list[BudgetEntry]:
    """Return the budget entries of a sensor: common error and hysteresis, or those of a calibration.

    Half the difference of both directions contains only the error that changes with direction.

    The standard uncertainty of the channel is that of the layout, or assumed. At the largest reading, the whole
    uncertainty may be an error of gain.
    """
    values = getattr(recording, channel)
    if channel == "force_n":
        known = recording.force_calibration
        if known is not None:
            found = known.doubts((up["force_n"] - down["force_n"]) / 2.0, (up["force_n"] + down["force_n"]) / 2.0)
            return [
                BudgetEntry(f"force: {name}", u, "N", "layout", friction, offset, known.words())
                for name, (u, friction, offset) in found.items()
            ]
        name, unit, zero, newton_per_unit = "force", "N", 0.0, 1.0
        largest = float(np.max(np.abs(values)))
        u, note = largest * ASSUMED_FORCE_OF_LARGEST, "0.2 % of the largest force, rectangular"
    else:
        name, unit, zero = channel.removesuffix("_pa").replace("_", " "), "Pa", recording.ambient_pressure_pa
        if np.ptp(values) == 0 and channel not in recording.accuracy and abs(values[0] - zero) < 1.0:
            return []  # open to ambient: not measured, no force
        newton_per_unit = recording.area_a_m2 if channel == "pressure_a_pa" else recording.area_b_m2
        largest = usual_range(float(np.max(np.abs(values - zero))))
        u, note = largest * ASSUMED_PRESSURE_OF_RANGE, f"0.5 % of a {largest / 1e5:g} bar range, rectangular"
    basis = "assumed"
    if channel in recording.accuracy:
        u, note = recording.accuracy[channel], recording.calibration.get(channel, "")
        basis = "assumed" if note.lower().startswith("assumed") else "layout"
    limits = recording.limits.get(channel)
    reference = max(abs(limit - zero) for limit in limits) if limits else largest
    change = abs(up[channel] - down[channel]) / 2
    common = u * newton_per_unit
    left = common * change / reference if reference else 0.0
    hysteresis = common * ASSUMED_DIRECTION_SHARE / float(np.sqrt(2.0))
    note = f"{note}; cancels in the pair except for the change of the reading with direction".lstrip("; ")
    turns, lost = "a third of the accuracy is assumed to change with direction", u * ASSUMED_DIRECTION_SHARE
    return [
        BudgetEntry(f"{name}: common error", u, unit, basis, left, common, note),
        BudgetEntry(f"{name}: hysteresis", lost, unit, "assumed", hysteresis, hysteresis, turns),
    ]


def usual_range(largest_pa: float) -> float:
    """Return the smallest usual transducer range that contains a pressure, or the pressure if it exceeds all ranges."""
    above = USUAL_RANGES_PA[largest_pa <= USUAL_RANGES_PA]
    return float(above[0]) if above.size else largest_pa


def chance_n(scatter_n: Array | float, noise_n: Array | float) -> Array:
    """Return the type A standard uncertainty of friction in N: scatter between strokes, but at least their noise.

    The scatter is NaN for single strokes (`pair_stderr`). The noise comes from the bins within the strokes,
    after their pattern over position is removed.
    """
    return np.fmax(scatter_n, noise_n)


def stated_shares(recording: Recording, up: Row, down: Row, late_s: float) -> dict[str, float | bool]:
    """Return the parts of a cycle's budget that campaigns treat separately, by column of the cycle.

    All cycles have the same sensors. The parts are proportional to friction, constant, or removed by zero runs.
    """
    entries = systematic_budget(recording, up, down, late_s=late_s)
    # Hysteresis needs a reading that changes with direction: a constant pressure has none.
    turns = {c: abs(up[f"pressure_{c}_pa"] - down[f"pressure_{c}_pa"]) for c in "ab"}
    moves = {f"pressure {c}: hysteresis": turns[c] * getattr(recording, f"area_{c}_m2") / 2.0 for c in "ab"}
    constant = ("hysteresis", "linearity")
    changing = [min(e.friction_n, moves.get(e.source, np.inf)) for e in entries if e.source.endswith(constant)]
    shared = [e for e in entries if not e.source.endswith("hysteresis")]
    # Tares remove the zero; the rest of an accuracy grows with the reading.
    ambient = recording.ambient_pressure_pa
    readings = {
        "force: common error": _of_range(recording, "force_n", (up["force_n"] + down["force_n"]) / 2.0, 0.0),
        "pressure a: common error": _of_range(recording, "pressure_a_pa", up["pressure_a_pa"], ambient),
        "pressure b: common error": _of_range(recording, "pressure_b_pa", up["pressure_b_pa"], ambient),
        "bore (area)": 1.0,
        **dict.fromkeys(("force: gain", "force: linearity", "force: creep"), 1.0),
    }
    named = entries if recording.force_calibration is not None else []
    offsets = {e.source: e.offset_n * readings.get(e.source, 0.0) for e in shared}
    return {
        "u_gain_n": combined_n(e.friction_n for e in shared if not e.source.endswith(constant)),
        "u_hysteresis_n": combined_n(changing),
        "u_offset_n": combined_n(offsets.values()),
        **{f"u_pressure_{c}_n": offsets.get(f"pressure {c}: common error", 0.0) for c in "ab"},
        **{e.source: e.friction_n for e in named if e.source.startswith("force: ")},
        "u_air_n": combined_n(e.friction_n for e in entries if e.source.startswith(("pressure", "bore"))),
        "assumed": any(e.source == "force: common error" and e.basis == "assumed" for e in entries),
    }


def combined_n(parts: Iterable[float]) -> float:
    """Return the combined standard uncertainty, in N, of the parts from independent sources."""
    return float(np.sqrt(sum(part**2 for part in parts)))


def _of_range(recording: Recording, channel: str, reading: float, zero: float) -> float:
    """Return the reading as a fraction of the sensor's range, both measured from `zero`."""
    limits = recording.limits.get(channel)
    reach = max(abs(v - zero) for v in limits) if limits else np.max(np.abs(getattr(recording, channel) - zero))
    return min(abs(reading - zero) / float(reach), 1.0) if reach > 0 else 0.0
