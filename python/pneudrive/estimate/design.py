"""Optimal designs over a list of candidate points.

A candidate is described by the gradient g of its expected value with respect to the parameters. g is divided by the
standard deviation of the value. One measurement adds g g' to the information matrix M. The gradients of a nonlinear law
depend on its parameters. Each sample d of a prior therefore has its own gradients. Criteria are means over the samples:

    D   mean of ln det M_d                the volume of the confidence region
    I   mean of trace(M_d^-1 W_d)         the variance of the prediction, averaged over a range

For p parameters, weights of the candidates are D-optimal if and only if mean g' M^-1 g <= p at every candidate.
At a candidate with a weight above zero, both sides are equal [fedorov1972].
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pneudrive.arrays import Array, Ints

#: Largest number of repeats that is tried for a given time.
MOST_REPEATS = 12
#: Regularisation: information added to each parameter, as a fraction of the information from all candidates.
RIDGE = 1e-9
#: Largest number of passes of exchanges; three to six usually suffice.
MOST_PASSES = 40
#: Smallest gain that is not a rounding error.
LEAST_GAIN = 1e-10


@dataclass(frozen=True)
class DesignSpace:
    """Candidate points of a design.

    Attributes
    ----------
    gradients : ndarray, shape (d, c, p)
        Gradients of c candidates for d samples of the prior, divided by the standard deviation of the measured value.
    known : ndarray, shape (d, p, p)
        Information matrix of earlier measurements.
    region : ndarray, shape (d, p, p) or None
        Mean of g g' over the range of prediction, in units of the value squared; needed for criterion I.
    """

    gradients: Array
    known: Array
    region: Array | None = None

    def scaled(self) -> DesignSpace:
        """Scale the gradients of each parameter to an rms value of 1, and add a diagonal term against singularity."""
        size = np.sqrt(np.mean(self.gradients**2, axis=(0, 1)))
        s = np.where(size > 0.0, size, 1.0)
        known = self.known / np.outer(s, s) + RIDGE * self.gradients.shape[1] * np.eye(s.size)
        region = None if self.region is None else self.region / np.outer(s, s)
        return DesignSpace(self.gradients / s, known, region)


def information(candidates: DesignSpace, counts: Array) -> Array:
    """Return the information matrices (d, p, p) of the prior samples if candidate i is measured `counts[i]` times."""
    g = candidates.gradients
    return candidates.known + np.einsum("c,dci,dcj->dij", counts, g, g)


def exchange(candidates: DesignSpace, count: int, criterion: str = "D") -> Ints:
    """Choose `count` candidates greedily, then exchange some to improve the criterion. Candidates may be repeated.

    Returns
    -------
    ndarray of int, shape (count,)
        Indices of candidates, sorted.
    """
    scaled = candidates.scaled()
    matrix, chosen = scaled.known.copy(), []
    for _ in range(count):
        best = int(np.argmax(_gain(scaled, matrix, criterion)))
        chosen.append(best)
        matrix = matrix + _outer(scaled, best)
    for _ in range(MOST_PASSES):
        changed = False
        for i, old in enumerate(chosen):
            rest = matrix - _outer(scaled, old)
            gain = _gain(scaled, rest, criterion)
            best = int(np.argmax(gain))
            if gain[best] > gain[old] + LEAST_GAIN * abs(gain[old]):
                chosen[i], matrix, changed = best, rest + _outer(scaled, best), True
        if not changed:
            break
    return np.sort(np.array(chosen, dtype=np.int64))


def within_budget(candidates: DesignSpace, cost: Array, budget: float, criterion: str) -> tuple[Ints, int]:
    """Choose the candidates with the largest ratio of gain to cost until the budget is spent. `cost` has shape (c,).

    Each candidate is chosen at most once. All have the same number of repeats, which is also optimised.

    Returns
    -------
    ndarray of int, shape (count,)
        Indices of candidates, sorted.
    int
        Repeats of each measurement.
    """
    scaled = candidates.scaled()
    best, most = (np.zeros(0, dtype=np.int64), 1), -np.inf
    for repeats in range(1, min(MOST_REPEATS, int(budget // cost.min())) + 1):
        repeated = DesignSpace(scaled.gradients * np.sqrt(repeats), scaled.known, scaled.region)
        matrix, chosen, left = scaled.known.copy(), [], budget / repeats
        free = cost <= left
        while free.any():
            one = int(np.argmax(np.where(free, _gain(repeated, matrix, criterion) / cost, -np.inf)))
            chosen.append(one)
            left -= float(cost[one])
            matrix = matrix + _outer(repeated, one)
            free[one] = False
            free &= cost <= left
        if (value := _criterion(repeated, matrix, criterion)) > most:
            best, most = (np.sort(np.array(chosen, dtype=np.int64)), repeats), value
    return best


def _criterion(candidates: DesignSpace, matrix: Array, criterion: str) -> float:
    """Return the criterion to maximise: the mean of ln det M, or minus the mean of trace(M^-1 W)."""
    if criterion == "D":
        return float(np.mean(np.linalg.slogdet(matrix)[1]))
    assert candidates.region is not None
    return -float(np.mean(np.trace(np.linalg.solve(matrix, candidates.region), axis1=1, axis2=2)))


def _outer(candidates: DesignSpace, index: int) -> Array:
    g = candidates.gradients[:, index]
    return g[:, :, None] * g[:, None, :]


def _gain(candidates: DesignSpace, matrix: Array, criterion: str) -> Array:
    """Return the gain (c,) of the criterion from one more measurement of each candidate."""
    g = candidates.gradients
    solved = np.linalg.solve(matrix, np.swapaxes(g, 1, 2))  # (d, p, c)
    leverage = np.einsum("dci,dic->dc", g, solved)
    if criterion == "D":
        return np.mean(np.log1p(leverage), axis=0)
    assert candidates.region is not None
    return np.mean(np.einsum("dic,dij,djc->dc", solved, candidates.region, solved) / (1.0 + leverage), axis=0)
