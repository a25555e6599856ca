"""The phases of a stop in a cycle: approach, rest, restart.

They are found from the steps of the cycle, otherwise from motion.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from pneudrive.rig.interface import Hold, Move
from pneudrive.signals.motion import middle, noise_level

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from pneudrive.campaign.cycle import Cycle
    from pneudrive.signals.recording import Recording

    Array = NDArray[np.float64]

#: Least number of samples of a phase.
FEWEST = 5
#: Speeds within this share of the usual one belong to the part of a move at constant speed.
STEADY = 0.1
#: A piston slower than this share of the move's speed rests.
RESTS = 0.1
#: Multiple of the noise of position within which two rests are one.
SAME_PLACE = 10.0
#: Largest factor between the duration of a rest and the planned stop.
OTHER_DURATION = 1.5
#: Least and largest time over which speed is taken.
SPEED_WINDOW_S = (0.005, 2.0)


@dataclass(frozen=True)
class Phases:
    """The stop of a cycle as slices of its samples.

    Attributes
    ----------
    approach, rest, restart : slice
    rest_s, restart_s : float
        Times at which the axis came to rest and began to move again.
    direction : int
        Speed of the restart.
    reversed : bool
        The approach came from the other side, or is missing.
    by_steps : bool
        Found by the steps of the cycle; by motion otherwise.
    """

    approach: slice
    rest: slice
    restart: slice
    rest_s: float
    restart_s: float
    direction: int
    reversed: bool
    by_steps: bool

    @property
    def dwell_s(self) -> float:
        """Duration of the rest."""
        return self.restart_s - self.rest_s


def find_phases(cycle: Cycle, time_s: Array, position_m: Array, step: NDArray[np.int64]) -> Phases | str:
    """Find the stop of a cycle.

    Parameters
    ----------
    cycle : Cycle
    time_s, position_m, step : ndarray, shape (n,)

    Returns
    -------
    Phases or str
        A string is the reason for a missing stop.
    """
    hold = stop_step(cycle) if cycle.steps else _resting_step(cycle, time_s, position_m, step)
    if hold is not None and np.unique(step).size > 1:
        before, rest, after = (np.flatnonzero(step == hold + k) for k in (-1, 0, 1))
        if after.size < FEWEST:
            return "no samples of the restart: the cycle ends with its stop"
        begins = int(after[0])
        last = int(before[-1]) if before.size else (int(rest[0]) if rest.size else begins - 1)
        approach = slice(int(before[0]), last + 1) if before.size >= FEWEST else slice(last, last)
        phases = slice(last + 1, begins), slice(begins, int(after[-1]) + 1)
        return _phases(time_s, position_m, approach, *phases, by_steps=True)
    return _by_motion(cycle, time_s, position_m)


def stop_step(cycle: Cycle) -> int | None:
    """Find the hold that is the stop of a cycle, before a move and with the planned duration.

    None without such a hold.
    """
    held = {
        i: step.duration_s
        for i, (step, following) in enumerate(pairwise(cycle.steps))
        if isinstance(step, Hold) and step.duration_s > 0 and isinstance(following, Move)
    }
    if not held or cycle.stop_s is None:
        return max(held, key=lambda i: held[i], default=None)
    wanted = max(cycle.stop_s, 1e-9)
    return min(held, key=lambda i: (abs(np.log(held[i] / wanted)), -i))


def _resting_step(cycle: Cycle, time_s: Array, position_m: Array, step: NDArray[np.int64]) -> int | None:
    """Find the stop only from the steps of the samples: a rest before a move, with the planned duration."""
    if not cycle.stop_s or not cycle.speed_m_s:
        return None
    found: list[tuple[float, int]] = []
    for number in np.unique(step):
        rest, after = np.flatnonzero(step == number), np.flatnonzero(step == number + 1)
        if rest.size < FEWEST or after.size < FEWEST:
            continue
        duration = float(time_s[after[0]] - time_s[rest[0]])
        if np.ptp(position_m[rest]) < RESTS * np.ptp(position_m[after]) and duration > 0:
            found.append((float(abs(np.log(duration / cycle.stop_s))), int(number)))
    misfit, number = min(found, default=(np.inf, 0))
    return number if misfit < np.log(OTHER_DURATION) else None


def speed_of(time_s: Array, position_m: Array, speed_m_s: float) -> Array:
    """Return the signed speed, shape (n,), averaged long enough to suppress the noise of position."""
    noise = max(noise_level(position_m), 1e-12)
    width = float(np.clip(20.0 * noise / max(speed_m_s, 1e-9), *SPEED_WINDOW_S))
    low, high = np.maximum(time_s - width / 2, time_s[0]), np.minimum(time_s + width / 2, time_s[-1])
    ends = np.interp(high, time_s, position_m) - np.interp(low, time_s, position_m)
    return ends / np.maximum(high - low, 1e-12)


def steady_part(recording: Recording, part: slice) -> slice:
    """Return the part of one move at constant speed, from the first to the last sample near its usual speed."""
    time_s, position_m = recording.time_s[part], recording.position_m[part]
    n = time_s.size
    share = np.abs(position_m - position_m[0]) / max(abs(float(position_m[-1] - position_m[0])), 1e-12)
    inner = np.flatnonzero((share > 0.2) & (share < 0.8))
    if inner.size < FEWEST or time_s[inner[-1]] <= time_s[inner[0]]:
        return slice(part.start, part.start + n)
    usual = float(position_m[inner[-1]] - position_m[inner[0]]) / float(time_s[inner[-1]] - time_s[inner[0]])
    steady = np.flatnonzero(np.abs(speed_of(time_s, position_m, abs(usual)) - usual) < STEADY * abs(usual))
    first, last = (steady[0], steady[-1]) if steady.size >= FEWEST else (0, n - 1)
    return slice(part.start + int(first), part.start + int(last) + 1)


def mean_velocity(recording: Recording, part: slice) -> float:
    """Return the mean signed velocity of a part of a recording."""
    time, position = recording.time_s[part], recording.position_m[part]
    return float(position[-1] - position[0]) / max(float(time[-1] - time[0]), 1e-12)


def _by_motion(cycle: Cycle, time_s: Array, position_m: Array) -> Phases | str:
    """Find the rest with the planned duration, or the longest one between two moves in one direction."""
    if time_s.size < 4 * FEWEST or np.ptp(position_m) <= 20 * noise_level(position_m):
        return "nothing moves"
    planned = [step.speed_m_s for step in cycle.steps if isinstance(step, Move)]
    usual = cycle.speed_m_s or (min(planned) if planned else None)
    if usual is None:
        moving = np.abs(speed_of(time_s, position_m, float(np.ptp(position_m)) / float(np.ptp(time_s))))
        usual = middle(moving[moving > 0]) if (moving > 0).any() else 0.0
    speed = speed_of(time_s, position_m, usual)
    resting = np.abs(speed) < RESTS * usual
    # A slow move reverses within less than a sample: the sign changes without a rest.
    turns = np.r_[False, np.sign(speed[1:]) * np.sign(speed[:-1]) < 0] | resting
    edges = np.flatnonzero(np.diff(np.r_[False, resting, False].astype(int)))
    whole = _without_gaps(edges.reshape(-1, 2).tolist(), position_m)
    rests = [(a, b) for a, b in whole if a > FEWEST and time_s.size - b > FEWEST]
    if not rests:
        return "no rest between two moves"
    found = []
    for begin, end in rests:
        turn = np.flatnonzero(turns[:begin])
        start = int(turn[-1]) + 1 if turn.size else 0
        following = np.flatnonzero(turns[end + 1 :]) + 1
        stop = end + (int(following[0]) if following.size else time_s.size - end)
        if stop - end >= FEWEST:
            parts = slice(start, begin), slice(begin, end), slice(end, stop)
            found.append(_phases(time_s, position_m, *parts, by_steps=False))
    if not found:
        return "no samples of a restart"
    if cycle.stop_s:
        wanted = cycle.stop_s
        return min(found, key=lambda p: abs(np.log(max(p.dwell_s, 1e-9) / wanted)))
    return max(found, key=lambda p: (not p.reversed, p.dwell_s))


def _without_gaps(rests: list[list[int]], position_m: Array) -> list[tuple[int, int]]:
    """Join rests that are separated only by noise of the position."""
    reach = SAME_PLACE * max(noise_level(position_m), 1e-12)
    whole: list[tuple[int, int]] = []
    for begin, end in rests:
        if whole and abs(position_m[begin] - position_m[whole[-1][1] - 1]) < reach:
            whole[-1] = (whole[-1][0], end)
        else:
            whole.append((begin, end))
    return whole


def _phases(
    time_s: Array, position_m: Array, approach: slice, rest: slice, restart: slice, *, by_steps: bool
) -> Phases:
    at = float(position_m[max(restart.start - 1, 0)])
    direction = 1 if position_m[restart.stop - 1] >= at else -1
    came = float(at - position_m[approach.start]) if approach.stop > approach.start else 0.0
    return Phases(
        approach=approach,
        rest=rest,
        restart=restart,
        rest_s=float(time_s[max(rest.start - 1, 0)]),
        restart_s=float(time_s[restart.start]),
        direction=direction,
        reversed=came * direction <= 0,
        by_steps=by_steps,
    )
