"""The results of each stroke: its balance in bins of position, its means in the window, its breakaway."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import TYPE_CHECKING, Any

import numpy as np

from pneudrive.friction.reduction.budget import CLOCK_S
from pneudrive.friction.reduction.motion import mean_speed
from pneudrive.friction.reduction.pairing import Grid, bin_means, grid_over, pair
from pneudrive.friction.reduction.reversal import ReversalPeak, breakaway, find_reversal_peaks
from pneudrive.friction.reduction.side import DirectionMeans
from pneudrive.friction.reduction.stick_slip import StickSlip, stick_slip_of
from pneudrive.signals.motion import thinned

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from pneudrive.friction.reduction.motion import RecordedMotion
    from pneudrive.signals.motion import Stroke
    from pneudrive.signals.recording import Recording

    Array = NDArray[np.float64]

# A stroke counts in the window if it has settled samples in at least this fraction of its bins.
COVERED_SHARE = 0.5


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
    peak : ReversalPeak or None
    stick_slip : StickSlip or None
    """

    stroke: Stroke
    time_s: float
    first: int
    balance_n: Array
    mean_n: float
    inside: StrokeMeans | None
    peak: ReversalPeak | None
    stick_slip: StickSlip | None


def stroke_frictions(
    motion: RecordedMotion, strokes: Sequence[Stroke], window: tuple[float, float], bins: int | None = None
) -> tuple[Grid, list[StrokeFriction]]:
    """Return the results of strokes for their speed class.

    Parameters
    ----------
    motion : RecordedMotion
    strokes : sequence of Stroke
        Strokes of one speed class.
    window : tuple of float
        Positions between which friction is averaged, m.
    bins : int, optional
        Bins of the window; None: by the number of samples.

    Returns
    -------
    Grid
    list of StrokeFriction
        Empty if no stroke covers the window.
    """
    recording, balance = motion.recording, motion.balance_n
    grid = stroke_grid(recording.position_m, strokes, window, bins)
    rows = stroke_rows(recording.position_m, balance, motion.settled, strokes, grid)
    window_bins = slice(-grid.first, -grid.first + grid.in_window)
    covers = [bool(np.isfinite(row[window_bins]).mean() >= COVERED_SHARE) for row in rows]
    if not any(covers):
        return grid, []
    both = len({s.direction for s, ok in zip(strokes, covers, strict=True) if ok}) == 2
    peaks = (
        find_reversal_peaks(recording, strokes, motion.raw_balance_n, pair(grid, by_direction(strokes, rows)))
        if both
        else []
    )
    peak_of = {peak.stroke: peak for peak in peaks}
    found = []
    for stroke, row, ok in zip(strokes, rows, covers, strict=True):
        counts = balance[stroke.samples][motion.settled[stroke.samples]]
        found.append(
            StrokeFriction(
                stroke=stroke,
                time_s=float(recording.time_s[stroke.start]),
                first=grid.first,
                balance_n=row,
                mean_n=float(counts.mean()) if ok else float("nan"),
                inside=window_means(recording, stroke, motion.settled, window) if ok else None,
                peak=peak_of.get(stroke.index),
                stick_slip=stick_slip_of(stroke, recording.time_s, recording.position_m) if ok else None,
            )
        )
    return grid, found


def stroke_grid(
    position_m: Array, strokes: Sequence[Stroke], window: tuple[float, float], bins: int | None = None
) -> Grid:
    """Divide the travel of some strokes into bins."""
    inside = [int(((x >= window[0]) & (x <= window[1])).sum()) for x in (position_m[s.samples] for s in strokes)]
    ends = [value for s in strokes for value in (s.from_m, s.to_m)]
    return grid_over(window, ends, float(np.median(inside)), bins)


def stroke_rows(
    position_m: Array, balance_n: Array, settled: NDArray[np.bool_], strokes: Sequence[Stroke], grid: Grid
) -> list[Array]:
    """Average the balance of each stroke in each bin, over the chosen samples."""
    edges = grid.edges_m
    return [bin_means(position_m, balance_n, edges, [stroke.samples], settled) for stroke in strokes]


def by_direction(strokes: Sequence[Stroke], rows: Sequence[Array]) -> dict[int, Array]:
    """Stack the rows of the strokes of each direction, shape (strokes, bins)."""
    bins = rows[0].size
    return {
        d: np.array([row for s, row in zip(strokes, rows, strict=True) if s.direction == d]).reshape(-1, bins)
        for d in (1, -1)
    }


def window_means(
    recording: Recording, stroke: Stroke, settled: NDArray[np.bool_], window: tuple[float, float]
) -> StrokeMeans | None:
    """Average the settled samples of a stroke between two positions; return None without any."""
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
        late_n=CLOCK_S * _gas_rate(recording, index) if recording.parallel else 0.0,
    )


def _gas_rate(recording: Recording, index: NDArray[np.intp]) -> float:
    """Return the mean rate of the gas force over some samples, N/s."""
    ends = [index[0], index[-1]]
    gas = recording.area_a_m2 * recording.pressure_a_pa[ends] - recording.area_b_m2 * recording.pressure_b_pa[ends]
    seconds = float(np.diff(recording.time_s[ends])[0])
    return float(np.diff(gas)[0]) / seconds if seconds > 0.0 else 0.0


def side_values(
    means: Sequence[StrokeMeans], peaks: Sequence[ReversalPeak], strokes: Sequence[Stroke]
) -> dict[str, Any]:
    """Return the values of one direction by the fields of `Side`: its strokes have equal weight."""
    names = [one.name for one in fields(DirectionMeans)]
    return {
        **{name: float(np.mean([getattr(s, name) for s in means])) for name in names},
        "samples": sum(s.samples for s in means),
        "strokes": len(strokes),
        **breakaway(peaks, strokes),
    }


def _usual_range(values: Array) -> float:
    """Return the range that holds all but the lowest and highest 5 % of the values."""
    some = np.sort(thinned(values))
    margin = int(0.05 * some.size)
    return float(some[some.size - 1 - margin] - some[margin])
