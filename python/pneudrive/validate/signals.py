"""What a recording says of the motion beside its samples: velocity, acceleration, states to start a model from."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from pneudrive.signals.motion import noise_level

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from pneudrive.signals.drive_recording import DriveRecording

    Array = NDArray[np.float64]

#: Half of the time over which a polynomial is fitted for velocity and acceleration (assumed: a servo drive changes
#: its acceleration within more than this).
HALF_WINDOW_S = 8e-3
LEAST_HALF = 3
#: Samples on each side that a pressure is averaged over.
PRESSURE_HALF = 2
#: A speed below this many standard deviations of its noise is no motion.
MOVES = 4.0


@dataclass(frozen=True, eq=False)
class Signals:
    """A recording on an even time base, with derivatives.

    Attributes
    ----------
    recording : DriveRecording
    time_s, command, position_m, pressure_a_pa, pressure_b_pa : ndarray, shape (n,)
        On the even time base of `step_s`.
    """

    recording: DriveRecording
    step_s: float
    time_s: Array
    command: Array
    position_m: Array
    pressure_a_pa: Array
    pressure_b_pa: Array

    @classmethod
    def of(cls, recording: DriveRecording) -> Signals:
        """Bring a recording to an even time base; what is even already keeps its samples."""
        time = recording.time_s
        steps = np.diff(time)
        step = float(recording.duration_s / (time.size - 1))
        channels = ("position_m", "pressure_a_pa", "pressure_b_pa")
        if np.abs(steps - step).max() <= 1e-3 * step:
            return cls(recording, step, time, recording["command"], *(recording[c] for c in channels))
        step = float(np.median(steps))
        even: Array = np.arange(round(recording.duration_s / step) + 1, dtype=np.float64) * step
        held = recording["command"][np.searchsorted(time, even, side="right") - 1]
        x, a, b = (np.asarray(np.interp(even, time, recording[c]), dtype=np.float64) for c in channels)
        return cls(recording, step, even, held, x, a, b)

    @property
    def half(self) -> int:
        """Samples on each side over which derivatives are taken."""
        return max(LEAST_HALF, round(HALF_WINDOW_S / self.step_s))

    def smooth(self, values: Array) -> Array:
        """Values of local cubics, as velocity and acceleration are taken from; NaN stays NaN."""
        from scipy.signal import savgol_filter

        width = min(2 * self.half + 1, (values.size - 1) // 2 * 2 - 1)
        return np.asarray(savgol_filter(values, width, 3), dtype=np.float64)

    @cached_property
    def velocity_unsure_m_s(self) -> Array:
        """How much the velocity depends on the time over which it is taken: the change with half of it, per sample."""
        if "velocity_m_s" in self.recording:
            return np.zeros_like(self.position_m)
        return np.abs(self._derivative(1) - self._derivative(1, max(self.half // 2, LEAST_HALF - 1)))

    def _derivative(self, order: int, half: int | None = None) -> Array:
        from scipy.signal import savgol_filter

        width = min(2 * (half or self.half) + 1, (self.position_m.size - 1) // 2 * 2 - 1)
        return np.asarray(savgol_filter(self.position_m, width, 3, deriv=order, delta=self.step_s), dtype=np.float64)

    @cached_property
    def velocity_m_s(self) -> Array:
        """Velocity: measured where it is, else the slope of a local cubic."""
        if "velocity_m_s" in self.recording:
            measured = self.recording["velocity_m_s"]
            same = measured.size == self.time_s.size
            return measured if same else np.interp(self.time_s, self.recording.time_s, measured)
        return self._derivative(1)

    @cached_property
    def acceleration_m_s2(self) -> Array:
        """Acceleration from a local cubic of the position."""
        return self._derivative(2)

    @cached_property
    def velocity_noise_m_s(self) -> float:
        """Standard deviation of the noise of `velocity_m_s`, from that of the position."""
        from scipy.signal import savgol_coeffs

        if "velocity_m_s" in self.recording:
            return noise_level(self.velocity_m_s)
        weights = savgol_coeffs(2 * self.half + 1, 3, deriv=1, delta=self.step_s)
        return float(np.sqrt(weights @ weights)) * noise_level(self.position_m)

    @cached_property
    def moving(self) -> NDArray[np.bool_]:
        """Where the speed is beyond its noise."""
        return np.abs(self.velocity_m_s) > max(MOVES * self.velocity_noise_m_s, 1e-4)

    def state(self, i: int) -> tuple[float, float, float, float, float]:
        """Time, position, velocity, pressures of both chambers at sample `i`, with some noise averaged out."""
        around = slice(max(i - PRESSURE_HALF, 0), i + PRESSURE_HALF + 1)
        near = slice(max(i - self.half, 0), i + self.half + 1)
        t = self.time_s[near] - self.time_s[i]
        x = float(np.polyfit(t, self.position_m[near], min(2, t.size - 1))[-1])
        v = float(self.velocity_m_s[i]) if self.moving[i] else 0.0
        pressures = [
            float(np.polyfit(self.time_s[around] - self.time_s[i], p[around], 1)[-1])
            for p in (self.pressure_a_pa, self.pressure_b_pa)
        ]
        return (float(self.time_s[i]), x, v, pressures[0], pressures[1])
