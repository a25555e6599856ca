"""Motion of a recording: strokes, force balance and settled samples, computed once for all later steps."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Protocol

import numpy as np

from pneudrive.friction.reduction.budget import CLOCK_S
from pneudrive.signals.impossible import refuse_impossible
from pneudrive.signals.motion import find_strokes, local_slope

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from pneudrive.signals.motion import Stroke
    from pneudrive.signals.pressure_delay import PressureDelay
    from pneudrive.signals.recording import Recording

    Array = NDArray[np.float64]


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


@dataclass(frozen=True, eq=False)
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
        cls,
        recording: Recording,
        choice: SampleChoice,
        *,
        inertia: bool = True,
        delay: PressureDelay | None = None,
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


def mean_speed(recording: Recording, index: NDArray[np.intp], otherwise: float) -> float:
    """Return the mean speed between the first and the last of some samples."""
    time = recording.time_s[index[-1]] - recording.time_s[index[0]]
    way = recording.position_m[index[-1]] - recording.position_m[index[0]]
    return float(way / time) if time > 0 else otherwise
