"""Friction and offset against position: both directions paired at equal position."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from pneudrive.characterise.motion import Stroke

MAXIMUM_BINS = 100
MINIMUM_BINS = 5
SAMPLES_PER_BIN = 4
ALTERNATIONS, CONVERGED = 50, 1e-9


@dataclass(frozen=True, eq=False)  # holds arrays: equal only to itself
class Profile:
    """Balance, friction and offset over position for one recording and speed level.

    ``position_m`` (m,) are bin centres; ``up_n``/``down_n`` (m,) the mean balance of the strokes in
    +x/-x, ``friction_n`` half their difference, ``offset_n`` half their sum, NaN where a direction
    has no settled samples. ``up_strokes_n`` (strokes, m) and ``down_strokes_n`` keep every stroke.
    ``in_window`` (m,) marks the bins that enter the friction map.
    """

    recording: str
    level: int
    position_m: NDArray[np.float64]
    up_n: NDArray[np.float64]
    down_n: NDArray[np.float64]
    friction_n: NDArray[np.float64]
    offset_n: NDArray[np.float64]
    up_strokes_n: NDArray[np.float64]
    down_strokes_n: NDArray[np.float64]
    in_window: NDArray[np.bool_]


def bin_edges(low_m: float, high_m: float, samples_per_stroke: int) -> NDArray[np.float64]:
    """Edges of equal bins, so many that a stroke has about four samples in each."""
    count = int(np.clip(samples_per_stroke // SAMPLES_PER_BIN, MINIMUM_BINS, MAXIMUM_BINS))
    return np.linspace(low_m, high_m, count + 1)


def bin_means(
    position_m: NDArray[np.float64], values: NDArray[np.float64], edges_m: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Mean of ``values`` in each position bin, shape (bins,), NaN where a bin is empty."""
    bins = edges_m.size - 1
    place = np.floor((position_m - edges_m[0]) / (edges_m[-1] - edges_m[0]) * bins).astype(np.int64)
    inside = (place >= 0) & (place < bins)
    place, values = place[inside], values[inside]
    count = np.bincount(place, minlength=bins)
    total = np.bincount(place, weights=values, minlength=bins)
    return np.where(count > 0, total / np.maximum(count, 1), np.nan)


def mean_profile(strokes_n: NDArray[np.float64]) -> NDArray[np.float64]:
    """Mean over strokes in each bin, shape (bins,), with the level of each stroke kept apart.

    A stroke that misses bins (a gap in the recording) must not shift the profile there: the
    two-way model  value = stroke + bin  is fitted by alternation, and the profile is  bin + mean stroke.
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
        profile = _nan_mean(strokes_n - level[:, None], axis=0)
        change = np.nan_to_num(_nan_mean(strokes_n - profile[None, :], axis=1) - level)
        level += change - (level + change).mean()
        if np.abs(change).max() <= CONVERGED * np.abs(strokes_n[known]).max(initial=0.0):
            break
    return profile


def stroke_means(strokes_n: NDArray[np.float64], bins: NDArray[np.bool_]) -> NDArray[np.float64]:
    """Mean of each stroke over the chosen bins, shape (strokes,), missing bins filled from the profile."""
    part = strokes_n[:, bins]
    profile = mean_profile(part)
    return _nan_mean(part - profile[None, :], axis=1) + np.nanmean(profile)


def _nan_mean(values: NDArray[np.float64], axis: int) -> NDArray[np.float64]:
    """Mean without NaN; NaN, and no warning, where nothing is left."""
    known = np.isfinite(values)
    count = known.sum(axis=axis)
    total = np.where(known, values, 0.0).sum(axis=axis)
    return np.where(count > 0, total / np.maximum(count, 1), np.nan)


def build_profile(
    recording: str,
    level: int,
    strokes: list[Stroke],
    position_m: NDArray[np.float64],
    balance_n: NDArray[np.float64],
    settled: NDArray[np.bool_],
    window_m: tuple[float, float],
    bins_in_window: int | None = None,
) -> Profile:
    """Bin every stroke over the whole travel and pair the directions.

    Parameters
    ----------
    recording, level
        Where it comes from.
    strokes
        Strokes of this speed level.
    position_m, balance_n, settled
        Shape (n,) of the recording; only settled samples count.
    window_m
        Bins whose centres lie inside are marked ``in_window``; the window's ends are bin edges.
    bins_in_window
        Their number; None: as many as the samples fill.
    """
    low, high = window_m
    inside = [int(((position_m[s.samples] >= low) & (position_m[s.samples] <= high)).sum()) for s in strokes]
    core = bin_edges(low, high, int(np.median(inside)) if inside else 0)
    if bins_in_window is not None:
        core = np.linspace(low, high, bins_in_window + 1)
    width = core[1] - core[0]
    ends = [value for s in strokes for value in (s.from_m, s.to_m)]
    below = max(int(np.ceil((low - min(ends)) / width)), 0)
    above = max(int(np.ceil((max(ends) - high) / width)), 0)
    edges = low + width * np.arange(-below, core.size + above)
    rows: dict[int, list[NDArray[np.float64]]] = {1: [], -1: []}
    for stroke in strokes:
        use = settled[stroke.samples]
        rows[stroke.direction].append(bin_means(position_m[stroke.samples][use], balance_n[stroke.samples][use], edges))
    bins = edges.size - 1
    up_strokes = np.array(rows[1]).reshape(-1, bins)
    down_strokes = np.array(rows[-1]).reshape(-1, bins)
    up, down = mean_profile(up_strokes), mean_profile(down_strokes)
    in_window = np.zeros(bins, dtype=bool)
    in_window[below : below + core.size - 1] = True
    return Profile(
        recording=recording,
        level=level,
        position_m=(edges[:-1] + edges[1:]) / 2,
        up_n=up,
        down_n=down,
        friction_n=(up - down) / 2,
        offset_n=(up + down) / 2,
        up_strokes_n=up_strokes,
        down_strokes_n=down_strokes,
        in_window=in_window,
    )
