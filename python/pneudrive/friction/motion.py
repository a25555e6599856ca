"""The motion of a recording, made once: strokes, force balance, and the samples that count.

A sample counts if its stroke has settled (`Settled`), or by the source paper's protocol (`SourcePaper`).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Protocol

import numpy as np

from pneudrive.friction.bins import bin_means
from pneudrive.signals.motion import find_strokes, local_slope, speed_levels, straight_line
from pneudrive.signals.recording import refuse_impossible

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from pneudrive.signals.motion import Stroke
    from pneudrive.signals.pressure_delay import PressureDelay
    from pneudrive.signals.recording import Recording

    Array = NDArray[np.float64]

CLOCK_S = 0.015  # standard uncertainty of a delay between loggers, with parallel forces (assumed)
SWING_BINS = 40  # bins over the travel for the balance of one direction
END_TRAVELS = 2.0  # of the way from the stroke's end at which its speed falls below the share: excluded
LEAST_SWING = 0.5  # of its median: limit of the variation of friction over position


class SampleChoice(Protocol):
    """A rule that selects, and may smooth, the samples of a stroke for its mean."""

    @property
    def name(self) -> str:
        """Name for provenance."""
        ...

    @property
    def uses_window(self) -> bool:
        """Whether the mean is taken over bins of equal position in the window.

        Otherwise it is taken over all chosen samples.
        """
        ...

    def choose(self, motion: RecordedMotion) -> tuple[NDArray[np.bool_], Array]:
        """Return the mask of chosen samples, shape (n,), and the balance to average, shape (n,)."""
        ...


@dataclass(frozen=True, eq=False, repr=False)
class RecordedMotion:
    """A cleaned recording with its strokes, its force balance and its settled samples.

    Attributes
    ----------
    recording : Recording
        Cleaned, with its counts of flags.
    strokes : tuple of Stroke
    raw_balance_n : ndarray, shape (n,)
        Force balance (see `Recording.balance_n`).
    balance_n : ndarray, shape (n,)
        Force balance to average: smoothed if the choice of samples does so.
    settled : ndarray of bool, shape (n,)
        Samples that count.
    delay : PressureDelay or None
        Delay of the pressures that closed chambers show. A clear one is removed from the recording.
    """

    recording: Recording
    strokes: tuple[Stroke, ...]
    raw_balance_n: Array
    balance_n: Array
    settled: NDArray[np.bool_]
    delay: PressureDelay | None

    @classmethod
    def of(
        cls, recording: Recording, choice: SampleChoice, *, inertia: bool = True, delay: PressureDelay | None = None
    ) -> RecordedMotion:
        """Find strokes, balance and settled samples of a cleaned recording.

        Parameters
        ----------
        recording : Recording
        choice : SampleChoice
        inertia : bool
            Whether inertia of the mass beyond the sensor is subtracted.
        delay : PressureDelay, optional

        Raises
        ------
        RecordingError
            Without motion, with too few samples, or with impossible values.
        """
        strokes = find_strokes(recording.name, recording.time_s, recording.position_m)
        refuse_impossible(recording, strokes)
        balance, every = balance_of(recording, inertia=inertia), np.ones(len(recording), dtype=bool)
        motion = cls(recording, tuple(strokes), balance, balance, every, delay)
        settled, chosen = choice.choose(motion)
        return replace(motion, balance_n=chosen, settled=settled)

    @property
    def time_s(self) -> Array:
        """Times, s."""
        return self.recording.time_s

    @property
    def position_m(self) -> Array:
        """Positions, m."""
        return self.recording.position_m

    @property
    def late_s(self) -> float:
        """Standard uncertainty of the times of the pressures: a delay that is not removed, or the rest of one."""
        clock = CLOCK_S if self.recording.parallel else 0.0
        if self.delay is None:
            return clock
        left = 0.0 if self.delay.is_clear else abs(self.delay.value_s)
        return max(clock, max(left, self.delay.half_width_s) / 2.0)

    @cached_property
    def velocity_m_s(self) -> Array:
        """Slope of the position over a few samples."""
        return local_slope(self.time_s, self.position_m)


def balance_of(recording: Recording, *, inertia: bool = True) -> Array:
    """Return the force balance of each sample, N, optionally without the inertia of the mass beyond the sensor."""
    acceleration: Array | float = 0.0
    if inertia and recording.mass_beyond_sensor_kg:
        acceleration = local_slope(recording.time_s, local_slope(recording.time_s, recording.position_m))
    return recording.balance_n(acceleration)


@dataclass(frozen=True)
class Settled:
    """Selection of the samples after the transient of the reversal, for motions with or without a controlled speed.

    A stroke has to settle in two ways, and the longer distance counts. First, its speed must reach ``speed_share`` of
    its middle speed. ``speed_travels`` times the travel to that point is left out. Second, the balance must complete
    the fraction ``force_share`` of its change from the level of the opposite direction. ``force_travels`` times that
    travel is left out.
    In presliding the force approaches its final value like 1 - 2 exp(-x/l). The distance 1.6 l gives 80 % of the
    change; after three times this distance, 2 % are left.
    A higher fraction would depend on friction that varies over position.
    At the end, twice the distance in which the axis brakes below the speed fraction is dropped.
    The whole change is the `Swing` of the stroke's speed class, because slow strokes never reach the friction of fast
    ones. It is limited to the swing of all strokes, because the friction of fast strokes may still grow along the
    stroke. Neither speed nor force needs to be constant.
    """

    speed_share: float = 0.8
    force_share: float = 0.8
    speed_travels: float = 2.0
    force_travels: float = 3.0
    name: str = "settled"
    uses_window: bool = True

    def choose(self, motion: RecordedMotion) -> tuple[NDArray[np.bool_], Array]:
        """Return the mask of settled samples and the unchanged balance."""
        position_m, balance_n, swings = motion.position_m, motion.balance_n, _swings(motion)
        mask = np.zeros(position_m.size, dtype=bool)
        for stroke in motion.strokes:
            part = stroke.samples
            travelled = np.abs(position_m[part] - stroke.from_m)
            fast = np.abs(motion.velocity_m_s[part]) >= self.speed_share * abs(stroke.speed_m_s)
            if not fast.any():
                continue
            begin = self.speed_travels * travelled[int(np.argmax(fast))]
            swing = swings[stroke.index]
            if swing is not None:
                risen = swing.share_risen(position_m[part], balance_n[part], stroke.direction) >= self.force_share
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
    Dropping 5 % is not enough if the distance to reach speed is longer.
    """

    dropped_share: float = 0.05
    average_samples: int = 5
    name: str = "source-paper"
    uses_window: bool = False

    def choose(self, motion: RecordedMotion) -> tuple[NDArray[np.bool_], Array]:
        """Return the mask of samples after the first 5 % of each stroke's time and the smoothed balance."""
        mask = np.zeros(motion.time_s.size, dtype=bool)
        smooth = motion.balance_n.copy()
        for stroke in motion.strokes:
            time = motion.time_s[stroke.samples]
            # By time, so that a burst after the reversal does not count more.
            mask[stroke.samples] = time >= time[0] + self.dropped_share * (time[-1] - time[0])
            smooth[stroke.samples] = moving_average(motion.balance_n[stroke.samples], self.average_samples)
        return mask, smooth


SAMPLE_CHOICES = {"settled": Settled, "source-paper": SourcePaper}


def moving_average(values: Array, count: int) -> Array:
    """Return the centred mean of ``count`` samples, of fewer at the ends; same shape."""
    kernel = np.ones(count)
    return np.convolve(values, kernel, "same") / np.convolve(np.ones(values.size), kernel, "same")


@dataclass(frozen=True, eq=False)
class Swing:
    """Mean balance of each direction over position, and the change from -x to +x as a line over position."""

    position_m: Array
    balance_n: dict[int, Array]
    middle_n: float  # median in the middle 60 % of the travel
    slope_n_m: float
    intercept_n: float

    @classmethod
    def of(cls, motion: RecordedMotion, strokes: Sequence[Stroke]) -> Swing | None:
        """Return the swing of some strokes over the travel of all; None if a direction is missing, or no change."""
        ends = [value for stroke in motion.strokes for value in (stroke.from_m, stroke.to_m)]
        low, high = min(ends), max(ends)
        edges = np.linspace(low, high, SWING_BINS + 1)
        centres = (edges[:-1] + edges[1:]) / 2
        parts = {way: [s.samples for s in strokes if s.direction == way] for way in (1, -1)}
        if not all(parts.values()):
            return None
        means = {way: bin_means(motion.position_m, motion.balance_n, edges, some) for way, some in parts.items()}
        swings, margin = means[1] - means[-1], 0.2 * (high - low)
        inside = (centres > low + margin) & (centres < high - margin) & np.isfinite(swings)
        middle = float(np.median(swings[inside])) if inside.any() else 0.0
        return cls(centres, means, middle, *straight_line(centres[inside], swings[inside])) if middle else None

    def share_risen(self, position_m: Array, balance_n: Array, direction: int) -> Array:
        """Return the progress of the balance from the level of the opposite direction, 0 to 1, with noise."""
        before = self.balance_n[-direction]
        known = np.isfinite(before)
        start = np.interp(position_m, self.position_m[known], before[known])
        line = (self.slope_n_m * position_m + self.intercept_n) / self.middle_n
        return direction * (balance_n - start) / (self.middle_n * np.clip(line, LEAST_SWING, 1 / LEAST_SWING))


def _swings(motion: RecordedMotion) -> dict[int, Swing | None]:
    """Return for each stroke the swing of its speed class, or that of all strokes if it is smaller.

    A direction without strokes in the class has those of all strokes.
    """
    strokes = motion.strokes
    whole, classes = Swing.of(motion, strokes), speed_levels(list(strokes))
    swings = {stroke.index: whole for stroke in strokes}
    if whole is None or len(classes) == 1:
        return swings
    for members in classes:
        ways = {stroke.direction for stroke in members}
        swing = Swing.of(motion, [*members, *(s for s in strokes if s.direction not in ways)])
        if swing is not None and abs(swing.middle_n) < abs(whole.middle_n):
            swings |= {stroke.index: swing for stroke in members}
    return swings
