"""The steps of a cycle from its motion, for recordings without step numbers."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pneudrive.signals.motion import noise_level, turning_points

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]

#: The axis stands where its position stays within so many deviations of the position noise
STILL_NOISE = 6.0
#: for at least this long, s; half of the stop that the cycle is for, if that is shorter.
STILL_S = 0.05
#: Grid of times for this test: this many steps in the time above, and at most so many in all.
GRID_STEPS, MOST_STEPS = 10, 2_000_000
#: A move turns back where the position retreats by this share of the whole travel.
TURN_SHARE = 0.01
LEAST_SAMPLES = 20


def steps_from_motion(time_s: Array, position_m: Array, stop_s: float | None = None) -> NDArray[np.int64]:
    """Return the number of the move or hold at each sample of a cycle.

    Parameters
    ----------
    time_s, position_m : ndarray, shape (n,)
        As recorded; samples that are not finite, or out of order in time, take the number of their neighbour.
    stop_s : float, optional
        Duration of the cycle's stop.

    Returns
    -------
    ndarray of int64, shape (n,)
        0 for the first move or hold, one more with each start, stop and reversal. All 0 where nothing moves.

    Notes
    -----
    A move slower than 6 deviations of the position noise per 50 ms counts as a hold. A recording of such moves needs a
    separate column ``step``.
    """
    numbers = np.zeros(time_s.size, dtype=np.int64)
    usable = np.isfinite(time_s) & np.isfinite(position_m)
    usable[usable] = time_s[usable] >= np.maximum.accumulate(time_s[usable])
    time, position = time_s[usable], position_m[usable]
    if time.size < LEAST_SAMPLES or not time[-1] > time[0] or np.ptp(position) == 0.0:
        return numbers
    still_s = min(STILL_S, 0.5 * stop_s) if stop_s else STILL_S
    step_s = max(still_s / GRID_STEPS, (time[-1] - time[0]) / MOST_STEPS)
    grid = np.arange(time[0], time[-1] + step_s, step_s)
    at = np.interp(grid, time, position)
    noise = noise_level(position)
    standing = _standing(at, STILL_NOISE * noise, max(round(still_s / step_s), 1))
    begins = 1 + np.flatnonzero(np.diff(standing.astype(np.int8)))
    borders = set(begins.tolist())
    for begin, end in zip([0, *begins], [*begins, grid.size], strict=True):
        if not standing[begin] and end - begin > 2:
            turns = turning_points(at[begin:end], max(TURN_SHARE * float(np.ptp(position)), STILL_NOISE * noise))
            borders |= {int(begin + t) for t in turns[1:-1]}
    times = grid[sorted(borders)]
    numbers[usable] = np.searchsorted(times, time, side="right")
    return _spread(numbers, usable)


def _standing(position: Array, tolerance: float, width: int) -> NDArray[np.bool_]:
    """Mark every stretch of `width` steps over which the position stays within the tolerance."""
    if position.size <= width:
        return np.zeros(position.size, dtype=bool)
    windows = np.lib.stride_tricks.sliding_window_view(position, width + 1)
    still = windows.max(axis=1) - windows.min(axis=1) <= tolerance
    edges = np.zeros(position.size + 1, dtype=np.int64)
    begins = np.flatnonzero(still)
    np.add.at(edges, begins, 1)
    np.add.at(edges, begins + width + 1, -1)
    return np.cumsum(edges[:-1]) > 0


def _spread(numbers: NDArray[np.int64], usable: NDArray[np.bool_]) -> NDArray[np.int64]:
    """Give unusable samples the step number of the usable sample before them."""
    last = np.maximum.accumulate(np.where(usable, np.arange(numbers.size), -1))
    return np.where(last >= 0, numbers[np.maximum(last, 0)], 0)
