"""Relaxation of the force while the piston is held: how much, how fast, and in which form.

  log           f = a - R log10(1 + t/t0)          R per decade: creep of an elastomer
  exponential   f = a - A [1 - exp(-t/tau)]        one time constant: a film that is squeezed out
  two times     f = a - A1 [1 - exp(-t/tau1)] - A2 [1 - exp(-t/tau2)]
  none          f = a

All four are fitted to means over bins that are even in log time and compared by AICc [burnham2002].
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from pneudrive.characterise.motion import noise_level
from pneudrive.estimate.estimates import NORMAL_95, Estimate
from pneudrive.estimate.separable import Scan, corrected_criterion, scan

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]

PER_DECADE = 12
FEWEST_BINS = 6
#: Start and end of the hold that the amount is the difference of: the force falls fastest at first.
START_S, END_SHARE = 0.1, 0.1
LEAST_SAMPLES = 3
#: Times are sought from the first bin, divided by this, to the last one, times this.
REACH = 5.0
TIMES = 60
CHI_SQUARE_95 = 3.84  # of one quantity


@dataclass(frozen=True)
class Relaxation:
    """What the force did while the piston was held, friction positive in the direction of the restart.

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
        0 or inf where open; of two times none is told.
    amplitudes_n : tuple of float
        R of the log, A of the others.
    per_decade : Estimate or None
        R, whatever form is best; None where the hold is too short for it.
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
        """Force over time since the rest began, N, for a force at its beginning."""
        basis = _basis(self.form, np.asarray(time_s, dtype=float), self.times_s)
        return (
            start_n - basis @ np.array(self.amplitudes_n) if self.amplitudes_n else np.full(np.shape(time_s), start_n)
        )


@dataclass(frozen=True, eq=False)
class _Bins:
    time_s: Array
    force_n: Array
    variance: Array


def relax(time_s: Array, friction_n: Array) -> Relaxation | None:
    """Describe a hold.

    Parameters
    ----------
    time_s : ndarray, shape (n,)
        Since the rest began.
    friction_n : ndarray, shape (n,)
        Raw samples.

    Returns
    -------
    Relaxation or None
        None where fewer than six samples were taken.
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
    bins = _binned(time_s, friction_n, noise)
    if bins.time_s.size < FEWEST_BINS:
        return Relaxation(amount, float(end.mean()), "none", (), (), (), None, {})
    return _forms(bins, amount, float(end.mean()))


def _binned(time: Array, friction: Array, noise: float) -> _Bins:
    known = time > 0
    time, friction = time[known], friction[known]
    if time.size < FEWEST_BINS:
        return _Bins(time, friction, np.full(time.size, noise**2))
    low = max(float(time[0]), float(time[-1]) * 1e-6)
    count = max(int(PER_DECADE * np.log10(float(time[-1]) / low)), FEWEST_BINS)
    edges = np.geomspace(low, float(time[-1]) * (1 + 1e-9), count + 1)
    at = np.clip(np.searchsorted(edges, time, side="right") - 1, 0, count - 1)
    number = np.bincount(at, minlength=count)
    kept = number > 0
    mean_t = np.bincount(at, time, count)[kept] / number[kept]
    mean_f = np.bincount(at, friction, count)[kept] / number[kept]
    return _Bins(mean_t, mean_f, noise**2 / number[kept])


def _basis(form: str, time: Array, times: tuple[float, ...]) -> Array:
    if form == "log":
        return np.log10(1.0 + time / times[0])[:, None]
    return np.column_stack([-np.expm1(-time / tau) for tau in times]) if times else np.zeros((time.size, 0))


def _forms(bins: _Bins, amount: Estimate, held_n: float) -> Relaxation:
    # Slow noise that bins share is no part of the samples' noise: the least variance that a cubic in log time leaves.
    weight = 1.0 / (bins.variance + _slow_variance(bins))
    grid = np.geomspace(bins.time_s[0] / REACH, bins.time_s[-1] * REACH, TIMES)
    pairs = [(float(a), float(b)) for i, a in enumerate(grid[::3]) for b in grid[::3][i + 2 :]]
    single = [(float(t),) for t in grid]
    candidates = {"none": [()], "exponential": single, "log": single, "two times": pairs}
    n = bins.time_s.size
    fits = {form: _scan(bins, weight, form, shapes) for form, shapes in candidates.items()}
    aicc = {
        form: corrected_criterion(float(found.cost[found.best]), 1 + 2 * found.shape.shape[1], n)
        for form, found in fits.items()
    }
    form = min(aicc, key=lambda name: aicc[name])
    best, log, freedom = fits[form], fits["log"], max(n - 3, 1)
    per_decade = None
    if np.isfinite(aicc["log"]):
        low, high = log.interval(np.array([0.0, 1.0]), log.rise(freedom, 1.0))
        stderr = float(np.sqrt(log.scale(freedom, 1.0) * log.covariance[log.best, 1, 1]))
        per_decade = Estimate(float(log.coefficient[log.best, 1]), low, high, stderr, "N", float(freedom))
    single = form in {"log", "exponential"}
    return Relaxation(
        amount=amount,
        held_n=held_n,
        form=form,
        times_s=tuple(best.shape[best.best].tolist()),
        time_intervals_s=(best.shape_interval(0, CHI_SQUARE_95, (grid[0], grid[-1])),) if single else (),
        amplitudes_n=tuple(best.coefficient[best.best, 1:].tolist()),
        per_decade=per_decade,
        aicc={name: value - aicc[form] for name, value in aicc.items() if np.isfinite(value)},
    )


def _slow_variance(bins: _Bins) -> float:
    u = np.log10(bins.time_s)
    design = np.vander((u - u.mean()) / max(float(np.ptp(u)), 1e-9), min(6, max(u.size - 3, 1)))
    w = 1.0 / np.sqrt(bins.variance)
    rest = (bins.force_n - design @ np.linalg.lstsq(design * w[:, None], bins.force_n * w, rcond=None)[0]) ** 2
    freedom = max(u.size - design.shape[1], 1)
    return max(float(rest.sum()) / freedom - float(bins.variance.mean()), 0.0)


def _scan(bins: _Bins, weight: Array, form: str, shapes: list[tuple[float, ...]]) -> Scan:
    """Weighted linear fit at each shape."""
    root = np.sqrt(weight)
    basis = np.array([_basis(form, bins.time_s, shape) for shape in shapes])
    ones = np.ones((len(shapes), bins.time_s.size, 1))
    shape = np.array(shapes).reshape(len(shapes), -1)
    return scan(shape, np.concatenate([ones, -basis], axis=2) * root[None, :, None], bins.force_n * root)
