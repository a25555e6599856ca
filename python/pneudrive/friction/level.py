"""A speed level: friction, offset, uncertainty, flags and rows of the friction map from its strokes.

Processing: recording -> motion -> tables of strokes -> speed levels. Long recordings are processed part by part.

Only one part is in memory at a time. Parts overlap by one stroke, so that each stroke is counted once, with the dwell
before it. Speed classes are found from the strokes of all parts. The window is that of the layout, or the middle of the
strokes of the first part. The samples of the part with the largest force are kept for figures and the uncertainty
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
from pneudrive.friction.budget import COVERAGE_FACTOR, BudgetEntry, chance_n, combined_n, systematic_budget, unseen_n
from pneudrive.friction.friction_map import TABLES, group_of
from pneudrive.friction.sentences import sentence
from pneudrive.friction.stick_slip import RIPPLE_LIMIT, ReversalPeak, StickSlip
from pneudrive.friction.strokes import COVERED_SHARE, RecordedMotion, Strokes, StrokeUse, stroke_grid
from pneudrive.numbers import plain
from pneudrive.progress import Watch
from pneudrive.repr_tables import Card, Shown, brief
from pneudrive.signals.motion import Stroke, middle, speed_levels, speeds_differ, straight_line
from pneudrive.signals.pressure_delay import pressure_delay
from pneudrive.signals.recording import PRESSURES_PA, SLOWEST_M_S, SPEEDS_M_S, Recording, clean

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from pneudrive.arrays import Bools, Columns, Interval, NamedNumbers, Row
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
        """Systematic standard uncertainty of friction. For a single direction, it equals that of the offset."""
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
        """Names of the flags of samples, level and doubtful values."""
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
        """Mean gauge pressure in Pa, of the chamber in which its magnitude is larger."""
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
