"""One recording through the chain: strokes, settled samples, profiles, map rows, uncertainty."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np

from pneudrive.characterise.budget import (
    BudgetEntry,
    DirectionMeans,
    combined,
    expanded,
    systematic_budget,
    uncertainty_of,
)
from pneudrive.characterise.closure import ClosurePoint
from pneudrive.characterise.friction_map import MapRow
from pneudrive.characterise.levels import speed_levels
from pneudrive.characterise.motion import Stroke, find_strokes, local_slope, middle, straight_line, thinned
from pneudrive.characterise.plausible import doubts_of, refuse_impossible
from pneudrive.characterise.pressure_line import ALL_RECORDINGS
from pneudrive.characterise.profile import Profile, build_profile, stroke_means
from pneudrive.characterise.recording import Recording
from pneudrive.characterise.reversal import ReversalPeak, find_reversal_peaks, usable
from pneudrive.characterise.samples import clean
from pneudrive.characterise.settling import Motion, SampleChoice
from pneudrive.characterise.spread import Spread, pair_stderr, profile_stderr, spread_of, within_stderr
from pneudrive.characterise.stick_slip import StickSlip, measure_stick_slip
from pneudrive.errors import RecordingError
from pneudrive.show import Shown

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

DEFAULT_WINDOW = (0.2, 0.8)  # of the stroke
# A stroke counts in the window when it has settled samples in at least this share of its bins.
COVERED_SHARE = 0.5
RIPPLE_LIMIT = 0.2  # speed ripple above which the mean over the window is no point of F(v)


@dataclass(frozen=True, eq=False, repr=False)  # holds arrays: equal only to itself
class Level(Shown):
    """One speed level of one recording.

    ``doubts`` says of some of the ``flags``, in a sentence, what to look at.
    ``spreads`` and ``stroke_friction_n`` are by direction +1/-1: the latter holds the mean friction of
    each stroke in the window, direction * (stroke - offset), in N, and ``stroke_times_s`` its time.
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
    rows: tuple[MapRow, ...]
    doubts: dict[str, str] = field(default_factory=dict)

    @property
    def expanded_n(self) -> float:
        """Expanded uncertainty U (k = 2) of ``friction_n``."""
        return expanded(self.stderr_n, self.u_systematic_n)

    @property
    def speed_m_s(self) -> float:
        """Mean speed of the directions in the window, not negative."""
        return float(np.mean([abs(row.velocity_m_s) for row in self.rows]))

    @property
    def speed_stderr_m_s(self) -> float:
        """Standard error of ``speed_m_s``: the scatter of the strokes' speeds, the larger one of both directions."""
        speeds = [[s.speed_m_s for s in self.strokes if s.direction == d] for d in (1, -1)]
        return max((float(np.std(v, ddof=1)) / float(np.sqrt(len(v))) for v in speeds if len(v) > 1), default=0.0)

    def gauge_pa(self, ambient_pressure_pa: float) -> dict[str, float]:
        """Mean gauge pressure of the directions in chambers ``a`` and ``b``."""
        means = {side: np.mean([getattr(row, f"pressure_{side}_pa") for row in self.rows]) for side in ("a", "b")}
        return {side: float(mean) - ambient_pressure_pa for side, mean in means.items()}

    def larger_gauge_pa(self, ambient_pressure_pa: float) -> float:
        """Mean gauge pressure in the chamber that is pressurised more."""
        return max(self.gauge_pa(ambient_pressure_pa).values(), key=abs)


@dataclass(frozen=True, eq=False, repr=False)  # holds arrays: equal only to itself
class RecordingResult(Shown):
    """What one recording gave. ``recording`` is the cleaned one, with its counts of flags."""

    recording: Recording
    strokes: tuple[Stroke, ...]
    settled: NDArray[np.bool_]
    balance_n: NDArray[np.float64]
    levels: tuple[Level, ...]
    closure_points: tuple[ClosurePoint, ...]


@dataclass(frozen=True, eq=False)
class Moved:
    """A recording after its samples were judged: what its speed levels are put together from."""

    recording: Recording
    strokes: tuple[Stroke, ...]
    settled: NDArray[np.bool_]
    balance_n: NDArray[np.float64]


def extract(recording: Recording, choice: SampleChoice) -> RecordingResult:
    """Extract friction from one recording.

    Raises
    ------
    RecordingError
        No motion, too few samples, or no stroke with settled samples in the window.
    """
    moved = judged(recording, choice)
    window = window_of(moved.recording, moved.strokes, choice)
    groups = (pieces_of(moved, members, window, choice) for members in speed_levels(list(moved.strokes)))
    return result_of(moved, [group for group in groups if group is not None], window, choice)


def judged(recording: Recording, choice: SampleChoice) -> Moved:
    """Clean a recording, find its strokes, and choose the samples that count.

    Raises
    ------
    RecordingError
        No motion, too few samples, or what no rig can have measured.
    """
    recording = clean(recording)
    strokes = find_strokes(recording.name, recording.time_s, recording.position_m)
    refuse_impossible(recording, strokes)
    acceleration: NDArray[np.float64] | float = 0.0
    if recording.mass_beyond_sensor_kg:
        acceleration = local_slope(recording.time_s, local_slope(recording.time_s, recording.position_m))
    motion = Motion(recording.time_s, recording.position_m, recording.balance_n(acceleration), strokes)
    settled, balance = choice.choose(motion)
    return Moved(recording, tuple(strokes), settled, balance)


def result_of(moved: Moved, groups: list[Pieces], window: tuple[float, float], choice: SampleChoice) -> RecordingResult:
    """Put the speed levels together.

    Raises
    ------
    RecordingError
        No level has settled samples in the window.
    """
    levels: list[Level] = []
    for pieces in groups:
        level = _level(moved.recording, len(levels), pieces, window, choice)
        if level is not None:
            levels.append(level)
    if not levels:
        raise RecordingError(
            "no stroke has settled samples in the window",
            where=moved.recording.name,
            value=f"window {window[0] * 1e3:.4g} mm .. {window[1] * 1e3:.4g} mm, {len(moved.strokes)} strokes",
            remedy="widen window.position in the layout, or record longer strokes",
        )
    points = [p for p in (_closure_point(moved.recording, level) for level in levels) if p is not None]
    return RecordingResult(moved.recording, moved.strokes, moved.settled, moved.balance_n, tuple(levels), tuple(points))


def window_of(recording: Recording, strokes: Sequence[Stroke], choice: SampleChoice) -> tuple[float, float]:
    """Positions between which friction is averaged: those of the layout, or the middle of the strokes.

    Raises
    ------
    RecordingError
        The layout's lie outside the motion.
    """
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
    return low + DEFAULT_WINDOW[0] * travel, low + DEFAULT_WINDOW[1] * travel


@dataclass(frozen=True, eq=False)
class Pieces:
    """What the strokes of one speed level leave: it grows with their number, and not with the samples.

    ``used`` are the strokes that cover the window, ``rows`` their bins, shape (strokes, bins), ``times_s`` their
    beginnings, ``sample_means_n`` the means of all their samples that count, each by direction.
    """

    strokes: tuple[Stroke, ...]
    profile: Profile
    used: dict[int, list[Stroke]]
    rows: dict[int, NDArray[np.float64]]
    times_s: dict[int, NDArray[np.float64]]
    sample_means_n: dict[int, NDArray[np.float64]]
    conditions: dict[int, Conditions]
    peaks: tuple[ReversalPeak, ...]
    stick_slip: tuple[StickSlip, ...]


def pieces_of(
    moved: Moved,
    strokes: list[Stroke],
    window: tuple[float, float],
    choice: SampleChoice,
    bins: int | None = None,
) -> Pieces | None:
    """Take from the samples what a level of these strokes needs; None where no stroke covers the window."""
    recording, balance, settled = moved.recording, moved.balance_n, moved.settled
    profile = build_profile(recording.name, 0, strokes, recording.position_m, balance, settled, window, bins)
    used, rows = _covering(strokes, profile)
    if not used:
        return None
    means = {}
    if not choice.uses_window:
        means = {d: np.array([balance[s.samples][settled[s.samples]].mean() for s in used[d]]) for d in used}
    slips = [_stick_slip(recording, s) for members in used.values() for s in members]
    return Pieces(
        strokes=tuple(strokes),
        profile=profile,
        used=used,
        rows=rows,
        times_s={d: recording.time_s[[s.start for s in members]] for d, members in used.items()},
        sample_means_n=means,
        conditions={d: _conditions(recording, members, settled, window) for d, members in used.items()},
        peaks=tuple(find_reversal_peaks(recording, strokes, balance, profile)) if len(used) == 2 else (),
        stick_slip=tuple(s for s in slips if s is not None),
    )


def _level(
    recording: Recording, index: int, pieces: Pieces, window: tuple[float, float], choice: SampleChoice
) -> Level | None:
    """Put one speed level together; None where the directions share no bin of the window."""
    profile, used, rows, conditions = replace(pieces.profile, level=index), pieces.used, pieces.rows, pieces.conditions
    # Equal positions: only bins that every present direction has.
    bins = profile.in_window.copy()
    for matrix in rows.values():
        bins &= np.isfinite(matrix).any(axis=0)
    if not bins.any():
        return None
    means = (
        {d: stroke_means(matrix, bins) for d, matrix in rows.items()} if choice.uses_window else pieces.sample_means_n
    )
    spreads = {d: spread_of(means.get(d, np.zeros(0))) for d in (1, -1)}
    found = _estimate(recording, profile, bins, spreads, rows, conditions)
    paired = len(used) == 2
    level = Level(
        recording=recording.name,
        index=index,
        strokes=pieces.strokes,
        profile=profile,
        window_m=window,
        friction_n=found.friction_n,
        offset_n=found.offset_n,
        stderr_n=found.stderr_n,
        u_systematic_n=found.u_friction_n,
        u_offset_n=found.u_offset_n,
        spreads=spreads,
        stroke_friction_n={d: d * (m - (found.offset_n if paired else 0.0)) for d, m in means.items()},
        stroke_times_s=pieces.times_s,
        budget=tuple(found.budget),
        peaks=tuple(replace(peak, level=index) for peak in pieces.peaks),
        stick_slip=pieces.stick_slip,
        flags=(),
        rows=(),
    )
    # What may be wrong is judged by the means of the rows, which carry it in turn.
    doubts = doubts_of(recording, replace(level, rows=_rows(recording, level, conditions, used)))
    flags = (*_level_flags(recording, level, used, conditions, bins), *doubts)
    level = replace(level, flags=flags, doubts=doubts)
    return replace(level, rows=_rows(recording, level, conditions, used))


def _covering(
    strokes: list[Stroke], profile: Profile
) -> tuple[dict[int, list[Stroke]], dict[int, NDArray[np.float64]]]:
    """Keep the strokes that cover the window, and their bins, by direction; a direction without any is absent."""
    used: dict[int, list[Stroke]] = {}
    rows: dict[int, NDArray[np.float64]] = {}
    for direction, matrix in ((1, profile.up_strokes_n), (-1, profile.down_strokes_n)):
        covered = np.isfinite(matrix[:, profile.in_window]).mean(axis=1) >= COVERED_SHARE
        if covered.any():
            members = [s for s in strokes if s.direction == direction]
            used[direction] = [s for s, ok in zip(members, covered, strict=True) if ok]
            rows[direction] = matrix[covered]
    return used, rows


@dataclass(frozen=True)
class _Estimate:
    """Friction and offset of one level with their uncertainties, N."""

    friction_n: float
    offset_n: float
    stderr_n: float
    u_friction_n: float
    u_offset_n: float
    budget: list[BudgetEntry]


def _estimate(
    recording: Recording,
    profile: Profile,
    bins: NDArray[np.bool_],
    spreads: dict[int, Spread],
    rows: dict[int, NDArray[np.float64]],
    conditions: dict[int, Conditions],
) -> _Estimate:
    """Pair the directions, or take the one that is there, and state the uncertainty."""
    only = next(iter(conditions))
    up, down = (conditions.get(d, conditions[only]).means for d in (1, -1))
    paired = len(conditions) == 2
    known = bins & np.isfinite(profile.offset_n)
    slope = straight_line(profile.position_m[known], profile.offset_n[known])[0] if known.any() else 0.0
    budget = systematic_budget(recording, up, down, slope, middle(np.diff(recording.time_s)))
    u_friction, u_offset = combined(budget)
    if not paired:
        stderr = spreads[only].stderr_n
        if not np.isfinite(stderr):
            stderr = profile_stderr(rows[only][0][bins])
        # Nothing cancels in one direction alone: friction is as uncertain as the offset would be.
        return _Estimate(only * spreads[only].mean_n, float("nan"), stderr, u_offset, u_offset, budget)
    stderr = pair_stderr(spreads[1], spreads[-1])
    if np.isfinite(stderr):
        inside = sum(within_stderr(matrix[:, bins]) ** 2 for matrix in rows.values())
        stderr = max(stderr, float(np.sqrt(inside)) / 2)
    else:
        stderr = profile_stderr(profile.friction_n[bins])
    half_difference = (spreads[1].mean_n - spreads[-1].mean_n) / 2
    half_sum = (spreads[1].mean_n + spreads[-1].mean_n) / 2
    return _Estimate(half_difference, half_sum, stderr, u_friction, u_offset, budget)


@dataclass(frozen=True)
class Conditions:
    """Means over the settled samples of the window in one direction."""

    means: DirectionMeans
    samples: int
    pressure_moves_n: float


def _conditions(
    recording: Recording, strokes: list[Stroke], settled: NDArray[np.bool_], window: tuple[float, float]
) -> Conditions:
    position = recording.position_m
    inside = (position >= window[0]) & (position <= window[1]) & settled
    force, pressure_a, pressure_b, speed, moves = [], [], [], [], []
    samples = 0
    for stroke in strokes:
        index = np.flatnonzero(inside[stroke.samples]) + stroke.start
        samples += index.size
        force.append(recording.force_n[index].mean())
        pressure_a.append(recording.pressure_a_pa[index].mean())
        pressure_b.append(recording.pressure_b_pa[index].mean())
        time = recording.time_s[index[-1]] - recording.time_s[index[0]]
        speed.append((position[index[-1]] - position[index[0]]) / time if time > 0 else stroke.speed_m_s)
        moves.append(
            _usual_range(recording.pressure_a_pa[index]) * recording.area_a_m2
            + _usual_range(recording.pressure_b_pa[index]) * recording.area_b_m2
        )
    means = DirectionMeans(*(float(np.mean(v)) for v in (force, pressure_a, pressure_b, speed)))
    return Conditions(means, samples, float(np.median(moves)))


def _usual_range(values: NDArray[np.float64]) -> float:
    """Range that holds all but the lowest and highest 5 % of the values."""
    some = np.sort(thinned(values))
    margin = int(0.05 * some.size)
    return float(some[some.size - 1 - margin] - some[margin])


def _stick_slip(recording: Recording, stroke: Stroke) -> StickSlip | None:
    share = (recording.position_m[stroke.samples] - stroke.from_m) / (stroke.to_m - stroke.from_m)
    inside = np.flatnonzero((share >= 0.1) & (share <= 0.9))
    if inside.size < 20:
        return None
    section = slice(stroke.start + int(inside[0]), stroke.start + int(inside[-1]) + 1)
    return measure_stick_slip(recording.time_s[section], recording.position_m[section])


def _level_flags(
    recording: Recording,
    level: Level,
    used: dict[int, list[Stroke]],
    conditions: dict[int, Conditions],
    bins: NDArray[np.bool_],
) -> tuple[str, ...]:
    """Names of what the reader of the map should know."""
    flags = [kind for kind, count in recording.flags.items() if count]
    slips = level.stick_slip
    speeds = [abs(c.means.speed_m_s) for c in conditions.values()]
    stick_slip = bool(slips) and float(np.mean([s.found for s in slips])) > 0.5
    ripple = bool(slips) and float(np.median([s.ripple for s in slips])) > RIPPLE_LIMIT
    seen = {
        "unpaired": len(used) < 2,
        "negative_friction": level.friction_n < -2 * level.expanded_n,
        "single_stroke": min(len(members) for members in used.values()) == 1,
        "trend": any(s.has_trend for s in level.spreads.values()),
        "stick_slip": stick_slip,
        "speed_ripple": ripple and not stick_slip,
        "window_not_covered": bins.sum() < 0.9 * level.profile.in_window.sum(),
        "pressure_moves": any(c.pressure_moves_n > 0.5 * abs(level.friction_n) for c in conditions.values()),
        "unequal_speeds": max(speeds) - min(speeds) > 0.1 * max(speeds),
    }
    return (*flags, *(name for name, is_so in seen.items() if is_so))


def _rows(
    recording: Recording, level: Level, conditions: dict[int, Conditions], used: dict[int, list[Stroke]]
) -> tuple[MapRow, ...]:
    """Write the map's rows, one per direction that is there."""
    rows = []
    for direction, condition in conditions.items():
        peaks = [p for p in level.peaks if p.direction == direction]
        good = usable(peaks)
        dwells = [s.dwell_s for s in used[direction] if s.index > 0]
        rates = [p.loading_rate_n_s for p in peaks if np.isfinite(p.loading_rate_n_s)]
        spoiled = ("breakaway_spoiled",) if peaks and not good else ()
        rows.append(
            MapRow(
                recording=level.recording,
                direction=direction,
                velocity_m_s=condition.means.speed_m_s,
                pressure_a_pa=condition.means.pressure_a_pa,
                pressure_b_pa=condition.means.pressure_b_pa,
                balance_n=level.spreads[direction].mean_n,
                friction_n=level.friction_n,
                offset_n=level.offset_n,
                stderr_n=level.stderr_n,
                u_systematic_n=level.u_systematic_n,
                samples=condition.samples,
                strokes=len(used[direction]),
                position_from_m=level.window_m[0],
                position_to_m=level.window_m[1],
                breakaway_n=float(np.median([p.friction_n for p in good])) if good else float("nan"),
                dwell_s=float(np.median(dwells)) if dwells else float("nan"),
                loading_rate_n_s=float(np.median(rates)) if rates else float("nan"),
                flags=",".join((*level.flags, *spoiled)),
                labels=recording.labels,
            )
        )
    return tuple(rows)


def _closure_point(recording: Recording, level: Level) -> ClosurePoint | None:
    """Half the sum of both directions' forces, by way of the balance so that positions are equal."""
    if len(level.rows) != 2 or recording.area_a_m2 + recording.area_b_m2 == 0:
        return None
    gauge, weight = level.gauge_pa(recording.ambient_pressure_pa), recording.weight_n
    force = level.offset_n - gauge["a"] * recording.area_a_m2 + gauge["b"] * recording.area_b_m2 + weight
    return ClosurePoint(
        recording=recording.name,
        group=recording.labels.get("seal", ALL_RECORDINGS),
        half_sum_force_n=force,
        gauge_a_pa=gauge["a"],
        gauge_b_pa=gauge["b"],
        weight_n=weight,
        area_a_m2=recording.area_a_m2,
        area_b_m2=recording.area_b_m2,
        u_a_pa=uncertainty_of(level.budget, "pressure a: common error"),
        u_b_pa=uncertainty_of(level.budget, "pressure b: common error"),
    )
