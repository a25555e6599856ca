"""Uninterrupted sliding as the reference of a stop: its level at the stop, and its course over the travel."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from pneudrive.campaign.storage.folder import read_samples
from pneudrive.friction.campaign.samples import condition_of, read_or_skip, recording_of, steps_of
from pneudrive.friction.campaign.stops.phases import FEWEST, mean_velocity, steady_part
from pneudrive.friction.conditions import Skipped
from pneudrive.friction.spread import profile_stderr

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from numpy.typing import NDArray

    from pneudrive.campaign.storage.folder import CycleFile
    from pneudrive.friction.campaign.stops.phases import Phases
    from pneudrive.friction.conditions import Condition
    from pneudrive.rig.interface import Identity, Samples
    from pneudrive.signals.recording import Recording

    Array = NDArray[np.float64]

SAME_SPEED = 0.05  # speeds that differ by less than this share are equal
POINTS = 400  # over a stroke: means of neighbouring samples
#: Part of the approach at constant speed whose friction counts: its start may still recover.
LAST_SHARE = 0.5
BINS = 24
MOST_REFERENCES = 8
COVERED = 0.8  # of the way before the stop that a stroke must cover to be a reference
NOISE_OF_STEPS = 0.954  # median size of the step between two values of noise 1


@dataclass(frozen=True, eq=False)
class UninterruptedStroke:
    """One stroke at constant speed without a stop: friction over rising position, as means of neighbours, shape (m,).

    ``noise_n`` is the noise of one mean.
    """

    condition: Condition
    direction: int
    speed_m_s: float
    position_m: Array
    friction_n: Array
    noise_n: float


def strokes_of(
    file: CycleFile, recording: Recording, step: NDArray[np.int64], *, leave: int | None = None
) -> list[UninterruptedStroke]:
    """Return the strokes of a cycle at its planned speed.

    Parameters
    ----------
    file : CycleFile
    recording : Recording
        Its samples.
    step : ndarray of int, shape (n,)
    leave : int or None
        Step of a stop: the moves before and after it are excluded.
    """
    planned, out = file.head.cycle.speed_m_s, []
    balance = recording.balance_n()
    edges = np.flatnonzero(np.diff(np.r_[step[:1] - 1, step]) != 0) if step.size else []
    for begin, end in pairwise([*edges, step.size]):
        if (leave is not None and abs(int(step[begin]) - leave) <= 1) or end - begin < 4 * FEWEST:
            continue
        part = steady_part(recording, slice(int(begin), int(end)))
        if part.stop - part.start < 4 * FEWEST or recording.time_s[part.stop - 1] <= recording.time_s[part.start]:
            continue
        velocity = mean_velocity(recording, part)
        if velocity == 0.0 or (planned is not None and abs(abs(velocity) - planned) > SAME_SPEED * planned):
            continue
        direction = 1 if velocity > 0 else -1
        position, _ = _means(recording.position_m[part], POINTS)
        friction, _ = _means(direction * balance[part], POINTS)
        noise = _noise(friction) if position.size > 3 else 0.0
        rising = np.argsort(position)
        arrays = position[rising], friction[rising]
        out.append(UninterruptedStroke(condition_of(file.head), direction, abs(velocity), *arrays, noise))
    return out


def read_strokes(files: Iterable[CycleFile], identity: Identity) -> list[UninterruptedStroke]:
    """Return the uninterrupted strokes of whole cycles; unreadable cycles give none."""

    def read(file: CycleFile, samples: Samples) -> list[UninterruptedStroke]:
        recording, _ = recording_of(file, identity, samples)
        return strokes_of(file, recording, steps_of(recording, samples))

    found = list(files)
    every = [read_or_skip(read, file, samples) for file, samples in zip(found, read_samples(found), strict=True)]
    # The characterisation of the cycle reports skipped parts.
    return [stroke for strokes in every if not isinstance(strokes, Skipped) for stroke in strokes]


def _means(values: Array, most: int) -> tuple[Array, float]:
    """Return the means over equal parts, and the mean number of samples in a part."""
    edges = np.linspace(0, values.size, min(most, values.size) + 1).astype(int)
    sizes = np.diff(edges)
    return np.add.reduceat(values, edges[:-1]) / sizes, float(sizes.mean())


def _noise(values: Array) -> float:
    """Estimate the noise of single values from neighbours."""
    return float(np.median(np.abs(np.diff(values)))) / NOISE_OF_STEPS


@dataclass(frozen=True, eq=False)
class Running:
    """Friction as it would be without the stop.

    Attributes
    ----------
    level_n, stderr_n : float
        Level at the stop; NaN if unknown.
    texture_n : float
        Scatter of friction over the travel about that level, beyond noise.
    basis : str
        approach, approach and reference, reference, none.
    stop_m : float
        Position of the level.
    reference_m, reference_n : ndarray, shape (m,)
        Uninterrupted friction over the travel. Empty if unknown.
    """

    level_n: float
    stderr_n: float
    texture_n: float
    basis: str
    stop_m: float
    reference_m: Array
    reference_n: Array

    def shape(self, position_m: Array) -> Array:
        """Return the uninterrupted friction at these positions minus that at the stop; 0 without a reference."""
        if not self.reference_m.size:
            return np.zeros(position_m.size)
        at = np.interp(np.r_[self.stop_m, position_m], self.reference_m, self.reference_n)
        return at[1:] - at[0]


def running_level(
    recording: Recording,
    friction_n: Array,
    phases: Phases,
    own: Sequence[UninterruptedStroke],
    others: Sequence[UninterruptedStroke],
    condition: Condition,
) -> Running:
    """Find the level from the approach, from uninterrupted strokes, or both.

    Parameters
    ----------
    recording : Recording
    friction_n : ndarray, shape (n,)
        direction * balance.
    phases : Phases
    own, others : sequence of UninterruptedStroke
        Strokes of this cycle, and of others.
    condition : Condition
    """
    steady = steady_part(recording, phases.restart)
    at = float(recording.position_m[phases.restart.start])
    speed = abs(mean_velocity(recording, steady))
    approach = _approach(recording, phases, speed)
    end = float(recording.position_m[steady.stop - 1])
    low, high = sorted((float(recording.position_m[approach.start]) if approach else at, end))
    alike = (phases.direction, speed, low, high, condition)
    references = _references(own, *alike) or _references(others, *alike)
    reference_m, reference_n, noise = _averaged(references)
    nothing = Running(np.nan, np.nan, 0.0, "none", at, reference_m, reference_n)
    if approach is not None:
        basis = "approach and reference" if references else "approach"
        before = friction_n[approach] - nothing.shape(recording.position_m[approach])
        level, stderr, texture = _of_approach(before)
    elif references:
        basis, level = "reference", [float(np.interp(at, s.position_m, s.friction_n)) for s in references]
        near = np.abs(reference_m - at) < 0.1 * (high - low)
        texture = float(np.std(reference_n[near])) if near.sum() > 3 else 0.0
        stderr = float(np.std(level, ddof=1)) / np.sqrt(len(level)) if len(level) > 1 else texture
        level = float(np.mean(level))
    else:
        return nothing
    return Running(level, float(np.hypot(stderr, noise)), texture, basis, at, reference_m, reference_n)


def _of_approach(friction: Array) -> tuple[float, float, float]:
    """Return mean, standard error and variation over position of friction before the stop."""
    bins, each = _means(friction, int(min(BINS, max(friction.size // 4, 4))))
    noise = _noise(friction) / np.sqrt(each)
    stderr = profile_stderr(bins)
    lean = abs(float(np.polyfit(np.linspace(0.0, 1.0, bins.size), bins, 1)[0])) / 2.0 if bins.size > 3 else 0.0
    texture = float(np.sqrt(max(np.var(bins, ddof=2) - noise**2, 0.0))) if bins.size > 3 else 0.0
    return float(bins.mean()), float(np.hypot(stderr if np.isfinite(stderr) else noise, lean / np.sqrt(3.0))), texture


def _approach(recording: Recording, phases: Phases, speed: float) -> slice | None:
    """Return the last part of an approach in the same direction and at the same speed, or None."""
    if phases.reversed or phases.approach.stop - phases.approach.start < 4 * FEWEST:
        return None
    steady = steady_part(recording, phases.approach)
    if abs(abs(mean_velocity(recording, steady)) - speed) > SAME_SPEED * speed:
        return None
    position = recording.position_m[steady]
    share = np.abs(position - position[0]) / max(abs(float(position[-1] - position[0])), 1e-12)
    first = steady.start + int(np.argmax(share >= 1.0 - LAST_SHARE))
    return slice(first, steady.stop) if steady.stop - first >= 2 * FEWEST else None


def _references(
    strokes: Sequence[UninterruptedStroke], direction: int, speed: float, low: float, high: float, condition: Condition
) -> list[UninterruptedStroke]:
    """Return the strokes in the same direction, speed and condition that cover the travel."""
    out = []
    for s in strokes:
        alike = s.direction == direction and s.condition == condition
        covered = min(float(s.position_m[-1]), high) - max(float(s.position_m[0]), low)
        if alike and abs(s.speed_m_s - speed) <= SAME_SPEED * speed and covered >= COVERED * (high - low):
            out.append(s)
    return out[-MOST_REFERENCES:]


def _averaged(strokes: Sequence[UninterruptedStroke]) -> tuple[Array, Array, float]:
    """Return the mean friction of the strokes over the travel, smoothed over three points, and its noise."""
    if not strokes:
        return np.zeros(0), np.zeros(0), 0.0
    ends = max(float(s.position_m[0]) for s in strokes), min(float(s.position_m[-1]) for s in strokes)
    grid = np.linspace(*ends, 200)
    mean = np.mean([np.interp(grid, s.position_m, s.friction_n) for s in strokes], axis=0)
    padded = np.r_[mean[0], mean, mean[-1]]
    smooth = (padded[:-2] + padded[1:-1] + padded[2:]) / 3.0
    return grid, smooth, float(np.mean([s.noise_n for s in strokes])) / np.sqrt(3.0 * len(strokes))
