"""Metrics of the residual between measurement and model, and tests whether it is noise.

The residual is measurement minus model. Bounds of correlations are valid for white residuals. The residual of a wrong
model's free run is never white, and the test shows this. Sources of the tests: [ljung1978], [mathworks-residuals].
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from pneudrive.estimate.estimates import NORMAL_95

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    from numpy.typing import NDArray

    from pneudrive.describe.drive import Drive

    Array = NDArray[np.float64]


LAGS = 25


@dataclass(frozen=True)
class Metrics:
    """Metrics of the residual of one channel.

    Attributes
    ----------
    rms : float
        Root mean square, SI.
    largest : float
        Greatest absolute residual, SI.
    nrmse : float
        rms / (max - min of the measurement).
    fit_percent : float
        100 (1 - ||e|| / ||y - mean y||); negative if the mean would fit better.
    samples : int
    """

    rms: float
    largest: float
    nrmse: float
    fit_percent: float
    samples: int


@dataclass(frozen=True, eq=False)
class Whiteness:
    """Test of a residual for whiteness.

    Attributes
    ----------
    autocorrelation : ndarray, shape (LAGS,)
        Values at lags 1 to LAGS.
    bound : float
        1.96 / sqrt(N): 95 % of the values of white noise are within it.
    outside : float
        Share of the lags beyond the bound.
    ljung_box, p : float
        Statistic of Ljung and Box over all lags, and its p-value for white noise.
    """

    autocorrelation: Array
    bound: float
    outside: float
    ljung_box: float
    p: float


@dataclass(frozen=True)
class CrossCorrelation:
    """Strongest correlation of a residual with a signal within +/- LAGS samples; `lag_s` > 0: the residual is later."""

    signal: str
    value: float
    lag_s: float
    bound: float


def metrics(measured: Array, model: Array) -> Metrics:
    """Return the metrics of a model against a measurement; samples where the model is NaN are left out.

    Examples
    --------
    >>> found = metrics(np.array([0.0, 1.0, 2.0]), np.array([0.0, 1.0, 2.2]))
    >>> round(found.nrmse, 4), round(found.fit_percent, 2)
    (0.0577, 85.86)
    """
    there = np.isfinite(model)
    y, e = measured[there], (measured - model)[there]
    if not e.size:
        return Metrics(np.nan, np.nan, np.nan, np.nan, 0)
    rms = float(np.sqrt(np.mean(e * e)))
    span, spread = float(np.ptp(y)), float(np.linalg.norm(y - y.mean()))
    return Metrics(
        rms=rms,
        largest=float(np.abs(e).max()),
        nrmse=rms / span if span > 0.0 else np.nan,
        fit_percent=100.0 * (1.0 - float(np.linalg.norm(e)) / spread) if spread > 0.0 else np.nan,
        samples=int(e.size),
    )


def whiteness(residual: Array) -> Whiteness:
    """Test a residual for whiteness with its first LAGS autocorrelations."""
    from scipy.stats import chi2

    e = residual[np.isfinite(residual)]
    e = e - e.mean() if e.size else e
    n, power = e.size, float(e @ e)
    lags = np.arange(1, min(LAGS, n - 1) + 1)
    if power == 0.0 or lags.size < 1:
        return Whiteness(np.zeros(lags.size), np.nan, 0.0, 0.0, 1.0)
    r = np.array([float(e[k:] @ e[:-k]) / power for k in lags])
    bound = NORMAL_95 / np.sqrt(n)
    statistic = float(n * (n + 2) * np.sum(r * r / (n - lags)))
    outside = float(np.mean(np.abs(r) > bound))
    return Whiteness(r, bound, outside, statistic, float(chi2.sf(statistic, lags.size)))


def cross_correlations(residual: Array, signals: Mapping[str, Array], step_s: float) -> tuple[CrossCorrelation, ...]:
    """Find the strongest correlation of a residual with each signal that changes; strongest first."""
    there = np.isfinite(residual)
    e = np.where(there, residual, 0.0) - (residual[there].mean() if there.any() else 0.0)
    e[~there] = 0.0
    bound = NORMAL_95 / np.sqrt(max(int(there.sum()), 1))
    out = []
    for name, values in signals.items():
        s = np.where(there, values - values[there].mean(), 0.0) if there.any() else np.zeros_like(e)
        scale = float(np.linalg.norm(e) * np.linalg.norm(s))
        if scale == 0.0:
            continue
        best = max(range(-LAGS, LAGS + 1), key=lambda k: abs(_lagged(e, s, k)))
        out.append(CrossCorrelation(name, _lagged(e, s, best) / scale, best * step_s, bound))
    return tuple(sorted(out, key=lambda c: -abs(c.value)))


def _lagged(e: Array, s: Array, k: int) -> float:
    """Return the sum of e(t + k) s(t)."""
    return float(e[k:] @ s[: s.size - k]) if k >= 0 else float(e[:k] @ s[-k:])


# --- Recordings that made a fit, and recordings that were held out: only the latter test the fit.

MADE, HELD_OUT = "made the fit", "held out"  # badges of a recording
NONE_HELD_OUT = "no recording was held out: all of them made the fit, so nothing tests its predictions"


def sources_of(drive: Drive) -> dict[str, str]:
    """Return the recordings of the identified values of a drive, without hashes. A drive file lists the first six."""
    texts = {origin.source for origin in drive.provenance.values()} - {"not stated"}
    return {name: "" for text in texts for name in text.partition(" and ")[0].split(", ")}


def badge_of(name: str, sha256: str, fitted: Mapping[str, str]) -> str:
    """Return the badge of a recording; empty if no recordings of a fit are known.

    Parameters
    ----------
    name, sha256 : str
        Of the recording.
    fitted : mapping
        Name of each recording of the fit -> its hash, empty if unknown. Hashes decide if there are any.
    """
    if not fitted:
        return ""
    hashes = set(fitted.values()) - {""}
    return MADE if (sha256 in hashes if hashes else name in fitted) else HELD_OUT


def held_out_notes(badges: Iterable[str]) -> list[str]:
    """Return a sentence if no recording was held out, or if the verdicts leave out recordings of the fit."""
    found = list(badges)
    if MADE not in found:
        return []
    if HELD_OUT not in found:
        return [NONE_HELD_OUT]
    return [f"recordings held out of the fit: {found.count(HELD_OUT)} of {len(found)}. Only they count in the verdicts"]
