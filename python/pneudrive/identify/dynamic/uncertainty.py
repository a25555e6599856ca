"""Uncertainty of identified values: covariance, profile likelihood."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from pneudrive.errors import FitError
from pneudrive.estimate.estimates import student
from pneudrive.estimate.profile import profile_interval
from pneudrive.identify.dynamic.search import SINGULAR_SHARE, Joined, join_segments, reduced, start_solution

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from pneudrive.identify.dynamic.problem import FitProblem, Iterate

    Array = NDArray[np.float64]

#: Largest lag for the correlation of residuals, as a share of a recording.
LAG_SHARE = 0.1
PROFILE_FITS = 12


@dataclass(frozen=True)
class Information:
    """Linearisation at the estimate, the starts of the recordings eliminated.

    Attributes
    ----------
    slopes : list of ndarray, shape (n, c, P)
        Derivatives of each recording, in units of the noise, without the part that starts can compensate.
    residuals : list of ndarray, shape (n, c)
    matrix : ndarray, shape (P, P)
        Information of the coordinates, with prior knowledge of the sensors.
    inverse : ndarray, shape (P, P)
        Its inverse on the directions that the data determine.
    weak : ndarray, shape (w, P)
        Unit directions of the scaled coordinates that the data do not determine.
    inflation : dict
        (recording, channel number) -> (variance of the residuals, sum of their correlations over all lags).
    """

    slopes: list[Array]
    residuals: list[Array]
    matrix: Array
    inverse: Array
    weak: Array
    inflation: dict[tuple[int, int], tuple[float, float]]

    def covariance(self, problem: FitProblem) -> Array:
        """Covariance of the coordinates [bates1988], with variance and autocorrelation of the residuals.

        inverse (sum over channels of s^2 tau J^T J + prior) inverse,  tau = 1 + 2 sum of autocorrelations.
        """
        middle = np.diag(problem.prior)
        for (i, c), (variance, tau) in self.inflation.items():
            jac = self.slopes[i][:, c]
            middle = middle + variance * tau * (jac.T @ jac)
        return self.inverse @ middle @ self.inverse


@dataclass
class Solved:
    """Fit problem with its solution, for profiles."""

    problem: FitProblem
    point: Iterate
    believed: list[Array]
    at: Joined
    information: Information
    freedom: int


def information(problem: FitProblem, at: Joined) -> Information:
    """Return the linearisation at the estimate."""
    matrix, _ = reduced(at.blocks, problem.size)
    matrix += np.diag(problem.prior)
    size = problem.size
    slopes = []
    for block, jac in zip(at.blocks, at.slopes, strict=True):
        n = block.information
        slopes.append(jac[..., :size] - jac[..., size:] @ start_solution(block, n[size:, :size]))
    scale = np.sqrt(np.maximum(np.diag(matrix), 0.0))  # what rounding makes negative is zero
    scale[scale == 0.0] = 1.0
    power, axes = np.linalg.eigh(matrix / np.outer(scale, scale))
    good = power > SINGULAR_SHARE**2 * max(power[-1], 1e-300)
    inverse = (axes[:, good] / power[good]) @ axes[:, good].T / np.outer(scale, scale)
    inflation = {}
    for i, residual in enumerate(at.residuals):
        weight = problem.experiments[i].weight
        for c in range(residual.shape[1]):
            r = residual[weight[:, c] > 0.0, c]
            inflation[i, c] = (float(np.mean(r**2)), correlation_time(r))
    return Information(slopes, at.residuals, matrix, inverse, axes[:, ~good].T, inflation)


def correlation_time(residual: Array) -> float:
    """Return the sum of the autocorrelations over all lags of both signs, in samples; 1 for white residuals.

    Neighbouring lags are added in pairs until a pair is not positive.
    """
    n = residual.size
    most = max(2, int(LAG_SHARE * n))
    size = 1 << (n + most).bit_length()
    power = np.abs(np.fft.rfft(residual, size)) ** 2
    r = np.fft.irfft(power, size)[: most + 1]
    if r[0] <= 0.0:
        return 1.0
    r = r / r[0]
    pairs = r[1:most:2] + r[2 : most + 1 : 2]
    stop = np.flatnonzero(pairs <= 2.0 / np.sqrt(n))
    return max(1.0, 1.0 + 2.0 * float(pairs[: stop[0] if stop.size else None].sum()))


def profile(solved: Solved, name: str, least: float | None = None) -> tuple[float, float]:
    """Return the interval of one value by profile likelihood, SI.

    With all other values refitted, the cost may grow by Student's t squared times the inflation of the residuals. If
    the cost never grows that much, the end of the interval is the bound of the value.

    Parameters
    ----------
    solved : Solved
        End of the search.
    name : str
        Name of the value, as in `FitProblem.names`.
    least : float, optional
        Cost of the best minimum; by default that of this one.
    """
    problem, point, found, reach = solved.problem, solved.point, solved.information, student(solved.freedom)
    index = problem.names.index(name)
    spread = float(np.sqrt(found.covariance(problem)[index, index]))
    plain = float(np.sqrt(found.inverse[index, index]))
    allowed = reach**2 * (spread / plain) ** 2 if plain > 0.0 else reach**2

    def held(value: float, start: Iterate) -> tuple[float, Iterate]:
        return _constrained(problem, start, solved.believed, value, index)

    least = solved.at.cost if least is None else least
    at, ends = point.eta[index], []
    for end in profile_interval(held, point, at, reach * spread, least, allowed):
        eta = point.eta.copy()
        eta[index] = end
        ends.append(float(problem.values(eta)[index]))
    return min(ends), max(ends)


def _constrained(
    problem: FitProblem, point: Iterate, believed: list[Array], value: float, index: int
) -> tuple[float, Iterate]:
    """Return the best cost with one coordinate held."""
    eta = point.eta.copy()
    eta[index] = value
    problem.held = np.arange(problem.size) == index
    try:
        moved, at, _ = join_segments(problem, replace(point, eta=eta), believed, None, most=PROFILE_FITS)
    except FitError:
        return np.inf, point
    finally:
        problem.held = np.zeros(problem.size, dtype=bool)
    return at.cost, moved
