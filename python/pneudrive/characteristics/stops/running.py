"""Friction of uninterrupted sliding where a stop was: its level, and how it goes on along the way."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from pneudrive.characterise.spread import profile_stderr
from pneudrive.characteristics.stops.phases import FEWEST, steady_part
from pneudrive.characteristics.stops.uninterrupted import SAME_SPEED

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from pneudrive.characterise.recording import Recording
    from pneudrive.characteristics.basics import Condition
    from pneudrive.characteristics.stops.phases import Phases
    from pneudrive.characteristics.stops.uninterrupted import Stroke

    Array = NDArray[np.float64]

LAST_SHARE = (
    0.5  # of the approach at constant speed whose friction counts: its beginning may still recover from a start
)
BINS = 24
MOST_REFERENCES = 8
COVERED = 0.8  # of the way before the stop that a stroke must cover to be a reference


@dataclass(frozen=True, eq=False)
class Running:
    """Friction without the stop.

    Attributes
    ----------
    level_n, stderr_n : float
        At the stop; NaN where nothing tells.
    texture_n : float
        How friction scatters along the way about that level, beyond noise.
    basis : str
        approach, approach and reference, reference, none.
    stop_m : float
        Position to which the level belongs.
    reference_m, reference_n : ndarray, shape (m,)
        Uninterrupted friction along the way; empty where there is none.
    """

    level_n: float
    stderr_n: float
    texture_n: float
    basis: str
    stop_m: float
    reference_m: Array
    reference_n: Array

    def shape(self, position_m: Array) -> Array:
        """Uninterrupted friction at these positions less that at the stop; 0 where no reference tells."""
        if not self.reference_m.size:
            return np.zeros(position_m.size)
        at = np.interp(np.r_[self.stop_m, position_m], self.reference_m, self.reference_n)
        return at[1:] - at[0]


def running_level(
    recording: Recording,
    friction_n: Array,
    phases: Phases,
    own: Sequence[Stroke],
    others: Sequence[Stroke],
    condition: Condition,
) -> Running:
    """Find the level from the approach, from uninterrupted strokes, or both.

    Parameters
    ----------
    recording : Recording
    friction_n : ndarray, shape (n,)
        direction * balance.
    phases : Phases
    own, others : sequence of Stroke
        Of this cycle, and of others.
    condition : Condition
    """
    part = phases.restart
    steady = steady_part(recording.time_s[part], recording.position_m[part])
    at = float(recording.position_m[part.start])
    speed = _speed(recording, slice(part.start + steady.start, part.start + steady.stop))
    approach = _approach(recording, phases, speed)
    end = float(recording.position_m[part.start + steady.stop - 1])
    way = sorted((float(recording.position_m[approach.start]) if approach else at, end))
    references = _references(own, phases, speed, way, condition) or _references(others, phases, speed, way, condition)
    reference_m, reference_n, reference_noise = _averaged(references, phases.direction)
    if approach is None:
        if not references:
            return Running(np.nan, np.nan, 0.0, "none", at, reference_m, reference_n)
        levels = [float(np.interp(at, s.position_m, phases.direction * s.balance_n)) for s in _ascending(references)]
        near = np.abs(reference_m - at) < 0.1 * (way[1] - way[0])
        texture = float(np.std(reference_n[near])) if near.sum() > 3 else 0.0
        spread = float(np.std(levels, ddof=1)) / np.sqrt(len(levels)) if len(levels) > 1 else texture
        return Running(
            float(np.mean(levels)),
            float(np.hypot(spread, reference_noise)),
            texture,
            "reference",
            at,
            reference_m,
            reference_n,
        )
    position, before = recording.position_m[approach], friction_n[approach]
    basis = "approach"
    if references:
        basis = "approach and reference"
        before = before - (np.interp(position, reference_m, reference_n) - np.interp(at, reference_m, reference_n))
    bins, noise = _binned(position, before)
    stderr = profile_stderr(bins)
    lean = abs(float(np.polyfit(np.linspace(0.0, 1.0, bins.size), bins, 1)[0])) / 2.0 if bins.size > 3 else 0.0
    stderr = float(np.hypot(stderr if np.isfinite(stderr) else noise, lean / np.sqrt(3.0)))
    texture = float(np.sqrt(max(np.var(bins, ddof=2) - noise**2, 0.0))) if bins.size > 3 else 0.0
    return Running(
        float(bins.mean()), float(np.hypot(stderr, reference_noise)), texture, basis, at, reference_m, reference_n
    )


def _speed(recording: Recording, part: slice) -> float:
    time, position = recording.time_s[part], recording.position_m[part]
    return abs(float(position[-1] - position[0])) / max(float(time[-1] - time[0]), 1e-12)


def _approach(recording: Recording, phases: Phases, speed: float) -> slice | None:
    """Last part of an approach in the same direction and at the same speed; None where there is none."""
    part = phases.approach
    if phases.reversed or part.stop - part.start < 4 * FEWEST:
        return None
    steady = steady_part(recording.time_s[part], recording.position_m[part])
    begin, end = part.start + steady.start, part.start + steady.stop
    if abs(_speed(recording, slice(begin, end)) - speed) > SAME_SPEED * speed:
        return None
    position = recording.position_m[begin:end]
    share = np.abs(position - position[0]) / max(abs(float(position[-1] - position[0])), 1e-12)
    first = begin + int(np.argmax(share >= 1.0 - LAST_SHARE))
    return slice(first, end) if end - first >= 2 * FEWEST else None


def _references(
    strokes: Sequence[Stroke], phases: Phases, speed: float, way: list[float], condition: Condition
) -> list[Stroke]:
    """Strokes in the same direction, speed and condition that cover the way."""
    out = []
    for s in strokes:
        if s.direction != phases.direction or s.condition != condition or abs(s.speed_m_s - speed) > SAME_SPEED * speed:
            continue
        low, high = max(float(s.position_m.min()), way[0]), min(float(s.position_m.max()), way[1])
        if high - low >= COVERED * (way[1] - way[0]):
            out.append(s)
    return out[-MOST_REFERENCES:]


def _ascending(strokes: Sequence[Stroke]) -> list[Stroke]:
    """Turn strokes so that positions rise, as interpolation needs them."""
    out = []
    for s in strokes:
        order = np.argsort(s.position_m)
        out.append(replace(s, position_m=s.position_m[order], balance_n=s.balance_n[order]))
    return out


def _averaged(strokes: Sequence[Stroke], direction: int) -> tuple[Array, Array, float]:
    """Friction along the way, mean of the strokes, smoothed over three points, and the noise of such a mean."""
    if not strokes:
        return np.zeros(0), np.zeros(0), 0.0
    ascending = _ascending(strokes)
    low = max(float(s.position_m[0]) for s in ascending)
    high = min(float(s.position_m[-1]) for s in ascending)
    grid = np.linspace(low, high, 200)
    mean = np.mean([np.interp(grid, s.position_m, direction * s.balance_n) for s in ascending], axis=0)
    padded = np.r_[mean[0], mean, mean[-1]]
    smooth = (padded[:-2] + padded[1:-1] + padded[2:]) / 3.0
    noise = float(np.mean([s.noise_n[0] for s in strokes])) / np.sqrt(3.0 * len(strokes))
    return grid, smooth, noise


def _binned(position: Array, friction: Array) -> tuple[Array, float]:
    """Means over equal parts of the way, and the noise of one of them from neighbouring samples."""
    count = int(min(BINS, max(position.size // 4, 4)))
    edges = np.linspace(0, position.size, count + 1).astype(int)
    sizes = np.diff(edges)
    means = np.add.reduceat(friction, edges[:-1]) / sizes
    noise = float(np.median(np.abs(np.diff(friction)))) / 0.954 / np.sqrt(float(sizes.mean()))
    return means, noise
