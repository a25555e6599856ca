"""From samples to the strokes of a motion, their settled samples, and the results of each stroke."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Protocol

import numpy as np

from pneudrive.friction.reduction.budget import DirectionMeans
from pneudrive.friction.reduction.pairing import Grid, bin_means, grid_over, pair
from pneudrive.friction.reduction.reversal import ReversalPeak, find_reversal_peaks
from pneudrive.friction.reduction.stick_slip import StickSlip, stick_slip_of
from pneudrive.signals.impossible import refuse_impossible
from pneudrive.signals.motion import find_strokes, local_slope, thinned

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from pneudrive.signals.motion import Stroke
    from pneudrive.signals.recording import Recording

    Array = NDArray[np.float64]

# A stroke counts in the window if it has settled samples in at least this share of its bins.
COVERED_SHARE = 0.5


@dataclass(frozen=True, eq=False)
class SlidingMotion:
    """A cleaned recording, its strokes and its force balance, shape (n,), for the selection of samples."""

    recording: Recording
    strokes: list[Stroke]
    balance_n: Array

    @property
    def time_s(self) -> Array:
        """Times, s."""
        return self.recording.time_s

    @property
    def position_m(self) -> Array:
        """Positions, m."""
        return self.recording.position_m

    @cached_property
    def velocity_m_s(self) -> Array:
        """Slope of the position over a few samples."""
        return local_slope(self.time_s, self.position_m)


class SampleChoice(Protocol):
    """A rule that chooses, and perhaps smooths, the samples of a stroke for its mean."""

    @property
    def name(self) -> str:
        """Name for provenance."""
        ...

    @property
    def uses_window(self) -> bool:
        """Whether the mean is over equal positions of the window; else over all chosen samples."""
        ...

    def choose(self, motion: SlidingMotion) -> tuple[NDArray[np.bool_], Array]:
        """Return the mask of chosen samples, shape (n,), and the balance to average, shape (n,)."""
        ...


@dataclass(frozen=True, eq=False)
class Sliding:
    """A recording with chosen samples: ``settled`` marks them, ``balance_n`` is averaged."""

    recording: Recording
    strokes: tuple[Stroke, ...]
    settled: NDArray[np.bool_]
    balance_n: Array


def find_motion(recording: Recording, *, inertia: bool = True) -> SlidingMotion:
    """Find the strokes of a cleaned recording, and its force balance.

    Parameters
    ----------
    recording : Recording
    inertia : bool
        Whether inertia of the mass beyond the sensor is subtracted.

    Raises
    ------
    RecordingError
        Without motion, with too few samples, or with impossible values.
    """
    strokes = find_strokes(recording.name, recording.time_s, recording.position_m)
    refuse_impossible(recording, strokes)
    return SlidingMotion(recording, strokes, balance_of(recording, inertia=inertia))


def balance_of(recording: Recording, *, inertia: bool = True) -> Array:
    """Return the force balance of each sample, N; without the inertia of the mass beyond the sensor if wanted."""
    acceleration: Array | float = 0.0
    if inertia and recording.mass_beyond_sensor_kg:
        acceleration = local_slope(recording.time_s, local_slope(recording.time_s, recording.position_m))
    return recording.balance_n(acceleration)


def judge(motion: SlidingMotion, choice: SampleChoice) -> Sliding:
    """Choose the samples."""
    return Sliding(motion.recording, tuple(motion.strokes), *choice.choose(motion))


@dataclass(frozen=True)
class WindowMeans:
    """Means over the settled samples of the window, of one stroke or of one direction."""

    means: DirectionMeans
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
    inside : WindowMeans or None
        None if it does not cover the window.
    peak : ReversalPeak or None
    stick_slip : StickSlip or None
    """

    stroke: Stroke
    time_s: float
    first: int
    balance_n: Array
    mean_n: float
    inside: WindowMeans | None
    peak: ReversalPeak | None
    stick_slip: StickSlip | None


def stroke_frictions(
    sliding: Sliding, strokes: Sequence[Stroke], window: tuple[float, float], bins: int | None = None
) -> tuple[Grid, list[StrokeFriction]]:
    """Return the results of strokes for their speed class.

    Parameters
    ----------
    sliding : Sliding
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
    recording, balance = sliding.recording, sliding.balance_n
    grid = stroke_grid(recording.position_m, strokes, window, bins)
    rows = stroke_rows(recording.position_m, balance, sliding.settled, strokes, grid)
    window_bins = slice(-grid.first, -grid.first + grid.in_window)
    covers = [bool(np.isfinite(row[window_bins]).mean() >= COVERED_SHARE) for row in rows]
    if not any(covers):
        return grid, []
    both = len({s.direction for s, ok in zip(strokes, covers, strict=True) if ok}) == 2
    peaks = find_reversal_peaks(recording, strokes, balance, pair(grid, by_direction(strokes, rows))) if both else []
    peak_of = {peak.stroke: peak for peak in peaks}
    found = []
    for stroke, row, ok in zip(strokes, rows, covers, strict=True):
        counts = balance[stroke.samples][sliding.settled[stroke.samples]]
        found.append(
            StrokeFriction(
                stroke=stroke,
                time_s=float(recording.time_s[stroke.start]),
                first=grid.first,
                balance_n=row,
                mean_n=float(counts.mean()) if ok else float("nan"),
                inside=_window_means(recording, stroke, sliding.settled, window) if ok else None,
                peak=peak_of.get(stroke.index),
                stick_slip=stick_slip_of(stroke, recording.time_s, recording.position_m) if ok else None,
            )
        )
    return grid, found


def stroke_grid(
    position_m: Array, strokes: Sequence[Stroke], window: tuple[float, float], bins: int | None = None
) -> Grid:
    """Divide the way of some strokes into bins."""
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


def _window_means(
    recording: Recording, stroke: Stroke, settled: NDArray[np.bool_], window: tuple[float, float]
) -> WindowMeans:
    position = recording.position_m[stroke.samples]
    inside = (position >= window[0]) & (position <= window[1]) & settled[stroke.samples]
    index = np.flatnonzero(inside) + stroke.start
    pressure_a, pressure_b = recording.pressure_a_pa[index], recording.pressure_b_pa[index]
    means = DirectionMeans(
        force_n=float(recording.force_n[index].mean()),
        pressure_a_pa=float(pressure_a.mean()),
        pressure_b_pa=float(pressure_b.mean()),
        speed_m_s=mean_speed(recording, index, stroke.speed_m_s),
    )
    moves = _usual_range(pressure_a) * recording.area_a_m2 + _usual_range(pressure_b) * recording.area_b_m2
    return WindowMeans(means, index.size, moves)


def mean_speed(recording: Recording, index: NDArray[np.intp], otherwise: float) -> float:
    """Return the mean speed between the first and the last of some samples."""
    time = recording.time_s[index[-1]] - recording.time_s[index[0]]
    way = recording.position_m[index[-1]] - recording.position_m[index[0]]
    return float(way / time) if time > 0 else otherwise


def mean_of_strokes(strokes: Sequence[WindowMeans]) -> WindowMeans:
    """Average the strokes of one direction with equal weight."""
    means = {name: float(np.mean([getattr(s.means, name) for s in strokes])) for name in vars(strokes[0].means)}
    moves = float(np.median([s.pressure_moves_n for s in strokes]))
    return WindowMeans(DirectionMeans(**means), sum(s.samples for s in strokes), moves)


def _usual_range(values: Array) -> float:
    """Return the range that holds all but the lowest and highest 5 % of the values."""
    some = np.sort(thinned(values))
    margin = int(0.05 * some.size)
    return float(some[some.size - 1 - margin] - some[margin])
