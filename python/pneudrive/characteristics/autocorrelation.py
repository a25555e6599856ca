"""Standard error of a mean whose values know their neighbours."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

#: Values beyond which the autocorrelation is taken from means of neighbours: lags in between are then not needed.
MOST_VALUES = 400


def stderr_of_mean(values: NDArray[np.float64]) -> float:
    """Estimate the standard error of the mean of a series, shape (n,), in the order of time or position.

    The autocorrelation is summed until it first falls below zero. As the mean itself was taken out of the series,
    its power is too small by the same sum, which is put right.

    Returns
    -------
    float
        0 where fewer than four values are given, or all are equal.
    """
    series = np.asarray(values, dtype=float)
    series = series[np.isfinite(series)]
    if series.size > MOST_VALUES:  # means of neighbours keep what matters: the slow part
        each = series.size // MOST_VALUES
        series = series[: each * (series.size // each)].reshape(-1, each).mean(axis=1)
    n = series.size
    away = series - series.mean()
    power = float(away @ away)
    if n < 4 or power == 0.0:
        return 0.0
    spectrum = np.fft.rfft(away, 2 * n)
    correlation = np.fft.irfft(np.abs(spectrum) ** 2)[: n // 2] / power
    first = np.flatnonzero(correlation <= 0.0)
    reach = int(first[0]) if first.size else n // 2
    lags = np.arange(1, reach)
    factor = 1.0 + 2.0 * float(np.sum(correlation[1:reach] * (1.0 - lags / n)))
    factor = min(factor, n / 3.0)
    return float(np.sqrt(power / (n - factor) * factor / n))
