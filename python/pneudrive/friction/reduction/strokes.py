"""The results of each stroke: its balance in bins of position, its means in the window, its breakaway."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from typing import TYPE_CHECKING

import numpy as np

from pneudrive.friction.reduction.motion import mean_speed
from pneudrive.friction.reduction.pairing import Grid, Profile, bin_means, grid_over, pair, stroke_means
from pneudrive.friction.reduction.reversal import ReversalPeak, breakaway, find_reversal_peaks
from pneudrive.friction.reduction.side import DirectionMeans, Side
from pneudrive.friction.reduction.spread import spread_of
from pneudrive.friction.reduction.stick_slip import StrokeSlip, sliding_of
from pneudrive.signals.motion import thinned

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from pneudrive.friction.reduction.motion import RecordedMotion
    from pneudrive.signals.motion import Stroke
    from pneudrive.signals.recording import Recording

    Array = NDArray[np.float64]

# Least share of the window's bins with settled samples for a stroke to count. Missing bins are filled from the profile.
COVERED_SHARE = 0.25
CUT_SHARE = 0.1  # of a bin: largest part of it that may lie outside the settled part


@dataclass(frozen=True)
class StrokeMeans(DirectionMeans):
    """Means over the settled samples of one stroke in the window."""

    samples: int
    pressure_moves_n: float


@dataclass(frozen=True, eq=False)
class StrokeFriction:
    """The results of one stroke for its speed class; their size grows with the bins, not with the samples.

    Attributes
    ----------
    stroke : Stroke
    time_s : float
        Its start.
    first : int
        Number of its first bin, see `Grid`.
    balance_n : ndarray, shape (bins,)
        Mean balance in each bin, NaN without settled samples.
    mean_n : float
        Mean balance of all chosen samples.
    inside : StrokeMeans or None
        None if it does not cover the window.
    slip : StrokeSlip or None
    peak : ReversalPeak or None
        After the reversal before it.
    """

    stroke: Stroke
    time_s: float
    first: int
    balance_n: Array
    mean_n: float
    inside: StrokeMeans | None
    slip: StrokeSlip | None
    peak: ReversalPeak | None = None


def stroke_frictions(
    motion: RecordedMotion, strokes: Sequence[Stroke], window: tuple[float, float], grid: Grid
) -> list[StrokeFriction]:
    """Return the results of the strokes of one speed level or cycle.

    Parameters
    ----------
    motion : RecordedMotion
    strokes : sequence of Stroke
    window : tuple of float
        Positions between which speed, force and pressures are averaged, m.
    grid : Grid
        A stroke counts if it has settled in a quarter of the bins in its window.

    Returns
    -------
    list of StrokeFriction
        Empty if no stroke counts.
    """
    recording, settled = motion.recording, motion.settled
    window_bins = slice(-grid.first, -grid.first + grid.in_window)
    found = []
    for stroke, row in zip(strokes, stroke_rows(motion, strokes, grid), strict=True):
        counts = np.isfinite(row[window_bins]).mean() >= COVERED_SHARE
        chosen = motion.balance_n[stroke.samples][settled[stroke.samples]]
        found.append(
            StrokeFriction(
                stroke=stroke,
                time_s=float(recording.time_s[stroke.start]),
                first=grid.first,
                balance_n=row,
                mean_n=float(chosen.mean()) if counts else float("nan"),
                inside=window_means(motion, stroke, window) if counts else None,
                slip=StrokeSlip.of(recording, stroke) if counts else None,
            )
        )
    if len({one.stroke.direction for one in found if one.inside}) < 2:
        return found if any(one.inside for one in found) else []
    peaks = find_reversal_peaks(recording, strokes, motion.raw_balance_n, profile_of(grid, found))
    peak_of = {peak.stroke: peak for peak in peaks}
    return [replace(one, peak=peak_of.get(one.stroke.index)) for one in found]


def stroke_grid(
    position_m: Array, strokes: Sequence[Stroke], window: tuple[float, float], bins: int | None = None
) -> Grid:
    """Divide the travel of some strokes into bins."""
    inside = [int(((x >= window[0]) & (x <= window[1])).sum()) for x in (position_m[s.samples] for s in strokes)]
    ends = [value for s in strokes for value in (s.from_m, s.to_m)]
    return grid_over(window, ends, float(np.median(inside)), bins)


def stroke_rows(motion: RecordedMotion, strokes: Sequence[Stroke], grid: Grid) -> list[Array]:
    """Average the balance of the settled samples of each stroke in each bin; NaN in bins that do not count."""
    edges, rows = grid.edges_m, []
    slack = CUT_SHARE * grid.width_m
    for stroke in strokes:
        row = bin_means(motion.position_m, motion.balance_n, edges, [stroke.samples], motion.settled)
        reached = motion.position_m[stroke.samples][motion.settled[stroke.samples]]
        if grid.whole and reached.size:
            row[(edges[:-1] < reached.min() - slack) | (edges[1:] > reached.max() + slack)] = np.nan
        rows.append(row)
    return rows


def window_means(motion: RecordedMotion, stroke: Stroke, window: tuple[float, float]) -> StrokeMeans | None:
    """Average the settled samples of a stroke between two positions; return None without any."""
    recording, settled = motion.recording, motion.settled
    position = recording.position_m[stroke.samples]
    inside = (position >= window[0]) & (position <= window[1]) & settled[stroke.samples]
    index = np.flatnonzero(inside) + stroke.start
    if not index.size:
        return None
    pressure_a, pressure_b = recording.pressure_a_pa[index], recording.pressure_b_pa[index]
    return StrokeMeans(
        force_n=float(recording.force_n[index].mean()),
        pressure_a_pa=float(pressure_a.mean()),
        pressure_b_pa=float(pressure_b.mean()),
        velocity_m_s=mean_speed(recording, index, stroke.speed_m_s),
        samples=index.size,
        pressure_moves_n=_usual_range(pressure_a) * recording.area_a_m2
        + _usual_range(pressure_b) * recording.area_b_m2,
        parallel_n=sum(force.uncertainty * float(force.force_n[index].mean()) for force in recording.parallel),
        late_n=motion.late_s * _gas_rate(recording, index) if motion.late_s else 0.0,
    )


def _gas_rate(recording: Recording, index: NDArray[np.intp]) -> float:
    """Return the mean rate of the gas force over some samples, N/s."""
    ends = [index[0], index[-1]]
    gas = recording.area_a_m2 * recording.pressure_a_pa[ends] - recording.area_b_m2 * recording.pressure_b_pa[ends]
    seconds = float(np.diff(recording.time_s[ends])[0])
    return float(np.diff(gas)[0]) / seconds if seconds > 0.0 else 0.0


@dataclass(frozen=True, eq=False)
class ReducedStrokes:
    """The strokes of one speed level or cycle by direction, over the bins of a grid.

    Attributes
    ----------
    used : dict of list of StrokeFriction
        Direction -> strokes that count.
    rows : dict of ndarray, shape (strokes, bins)
        Direction -> balance of these strokes.
    bins : ndarray of bool, shape (bins,)
        Bins of the window that all present directions have: means are over equal positions.
    sides : dict of Side
    means_n : dict of ndarray, shape (strokes,)
        Direction -> mean balance of each stroke.
    """

    used: dict[int, list[StrokeFriction]]
    rows: dict[int, Array]
    bins: NDArray[np.bool_]
    sides: dict[int, Side]
    means_n: dict[int, Array]

    @classmethod
    def of(cls, grid: Grid, frictions: Sequence[StrokeFriction], *, uses_window: bool) -> ReducedStrokes | None:
        """Combine the strokes of each direction; None if none counts, or the directions have no common bin.

        Parameters
        ----------
        grid : Grid
        frictions : sequence of StrokeFriction
        uses_window : bool
            Whether means are over the bins of the window, not over all chosen samples.
        """
        ways = _by_direction(frictions)
        used = {d: [s for s in some if s.inside] for d, some in ways.items() if any(s.inside for s in some)}
        rows = {d: rows_over(grid, some) for d, some in used.items()}
        bins = grid.is_in_window
        for matrix in rows.values():
            bins &= np.isfinite(matrix).any(axis=0)
        if not used or not bins.any():
            return None
        means = {
            d: stroke_means(rows[d], bins) if uses_window else np.array([s.mean_n for s in some])
            for d, some in used.items()
        }
        sides = {d: _side(some, means[d], len(ways[d])) for d, some in used.items()}
        return cls(used, rows, bins, sides, means)


def profile_of(grid: Grid, frictions: Sequence[StrokeFriction]) -> Profile:
    """Pair both directions of all strokes at equal position."""
    return pair(grid, {d: rows_over(grid, some) for d, some in _by_direction(frictions).items()})


def _by_direction(frictions: Sequence[StrokeFriction]) -> dict[int, list[StrokeFriction]]:
    return {d: [friction for friction in frictions if friction.stroke.direction == d] for d in (1, -1)}


def rows_over(grid: Grid, strokes: Sequence[StrokeFriction]) -> Array:
    """Map the bins of some strokes to one grid, shape (strokes, bins)."""
    rows = np.full((len(strokes), grid.stop - grid.first), np.nan)
    for row, stroke in zip(rows, strokes, strict=True):
        at = stroke.first - grid.first
        row[at : at + stroke.balance_n.size] = stroke.balance_n
    return rows


def _side(used: Sequence[StrokeFriction], means_n: Array, recorded: int) -> Side:
    """Combine the used strokes of one direction, which have equal weight."""
    inside, strokes = [s.inside for s in used if s.inside], tuple(s.stroke for s in used)
    names = [field.name for field in fields(DirectionMeans)]
    return Side(
        **{name: float(np.mean([getattr(s, name) for s in inside])) for name in names},
        samples=sum(s.samples for s in inside),
        strokes=len(strokes),
        strokes_recorded=recorded,
        used=strokes,
        spread=spread_of(means_n),
        pressure_moves_n=float(np.median([s.pressure_moves_n for s in inside])),
        **breakaway([s.peak for s in used if s.peak], strokes),
        **sliding_of([s.slip for s in used if s.slip]),
    )


def _usual_range(values: Array) -> float:
    """Return the range that holds all but the lowest and highest 5 % of the values."""
    some = np.sort(thinned(values))
    margin = int(0.05 * some.size)
    return float(some[some.size - 1 - margin] - some[margin])
