"""Phases of a stop, and friction around the stop: uninterrupted sliding as reference, relaxation while held, recovery.

The phases approach, rest and restart are found from the steps of the cycle, otherwise from motion.

Recovery is the distance after a restart until friction has returned to that of uninterrupted sliding:

  excess(s) = E exp(-s/L) + c        s: travel since the breakaway peak

c is the remaining excess at the end of the move. Friction has recovered when the excess over c has fallen to 5 % of its
initial value. This distance does not depend on noise, unlike the distance at which the excess is lost in the noise.

Relaxation of the force while the piston is held has one of four forms:

  log           f = a - R log10(1 + t/t0)          R per decade: creep of an elastomer
  exponential   f = a - A [1 - exp(-t/tau)]        one time constant: a film that is squeezed out
  two times     f = a - A1 [1 - exp(-t/tau1)] - A2 [1 - exp(-t/tau2)]
  none          f = a

All four forms are fitted to means over bins of equal width in log time, and compared by AICc [burnham2002].
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from pneudrive.arrays import Array, Ints, Row
from pneudrive.campaign.cycle import Cycle
from pneudrive.campaign.storage.folder import RESTS, CycleFile, recording_of, speed_of, steps_from_motion, steps_of
from pneudrive.errors import RecordingError
from pneudrive.estimate.autocorrelation import cells, corrected_criterion, means
from pneudrive.estimate.estimates import NORMAL_95, rms
from pneudrive.estimate.mixed import Scan, refined
from pneudrive.friction.bins import profile_stderr
from pneudrive.friction.campaign.reading import condition_of
from pneudrive.friction.friction_map import Condition
from pneudrive.rig.interface import Hold, Identity, Move, Samples
from pneudrive.signals.motion import noise_level
from pneudrive.signals.recording import Recording

#: Smallest number of samples of a phase.
FEWEST = 5
#: Largest relative deviation from the usual speed in the part of a move at constant speed.
STEADY = 0.1


@dataclass(frozen=True)
class Phases:
    """The stop of a cycle as slices of its samples.

    Attributes
    ----------
    approach, rest, restart : slice
    rest_s, restart_s : float
        Times at which the axis came to rest and began to move again.
    direction : int
        Direction of the restart, +1 or -1.
    reversed : bool
        Whether the approach was in the opposite direction, or is missing.
    by_steps : bool
        Whether the phases come from the steps of the cycle; otherwise from the motion.
    """

    approach: slice
    rest: slice
    restart: slice
    rest_s: float
    restart_s: float
    direction: int
    reversed: bool
    by_steps: bool = True

    @property
    def dwell_s(self) -> float:
        """Duration of the rest, in s."""
        return self.restart_s - self.rest_s


def find_phases(cycle: Cycle, time_s: Array, position_m: Array, step: Ints) -> Phases:
    """Find approach, rest and restart of the stop of a cycle.

    Parameters
    ----------
    cycle : Cycle
    time_s, position_m, step : ndarray, shape (n,)

    Raises
    ------
    RecordingError
        If no stop was found.
    """
    if np.unique(step).size > 1:
        if (hold := stop_step(cycle)) is not None:
            if (found := _phases(time_s, position_m, step, hold)) is None:
                raise RecordingError("no samples of the restart: the cycle ends with its stop")
            return found
        with suppress(RecordingError):
            return _rest(cycle, time_s, position_m, step)
    planned = [move.speed_m_s for move in cycle.steps if isinstance(move, Move)]
    speed = cycle.speed_m_s or min(planned, default=None)
    return replace(_rest(cycle, time_s, position_m, steps_from_motion(time_s, position_m, speed)), by_steps=False)


def stop_step(cycle: Cycle) -> int | None:
    """Return the index of the stop of a cycle. It is the hold with the planned duration that precedes a move.

    None without such a hold.
    """
    held = {
        i: step.duration_s
        for i, (step, following) in enumerate(pairwise(cycle.steps))
        if isinstance(step, Hold) and step.duration_s > 0 and isinstance(following, Move)
    }
    if cycle.stop_s is None:
        return max(held, key=lambda i: held[i], default=None)
    wanted = max(cycle.stop_s, 1e-9)
    return min(held, key=lambda i: (abs(np.log(held[i] / wanted)), -i), default=None)


def _rest(cycle: Cycle, time_s: Array, position_m: Array, step: Ints) -> Phases:
    """Find the rest with the planned duration, or the longest rest between two moves in the same direction."""
    if step.max() == 0:
        raise RecordingError("nothing moves")
    every = [_phases(time_s, position_m, step, number) for number in np.unique(step)[:-1]]
    found = [p for p in every if p and p.rest.stop > p.rest.start]
    found = [p for p in found if np.ptp(position_m[p.rest]) < RESTS * np.ptp(position_m[p.restart])]
    if not found:
        raise RecordingError("no rest between two moves")
    if wanted := cycle.stop_s:
        return min(found, key=lambda p: abs(np.log(max(p.dwell_s, 1e-9) / wanted)))
    return max(found, key=lambda p: (not p.reversed, p.dwell_s))


def steady_part(recording: Recording, part: slice) -> tuple[slice, float]:
    """Return the slice from the first to the last sample of a move near its usual speed, and its mean velocity."""
    time_s, position_m = recording.time_s[part], recording.position_m[part]
    share, ends = _travelled(position_m), np.array([0, time_s.size - 1])
    inner = np.flatnonzero((share > 0.2) & (share < 0.8))
    if inner.size >= FEWEST:
        (way_m,), (lasts_s,) = (np.diff(values[inner[[0, -1]]]) for values in (position_m, time_s))
        usual = float(way_m / lasts_s)
        steady = np.flatnonzero(np.abs(speed_of(time_s, position_m, abs(usual)) - usual) < STEADY * abs(usual))
        ends = steady[[0, -1]] if steady.size >= FEWEST else ends
    (way_m,), (lasts_s,) = np.diff(position_m[ends]), np.diff(time_s[ends])
    return slice(part.start + int(ends[0]), part.start + int(ends[1]) + 1), way_m / max(lasts_s, 1e-12)


def _travelled(position_m: Array) -> Array:
    """Return the fraction of the distance of a move that has been covered at each sample."""
    return np.abs(position_m - position_m[0]) / max(abs(position_m[-1] - position_m[0]), 1e-12)


def _phases(time_s: Array, position_m: Array, step: Ints, hold: int) -> Phases | None:
    """Return the phases of a stop by the index of its hold; None with too few samples of the restart."""
    before, rest, after = (np.flatnonzero(step == hold + k) for k in (-1, 0, 1))
    if after.size < FEWEST:
        return None
    begins, end = int(after[0]), int(after[-1])
    last = int(before[-1]) if before.size else (int(rest[0]) if rest.size else begins - 1)
    approach = slice(int(before[0]), last + 1) if before.size >= FEWEST else slice(last, last)
    at = position_m[max(begins - 1, 0)]
    direction = 1 if position_m[end] >= at else -1
    came = at - position_m[approach.start] if approach.stop > approach.start else 0.0
    return Phases(
        approach=approach,
        rest=slice(last + 1, begins),
        restart=slice(begins, end + 1),
        rest_s=float(time_s[max(last, 0)]),
        restart_s=float(time_s[begins]),
        direction=direction,
        reversed=came * direction <= 0,
    )


SAME_SPEED = 0.05  # speeds that differ by less than this share are equal
POINTS = 400  # over a stroke: means of neighbouring samples
#: Last fraction of the approach at constant speed. Only this part is used: friction may still recover earlier.
LAST_SHARE = 0.5
BINS = 24
MOST_REFERENCES = 8
COVERED = 0.8  # of the way before the stop that a stroke must cover to be a reference
NOISE_OF_STEPS = 0.954  # median size of the step between two values of noise 1


@dataclass(frozen=True, eq=False)
class UninterruptedStroke:
    """One stroke at constant speed without a stop, as block means of friction over increasing position (shape (m,)).

    ``noise_n`` is the standard deviation of one mean.
    """

    condition: Condition
    direction: int
    speed_m_s: float
    position_m: Array
    friction_n: Array
    noise_n: float


def strokes_of(file: CycleFile, recording: Recording, step: Ints) -> list[UninterruptedStroke]:
    """Return the strokes of a cycle at its planned speed. The moves before and after a stop are excluded.

    Parameters
    ----------
    file : CycleFile
    recording : Recording
        Samples of the cycle.
    step : ndarray of int, shape (n,)
    """
    cycle, out = file.head.cycle, []
    planned, hold = cycle.speed_m_s, stop_step(cycle) if cycle.kind == "stop" and cycle.stop_s != 0.0 else None
    balance = recording.balance_n()
    edges = np.flatnonzero(np.diff(np.r_[step[:1] - 1, step])).tolist()
    for begin, end in pairwise([*edges, step.size]):
        if (hold is not None and abs(int(step[begin]) - hold) <= 1) or end - begin < 4 * FEWEST:
            continue
        part, velocity = steady_part(recording, slice(begin, end))
        other = planned is not None and abs(abs(velocity) - planned) > SAME_SPEED * planned
        if part.stop - part.start < 4 * FEWEST or velocity == 0.0 or other:
            continue
        direction = 1 if velocity > 0 else -1
        position, _ = _means(recording.position_m[part], POINTS)
        friction, _ = _means(direction * balance[part], POINTS)
        rising = np.argsort(position)
        arrays = position[rising], friction[rising], _noise(friction)
        out.append(UninterruptedStroke(condition_of(file.head), direction, abs(velocity), *arrays))
    return out


def uninterrupted_strokes(file: CycleFile, samples: Samples, identity: Identity) -> list[UninterruptedStroke]:
    """Return the strokes of a whole cycle without a stop."""
    recording, _ = recording_of(file, identity, samples)
    return strokes_of(file, recording, steps_of(recording, samples))


def _means(values: Array, most: int) -> tuple[Array, float]:
    """Return the means over parts of equal size, and the mean number of samples in a part."""
    edges = np.linspace(0, values.size, min(most, values.size) + 1).astype(int)
    sizes = np.diff(edges)
    return np.add.reduceat(values, edges[:-1]) / sizes, sizes.mean()


def _noise(values: Array) -> float:
    """Estimate the standard deviation of single values from differences of neighbours."""
    return float(np.median(np.abs(np.diff(values)))) / NOISE_OF_STEPS


@dataclass(frozen=True, eq=False)
class Running:
    """Friction that the piston would have without the stop.

    Attributes
    ----------
    level_n, stderr_n : float
        Level at the stop; NaN if unknown.
    texture_n : float
        Scatter of friction over position about that level, beyond noise.
    basis : str
        approach, approach and reference, reference, none.
    stop_m : float
        Position at which the level applies.
    reference_m, reference_n : ndarray, shape (m,)
        Uninterrupted friction over position. Empty if unknown.
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
    """Estimate friction without the stop from the approach, from uninterrupted strokes, or from both.

    Parameters
    ----------
    recording : Recording
    friction_n : ndarray, shape (n,)
        Force balance times direction, in N.
    phases : Phases
    own, others : sequence of UninterruptedStroke
        Strokes of this cycle, and of others.
    condition : Condition
    """
    steady, velocity = steady_part(recording, phases.restart)
    at, speed = float(recording.position_m[phases.restart.start]), abs(velocity)
    approach = _approach(recording, phases, speed)
    end = float(recording.position_m[steady.stop - 1])
    low, high = sorted((float(recording.position_m[approach.start]) if approach else at, end))

    def is_alike(s: UninterruptedStroke) -> bool:
        """Return whether a stroke has this direction, condition and speed, and covers the travel around the stop."""
        covered = min(s.position_m[-1], high) - max(s.position_m[0], low) >= COVERED * (high - low)
        same = s.direction == phases.direction and s.condition == condition
        return same and covered and abs(s.speed_m_s - speed) <= SAME_SPEED * speed

    references = [s for s in own if is_alike(s)] or [s for s in others if is_alike(s)]
    references = references[-MOST_REFERENCES:]
    reference_m, reference_n, noise = np.zeros(0), np.zeros(0), 0.0
    if references:
        # Mean of the strokes over their common travel, smoothed over three points, and its noise.
        ends = max(s.position_m[0] for s in references), min(s.position_m[-1] for s in references)
        reference_m = np.linspace(*ends, 200)
        mean = np.mean([np.interp(reference_m, s.position_m, s.friction_n) for s in references], axis=0)
        padded = np.r_[mean[0], mean, mean[-1]]
        reference_n = (padded[:-2] + padded[1:-1] + padded[2:]) / 3.0
        noise = np.mean([s.noise_n for s in references]) / np.sqrt(3.0 * len(references))
    nothing = Running(np.nan, np.nan, 0.0, "none", at, reference_m, reference_n)
    if approach is not None:
        basis = "approach and reference" if references else "approach"
        before = friction_n[approach] - nothing.shape(recording.position_m[approach])
        # Mean, standard error and variation over position of friction before the stop.
        bins, each = _means(before, int(min(BINS, max(before.size // 4, 4))))
        sigma = _noise(before) / np.sqrt(each)
        lean = abs(np.polyfit(np.linspace(0.0, 1.0, bins.size), bins, 1)[0]) / 2.0
        texture = np.sqrt(max(np.var(bins, ddof=2) - sigma**2, 0.0))
        level, stderr = bins.mean(), np.hypot(profile_stderr(bins), lean / np.sqrt(3.0))
    elif references:
        basis, level = "reference", [np.interp(at, s.position_m, s.friction_n) for s in references]
        near = np.abs(reference_m - at) < 0.1 * (high - low)
        texture = float(np.std(reference_n[near])) if near.sum() > 3 else 0.0
        stderr = np.std(level, ddof=1) / np.sqrt(len(level)) if len(level) > 1 else texture
        level = float(np.mean(level))
    else:
        return nothing
    return Running(level, float(np.hypot(stderr, noise)), texture, basis, at, reference_m, reference_n)


def _approach(recording: Recording, phases: Phases, speed: float) -> slice | None:
    """Return the last part of an approach with the same direction and speed as the restart, or None."""
    if phases.reversed or phases.approach.stop - phases.approach.start < 4 * FEWEST:
        return None
    steady, velocity = steady_part(recording, phases.approach)
    if abs(abs(velocity) - speed) > SAME_SPEED * speed:
        return None
    first = steady.start + int(np.argmax(_travelled(recording.position_m[steady]) >= 1.0 - LAST_SHARE))
    return slice(first, steady.stop) if steady.stop - first >= 2 * FEWEST else None


BACK = 0.05  # of the excess at the peak
BINS_PER_DECADE = 14
LEAST_IN_BIN = 4
FEWEST_BINS = 8
LENGTHS = 60
MISFIT = 0.05  # of the excess: largest misfit of an exponential for reading a distance
#: Number of standard errors below which an excess counts as zero.
SIGNIFICANT = 3.0


def _interval(name: str, value: float, low: float, high: float) -> Row:
    """Return the columns of a value and of the bounds of its 95 % interval."""
    return {name: value, f"{name}_low": low, f"{name}_high": high}


def bin_excess(
    recording: Recording, friction_n: Array, part: slice, direction: int, running: Running
) -> tuple[Array, float] | None:
    """Average the excess over bins whose width grows with travel. Return None if there are too few samples.

    Parameters
    ----------
    recording : Recording
    friction_n : ndarray, shape (n,)
        Force balance times direction, in N.
    part : slice
        Samples from the peak to the end of the part at constant speed.
    direction : int
    running : Running

    Returns
    -------
    ndarray, shape (4, m)
        Travel and time since the peak, excess over uninterrupted sliding, and its standard error.
    float
        Speed of the restart.
    """
    if not np.isfinite(running.level_n) or part.stop - part.start < 2:
        return None
    position = recording.position_m[part]
    travel = np.maximum.accumulate(direction * (position - position[0]))
    time = recording.time_s[part] - recording.time_s[part.start]
    excess = friction_n[part] - running.level_n - running.shape(position)
    known, speed = travel > 0, float(travel[-1] / max(time[-1], 1e-12))
    travel, time, excess = travel[known], time[known], excess[known]
    if travel.size < FEWEST_BINS * LEAST_IN_BIN:
        return None
    low = travel[LEAST_IN_BIN]
    edges = np.r_[0.0, np.geomspace(low, travel[-1] * (1 + 1e-9), BINS_PER_DECADE * 4)]
    at = np.searchsorted(edges, travel, side="right") - 1
    number = np.bincount(at, minlength=edges.size)
    # Bins with too few samples join the following one.
    target, carried, label = np.zeros(edges.size, dtype=int), 0, 0
    for i, count in enumerate(number):
        target[i] = label
        carried += count
        if carried >= LEAST_IN_BIN:
            label, carried = label + 1, 0
    group = target[at]
    count = np.bincount(group)
    kept = count >= LEAST_IN_BIN
    if kept.sum() < FEWEST_BINS:
        return None
    # Averaging in bins does not reduce the texture, the scatter of uninterrupted friction over position.
    stderr = np.hypot(noise_level(friction_n[part]) / np.sqrt(count), running.texture_n)
    return np.array([*means(group, travel, time, excess), stderr])[:, kept], speed


def recover(bins: Array, running_stderr_n: float, speed_m_s: float) -> Row:
    """Fit the return of friction to that of uninterrupted sliding after a restart.

    Parameters
    ----------
    bins : ndarray, shape (4, m)
        See `bin_excess`.
    running_stderr_n : float
        Standard error of the level of uninterrupted sliding.
    speed_m_s : float
        Speed of the restart.

    Returns
    -------
    dict
        Empty if the excess at the peak is not distinguishable from zero. Otherwise distance and time from the peak to 5
        % of the excess, travel after the peak, and whether the move is long enough. Upper bounds are infinite if the
        move is too short. If the excess is not exponential within its noise, the distance is read from the bins.
    """
    s, time, y, sigma = bins
    first = slice(0, max(2, s.size // 10))
    start = np.average(y[first], weights=sigma[first] ** -2)
    if start < SIGNIFICANT * np.hypot(sigma[first].min(), running_stderr_n):
        return {}
    freedom = s.size - 3
    coarse = np.geomspace(s[0], 3.0 * s[-1], LENGTHS)

    def at(lengths: Array) -> Scan:
        decay = np.exp(-s / lengths[:, None])
        design = np.stack([decay, np.ones_like(decay)], axis=2)
        return Scan(lengths[:, None], design / sigma[:, None], y / sigma, freedom, least=1.0)

    found = refined(at, coarse, LENGTHS)
    lengths = found.shape[:, 0]
    back = lengths * np.log(1.0 / BACK)
    inside = back[found.inside]
    best, cost, (drop, left) = found.best, found.cost[found.best], found.coefficient[found.best].tolist()
    rest = y - drop * np.exp(-s / lengths[best]) - left
    strange = cost > freedom + 3.0 * np.sqrt(2.0 * freedom)
    value, seen = float(back[best]), float(s[-1])
    low, high = float(inside.min()), float(inside.max())
    if strange and rms(rest) > MISFIT * start:
        value, low, high = _by_bins(s, y - left, sigma)
    complete = high <= seen
    high = high if complete else np.inf
    # Beyond the observed travel, at the speed of the move.
    ends = np.array([value, low, high])
    beyond = np.maximum(ends - seen, 0.0)
    times = np.interp(ends, np.r_[0.0, s], np.r_[0.0, time]) + beyond / max(speed_m_s, 1e-9)
    return {
        **_interval("recovery_m", *ends.tolist()),
        **_interval("recovery_s", *times.tolist()),
        "recovery_seen_m": seen,
        "recovery_complete": complete,
    }


def _by_bins(travel: Array, above: Array, sigma: Array) -> tuple[float, float, float]:
    """Return the distance, with bounds, at which the binned excess falls below 5 % and stays there."""
    top = above[: max(2, above.size // 10)].mean()

    def crossing(shift: float) -> float:
        over = np.flatnonzero(above + shift * sigma > BACK * top)
        last = over[-1] + 1 if over.size else 0
        return float(travel[last]) if last < above.size else np.inf

    low, value, high = crossing(-1.0), crossing(0.0), crossing(1.0)
    return min(value, travel[-1]), low, max(high, value)


PER_DECADE = 12
FEWEST_TIMES = 6
#: Parts of a hold that are averaged for the amount of relaxation: duration at the start, s; fraction at the end.
START_S, END_SHARE = 0.1, 0.1
LEAST_SAMPLES = 3
#: Factor by which the search for time constants extends beyond the times of the first and last bin.
REACH = 5.0
TIMES = 60


def relax(time_s: Array, friction_n: Array) -> Row:
    """Describe the fall of the force in a hold; friction is positive in the direction of the restart.

    Parameters
    ----------
    time_s : ndarray, shape (n,)
        Time since the beginning of the rest, positive.
    friction_n : ndarray, shape (n,)
        Raw samples.

    Returns
    -------
    dict
        Empty with fewer than six samples. Otherwise the fall of the force from the start to the end of the hold,
        independent of any form; the fall per decade, NaN if the hold is too short; the best form; the force at the end
        of the hold.
    """
    if time_s.size < 2 * LEAST_SAMPLES:
        return {}
    noise = max(noise_level(friction_n), 1e-12 * np.abs(friction_n).max() + 1e-300)
    duration = time_s[-1]
    early = max(np.searchsorted(time_s, START_S), LEAST_SAMPLES)
    late = min(np.searchsorted(time_s, (1.0 - END_SHARE) * duration), time_s.size - LEAST_SAMPLES)
    early = min(early, late)
    start, end = friction_n[:early], friction_n[late:]
    stderr = noise * np.sqrt(1.0 / start.size + 1.0 / end.size)
    value, reach = float(start.mean() - end.mean()), NORMAL_95 * stderr
    row: Row = {"relaxation_form": "none", "relaxation_held_n": float(end.mean())}
    row |= _interval("relaxation_n", value, value - reach, value + reach)
    low, high = max(time_s[0], duration * 1e-6), duration * (1 + 1e-9)
    edges = np.geomspace(low, high, max(int(PER_DECADE * np.log10(duration / low)), FEWEST_TIMES) + 1)
    group = cells(np.clip(np.searchsorted(edges, time_s, side="right") - 1, 0, edges.size - 2))
    time, friction = means(group, time_s, friction_n)
    if time.size < FEWEST_TIMES:
        return row
    return row | _forms(time, friction, noise**2 / np.bincount(group))


def _forms(time: Array, force: Array, variance: Array) -> Row:
    # Slow noise that bins share is not in the samples' noise: least variance from a polynomial in log time.
    u = np.log10(time)
    design = np.vander((u - u.mean()) / max(np.ptp(u), 1e-9), min(6, u.size - 3))
    w = 1.0 / np.sqrt(variance)
    rest = (force - design @ np.linalg.lstsq(design * w[:, None], force * w, rcond=None)[0]) ** 2
    slow = max(rest.sum() / (u.size - design.shape[1]) - variance.mean(), 0.0)
    root = np.sqrt(1.0 / (variance + slow))
    grid = np.geomspace(time[0] / REACH, time[-1] * REACH, TIMES)
    pairs = [(a, b) for i, a in enumerate(grid[::3]) for b in grid[::3][i + 2 :]]
    single = [(t,) for t in grid]
    candidates = {"none": [()], "exponential": single, "log": single, "two times": pairs}
    fits, aicc = {}, {}
    for form, shapes in candidates.items():
        shape = np.array(shapes).reshape(len(shapes), -1)
        ratio = time[None, :, None] / shape[:, None, :]  # of times (n,) to time constants (g, k), shape (g, n, k)
        relaxed = np.log10(1.0 + ratio) if form == "log" else -np.expm1(-ratio)
        columns = np.concatenate([np.ones((len(shapes), time.size, 1)), -relaxed], axis=2)
        fits[form] = Scan(shape, columns * root[:, None], force * root, time.size - 3, least=1.0)
        aicc[form] = corrected_criterion(fits[form].cost.min(), 1 + 2 * shape.shape[1], time.size)
    form = min(aicc, key=lambda name: aicc[name])
    best, log = fits[form], fits["log"]
    found: Row = {"relaxation_form": form}
    if np.isfinite(aicc["log"]):
        ends = log.interval(np.array([0.0, 1.0]))
        found |= _interval("relaxation_n_per_decade", float(log.coefficient[log.best, 1]), *ends)
    if form != "none":
        found["relaxation_time_s"] = float(best.shape[best.best, 0])
        found["relaxation_amplitude_n"] = float(best.coefficient[best.best, 1])
    return found
