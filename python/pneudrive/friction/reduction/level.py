"""Reduction of one recording: strokes, settled samples, profiles, map rows, uncertainty."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from pneudrive.errors import RecordingError
from pneudrive.friction.friction_map import Row
from pneudrive.friction.reduction.budget import (
    BudgetEntry,
    chance_n,
    combined,
    expanded,
    systematic_budget,
    window_entry,
)
from pneudrive.friction.reduction.motion import RecordedMotion, SampleChoice
from pneudrive.friction.reduction.pairing import MIDDLE, Grid, Profile
from pneudrive.friction.reduction.plausible import doubts_of
from pneudrive.friction.reduction.reversal import ReversalPeak
from pneudrive.friction.reduction.side import RowValue, Side, row_of
from pneudrive.friction.reduction.spread import Spread, pair_stderr, profile_stderr, spread_of, within_stderr
from pneudrive.friction.reduction.stick_slip import RIPPLE_LIMIT, StickSlip
from pneudrive.friction.reduction.stroke_use import StrokeUse
from pneudrive.friction.reduction.strokes import (
    ReducedStrokes,
    StrokeFriction,
    profile_of,
    stroke_frictions,
    stroke_grid,
)
from pneudrive.repr_tables import Shown
from pneudrive.signals.levels import speed_levels, speeds_differ
from pneudrive.signals.motion import Stroke, middle, straight_line
from pneudrive.signals.pressure_delay import pressure_delay
from pneudrive.signals.recording import Recording
from pneudrive.signals.samples import clean

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray


@dataclass(frozen=True, eq=False, repr=False)  # holds arrays: equal only to itself
class Level(Shown):
    """One speed class of one recording.

    ``doubts`` has a sentence for some of the ``flags``.
    ``spreads`` and ``stroke_friction_n`` have the keys +1 and -1 for the direction. ``stroke_friction_n`` has the mean
    friction of each stroke in
    the window, direction * (stroke - offset), in N, and ``stroke_times_s`` its time.
    """

    recording: str
    index: int
    strokes: tuple[Stroke, ...]
    profile: Profile
    window_m: tuple[float, float]
    friction_n: float
    offset_n: float
    stderr_n: float
    u_systematic_n: float
    u_offset_n: float
    spreads: dict[int, Spread]
    stroke_friction_n: dict[int, NDArray[np.float64]]
    stroke_times_s: dict[int, NDArray[np.float64]]
    budget: tuple[BudgetEntry, ...]
    peaks: tuple[ReversalPeak, ...]
    stick_slip: tuple[StickSlip, ...]
    flags: tuple[str, ...]
    rows: tuple[Row, ...]
    sides: dict[int, Side]
    doubts: dict[str, str] = field(default_factory=dict)

    @property
    def expanded_n(self) -> float:
        """Expanded uncertainty U (k = 2) of ``friction_n``."""
        return expanded(self.stderr_n, self.u_systematic_n)

    @property
    def speed_m_s(self) -> float:
        """Mean absolute speed of both directions in the window."""
        return float(np.mean([abs(side.velocity_m_s) for side in self.sides.values()]))

    @property
    def speed_stderr_m_s(self) -> float:
        """Standard error of ``speed_m_s``: scatter of the strokes' speeds, the larger one of both directions."""
        speeds = [[s.speed_m_s for s in self.strokes if s.direction == d] for d in (1, -1)]
        return max((float(np.std(v, ddof=1)) / float(np.sqrt(len(v))) for v in speeds if len(v) > 1), default=0.0)

    def gauge_pa(self, ambient_pressure_pa: float) -> dict[str, float]:
        """Return the mean gauge pressure of the directions in chambers ``a`` and ``b``."""
        means = {side: np.mean([getattr(s, f"pressure_{side}_pa") for s in self.sides.values()]) for side in "ab"}
        return {side: float(mean) - ambient_pressure_pa for side, mean in means.items()}

    def larger_gauge_pa(self, ambient_pressure_pa: float) -> float:
        """Return the higher mean gauge pressure of both chambers."""
        return max(self.gauge_pa(ambient_pressure_pa).values(), key=abs)


@dataclass(frozen=True, eq=False, repr=False)  # holds arrays: equal only to itself
class RecordingResult(RecordedMotion, Shown):
    """The result of one recording. ``recording`` is the cleaned one, with its counts of flags."""

    levels: tuple[Level, ...]
    stroke_use: StrokeUse


def extract(recording: Recording, choice: SampleChoice) -> RecordingResult:
    """Extract friction from one recording, after the delay of its pressures is removed.

    Raises
    ------
    RecordingError
        Without motion, with too few samples, or without a stroke with settled samples in the window.
    """
    recording = clean(recording)
    delay = pressure_delay(recording)
    if delay is not None and delay.is_clear:
        recording = delay.removed(recording)
    motion = RecordedMotion.of(recording, choice, delay=delay)
    window = window_of(motion, choice)
    groups = []
    for members in speed_levels(list(motion.strokes)):
        grid = stroke_grid(motion.position_m, members, window)
        groups.append((grid, stroke_frictions(motion, members, window, grid)))
    return result_of(motion, groups, window, choice, motion.strokes)


def result_of(
    motion: RecordedMotion,
    groups: Sequence[tuple[Grid, list[StrokeFriction]]],
    window: tuple[float, float],
    choice: SampleChoice,
    strokes: Sequence[Stroke],
) -> RecordingResult:
    """Combine the speed classes; ``strokes`` are all strokes of the recording.

    Raises
    ------
    RecordingError
        If no speed class has settled samples in the window.
    """
    levels: list[Level] = []
    used: set[int] = set()
    covering = {f.stroke.index for _, members in groups for f in members if f.inside}
    for grid, members in groups:
        level = _level(motion, len(levels), grid, members, window, choice)
        if level is not None:
            levels.append(level)
            used |= {f.stroke.index for f in members if f.inside}
    use = StrokeUse.of(strokes, used, covering, window)
    if not levels:
        raise RecordingError(
            "no stroke has settled samples in the window",
            where=motion.recording.name,
            value=f"window {window[0] * 1e3:.4g} mm .. {window[1] * 1e3:.4g} mm, {use.recorded} strokes: {use.why}",
            remedy="widen window.position in the layout, or record longer strokes",
        )
    return RecordingResult(**vars(motion), levels=tuple(levels), stroke_use=use)


def window_of(motion: RecordedMotion, choice: SampleChoice) -> tuple[float, float]:
    """Return the positions between which friction is averaged: those of the layout, or the middle of the strokes.

    Raises
    ------
    RecordingError
        The bounds of the layout are outside the motion.
    """
    recording, strokes = motion.recording, motion.strokes
    low = float(np.median([min(s.from_m, s.to_m) for s in strokes]))
    high = float(np.median([max(s.from_m, s.to_m) for s in strokes]))
    if not choice.uses_window:
        return low, high
    if recording.window_m is not None:
        if recording.window_m[0] >= high or recording.window_m[1] <= low:
            raise RecordingError(
                "the window lies outside the motion",
                where=recording.name,
                value=f"window {recording.window_m[0] * 1e3:.4g} .. {recording.window_m[1] * 1e3:.4g} mm, "
                f"strokes {low * 1e3:.4g} .. {high * 1e3:.4g} mm",
                remedy="change window.position in the layout",
            )
        return recording.window_m
    travel = high - low
    return low + MIDDLE[0] * travel, low + MIDDLE[1] * travel


def _level(
    motion: RecordedMotion,
    index: int,
    grid: Grid,
    strokes: Sequence[StrokeFriction],
    window: tuple[float, float],
    choice: SampleChoice,
) -> Level | None:
    """Return one speed class. None if no stroke covers the window, or the directions have no common bin."""
    recording, found = motion.recording, ReducedStrokes.of(grid, strokes, uses_window=choice.uses_window)
    if found is None:
        return None
    profile = profile_of(grid, strokes)
    spreads = {d: found.sides[d].spread if d in found.sides else spread_of(np.zeros(0)) for d in (1, -1)}
    estimate = _estimate(motion, profile, found, spreads)
    offset = estimate["offset_n"] if len(found.sides) == 2 else 0.0
    slips = [s.slip.axis for members in found.used.values() for s in members if s.slip]
    level = Level(
        recording=recording.name,
        index=index,
        strokes=tuple(s.stroke for s in strokes),
        profile=profile,
        window_m=window,
        spreads=spreads,
        stroke_friction_n={d: d * (means - offset) for d, means in found.means_n.items()},
        stroke_times_s={d: np.array([s.time_s for s in members]) for d, members in found.used.items()},
        peaks=tuple(s.peak for s in strokes if s.peak),
        stick_slip=tuple(slips),
        flags=(),
        rows=(),
        sides=found.sides,
        **estimate,
    )
    ambient = recording.ambient_pressure_pa
    doubts = doubts_of(
        recording,
        gauge_pa=level.gauge_pa(ambient),
        speed_m_s=level.speed_m_s,
        friction_n=level.friction_n,
        offset_n=level.offset_n,
        u_offset_n=level.u_offset_n,
    )
    covered = not choice.uses_window or found.bins.sum() >= 0.9 * profile.in_window.sum()
    flags = (*_level_flags(recording, level, covers_window=bool(covered)), *doubts)
    level = replace(level, flags=flags, doubts=doubts)
    return replace(level, rows=_rows(recording, level))


def _estimate(
    motion: RecordedMotion, profile: Profile, found: ReducedStrokes, spreads: dict[int, Spread]
) -> dict[str, Any]:
    """Pair the directions, or use the only one, and estimate the uncertainty."""
    sides, only = found.sides, next(iter(found.sides))
    up, down = (sides.get(d, sides[only]) for d in (1, -1))
    known = found.bins & np.isfinite(profile.offset_n)
    slope = straight_line(profile.position_m[known], profile.offset_n[known])[0] if known.any() else 0.0
    step = middle(np.diff(motion.time_s))
    budget = tuple(systematic_budget(motion.recording, up, down, slope, step, motion.late_s))
    budget = (*budget, _window_entry(profile, found))
    u_friction, u_offset = combined(budget)
    stderr = _by_chance(spreads, found, profile)
    if len(sides) == 1:
        # A single direction cancels nothing: its friction is as uncertain as the offset.
        friction, offset, u_friction = only * spreads[only].mean_n, float("nan"), u_offset
    else:
        friction = (spreads[1].mean_n - spreads[-1].mean_n) / 2
        offset = (spreads[1].mean_n + spreads[-1].mean_n) / 2
    return {
        "friction_n": friction,
        "offset_n": offset,
        "stderr_n": stderr,
        "u_systematic_n": u_friction,
        "u_offset_n": u_offset,
        "budget": budget,
    }


def _by_chance(spreads: dict[int, Spread], found: ReducedStrokes, profile: Profile) -> float:
    """Return `chance_n`. The profile over position is all that is known if no direction has two strokes."""
    rows = {d: matrix[:, found.bins] for d, matrix in found.rows.items()}
    if len(rows) == 1:
        (only,) = rows
        scatter, single, inside = spreads[only].stderr_n, rows[only][0], within_stderr(rows[only])
    else:
        scatter, single = pair_stderr(spreads[1], spreads[-1]), profile.friction_n[found.bins]
        inside = float(np.sqrt(sum(within_stderr(matrix) ** 2 for matrix in rows.values()))) / 2
    return float(chance_n(scatter, inside if np.isfinite(scatter) else profile_stderr(single)))


def _window_entry(profile: Profile, found: ReducedStrokes) -> BudgetEntry:
    """Return the entry of the window; a single direction has its balance for both friction and half the sum."""
    only = profile.up_n if 1 in found.sides else profile.down_n
    friction, offset = (profile.friction_n, profile.offset_n) if len(found.sides) == 2 else (only, only)
    return window_entry(friction[found.bins], offset[found.bins], float(found.bins.mean()))


def _level_flags(recording: Recording, level: Level, *, covers_window: bool) -> tuple[str, ...]:
    """Return the flags of a speed class."""
    flags = [kind for kind, count in recording.flags.items() if count]
    speeds = [abs(c.velocity_m_s) for c in level.sides.values()]
    stick_slip = any(side.stick_slip for side in level.sides.values())
    ripple = any(side.ripple > RIPPLE_LIMIT for side in level.sides.values())
    seen = {
        "unpaired": len(level.sides) < 2,
        "negative_friction": level.friction_n < -2 * level.expanded_n,
        "single_stroke": min(side.strokes for side in level.sides.values()) == 1,
        "trend": any(s.has_trend for s in level.spreads.values()),
        "stick_slip": stick_slip,
        "speed_ripple": ripple and not stick_slip,
        "window_not_covered": not covers_window,
        "pressure_moves": any(c.pressure_moves_n > 0.5 * abs(level.friction_n) for c in level.sides.values()),
        "unequal_speeds": max(speeds) - min(speeds) > 0.1 * max(speeds),
        "mixed_speeds": any(speeds_differ(side.used) for side in level.sides.values()),
    }
    return (*flags, *(name for name, is_so in seen.items() if is_so))


def _rows(recording: Recording, level: Level) -> tuple[Row, ...]:
    """Return the map's rows, one per present direction."""
    rows = []
    for direction, side in level.sides.items():
        peaks = [p for p in level.peaks if p.direction == direction]
        spoiled = ("breakaway_spoiled",) if peaks and all(p.flags for p in peaks) else ()
        balance = level.spreads[direction].mean_n
        value = RowValue(balance, level.friction_n, level.offset_n, level.stderr_n, level.u_systematic_n)
        flags = ",".join((*level.flags, *spoiled))
        name, ambient = level.recording, recording.ambient_pressure_pa
        rows.append(row_of(name, direction, side, value, level.window_m, flags, ambient))
    return tuple(rows)
