"""Models of the sensors of a simulated rig, from the true signal to the recorded one."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from pneudrive.errors import DescriptionError
from pneudrive.rig.motion import uniform_in_position

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from pneudrive.rig.motion import Motion

    Array = NDArray[np.float64]


@dataclass(frozen=True)
class AnalogSensor:
    """Sensor with an amplifier and a converter: zero, gain, white noise, range, resolution.

    Parameters
    ----------
    low, high : float
        Range in the unit of the signal; signals outside saturate.
    bits : int
        Resolution of the converter over the range.
    noise : float
        Standard deviation of the white noise of one sample.
    zero : float
        Reading at zero, added to every sample.
    gain_error : float
        Relative error of the gain.
    hysteresis : float
        Error with the sign of the signal, at full size for signals above 1 % of the range.
    """

    low: float
    high: float
    bits: int
    noise: float
    zero: float = 0.0
    gain_error: float = 0.0
    hysteresis: float = 0.0

    def __post_init__(self) -> None:
        """Check range, resolution, noise and errors."""
        if not (np.isfinite([self.low, self.high]).all() and self.low < self.high):
            raise DescriptionError(f"a sensor range goes from a lower to a higher value, got {self.low} .. {self.high}")
        if not 4 <= self.bits <= 32:
            raise DescriptionError(f"a converter has 4 to 32 bits, got {self.bits}")
        if not (np.isfinite(self.noise) and self.noise >= 0.0):
            raise DescriptionError(f"noise is a standard deviation and not negative, got {self.noise}")
        if not np.isfinite([self.zero, self.gain_error, self.hysteresis]).all():
            raise DescriptionError(
                f"errors of a sensor are finite, got {self.zero}, {self.gain_error}, {self.hysteresis}"
            )

    @property
    def step(self) -> float:
        """Smallest step of the converter."""
        return (self.high - self.low) / (2**self.bits - 1)

    def read(self, signal: Array, rng: np.random.Generator | None, drift: float | Array = 0.0) -> Array:
        """Return the recorded samples of `signal`, same shape and unit.

        Parameters
        ----------
        signal : ndarray
        rng : numpy.random.Generator or None
            Generator of the noise; None: a mean of many samples, without noise.
        drift : float or ndarray
            Drift of the zero.
        """
        seen = (1.0 + self.gain_error) * signal + (self.zero + drift)
        if self.hysteresis:
            seen = seen + self.hysteresis * np.clip(signal / (0.01 * (self.high - self.low)), -1.0, 1.0)
        if rng is not None and self.noise > 0.0:
            seen = seen + self.noise * rng.standard_normal(np.shape(signal))
        steps = np.rint((np.clip(seen, self.low, self.high) - self.low) / self.step)
        return self.low + self.step * steps


@dataclass(frozen=True)
class TimeClock:
    """Sample clock uniform in time, with the same number of samples for a cycle at any speed.

    Parameters
    ----------
    samples_per_cycle : int
    """

    samples_per_cycle: int

    def times(self, motion: Motion, count: int) -> Array:
        """Return the sample times over `count` cycles, s, shape (count * samples_per_cycle,)."""
        return np.linspace(0.0, motion.duration_s, count * self.samples_per_cycle)


@dataclass(frozen=True)
class EncoderClock:
    """Sample clock triggered by the encoder at equal steps of position; no samples while the carriage is at rest.

    Parameters
    ----------
    samples_per_cycle : int
    """

    samples_per_cycle: int

    def times(self, motion: Motion, count: int) -> Array:
        """Return the sample times over `count` cycles, s, shape (count * samples_per_cycle,)."""
        return uniform_in_position(motion, count * self.samples_per_cycle)


#: Names of the clocks in a rig file.
CLOCKS = {"time": TimeClock, "encoder": EncoderClock}


@dataclass(frozen=True)
class Encoder:
    """Incremental encoder.

    Parameters
    ----------
    resolution_m : float
        Distance between two counts.
    """

    resolution_m: float

    def __post_init__(self) -> None:
        """Check that the resolution is positive."""
        if not (np.isfinite(self.resolution_m) and self.resolution_m > 0.0):
            raise DescriptionError(f"an encoder resolution is positive, got {self.resolution_m} m")

    def read(self, position_m: Array) -> Array:
        """Return the counted position: the last full count."""
        return np.floor(position_m / self.resolution_m) * self.resolution_m
