"""Block bootstrap of a drive fit: intervals from resampled parts of recordings, without stated errors of samples."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pneudrive.estimate.estimates import CONFIDENCE
from pneudrive.identify.dynamic.search import SINGULAR_SHARE, equations

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from pneudrive.identify.dynamic.search import Solved

    Array = NDArray[np.float64]

#: Least number of blocks of a recording.
LEAST_BLOCKS = 8


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
    problem = solved.problem
    information_of, gradient_of = [], []
    tau = max((t for _, t in solved.inflation.values()), default=1.0)
    for slopes, residual in zip(solved.slopes, solved.at.residuals, strict=True):
        n = residual.shape[0]
        blocks = int(np.clip(n / max(10.0 * tau, 50.0), LEAST_BLOCKS, 200))
        for part in np.array_split(np.arange(n), min(blocks, n)):
            jac = slopes[part].reshape(-1, problem.size)
            information_of.append(jac.T @ jac)
            gradient_of.append(jac.T @ residual[part].ravel())
    info, grad = np.array(information_of), np.array(gradient_of)
    grad = grad - grad.mean(axis=0)  # at the estimate the gradient is only rounding
    rng = np.random.default_rng(seed)
    project = solved.inverse @ equations(problem, solved.at)[0]  # onto the directions that the data determine
    out = np.empty((count, problem.size))
    for row in range(count):
        drawn = rng.multinomial(len(info), np.full(len(info), 1.0 / len(info)))
        matrix = np.tensordot(drawn, info, axes=1) + np.diag(problem.prior)
        step = np.linalg.lstsq(matrix, drawn @ grad, rcond=SINGULAR_SHARE**2)[0]
        out[row] = problem.values(solved.at.point.eta + project @ step)
    return out


def intervals_of_draws(names: tuple[str, ...], draws: NDArray[np.float64]) -> dict[str, tuple[float, float]]:
    """Return the 95 % interval of each column of `draws`, shape (m, p), from its quantiles: name -> (lower, upper)."""
    low, high = np.quantile(draws, [0.5 * (1.0 - CONFIDENCE), 0.5 * (1.0 + CONFIDENCE)], axis=0)
    return {name: (float(a), float(b)) for name, a, b in zip(names, low, high, strict=True)}
