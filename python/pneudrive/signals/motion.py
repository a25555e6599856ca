"""Strokes from motion: turning points, moving parts, speed and acceleration."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from pneudrive import _core
from pneudrive.arrays import Array, Bools, Ints, Pair, groups_by
from pneudrive.errors import RecordingError

Levels = list[list["Stroke"]]  # strokes of one speed, slowest first

MINIMUM_SAMPLES = 20
# A reversal counts if the position retreats by this fraction of the whole travel.
REVERSAL_SHARE = 0.1
# Below this fraction of the travel, a stroke has not left its turning point yet (dwell).
DEPARTURE_SHARE = 0.002
# Least ratio of travel to position noise for a motion.
NOISE_FACTOR = 20.0
ENOUGH_FOR_QUANTILES = 2000
# Local slopes by convolution, for short windows and steps that are equal except for rounding.
KERNEL_HALF_WIDTH = 16
UNIFORM_TOLERANCE = 0.01


@dataclass(frozen=True)
class Stroke:
    """One movement in one direction: samples ``start`` (inclusive) to ``stop`` (exclusive).

    ``dwell_s`` is the time at the turning point before the stroke. ``speed_m_s`` is the signed mean speed over the
    middle 60 % of the stroke.
    """

    index: int
    direction: int
    start: int
    stop: int
    from_m: float
    to_m: float
    speed_m_s: float
    dwell_s: float

    @property
    def samples(self) -> slice:
        """Slice of the stroke's samples."""
        return slice(self.start, self.stop)

    @property
    def pace_m_s(self) -> float:
        """Speed without its sign."""
        return abs(self.speed_m_s)


def local_slope(time_s: Array, values: Array, half_width: int = 4) -> Array:
    """Return the slope of a straight line fitted to each sample and its neighbours. The times may be uneven.

    Parameters
    ----------
    time_s, values
        Shape (n,); n must be at least 2.
    half_width
        Neighbours on each side. Samples near the ends have fewer neighbours. With equal time steps, they instead get
        the slope of the nearest sample that has all neighbours.

    Returns
    -------
    ndarray
        Shape (n,), unit of ``values`` per second. Zero if all times of a window are equal.
    """
    n = time_s.size
    steps = np.diff(time_s)
    usual = steps.mean()
    if half_width <= KERNEL_HALF_WIDTH and n > 4 * half_width and usual > 0:
        longest, shortest = steps.max(), steps.min()
        if longest - shortest <= UNIFORM_TOLERANCE * usual:  # one convolution
            offsets = np.arange(-half_width, half_width + 1)
            kernel = offsets[::-1] / (usual * (offsets @ offsets))
            slope = np.empty_like(values)
            slope[half_width:-half_width] = np.convolve(values, kernel, "valid")
            slope[:half_width] = slope[half_width]
            slope[-half_width:] = slope[-half_width - 1]
            return slope
    # Other times: a line through the neighbours of each sample, by running sums.
    low = np.maximum(np.arange(n) - half_width, 0)
    high = np.minimum(np.arange(n) + half_width + 1, n)
    count = (high - low).astype(float)
    # Centred values keep the running sums small, so that their differences stay accurate.
    t = time_s - time_s.mean()
    y = values - values.mean()

    def window_sum(terms: Array) -> Array:
        total = np.concatenate(([0.0], np.cumsum(terms)))
        return total[high] - total[low]

    sum_t, sum_y = window_sum(t), window_sum(y)
    spread = window_sum(t * t) - sum_t * sum_t / count
    joint = window_sum(t * y) - sum_t * sum_y / count
    tiny = 1e-12 * max(np.ptp(t), 1e-300) ** 2
    return np.where(spread > tiny, joint / np.where(spread > tiny, spread, 1.0), 0.0)


def noise_level(values: Array, *, quantisation: bool = True) -> float:
    """Estimate the standard deviation of white noise from second differences; robust, and insensitive to slow changes.

    If quantisation hides the noise, the estimate is that of a uniform distribution over one step. Set `quantisation` to
    False for a channel that jumps between a few values: its smallest step is not a quantisation step.
    """
    if values.size < 3:
        return 0.0
    stride = max(values.size // ENOUGH_FOR_QUANTILES, 1)
    second = values[2::stride] - 2 * values[1:-1:stride] + values[:-2:stride]
    from_differences = 1.4826 * middle(np.abs(second)) / np.sqrt(6.0)
    # Equal steps of a quantum without a finite binary fraction differ by rounding, which is not noise.
    rounding = 8.0 * np.finfo(float).eps * np.fmax.reduce(np.abs(values[::stride]))
    if from_differences > rounding or not quantisation:
        return from_differences
    steps = np.abs(np.diff(values))
    steps = steps[steps > rounding]
    return float(steps.min()) / np.sqrt(12.0) if steps.size else 0.0


def thinned(values: Array) -> Array:
    """Return every k-th value, so that at most about 4000 are left: enough for a median or a high quantile."""
    return values[:: max(values.size // ENOUGH_FOR_QUANTILES, 1)]


def straight_line(x: Array, y: Array) -> Pair:
    """Return slope and intercept of a line fitted by least squares. The slope is 0 if all x are equal."""
    away = x - x.mean()
    power = float(away @ away)
    slope = float(away @ y) / power if power > 0 else 0.0
    return slope, float(y.mean()) - slope * float(x.mean())


def middle(values: Array) -> float:
    """Return an approximate median of a long array, from every k-th value (see `thinned`).

    For an even number of values, it is the upper one of the two middle values.
    """
    some = thinned(values)
    return float(np.partition(some, some.size // 2)[some.size // 2])


def turning_points(position_m: Array, least_m: float) -> Ints:
    """Find the samples at which the motion reverses by at least ``least_m``, first and last included.

    The first of several equal extremes is returned. If consecutive samples have the extreme value, their middle is
    returned.
    """
    return _core.turning_points(np.ascontiguousarray(position_m, dtype=float), least_m)


def find_strokes(name: str, time_s: Array, position_m: Array) -> list[Stroke]:
    """Split a motion into strokes.

    Parameters
    ----------
    name
        Name for messages.
    time_s, position_m
        Shape (n,), finite, time not decreasing.

    Returns
    -------
    list of Stroke
        In the order of time.

    Raises
    ------
    RecordingError
        There are fewer than 20 samples, or no motion beyond the position noise.
    """
    if time_s.size < MINIMUM_SAMPLES:
        raise RecordingError.of("signals.too-few-samples", where=name, value=time_s.size, fewest=MINIMUM_SAMPLES)
    noise = noise_level(position_m)
    low, high = np.nanquantile(thinned(position_m), (0.001, 0.999)).tolist()
    travel = high - low
    if travel <= NOISE_FACTOR * noise or travel <= 0 or time_s[-1] <= time_s[0]:
        numbers = {"factor": NOISE_FACTOR, "travel_mm": 1e3 * travel, "noise_mm": 1e3 * noise}
        raise RecordingError.of("signals.no-motion", where=name, **numbers)
    points = turning_points(position_m, REVERSAL_SHARE * travel)
    departure = max(DEPARTURE_SHARE * travel, 4 * noise)
    strokes: list[Stroke] = []
    last_moving = int(points[0]) if points.size else 0
    for first, last in pairwise(points.tolist()):
        part = position_m[first : last + 1]
        direction = 1 if part[-1] > part[0] else -1
        left = np.flatnonzero(direction * (part - part[0]) < departure)
        reached = np.flatnonzero(direction * (part[-1] - part) < departure)
        start = first + (int(left[-1]) if left.size else 0)
        stop = first + (int(reached[0]) if reached.size else part.size - 1) + 1
        if stop - start < 5:  # without the dwell at both ends
            continue
        dwell = max(float(time_s[start] - time_s[last_moving]), 0.0)
        strokes.append(
            Stroke(
                index=len(strokes),
                direction=direction,
                start=start,
                stop=stop,
                from_m=float(position_m[start]),
                to_m=float(position_m[stop - 1]),
                speed_m_s=_middle_speed(time_s[start:stop], position_m[start:stop]),
                dwell_s=dwell if strokes else 0.0,
            )
        )
        last_moving = stop - 1
    if not strokes:
        raise RecordingError("no stroke was found", where=name, rule="the position must move back and forth")
    return strokes


def _middle_speed(time_s: Array, position_m: Array) -> float:
    """Return the mean speed between 20 % and 80 % of a stroke's travel."""
    share = (position_m - position_m[0]) / (position_m[-1] - position_m[0])
    first = np.argmax(share >= 0.2)
    last = share.size - 1 - np.argmax(share[::-1] <= 0.8)
    if last <= first or time_s[last] <= time_s[first]:
        first, last = 0, share.size - 1
    return float((position_m[last] - position_m[first]) / (time_s[last] - time_s[first]))


CONTROLLED_TOLERANCE = 0.03  # largest difference between a stroke and its return with controlled speed
LEVEL_WIDTH = 0.02  # speeds closer than this are one class
DRIFT_RANGE = 1.10  # all speeds within this ratio: one drifting class, not several
PAIRED_SHARE = 0.8  # least share of strokes with a stroke of the other direction in their class
LEAST_STEPS = 4  # least number of set speeds of a direction whose return is not controlled,
LEAST_RANGE = 2.0  # and least ratio of the fastest to the slowest: a single speed does not drift that far (assumed)
ONE_WAY = 0.8  # of the changes from stroke to stroke: least surplus of one sign in steps
APART = 3.0  # classes are this many times their width apart,
LEAST_GAP = 0.05  # and at least this share of their speed: smaller changes from stroke to stroke are drift


def speed_levels(strokes: list[Stroke]) -> Levels:
    """Group strokes into speed classes, slowest first. There is one class if the rig did not set speeds.

    If return strokes do not have the speed of the stroke before, each class contains one direction only.
    """
    if not speeds_differ(strokes):
        return [list(strokes)]
    groups = _groups(sorted(strokes, key=lambda s: s.pace_m_s), 1.0 + LEVEL_WIDTH)
    # The speed was controlled if neighbouring strokes in both directions have equal speeds.
    turns = [(a.speed_m_s, b.speed_m_s) for a, b in pairwise(strokes) if a.direction != b.direction]
    slow, fast = np.sort(np.abs(np.reshape(turns, (-1, 2))), axis=1).T
    # A pair differs if the class changes between neighbours: at most every second pair does.
    agree = np.sort((fast - slow) / fast)[: max(fast.size // 2, 1)]
    if (agree[-1:] <= CONTROLLED_TOLERANCE).any() and _are_levels(groups):
        return [sorted(group, key=lambda s: s.index) for group in groups]
    return _one_way_levels(strokes) or [list(strokes)]


def speeds_differ(strokes: Sequence[Stroke]) -> bool:
    """Return whether speeds differ by more than a drift, so that the strokes do not form one speed class."""
    speeds = [stroke.pace_m_s for stroke in strokes]
    return max(speeds) > DRIFT_RANGE * min(speeds)


def _one_way_levels(strokes: list[Stroke]) -> Levels:
    """Return the speed classes of one direction, if its speed was set in steps.

    If several return strokes have the speed of the strokes before them, the return strokes join the classes of the
    strokes before. The result is empty if neither direction has steps.
    """
    by_pace = sorted(strokes, key=lambda s: s.pace_m_s)
    ways = {d: [s for s in by_pace if s.direction == d] for d in (1, -1)}
    steps = {d: _groups(members, 1.0 + LEVEL_WIDTH) for d, members in ways.items()}
    way = max(filter(lambda d: _are_steps(steps[d]), steps), key=lambda d: len(steps[d]), default=0)
    if not way:
        return []
    classes = steps[way]
    before = {stroke.index + 1: (i, stroke.pace_m_s) for i, group in enumerate(classes) for stroke in group}
    after = [(stroke, *before[stroke.index]) for stroke in ways[-way] if stroke.index in before]
    returns = [(stroke, i) for stroke, i, pace in after if abs(stroke.pace_m_s / pace - 1.0) <= CONTROLLED_TOLERANCE]
    if len({i for _, i in returns}) < LEAST_STEPS:
        returns = []
    for stroke, i in returns:
        classes[i].append(stroke)
    joined = {stroke.index for stroke, _ in returns}
    rest = _groups([stroke for stroke in ways[-way] if stroke.index not in joined], DRIFT_RANGE)
    return [sorted(members, key=lambda s: s.index) for members in (*classes, *rest)]


def _groups(ordered: list[Stroke], width: float) -> Levels:
    """Return strokes in groups whose speeds differ at most by the factor ``width``; slowest first."""
    paces = [stroke.pace_m_s for stroke in ordered]
    return [ordered[group] for group in groups_by(paces, lambda slowest, pace: pace > slowest * width)]


def _are_steps(groups: Levels) -> bool:
    """Return whether groups of one direction are speed setpoints: clearly apart, in ascending or descending order.

    A few exceptions to the order are allowed, such as a first stroke at the usual speed.
    """
    speeds = [group[0].pace_m_s for group in groups]
    apart = all(b > a * (1.0 + CONTROLLED_TOLERANCE) for a, b in pairwise(speeds))
    number = {stroke.index: i for i, group in enumerate(groups) for stroke in group}
    changes = np.sign(np.diff([number[index] for index in sorted(number)]))
    one_way = abs(changes.sum()) >= ONE_WAY * np.count_nonzero(changes)
    return len(groups) >= LEAST_STEPS and speeds[-1] > LEAST_RANGE * speeds[0] and apart and bool(one_way)


def _are_levels(groups: Levels) -> bool:
    """Return whether groups are speed setpoints.

    Drift or scatter also causes groups, but these have one direction only, or no gaps between them.
    """
    paired = sum(len(group) for group in groups if len({stroke.direction for stroke in group}) == 2)
    if paired < PAIRED_SHARE * sum(map(len, groups)):
        return False
    speeds = [[stroke.pace_m_s for stroke in group] for group in groups]
    widths = [max(group) / min(group) - 1 for group in speeds]
    gaps = [min(upper) / max(lower) - 1 for lower, upper in pairwise(speeds)]
    return not gaps or float(np.median(gaps)) > max(APART * np.median(widths), LEAST_GAP)


# --- Signals of a foreign table: whether they move like a piston, or change with its direction.

FEWEST = 3  # least number of values for a guess
ONCE = 1.0  # added to the unevenness of a signal that moves in one direction only
HELD_SHARE = 0.9  # share of samples equal to the previous one: a held command, not a measured force
SAME_SIGNAL = 0.98  # least correlation of columns that may be one signal in two units
TAILS = 0.002  # fraction of the samples at either end that may be spikes
BINS = 20  # of the travel, in which both directions are compared
MOST_BINS = 0.75  # least share of them that agree on a direction


def is_held(values: Array) -> bool:
    """Return whether a column is constant from sample to sample, with occasional steps."""
    steps = np.diff(values[np.isfinite(values)])
    return bool(steps.size and steps.any() and (steps == 0).mean() > HELD_SHARE)


def same_signal(first: Array, second: Array) -> bool:
    """Return whether two columns are the same signal in different units: linearly related, except for rounding."""
    both = np.isfinite(first) & np.isfinite(second)
    first, second = first[both], second[both]
    if first.size < FEWEST or not np.ptp(first) or not np.ptp(second):
        return False
    if abs(np.corrcoef(first, second)[0, 1]) < SAME_SIGNAL:
        return False
    slope, intercept = np.polyfit(first, second, 1)
    rest = np.std(second - slope * first - intercept)
    return rest <= max(abs(slope) * resolution(first), resolution(second))


def resolution(values: Array) -> float:
    """Return the smallest difference between two different values; infinite if all values are equal."""
    return np.min(np.diff(np.unique(values)), initial=np.inf)


def unevenness(values: Array, *, is_one_of_many: bool) -> float:
    """Return the deviation of a signal from strokes at constant speed between turning points.

    The value is 1 for a triangle wave, and infinite without motion.
    """
    values = values[np.isfinite(values)]
    if values.size < FEWEST:
        return np.inf
    span = np.ptp(values)
    points = turning_points(values, 0.3 * span)
    if span == 0 or points.size < (2 if is_one_of_many else 3) or noise_level(values) > 0.02 * span:
        return np.inf
    once = ONCE if points.size < 3 else 0.0
    needed = np.abs(np.diff(values[points])).sum()
    middle = ((values > values.min() + 0.2 * span) & (values < values.min() + 0.8 * span)).mean()
    # An even stroke spends 60 % of its time in the middle 60 % of its travel. A switched signal spends almost no time
    # there.
    return np.abs(np.diff(values)).sum() / needed + 5 * abs(middle - 0.6) + once


@dataclass(frozen=True)
class Directions:
    """Samples at which the piston moves, towards +x and towards -x, and their position along the travel."""

    up: Bools
    down: Bools
    bins: Ints

    @classmethod
    def of(cls, position: Array) -> Directions:
        """Find the samples with motion, from the position alone."""
        good = np.isfinite(position)
        at = np.flatnonzero(good)
        velocity = np.zeros(position.size)
        bins = np.zeros(position.size, dtype=np.int64)
        if at.size >= FEWEST and np.ptp(position[good]) > 0:
            velocity[good] = local_slope(at.astype(float), position[good])
            low, high = np.quantile(position[good], (TAILS, 1.0 - TAILS))  # a spike does not widen the travel
            away = (position[good] - low) / ((high - low) or np.ptp(position[good]))
            bins[good] = np.clip((away * BINS).astype(np.int64), 0, BINS - 1)
        moving = np.abs(velocity)
        usual = np.median(moving[moving > 0]) if (moving > 0).any() else np.inf
        fast = moving > 0.5 * usual
        return cls(fast & (velocity > 0), fast & (velocity < 0), bins)

    def levels(self, values: Array) -> Pair | None:
        """Return the medians of a channel during motion in +x and in -x; None if a direction is missing."""
        there = np.isfinite(values)
        up, down = values[self.up & there], values[self.down & there]
        return (np.median(up), np.median(down)) if up.size and down.size else None

    def sign(self, values: Array) -> int:
        """Return 1 if a channel is larger in +x than in -x at equal positions, -1 if smaller, and 0 if unclear."""
        pairs = [self.levels(np.where(self.bins == number, values, np.nan)) for number in range(BINS)]
        larger = [np.sign(up - down) for up, down in filter(None, pairs)]
        needed = MOST_BINS * max(len(larger), FEWEST)
        return next((sign for sign in (1, -1) if larger.count(sign) >= needed), 0)

    def swing(self, values: Array) -> float:
        """Return the difference of a channel between the directions, relative to its magnitude; 0 if unclear."""
        levels = self.levels(values)
        if levels is None or self.sign(values) == 0:
            return 0.0
        return abs(levels[0] - levels[1]) / max(abs(levels[0]) + abs(levels[1]), 1e-300)
