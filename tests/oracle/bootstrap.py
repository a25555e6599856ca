"""Block bootstrap of a fit: intervals from resampled recordings (cycles).

The bootstrap does not use stated errors of single values.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from pneudrive.errors import FitError
from pneudrive.estimate.autocorrelation import SAME_SPEED
from pneudrive.estimate.estimates import CONFIDENCE
from pneudrive.identify.base import names_of
from pneudrive.identify.dynamic.search import SINGULAR_SHARE
from pneudrive.identify.static.robust import estimate
from pneudrive.identify.static.survey import pressure_levels
from pneudrive.repr_tables import Shown

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from pneudrive.identify.dynamic.search import Solved
    from pneudrive.identify.static.model import Observations
    from pneudrive.identify.static.result import FrictionFit

    Array = NDArray[np.float64]

#: Least number of blocks for a bootstrap, and of blocks of a recording of a drive.
LEAST_BLOCKS, LEAST_DRIVE_BLOCKS = 6, 8


@dataclass(frozen=True, repr=False)
class Bootstrap(Shown):
    """Estimates from resampled data.

    Attributes
    ----------
    names : tuple of str
    draws : ndarray, shape (m, p)
        Natural parameters.
    intervals : dict
        Name -> 95 % interval: quantiles of the draws.
    blocks : int
        Number of recordings (cycles), each drawn as a whole.
    kind : str
        ``cases``: blocks drawn with replacement among those of one speed and pressure. ``wild``, for conditions without
        repeats: residuals of each block with a common random sign [cameron2008].
    """

    names: tuple[str, ...]
    draws: Array
    intervals: dict[str, tuple[float, float]]
    blocks: int
    kind: str

    @property
    def covariance(self) -> Array:
        """Covariance of the draws, shape (p, p)."""
        return np.cov(self.draws, rowvar=False)


def bootstrap(fit: FrictionFit, draws: int = 400, seed: int = 1, loss: str = "huber") -> Bootstrap:
    """Resample the recordings of a fit, and fit each sample.

    Values of one recording (in a campaign: one cycle) share errors. The values of a recording stay together, so the
    intervals are valid although single values are not independent.

    Parameters
    ----------
    fit : FrictionFit
        Fit with its observations, not read from a file.
    draws, seed : int
    loss : str
        As for :func:`fit_friction`.

    Returns
    -------
    Bootstrap
    """
    fit.profile(())  # raises without the data
    data, model = fit.observations, fit.model
    blocks = [np.flatnonzero(data.group == g) for g in np.unique(data.group)]
    if len(blocks) < LEAST_BLOCKS:
        raise FitError(
            f"{len(blocks)} recordings are too few for a bootstrap",
            rule=f"at least {LEAST_BLOCKS}",
            remedy="Use the profile intervals of the fit, or measure more recordings.",
        )
    strata = _strata(data, blocks)
    kind = "cases" if min(len(s) for s in strata) >= 3 else "wild"
    rng = np.random.default_rng(seed)
    start = fit.coordinates
    fitted = model.value(start, data)
    residual = _inflated(fit, start, data.friction_n - fitted)
    found = np.empty((draws, start.size))
    for i in range(draws):
        if kind == "cases":
            rows = np.concatenate([blocks[b] for s in strata for b in rng.choice(s, len(s))])
            again = data.take(rows)
        else:
            sign = rng.choice([-1.0, 1.0], len(blocks))[np.unique(data.group, return_inverse=True)[1]]
            again = replace(data, friction_n=fitted + sign * residual)
        found[i] = model.natural(estimate(model, again, loss=loss, starts=[start]).q)
    lost = names_of(fit.undetermined)
    intervals = {name: ends for name, ends in intervals_of_draws(fit.free, found).items() if name not in lost}
    return Bootstrap(fit.free, found, intervals, len(blocks), kind)


def _strata(data: Observations, blocks: list[NDArray[np.int64]]) -> list[list[int]]:
    """Return the blocks of each speed and pressure."""
    pressure = pressure_levels(data)
    cells: dict[tuple, list[int]] = {}
    for k, rows in enumerate(blocks):
        speeds = np.round(np.log(np.sort(data.speed_m_s[rows])) / SAME_SPEED)
        cells.setdefault((tuple(speeds), tuple(pressure[rows])), []).append(k)
    return list(cells.values())


def _inflated(fit: FrictionFit, start: Array, residual: Array) -> Array:
    """Return residuals corrected for their reduction by the fit: divided by 1 - leverage."""
    assert fit.observations is not None
    jac = fit.model.value_and_jacobian(start, fit.observations)[1] / fit.observations.stderr_n[:, None]
    size = np.linalg.norm(jac, axis=0)
    q, _ = np.linalg.qr(jac / np.where(size > 0.0, size, 1.0))
    return residual / np.sqrt(np.maximum(1.0 - np.sum(q**2, axis=1), 0.05))


def drive_bootstrap(solved: Solved, count: int, seed: int) -> Array:
    """Return draws of a block bootstrap: recordings are cut into blocks, which are drawn with replacement.

    Each sample is fitted by one Gauss-Newton step from the estimate. This is exact if the model is linear within the
    uncertainty of its parameters.

    Parameters
    ----------
    solved : Solved
        End of the search.
    count : int
        Number of draws.
    seed : int

    Returns
    -------
    ndarray, shape (count, P)
        Values in SI, in the order of `FitProblem.names`.
    """
    problem, point, found = solved.problem, solved.point, solved.information
    information_of, gradient_of = [], []
    tau = max((t for _, t in found.inflation.values()), default=1.0)
    for slopes, residual in zip(found.slopes, solved.at.standing.residuals, strict=True):
        n = residual.shape[0]
        blocks = int(np.clip(n / max(10.0 * tau, 50.0), LEAST_DRIVE_BLOCKS, 200))
        for part in np.array_split(np.arange(n), min(blocks, n)):
            jac = slopes[part].reshape(-1, problem.size)
            information_of.append(jac.T @ jac)
            gradient_of.append(jac.T @ residual[part].ravel())
    info, grad = np.array(information_of), np.array(gradient_of)
    grad = grad - grad.mean(axis=0)  # at the estimate the gradient is only rounding
    rng = np.random.default_rng(seed)
    project = found.inverse @ found.matrix  # onto the directions that the data determine
    out = np.empty((count, problem.size))
    for row in range(count):
        drawn = rng.multinomial(len(info), np.full(len(info), 1.0 / len(info)))
        matrix = np.tensordot(drawn, info, axes=1) + np.diag(problem.prior)
        step = np.linalg.lstsq(matrix, drawn @ grad, rcond=SINGULAR_SHARE**2)[0]
        out[row] = problem.values(point.eta + project @ step)
    return out


def intervals_of_draws(names: tuple[str, ...], draws: NDArray[np.float64]) -> dict[str, tuple[float, float]]:
    """Return the 95 % interval of each column of `draws`, shape (m, p), from its quantiles: name -> (lower, upper)."""
    low, high = np.quantile(draws, [0.5 * (1.0 - CONFIDENCE), 0.5 * (1.0 + CONFIDENCE)], axis=0)
    return {name: (float(a), float(b)) for name, a, b in zip(names, low, high, strict=True)}
