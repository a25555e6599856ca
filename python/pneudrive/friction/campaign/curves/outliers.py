"""Outliers: cycles that do not fit any curve. They are found one at a time, by comparison with all others.

Two outliers inflate the scatter against which each is judged, and an outlier makes a good repeat look like an outlier.
Each cycle is therefore compared with its prediction from all others [cook1982]: neighbours in speed, other pressures,
repeats.
The cycle with the largest deviation relative to the robust scatter is removed, and the model is fitted again. This
repeats. The number
of outliers follows from probability [box1968]: an outlier may show any friction, but is rare. Finally each removed
cycle is compared with the prediction from the good cycles, and is used again if it agrees with this prediction. A cycle
is
suspect if the data do not decide.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from pneudrive.estimate.estimates import robust_deviation
from pneudrive.estimate.mixed import MOST_FOR_SEARCH
from pneudrive.friction.campaign.curves.smooth import curve_model

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from pneudrive.estimate.mixed import MixedModel
    from pneudrive.friction.campaign.curves.smooth import CurveData

    Array = NDArray[np.float64]

ENOUGH = 9  # least number of cycles to find a wild one
SUSPECT = 3.0  # robust deviations beyond which a cycle is examined
SURE = 5.0  # standard deviations of the prediction from the others, beyond which a cycle is wild
TRIED = 3  # suspects among which the one is sought without which all others fit best
LEAST_SHARE = 0.1  # share of friction: a smaller deviation is not a failure of a sensor
WILD = 0.02  # prior probability of a wild cycle (assumed)
WILD_SPREAD = 0.5  # share of friction: standard deviation of wild cycles (assumed)
OPEN = 4.0  # difference of logarithms: readings less than 2 % as probable as the likeliest are left out (assumed)
FEW = 100  # cycles, among which wild ones hide each other
ON_TRIAL = 2  # cycles that are removed though none stands out
MOST_SHARE = 0.1  # share of the cycles (and at least two): more are not outliers, but typical of the rig


@dataclass(frozen=True, eq=False)
class _Taken:
    """Removed cycles, the standard deviations of the rest, and their improbability."""

    rows: list[int]
    sd: Array
    cost: float


def wild_cycles(data: CurveData) -> tuple[list[int], list[list[int]]]:
    """Find the outliers, as rows of the data.

    Returns
    -------
    list of int
        Wild cycles.
    list of list of int
        Further cycles that may be outliers, for each hypothesis other than no outlier. Each holds those of the one
        before.
    """
    if len(data) < ENOUGH:
        return [], []
    path = _path(data)
    least_cost = min(one.cost for one in path)
    possible = [one for one in path if one.cost < least_cost + OPEN]
    taken, sd = list(possible[0].rows), possible[0].sd
    while taken:
        own = [_against(data, taken, i, sd) for i in taken]
        least = int(np.argmin(own))
        if own[least] > SURE:
            break
        taken.pop(least)
        sd, _ = _deviations(data, taken, sd)
    readings = [sorted(set(one.rows) - set(taken)) for one in possible]
    return sorted(taken), [rows for rows in readings if rows]


def _path(data: CurveData) -> list[_Taken]:
    """Remove cycles one by one, each time the cycle whose removal makes the others most likely.

    Return all steps, beginning with no removal.
    """
    size = len(data)
    most = max(2, int(MOST_SHARE * size))
    price = _price(data)
    path = [_Taken([], *_deviations(data, [], None))]
    while len(path[-1].rows) < most:
        taken, sd = path[-1].rows, path[-1].sd
        rows, off, far = _off(data, taken, sd)
        z = np.abs(off) / far
        usual = max(robust_deviation(off / far), 1e-12)
        large = (np.abs(off) > LEAST_SHARE * data.level) & _spare(data, rows)
        suspect = (z > SUSPECT * usual) & large
        if not suspect.any():
            # Among few cycles, two outliers hide each other by their scatter: neither is visible before both are
            # removed. So some are removed on trial.
            best = min(range(len(path)), key=lambda k: path[k].cost)
            if size > FEW or len(path) - 1 - best >= ON_TRIAL or not large.any():
                break
            suspect = large
        order = rows[np.flatnonzero(suspect)[np.argsort(-z[suspect])]].tolist()
        # Among very many cycles, a few outliers change nothing: remove all at once. Among few cycles, an outlier that
        # bends the curve makes its neighbours look like outliers. Remove the cycle without which the others are most
        # likely.
        tries = [order[: most - len(taken)]] if size > MOST_FOR_SEARCH else [[i] for i in order[:TRIED]]
        found = [(_deviations(data, [*taken, *some], sd), [*taken, *some]) for some in tries]
        (sd, cost), taken = min(found, key=lambda one: one[0][1])
        path.append(_Taken(taken, sd, cost + price * len(taken)))
    # With very many cycles the standard deviations come from some of them: their costs are not comparable.
    return path if size <= MOST_FOR_SEARCH else path[-1:]


def _price(data: CurveData) -> float:
    """Return the cost of an outlier: -log(odds of an outlier * its density / density of a good cycle)."""
    return float(np.log((1.0 - WILD) / WILD) + np.log(WILD_SPREAD * data.level))


def _rows(data: CurveData, taken: list[int]) -> NDArray[np.intp]:
    return np.setdiff1d(np.arange(len(data)), taken)


def _model(data: CurveData, rows: NDArray[np.intp]) -> MixedModel:
    return curve_model(data.part(rows))


def _deviations(data: CurveData, taken: list[int], start: Array | None) -> tuple[Array, float]:
    return _model(data, _rows(data, taken)).most_probable(start)


def _off(data: CurveData, taken: list[int], sd: Array) -> tuple[NDArray[np.intp], Array, Array]:
    """Return the remaining cycles, the deviation of each from the others, and its standard deviation."""
    rows = _rows(data, taken)
    return rows, *_model(data, rows).left_out(sd)


def _against(data: CurveData, taken: list[int], one: int, sd: Array) -> float:
    """Return the deviation of a removed cycle from the others, in standard deviations."""
    rows, off, far = _off(data, [i for i in taken if i != one], sd)
    at = int(np.searchsorted(rows, one))
    return abs(float(off[at])) / float(far[at]) if abs(off[at]) > LEAST_SHARE * data.level else 0.0


def _spare(data: CurveData, rows: NDArray[np.intp]) -> NDArray[np.bool_]:
    """Mark cycles whose curve has further cycles."""
    curve = data.curve[rows]
    return np.bincount(curve[curve >= 0], minlength=int(curve.max()) + 1)[curve] > 1
