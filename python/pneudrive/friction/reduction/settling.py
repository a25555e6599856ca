"""Selection of the samples of a stroke: a settling criterion, or the source paper's protocol."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from pneudrive.friction.reduction.motion import SampleChoice as SampleChoice
from pneudrive.friction.reduction.pairing import bin_means
from pneudrive.signals.levels import speed_levels
from pneudrive.signals.motion import straight_line

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from pneudrive.friction.reduction.motion import RecordedMotion
    from pneudrive.signals.motion import Stroke

LEVEL_BINS = 40  # bins over the travel for the balance of one direction
END_TRAVELS = 2.0  # of the way from the stroke's end at which its speed falls below the share: excluded
LEAST_SWING = 0.5  # of its median: limit of the variation of friction over position


@dataclass(frozen=True)
class Settled:
    """Selection of the samples after the transient of the reversal, for motions with or without a controlled speed.

    A stroke has to settle in two ways, and the longer distance counts. First, its speed must reach ``speed_share`` of
    its
    middle speed. ``speed_travels`` times the travel to that point is left out. Second, the balance must complete the
    fraction ``force_share`` of its change from the level of the opposite direction. ``force_travels`` times that travel
    is left
    out.
    In presliding the force approaches its final value like 1 - 2 exp(-x/l). The distance 1.6 l gives 80 % of the
    change; after three times this distance, 2 % are left.
    A higher fraction would depend on friction that varies over position.
    At the end, twice the distance in which the axis brakes below the speed fraction is dropped.
    The whole change is the difference of both directions, as a straight line over the middle 60 % of the travel.
    Neither speed nor
    force needs to be constant. The change is computed for the speed class of the stroke, because slow strokes never
    reach the friction of fast ones. It is limited to the change computed from all strokes, because the friction of fast
    strokes may still grow along the stroke.
    """

    speed_share: float = 0.8
    force_share: float = 0.8
    speed_travels: float = 2.0
    force_travels: float = 3.0
    name: str = "settled"
    uses_window: bool = True

    def choose(self, motion: RecordedMotion) -> tuple[NDArray[np.bool_], NDArray[np.float64]]:
        """Return the mask of settled samples and the unchanged balance."""
        position_m, balance_n = motion.position_m, motion.balance_n
        velocity = motion.velocity_m_s
        levels = _levels_of_strokes(motion)
        mask = np.zeros(position_m.size, dtype=bool)
        for stroke in motion.strokes:
            part = stroke.samples
            travelled = np.abs(position_m[part] - stroke.from_m)
            fast = np.abs(velocity[part]) >= self.speed_share * abs(stroke.speed_m_s)
            if not fast.any():
                continue
            begin = self.speed_travels * travelled[int(np.argmax(fast))]
            level = levels.get(stroke.index)
            if level is not None:
                risen = level.share_risen(position_m[part], balance_n[part], stroke.direction) >= self.force_share
                if risen.any():
                    begin = max(begin, self.force_travels * travelled[int(np.argmax(risen))])
            ahead = np.abs(stroke.to_m - position_m[part])
            braking = END_TRAVELS * ahead[np.flatnonzero(fast)[-1]]
            mask[part] = (travelled >= begin) & (ahead > braking)
        return mask, balance_n


@dataclass(frozen=True)
class SourcePaper:
    """The source paper's protocol: first 5 % dropped, moving average of 5 samples, mean of the rest.

    The moving average hardly changes the mean. This protocol is available for comparison with published numbers.
    Dropping 5 % is
    not enough if the distance to reach speed is longer.
    """

    dropped_share: float = 0.05
    average_samples: int = 5
    name: str = "source-paper"
    uses_window: bool = False

    def choose(self, motion: RecordedMotion) -> tuple[NDArray[np.bool_], NDArray[np.float64]]:
        """Return the mask of samples after the first 5 % of each stroke's time and the smoothed balance."""
        mask = np.zeros(motion.time_s.size, dtype=bool)
        smooth = motion.balance_n.copy()
        for stroke in motion.strokes:
            time = motion.time_s[stroke.samples]
            # By time, so that a burst after the reversal does not count more.
            mask[stroke.samples] = time >= time[0] + self.dropped_share * (time[-1] - time[0])
            smooth[stroke.samples] = moving_average(motion.balance_n[stroke.samples], self.average_samples)
        return mask, smooth


def moving_average(values: NDArray[np.float64], count: int) -> NDArray[np.float64]:
    """Return the centred mean of ``count`` samples, of fewer at the ends; same shape."""
    kernel = np.ones(count)
    return np.convolve(values, kernel, "same") / np.convolve(np.ones(values.size), kernel, "same")


SAMPLE_CHOICES = {"settled": Settled, "source-paper": SourcePaper}


@dataclass(frozen=True, eq=False)
class _Levels:
    """Mean balance of each direction over position, and the swing from -x to +x as a line over position."""

    position_m: dict[int, NDArray[np.float64]]
    balance_n: dict[int, NDArray[np.float64]]
    swing_n: float  # median in the middle of the travel
    slope_n_m: float
    intercept_n: float

    def share_risen(
        self, position_m: NDArray[np.float64], balance_n: NDArray[np.float64], direction: int
    ) -> NDArray[np.float64]:
        """Return the progress of the balance from the level of the opposite direction, 0 to 1, with noise."""
        start = np.interp(position_m, self.position_m[-direction], self.balance_n[-direction])
        line = (self.slope_n_m * position_m + self.intercept_n) / self.swing_n
        return direction * (balance_n - start) / (self.swing_n * np.clip(line, LEAST_SWING, 1 / LEAST_SWING))


def _levels_of_strokes(motion: RecordedMotion) -> dict[int, _Levels | None]:
    """Return for each stroke the levels of its speed class, or those of all strokes if their swing is smaller.

    A direction without strokes in the class has the level of all strokes.
    """
    strokes = motion.strokes
    whole, classes = _levels(motion, strokes), speed_levels(list(strokes))
    if whole is None or len(classes) == 1:
        return {s.index: whole for s in strokes}
    found: dict[int, _Levels | None] = {}
    for members in classes:
        ways = {s.direction for s in members}
        own = _levels(motion, [*members, *(s for s in strokes if s.direction not in ways)])
        slow = own is not None and abs(own.swing_n) < abs(whole.swing_n)
        found |= {s.index: own if slow else whole for s in members}
    return found


def _levels(motion: RecordedMotion, strokes: Sequence[Stroke]) -> _Levels | None:
    """Return the levels of both directions; None if one is missing, or they do not differ."""
    ends = [value for stroke in motion.strokes for value in (stroke.from_m, stroke.to_m)]
    low, high = min(ends), max(ends)
    edges = np.linspace(low, high, LEVEL_BINS + 1)
    centres = (edges[:-1] + edges[1:]) / 2
    position, balance, means = {}, {}, {}
    for direction in (1, -1):
        parts = [stroke.samples for stroke in strokes if stroke.direction == direction]
        if not parts:
            return None
        means[direction] = bin_means(motion.position_m, motion.balance_n, edges, parts)
        known = np.isfinite(means[direction])
        position[direction], balance[direction] = centres[known], means[direction][known]
    inside = (centres > low + 0.2 * (high - low)) & (centres < high - 0.2 * (high - low))
    swings = means[1] - means[-1]
    inside &= np.isfinite(swings)
    swing = float(np.median(swings[inside])) if inside.any() else 0.0
    if swing == 0.0:
        return None
    return _Levels(position, balance, swing, *straight_line(centres[inside], swings[inside]))
