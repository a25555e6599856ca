"""Standard error of the mean of autocorrelated values."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

#: Number of values above which the autocorrelation is computed from means of neighbours, with fewer lags.
MOST_VALUES = 400


def stderr_of_mean(values: NDArray[np.float64]) -> float:
    """Estimate the standard error of the mean of a series, shape (n,), in the order of time or position.

    The autocorrelation is summed until it first falls below zero. Subtracting the mean of the series makes its variance
    too small by the same sum, which is corrected.

    Returns
    -------
    float
        Standard error; 0 for fewer than four values, or equal values.
    """
    series = np.asarray(values, dtype=float)
    return float(stderrs_of_means(series[np.isfinite(series)][None, :])[0])


def stderrs_of_means(rows: NDArray[np.float64]) -> NDArray[np.float64]:
    """Estimate `stderr_of_mean` for many series of one length, shape (m, n), all finite."""
    if rows.shape[1] > MOST_VALUES:  # means of neighbours keep the slow part, which dominates
        each = rows.shape[1] // MOST_VALUES
        count = rows.shape[1] // each
        rows = rows[:, : each * count].reshape(-1, count, each).mean(axis=2)
    n = rows.shape[1]
    if n < 4:
        return np.zeros(rows.shape[0])
    away = rows - rows.mean(axis=1)[:, None]
    power = np.array([row @ row for row in away])
    moves = power > 0.0
    away, power = away[moves], power[moves]
    spectrum = np.fft.rfft(away, 2 * n, axis=1)
    correlation = np.fft.irfft(np.abs(spectrum) ** 2, axis=1)[:, : n // 2] / power[:, None]
    below = correlation <= 0.0
    reach = np.where(below.any(axis=1), below.argmax(axis=1), n // 2).tolist()
    share = 1.0 - np.arange(1, n) / n
    sums = [np.sum(row[1:end] * share[: end - 1]) for row, end in zip(correlation, reach, strict=True)]
    factor = np.minimum(1.0 + 2.0 * np.array(sums), n / 3.0)
    found = np.zeros(rows.shape[0])
    found[moves] = np.sqrt(power / (n - factor) * factor / n)
    return found
