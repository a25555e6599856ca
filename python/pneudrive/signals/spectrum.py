"""Spectrum of samples: the content of a signal at each frequency."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pneudrive.errors import RecordingError

if TYPE_CHECKING:
    from pneudrive.arrays import Array

LEAST_SAMPLES, SEGMENT = 32, 1 << 14
UNEVEN = 0.01  # largest deviation of a step of time from the median one, as a share


def amplitude_density(time_s: Array, values: Array) -> tuple[Array, Array]:
    """Return frequencies and the one-sided amplitude density by Welch's method (`scipy.signal.welch`, Hann windows).

    The mean of each segment is subtracted. Segments of at most 16384 samples overlap by half.

    Parameters
    ----------
    time_s, values : ndarray, shape (n,)
        At least 32 samples, evenly spaced to 1 %.

    Returns
    -------
    frequency_hz, density : ndarray
        Frequency, Hz, and density, unit of the values per root Hz. The integral of the squared density over frequency
        is the variance.

    Raises
    ------
    RecordingError
        There are too few samples, their times are uneven, or a value is missing.
    """
    from scipy.signal import welch

    if len(time_s) < LEAST_SAMPLES:
        raise RecordingError(f"{len(time_s)} samples are too few for a spectrum", rule=f"at least {LEAST_SAMPLES}")
    steps = np.diff(time_s)
    step = float(np.median(steps))
    if not step > 0.0 or np.abs(steps - step).max() > UNEVEN * step:
        raise RecordingError("the samples are not evenly spaced in time", rule="steps must be equal within 1 %")
    if not np.isfinite(values).all():
        raise RecordingError("a value is missing", remedy="Choose a part without gaps.")
    frequency, power = welch(np.asarray(values, float), 1.0 / step, nperseg=min(SEGMENT, len(values)))
    return frequency[1:], np.sqrt(power[1:])
