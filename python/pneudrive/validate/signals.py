"""Signals derived from a recording: velocity, acceleration, start states of a model."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.signal import savgol_coeffs, savgol_filter

from pneudrive.errors import FitError
from pneudrive.identify.dynamic.sensors import CHANNELS, Sensor, channels_of, command_delay
from pneudrive.numbers import plain
from pneudrive.signals.motion import noise_level
from pneudrive.units import readable

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

    from pneudrive.describe.drive import Drive
    from pneudrive.signals.drive_recording import DriveRecording

    Array = NDArray[np.float64]


#: Half of the window of the polynomial for velocity and acceleration, s (assumed: shorter than a servo drive needs to
#: change its acceleration).
HALF_WINDOW_S = 8e-3
LEAST_HALF = 3
#: Samples on each side over which a pressure is averaged.
PRESSURE_HALF = 2
#: Standard deviations of its noise above which a speed counts as motion.
MOVES = 4.0


@dataclass(frozen=True, eq=False)
class Signals:
    """Recording on a uniform time base, with derivatives.

    Attributes
    ----------
    recording : DriveRecording
    time_s, command, position_m, pressure_a_pa, pressure_b_pa : ndarray, shape (n,)
        Values on the uniform time base with `step_s`.
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
        """Resample a recording to a uniform time base; a uniform one keeps its samples."""
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
        """Number of samples on each side in the window of derivatives."""
        return max(LEAST_HALF, round(HALF_WINDOW_S / self.step_s))

    def smooth(self, values: Array) -> Array:
        """Return the values of the local cubics that also give velocity and acceleration; NaN stays NaN."""
        width = min(2 * self.half + 1, (values.size - 1) // 2 * 2 - 1)
        return np.asarray(savgol_filter(values, width, 3), dtype=np.float64)

    @cached_property
    def velocity_unsure_m_s(self) -> Array:
        """Uncertainty of the velocity from its window, for each sample: the change if the window is halved."""
        if "velocity_m_s" in self.recording:
            return np.zeros_like(self.position_m)
        return np.abs(self._derivative(1) - self._derivative(1, max(self.half // 2, LEAST_HALF - 1)))

    def _derivative(self, order: int, half: int | None = None) -> Array:
        width = min(2 * (half or self.half) + 1, (self.position_m.size - 1) // 2 * 2 - 1)
        return np.asarray(savgol_filter(self.position_m, width, 3, deriv=order, delta=self.step_s), dtype=np.float64)

    @cached_property
    def velocity_m_s(self) -> Array:
        """Velocity: the measured one, or the slope of a local cubic."""
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
        if "velocity_m_s" in self.recording:
            return noise_level(self.velocity_m_s)
        weights = savgol_coeffs(2 * self.half + 1, 3, deriv=1, delta=self.step_s)
        return float(np.sqrt(weights @ weights)) * noise_level(self.position_m)

    @property
    def direction(self) -> Array:
        """Sign of the velocity, 0 at rest."""
        return np.where(self.moving, np.sign(self.velocity_m_s), 0.0)

    @cached_property
    def moving(self) -> NDArray[np.bool_]:
        """Mask of samples with a speed beyond its noise."""
        return np.abs(self.velocity_m_s) > max(MOVES * self.velocity_noise_m_s, 1e-4)

    def start_temperatures(self, drive: Drive) -> list[float]:
        """Return the measured temperatures at the first sample, or the ambient one, K."""
        names = ("temperature_a_k", "temperature_b_k")
        return [float(self.recording[n][0]) if n in self.recording else drive.ambient.temperature_k for n in names]

    def state(self, i: int) -> tuple[float, float, float, float, float]:
        """Return time, position, velocity and both pressures at sample `i`, smoothed."""
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


# --- Correction of a recording for known errors of its sensors, before it is compared with a model.


def corrected(
    recording: DriveRecording, sensors: Mapping[str, Sensor | Mapping[str, Any]] | None
) -> tuple[DriveRecording, list[str]]:
    """Correct a recording for offsets, gains and the delay of the command; return it with a note.

    Parameters
    ----------
    recording : DriveRecording
    sensors : mapping or None
        Channel -> `Sensor` or its keywords, as of `identify`; offset, gain and lag are numbers here.

    Raises
    ------
    FitError
        The recording lacks a channel, or a number is free.
    """
    if not sensors:
        return recording, []
    delay = command_delay(sensors)
    present = [name for name, column in CHANNELS.items() if column in recording]
    columns, said = dict(recording.columns), []
    if delay.free or any(channel.free for channel in channels_of(present, sensors)):
        raise FitError("validate fits no numbers", remedy="Fit free numbers by identify, and pass its fit to validate.")
    for channel in channels_of(present, sensors):
        if channel.offset != 0.0 or channel.gain != 1.0:
            columns[channel.column] = (columns[channel.column] - channel.offset) / channel.gain
            factor, unit = readable(channel.unit)
            gain = f", gain {plain(channel.gain, 5)}" if channel.gain != 1.0 else ""
            said.append(f"{channel.name} offset {plain(channel.offset / factor)} {unit}{gain}")
        if channel.lag > 0.0:
            said.append(f"{channel.name} lag of {plain(1e3 * channel.lag)} ms, which is not corrected")
    if delay.value_s != 0.0:
        time, command = recording.time_s, recording["command"]
        held = np.searchsorted(time, time - delay.value_s + 1e-9 * recording.duration_s, side="right") - 1
        columns["command"] = command[np.clip(held, 0, time.size - 1)]
        said.append(f"command that acts {plain(1e3 * delay.value_s)} ms late")
    if not said:
        return recording, []
    note = f"{recording.name}: corrected for known errors of its sensors: {'; '.join(said)}"
    return replace(recording, columns=columns), [note]
