"""Relaxation of the force while the piston is held: amount, rate and form.

  log           f = a - R log10(1 + t/t0)          R per decade: creep of an elastomer
  exponential   f = a - A [1 - exp(-t/tau)]        one time constant: a film that is squeezed out
  two times     f = a - A1 [1 - exp(-t/tau1)] - A2 [1 - exp(-t/tau2)]
  none          f = a

All four forms are fitted to means over bins that are even in log time, and compared by AICc [burnham2002].
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from pneudrive.estimate.estimates import NORMAL_95, Estimate
from pneudrive.estimate.groups import cells, means
from pneudrive.estimate.separable import corrected_criterion, scan
from pneudrive.signals.motion import noise_level

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]

PER_DECADE = 12
FEWEST_BINS = 6
#: Start and end of the hold for the amount: the force falls fastest at first.
START_S, END_SHARE = 0.1, 0.1
LEAST_SAMPLES = 3
#: Factor by which the search for times extends beyond the first and last bin.
REACH = 5.0
TIMES = 60
CHI_SQUARE_95 = 3.84  # of one quantity


@dataclass(frozen=True)
class ForceRelaxation:
    """Relaxation of the force in a hold; friction is positive in the direction of the restart.

    Attributes
    ----------
    amount : Estimate
        Fall of the force from the start to the end of the hold; free of any form.
    held_n : float
        Force at the end of the hold.
    form : str
        log, exponential, two times or none.
    times_s : tuple of float
        t0 of the log, time constants of the others.
    time_intervals_s : tuple of (float, float)
        0 or inf if open; none for two times.
    amplitudes_n : tuple of float
        R of the log, A of the others.
    per_decade : Estimate or None
        R, for any form; None if the hold is too short.
    aicc : dict
        Form -> AICc above that of the best one.
    """

    amount: Estimate
    held_n: float
    form: str
    times_s: tuple[float, ...]
    time_intervals_s: tuple[tuple[float, float], ...]
    amplitudes_n: tuple[float, ...]
    per_decade: Estimate | None
    aicc: dict[str, float]

    def force_n(self, time_s: Array, start_n: float) -> Array:
        """Return the force over time since the rest began, N, for a force at its beginning."""
        basis = _basis(self.form, np.asarray(time_s, dtype=float), np.array([self.times_s]))[0]
        return start_n - basis @ np.array(self.amplitudes_n)


def relax(time_s: Array, friction_n: Array) -> ForceRelaxation | None:
    """Describe a hold.

    Parameters
    ----------
    time_s : ndarray, shape (n,)
        Since the rest began.
    friction_n : ndarray, shape (n,)
        Raw samples.

    Returns
    -------
    ForceRelaxation or None
        None with fewer than six samples.
    """
    if time_s.size < 2 * LEAST_SAMPLES:
        return None
    noise = max(noise_level(friction_n), 1e-12 * float(np.abs(friction_n).max()) + 1e-300)
    duration = float(time_s[-1])
    early = max(int(np.searchsorted(time_s, START_S)), LEAST_SAMPLES)
    late = min(int(np.searchsorted(time_s, (1.0 - END_SHARE) * duration)), time_s.size - LEAST_SAMPLES)
    early = min(early, late)
    start, end = friction_n[:early], friction_n[late:]
    stderr = noise * float(np.sqrt(1.0 / start.size + 1.0 / end.size))
    value = float(start.mean() - end.mean())
    amount = Estimate(value, value - NORMAL_95 * stderr, value + NORMAL_95 * stderr, stderr, "N")
    nothing = ForceRelaxation(amount, float(end.mean()), "none", (), (), (), None, {})
    known = time_s > 0
    if known.sum() < FEWEST_BINS:
        return nothing
    time, friction = time_s[known], friction_n[known]
    low, high = max(float(time[0]), float(time[-1]) * 1e-6), float(time[-1]) * (1 + 1e-9)
    edges = np.geomspace(low, high, max(int(PER_DECADE * np.log10(float(time[-1]) / low)), FEWEST_BINS) + 1)
    group = cells(np.clip(np.searchsorted(edges, time, side="right") - 1, 0, edges.size - 2))
    time, friction = means(group, time, friction)
    if time.size < FEWEST_BINS:
        return nothing
    return replace(nothing, **_forms(time, friction, noise**2 / np.bincount(group)))


def _basis(form: str, time: Array, times: Array) -> Array:
    """Return the fall for amplitude 1 at times (n,), for sets of time constants (g, k); shape (g, n, k)."""
    ratio = time[None, :, None] / times[:, None, :]
    return np.log10(1.0 + ratio) if form == "log" else -np.expm1(-ratio)


def _forms(time: Array, force: Array, variance: Array) -> dict[str, Any]:
    # Slow noise that bins share is not in the samples' noise: least variance from a cubic in log time.
    root = np.sqrt(1.0 / (variance + _slow_variance(time, force, variance)))
    grid = np.geomspace(time[0] / REACH, time[-1] * REACH, TIMES)
    pairs = [(a, b) for i, a in enumerate(grid[::3]) for b in grid[::3][i + 2 :]]
    single = [(t,) for t in grid]
    candidates = {"none": [()], "exponential": single, "log": single, "two times": pairs}
    fits, aicc = {}, {}
    for form, shapes in candidates.items():
        shape = np.array(shapes).reshape(len(shapes), -1)
        columns = np.concatenate([np.ones((len(shapes), time.size, 1)), -_basis(form, time, shape)], axis=2)
        fits[form] = scan(shape, columns * root[None, :, None], force * root)
        aicc[form] = corrected_criterion(float(fits[form].cost.min()), 1 + 2 * shape.shape[1], time.size)
    form = min(aicc, key=lambda name: aicc[name])
    best, log, freedom = fits[form], fits["log"], max(time.size - 3, 1)
    per_decade = None
    if np.isfinite(aicc["log"]):
        low, high = log.interval(np.array([0.0, 1.0]), log.rise(freedom, 1.0))
        stderr = float(np.sqrt(log.scale(freedom, 1.0) * log.covariance[log.best, 1, 1]))
        per_decade = Estimate(float(log.coefficient[log.best, 1]), low, high, stderr, "N", float(freedom))
    ends = (best.shape_interval(0, CHI_SQUARE_95, (grid[0], grid[-1])),) if form in {"log", "exponential"} else ()
    return {
        "form": form,
        "times_s": tuple(best.shape[best.best].tolist()),
        "time_intervals_s": ends,
        "amplitudes_n": tuple(best.coefficient[best.best, 1:].tolist()),
        "per_decade": per_decade,
        "aicc": {name: value - aicc[form] for name, value in aicc.items() if np.isfinite(value)},
    }


def _slow_variance(time: Array, force: Array, variance: Array) -> float:
    u = np.log10(time)
    design = np.vander((u - u.mean()) / max(float(np.ptp(u)), 1e-9), min(6, max(u.size - 3, 1)))
    w = 1.0 / np.sqrt(variance)
    rest = (force - design @ np.linalg.lstsq(design * w[:, None], force * w, rcond=None)[0]) ** 2
    return max(float(rest.sum()) / max(u.size - design.shape[1], 1) - float(variance.mean()), 0.0)
