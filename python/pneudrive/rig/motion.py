"""Jerk-limited motion of the linear servo, and sample times, uniform over each step and denser at its ends.

A motion is a list of segments with duration and constant jerk. The position is a cubic in each segment, so that
limits, continuity and the end state hold exactly, and the core can integrate piecewise without events.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from threading import Event
from time import monotonic
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from pneudrive.arrays import Array
from pneudrive.errors import CommandError
from pneudrive.files.bounds import within
from pneudrive.rig.interface import Sampling


@dataclass(frozen=True)
class MotionLimits:
    """Limits of the servo axis.

    Parameters
    ----------
    acceleration_m_s2, jerk_m_s3 : float
        Largest acceleration and jerk, > 0.
    """

    acceleration_m_s2: float
    jerk_m_s3: float

    def __post_init__(self) -> None:
        """Reject limits that are not positive."""
        for name, value in vars(self).items():
            if not (np.isfinite(value) and value > 0.0):
                raise CommandError(f"servo limit {name} = {value} must be positive and finite")

    def ramp_time_s(self, speed_m_s: float) -> float:
        """Return the shortest time in s from rest to `speed_m_s`."""
        a, j = self.acceleration_m_s2, self.jerk_m_s3
        return 2.0 * (speed_m_s / j) ** 0.5 if speed_m_s * j < a * a else a / j + speed_m_s / a

    def ramp_distance_m(self, speed_m_s: float) -> float:
        """Return the distance in m covered between rest and `speed_m_s`."""
        return 0.5 * speed_m_s * self.ramp_time_s(speed_m_s)

    def top_speed_m_s(self, distance_m: float) -> float:
        """Return the largest speed in m/s that a move from rest to rest over `distance_m` can reach."""
        a, j = self.acceleration_m_s2, self.jerk_m_s3
        speed = (0.25 * j * distance_m**2) ** (1.0 / 3.0)
        if speed * j >= a * a:  # the acceleration limit is reached: v (a/j + v/a) = distance
            half = 0.5 * a * a / j
            speed = (half * half + a * distance_m) ** 0.5 - half
        return speed


Limits = MotionLimits  # public name in pneudrive.rig


def _moved(h: Any, x: Any, v: Any, a: Any, j: Any) -> tuple[Any, Any, Any]:  # noqa: ANN401 - numbers or arrays
    """Return position, velocity and acceleration after a time `h` of constant jerk."""
    position = x + h * (v + h * (a / 2.0 + h * j / 6.0))
    velocity = v + h * (a + h * j / 2.0)
    return position, velocity, a + h * j


@dataclass(frozen=True)
class Motion:
    """Motion with piecewise constant jerk from rest at `start_m`.

    Attributes
    ----------
    durations_s, jerks_m_s3 : ndarray, shape (k,)
    start_m : float
    """

    durations_s: Array
    jerks_m_s3: Array
    start_m: float = 0.0

    @classmethod
    def of(cls, durations_s: Array, jerks_m_s3: Array, start_m: float) -> Motion:
        """Return a motion without segments of zero duration."""
        used = durations_s > 0.0
        return cls(durations_s[used], jerks_m_s3[used], start_m)

    @property
    def duration_s(self) -> float:
        """Total time in s."""
        return float(self.durations_s.sum())

    def knots(self) -> Array:
        """Time, position, velocity and acceleration at the ends of the segments, shape (4, k + 1)."""
        out = np.zeros((4, self.durations_s.size + 1))
        out[1, 0] = self.start_m
        for i, (h, j) in enumerate(zip(self.durations_s, self.jerks_m_s3, strict=True)):
            t, x, v, a = out[:, i]
            out[:, i + 1] = t + h, *_moved(h, x, v, a, j)
        return out

    def at(self, time_s: ArrayLike) -> tuple[Array, Array, Array]:
        """Return position (m), velocity (m/s) and acceleration (m/s2) at `time_s`; constant beyond the ends."""
        knots = self.knots()
        time = np.clip(np.asarray(time_s, dtype=float), 0.0, knots[0, -1])
        i = np.searchsorted(knots[0], time, side="right") - 1
        i = np.clip(i, 0, self.durations_s.size - 1)
        h = time - knots[0, i]
        x, v, a = knots[1:, i]
        return _moved(h, x, v, a, self.jerks_m_s3[i])

    def until(self, time_s: float) -> Motion:
        """Return the beginning of this motion, up to `time_s`."""
        ends = np.cumsum(self.durations_s)
        durations = np.clip(time_s - (ends - self.durations_s), 0.0, self.durations_s)
        return Motion.of(durations, self.jerks_m_s3, self.start_m)

    def then(self, other: Motion) -> Motion:
        """Return this motion followed by `other` (which starts where this one ends)."""
        return Motion(
            np.r_[self.durations_s, other.durations_s], np.r_[self.jerks_m_s3, other.jerks_m_s3], self.start_m
        )


def move(distance_m: float, speed_m_s: float, limits: MotionLimits, start_m: float = 0.0) -> Motion:
    """Return a straight move from rest to rest in the shortest time within the limits.

    Parameters
    ----------
    distance_m : float
        Signed distance, not zero.
    speed_m_s : float
        Largest speed, > 0. A short move may not reach it.
    limits : MotionLimits
    start_m : float
        Position at the start.

    Returns
    -------
    Motion
        Motion of at most seven segments.

    Examples
    --------
    >>> motion = move(0.1, 0.05, MotionLimits(2.0, 100.0))
    >>> float(round(motion.at(motion.duration_s)[0], 12))
    0.1
    """
    sign, distance = float(np.sign(distance_m)), abs(distance_m)
    speed = min(speed_m_s, limits.top_speed_m_s(distance))
    a, j = limits.acceleration_m_s2, limits.jerk_m_s3
    rise = (speed / j) ** 0.5 if speed * j < a * a else a / j
    hold = max(limits.ramp_time_s(speed) - 2.0 * rise, 0.0)
    cruise = max(distance / speed - limits.ramp_time_s(speed), 0.0)
    durations = np.array([rise, hold, rise, cruise, rise, hold, rise])
    jerks = sign * j * np.array([1.0, 0.0, -1.0, 0.0, -1.0, 0.0, 1.0])
    return Motion.of(durations, jerks, start_m)


def dwell(duration_s: float, start_m: float = 0.0) -> Motion:
    """Return a rest of the duration `duration_s` in s."""
    return Motion(np.array([duration_s]), np.array([0.0]), start_m)


def brake(position_m: float, speed_m_s: float, acceleration_m_s2: float, limits: MotionLimits) -> Motion:
    """Return the fastest motion to rest from any velocity and acceleration within the limits.

    Parameters
    ----------
    position_m, speed_m_s, acceleration_m_s2 : float
        Present motion of the axis; the acceleration is within its limit.
    limits : MotionLimits

    Returns
    -------
    Motion
        Braking motion. Its `at` and `knots` are not valid, because they assume a start at rest.

    Examples
    --------
    >>> round(brake(0.0, 0.5, 0.0, MotionLimits(5.0, 1000.0)).duration_s, 12)
    0.105
    """
    a, j = limits.acceleration_m_s2, limits.jerk_m_s3
    # speed after removing only the acceleration. Its sign gives the direction of braking
    coasting = speed_m_s + acceleration_m_s2 * abs(acceleration_m_s2) / (2.0 * j)
    sign = -1.0 if coasting > 0.0 else 1.0
    needed, now = -sign * speed_m_s, sign * acceleration_m_s2
    peak = (j * max(needed + 0.5 * now * now / j, 0.0)) ** 0.5
    hold = 0.0
    if peak > a:
        peak, hold = a, (needed - (2.0 * a * a - now * now) / (2.0 * j)) / a
    durations = np.array([(peak - now) / j, hold, peak / j])
    return Motion.of(durations, sign * j * np.array([1.0, 0.0, -1.0]), position_m)


def cycles(low_m: float, high_m: float, speed_m_s: float, limits: MotionLimits, *, count: int = 1) -> Motion:
    """Return `count` motions out and back between two positions, at one speed.

    Parameters
    ----------
    low_m, high_m : float
        Positions of the reversals, low < high; the motion starts at `low_m`.
    speed_m_s : float
        Speed between the ramps.
    limits : MotionLimits
    count : int
        Number of cycles, >= 1.

    Returns
    -------
    Motion

    Raises
    ------
    CommandError
        If the ramps do not fit between the positions.
    """
    distance = high_m - low_m
    if count < 1:
        raise CommandError(f"the number of cycles is {count}, but must be at least 1")
    if not 0.0 < speed_m_s < np.inf:
        raise CommandError(f"the speed of a cycle, {1e3 * speed_m_s:g} mm/s, must be positive and finite")
    ramps = 2.0 * limits.ramp_distance_m(speed_m_s)
    if ramps > distance:
        top = 1e3 * limits.top_speed_m_s(distance)
        speed, way, ramps = (1e3 * value for value in (speed_m_s, distance, ramps))
        raise CommandError.of("rig.speed", limits=limits, speed=speed, distance=way, ramps=ramps, top=top)
    both = move(distance, speed_m_s, limits, low_m).then(move(-distance, speed_m_s, limits, high_m))
    return Motion(np.tile(both.durations_s, count), np.tile(both.jerks_m_s3, count), low_m)


def step_times(duration_s: float, moving: bool, sampling: Sampling) -> Array:
    """Return the times of the samples of one step, counted from its beginning.

    The end of the step belongs to the next step.

    Parameters
    ----------
    duration_s : float
        Duration of the step in s; zero gives no samples.
    moving : bool
        True: move, with uniform samples. False: hold, with a separate rate.
    sampling : Sampling

    Returns
    -------
    ndarray, shape (n,)
        Times in s, ascending from zero.

    Examples
    --------
    >>> from pneudrive.rig.interface import Sampling
    >>> step_times(1.0, True, Sampling(samples_per_stroke=4, burst_rate_hz=0.0)).tolist()
    [0.0, 0.25, 0.5, 0.75]
    """
    spans = _spans(duration_s, moving, sampling)
    parts = [begin + (end - begin) * np.arange(n) / max(n, 1) for begin, end, n in spans]
    return np.concatenate(parts) if parts else np.zeros(0)


def step_samples(duration_s: float, moving: bool, sampling: Sampling) -> int:
    """Return the number of samples of `step_times`."""
    return sum(n for _, _, n in _spans(duration_s, moving, sampling))


def _spans(duration_s: float, moving: bool, sampling: Sampling) -> list[tuple[float, float, int]]:
    """Return the spans of a step, each with a constant rate: begin, end, number of samples."""
    if duration_s <= 0.0:
        return []
    rate = sampling.samples_per_stroke / duration_s if moving else sampling.hold_rate_hz
    if not (math.isfinite(rate) and rate > 0.0):
        raise CommandError.of("rig.rate", seconds=duration_s, rate=rate)
    spans = [(0.0, duration_s, rate)]
    if sampling.burst_rate_hz > rate:
        after = min(sampling.burst_after_s, duration_s)
        before = max(duration_s - sampling.burst_before_s, after)
        dense = sampling.burst_rate_hz
        spans = [(0.0, after, dense), (after, before, rate), (before, duration_s, dense)]
    counts = [(end - begin) * wanted * (1.0 - 1e-12) for begin, end, wanted in spans]
    total = sum(counts)
    within("samples", total, f"a step of {duration_s:g} s would have {np.ceil(total):,.15g} samples", CommandError)
    return [(begin, end, math.ceil(count)) for (begin, end, _), count in zip(spans, counts, strict=True)]


#: Size of the parts of samples from `acquire`: s in real time, otherwise number of samples.
PART_S, PART_SAMPLES = 0.1, 2000


def in_parts(count: int, duration_s: float, pace: float | None) -> list[slice]:
    """Split samples into equal parts: of `PART_S` seconds if there is a pace, otherwise of `PART_SAMPLES` samples."""
    size = PART_SAMPLES if pace is None else math.ceil(count * PART_S * pace / max(duration_s, PART_S * pace))
    return [slice(start, min(start + size, count)) for start in range(0, count, size)]


def keep_pace(pace: float | None, began: float, until_s: float, halted: Event) -> None:
    """Wait until `until_s` after the beginning, at the pace of the rig, or until the rig is halted."""
    if pace is not None:
        halted.wait(max(0.0, began + until_s / pace - monotonic()))
