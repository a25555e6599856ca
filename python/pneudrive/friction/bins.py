"""Friction and offset against position: both directions paired at equal position."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from pneudrive import _core

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    Array = NDArray[np.float64]

MAXIMUM_BINS = 100
MINIMUM_BINS = 5
SAMPLES_PER_BIN = 4
ALTERNATIONS, CONVERGED = 50, 1e-9
MIDDLE = (0.2, 0.8)  # of the way: the window, if the layout does not state it


@dataclass(frozen=True)
class Grid:
    """Equal bins of position, numbered from 0 in the window, whose ends are edges of bins.

    Attributes
    ----------
    low_m, width_m : float
        Lower end of the window, width of a bin.
    in_window : int
        Number of bins of the window.
    first, stop : int
        Number of the first bin, below the window negative, and of the one behind the last.
    whole : bool
        Whether bins that lie only partly in the settled part of a stroke are left out: bins that cycles share have
        equal positions.
    """

    low_m: float
    width_m: float
    in_window: int
    first: int
    stop: int
    whole: bool = False

    @property
    def edges_m(self) -> Array:
        """Edges of the bins."""
        return np.asarray(self.low_m + self.width_m * np.arange(self.first, self.stop + 1), dtype=np.float64)

    @property
    def is_in_window(self) -> NDArray[np.bool_]:
        """Whether each bin is in the window."""
        number = np.arange(self.first, self.stop)
        return (number >= 0) & (number < self.in_window)


@dataclass(frozen=True, eq=False)  # holds arrays: equal only to itself
class Profile:
    """Balance, friction and offset over position for one recording and speed level.

    ``position_m`` (m,) are bin centres. ``up_n``/``down_n`` (m,) are the mean balance of the strokes in +x/-x.
    ``friction_n`` is half their difference and ``offset_n`` half their sum, or NaN if a direction has no settled
    samples. ``up_strokes_n`` (strokes, m) and ``down_strokes_n`` keep every stroke. ``in_window`` (m,) marks the bins
    that enter the friction map.
    """

    position_m: Array
    up_n: Array
    down_n: Array
    friction_n: Array
    offset_n: Array
    up_strokes_n: Array
    down_strokes_n: Array
    in_window: NDArray[np.bool_]

    def strokes_n(self, direction: int) -> Array:
        """Return the balance of the strokes of one direction, shape (strokes, m)."""
        return self.up_strokes_n if direction > 0 else self.down_strokes_n


def grid_over(
    window_m: tuple[float, float], ends_m: Sequence[float], samples_in_window: float, count: int | None = None
) -> Grid:
    """Divide the range between the outermost of some ends into bins.

    Parameters
    ----------
    window_m : tuple of float
    ends_m : sequence of float
    samples_in_window : float
        Samples of a stroke in the window: the bins hold about four each.
    count : int, optional
        Bins of the window; None: by the number of samples.
    """
    low, high = window_m
    filled = int(np.clip(int(samples_in_window) // SAMPLES_PER_BIN, MINIMUM_BINS, MAXIMUM_BINS))
    core = np.linspace(low, high, (count or filled) + 1)
    width = core[1] - core[0]
    below = max(int(np.ceil((low - min(ends_m)) / width)), 0)
    above = max(int(np.ceil((max(ends_m) - high) / width)), 0)
    return Grid(low, float(width), core.size - 1, -below, core.size - 1 + above)


def grid_of(edges_m: Array) -> Grid:
    """Return the bins of all cycles as a grid, whose window is the middle of the way."""
    bins = edges_m.size - 1
    first, stop = (round(share * bins) for share in MIDDLE)
    return Grid(float(edges_m[first]), float(edges_m[1] - edges_m[0]), stop - first, -first, bins - first, whole=True)


def bin_means(
    position_m: Array, values: Array, edges_m: Array, parts: Sequence[slice], chosen: NDArray[np.bool_] | None = None
) -> Array:
    """Return the mean of ``values`` in each position bin over the samples of some parts, NaN in empty bins.

    Parameters
    ----------
    position_m, values : ndarray, shape (n,)
    edges_m : ndarray, shape (bins + 1,)
    parts : sequence of slice
    chosen : ndarray of bool, shape (n,), optional
        The samples that count; None: all.
    """
    bins = (float(edges_m[0]), float(edges_m[-1]), edges_m.size - 1)
    columns = np.ascontiguousarray(position_m), np.ascontiguousarray(values)
    return _core.bin_means(*columns, chosen, [(part.start, part.stop) for part in parts], bins)


def pair(grid: Grid, strokes_n: dict[int, Array]) -> Profile:
    """Pair the directions at equal position.

    Parameters
    ----------
    grid : Grid
    strokes_n : dict of ndarray, shape (strokes, bins)
        By direction +1/-1.
    """
    edges = grid.edges_m
    up, down = mean_profile(strokes_n[1]), mean_profile(strokes_n[-1])
    return Profile(
        position_m=(edges[:-1] + edges[1:]) / 2,
        up_n=up,
        down_n=down,
        friction_n=(up - down) / 2,
        offset_n=(up + down) / 2,
        up_strokes_n=strokes_n[1],
        down_strokes_n=strokes_n[-1],
        in_window=grid.is_in_window,
    )


def mean_profile(strokes_n: Array) -> Array:
    """Return the mean over strokes in each bin, shape (bins,), with a separate level of each stroke.

    A stroke with missing bins (a gap in the recording) must not shift the profile there. The two-way model value =
    stroke + bin is fitted by alternation, and the profile is bin + mean stroke.
    """
    if strokes_n.shape[0] == 0:
        return np.full(strokes_n.shape[1], np.nan)
    if strokes_n.shape[0] == 1:
        return strokes_n[0].copy()
    known = np.isfinite(strokes_n)
    if known.all():
        return strokes_n.mean(axis=0)
    level = np.zeros(strokes_n.shape[0])
    profile = np.zeros(strokes_n.shape[1])
    for _ in range(ALTERNATIONS):
        profile = known_mean(strokes_n - level[:, None], axis=0)
        change = np.nan_to_num(known_mean(strokes_n - profile[None, :], axis=1) - level)
        level += change - (level + change).mean()
        if np.abs(change).max() <= CONVERGED * np.abs(strokes_n[known]).max(initial=0.0):
            break
    return profile


def stroke_means(strokes_n: Array, bins: NDArray[np.bool_]) -> Array:
    """Return the mean of each stroke over the chosen bins, shape (strokes,), missing bins filled from the profile."""
    part = strokes_n[:, bins]
    profile = mean_profile(part)
    return known_mean(part - profile[None, :], axis=1) + np.nanmean(profile)


def known_mean(values: Array, axis: int) -> Array:
    """Return the mean of the finite values, or NaN without a warning."""
    known = np.isfinite(values)
    count = known.sum(axis=axis)
    total = np.where(known, values, 0.0).sum(axis=axis)
    return np.where(count > 0, total / np.maximum(count, 1), np.nan)
