"""Model selection: the part of a law that the values support, and its estimate."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from pneudrive.estimate.estimates import student
from pneudrive.identify.diagnose import without_support
from pneudrive.identify.profile import profile_intervals
from pneudrive.identify.static.robust import RobustEstimate, deviance, estimate
from pneudrive.identify.static.scatter import with_scatter

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from pneudrive.identify.determined import Undetermined
    from pneudrive.identify.static.model import FrictionModel, Observations

    Array = NDArray[np.float64]

#: Candidate knees, as multiples of the largest gauge pressure; above four the curve is a straight line to 20 % of its
#: end, and below a tenth a step.
KNEES = (0.1, 0.2, 0.35, 0.6, 1.0, 1.6, 2.5, 4.0)

#: Number of further knees between the best one and its neighbours.
FINER = np.geomspace(0.6, 1.0 / 0.6, 9)
#: Exponent of the Stribeck curve, and whether it is Lorentzian; literature has exponents of 0.5 to 2 [armstrong1994].
SHAPES = ((0.5, False), (1.0, False), (2.0, False), (2.0, True))
#: Factors of knees about the best one over which intervals are joined, if the values allow them.
NEIGHBOURS = np.geomspace(1.0, 40.0, 61)[1:]


@dataclass(frozen=True)
class Support:
    """Part of a law that the values support, with its estimate."""

    model: FrictionModel
    data: Observations
    found: RobustEstimate
    scatter_n: float
    intervals: dict[str, tuple[float, float]]
    lost: list[Undetermined]


def shrunk_to_the_data(model: FrictionModel, stated: Observations, loss: str) -> Support:
    """Fit a law without unsupported parts, which would only widen the intervals of the other parameters."""
    lost: list[Undetermined] = []
    while True:
        data, found, scatter, dof = estimated(model, stated, loss)
        intervals = interval_over_knees(model, data, found, student(dof), loss)
        smaller, statements = without_support(model, data, found, intervals, _excess_p_value(model, data, found, dof))
        if smaller == model:
            return Support(model, data, found, scatter, intervals, lost)
        model, lost = smaller, lost + statements


def as_it_is(model: FrictionModel, data: Observations, loss: str) -> Support:
    """Fit the whole law without profile intervals, for repeated predictions."""
    data, found, scatter, _ = estimated(model, data, loss)
    return Support(model, data, found, scatter, {}, [])


def estimated(model: FrictionModel, data: Observations, loss: str) -> tuple[Observations, RobustEstimate, float, int]:
    """Return the values with their scatter, the estimate of a law, the scatter, and the degrees of freedom."""
    dof = len(data) - len(model.names) - model.chosen
    found = estimate(model, data, loss=loss if dof > 0 else "linear", fixed_scale=dof == 0)
    return *with_scatter(model, data, found, loss=loss), dof


def with_knee(model: FrictionModel, data: Observations, loss: str) -> FrictionModel:
    """Choose the most likely knee of a saturating dependence on pressure among a few."""
    if model.pressure != "saturating" or not model.chambers:
        return model
    top = float(max(np.abs(data.gauge_a_pa).max(), np.abs(data.gauge_b_pa).max()))
    starts: list[Array] = []
    best, least, chosen = model, np.inf, 1.0
    for share in KNEES[::-1]:  # beginning nearest to a straight line, each starts from the estimate before
        tried = replace(model, knee_pa=share * top)
        found = estimate(tried, data, loss=loss, starts=starts)
        starts, size = [found.q], deviance(data, found)
        if size < least:
            best, least, chosen = tried, size, share
    for share in chosen * FINER:
        if KNEES[0] <= share <= KNEES[-1]:
            tried = replace(model, knee_pa=share * top)
            size = deviance(data, estimate(tried, data, loss=loss, starts=starts))
            if size < least:
                best, least = tried, size
    return best


def interval_over_knees(
    model: FrictionModel, data: Observations, found: RobustEstimate, quantile: float, loss: str
) -> dict[str, tuple[float, float]]:
    """Return profile intervals over all knees that the values allow: at a single knee they would be far too narrow."""
    out = profile_intervals(model, data, found, quantile)
    if model.knee_pa is None:
        return out
    top = float(max(np.abs(data.gauge_a_pa).max(), np.abs(data.gauge_b_pa).max()))
    least = float(np.sum(((found.pseudo - model.value(found.q, data)) / data.stderr_n) ** 2))
    pseudo = replace(data, friction_n=found.pseudo)
    for side in (NEIGHBOURS, 1.0 / NEIGHBOURS):
        for knee in model.knee_pa * side:
            if not KNEES[0] * top <= knee <= KNEES[-1] * top:
                break
            tried = replace(model, knee_pa=float(knee))
            near = estimate(tried, pseudo, loss="linear", starts=[found.q])
            near = replace(near, pseudo=found.pseudo, variance=found.variance)
            more = profile_intervals(tried, data, near, quantile, least)
            if not more:
                break
            out = {n: (min(low, more[n][0]), max(high, more[n][1])) for n, (low, high) in out.items()}
    return out


def interval_over_shapes(support: Support) -> dict[str, tuple[float, float]]:
    """Return the intervals of the forces over all Stribeck shapes that fit as well as the chosen one.

    The shape at low speed is not known, and the breakaway force depends on it. Parameters of the shape keep their own
    intervals. The chosen exponent is one of several usual values, so that at a single one the intervals are too narrow.
    """
    model, data, found = support.model, support.data, support.found
    out, dof = dict(support.intervals), len(data) - len(model.names) - model.chosen
    if not model.stribeck or model.exponent is None or dof < 1:
        return out
    least = float(np.sum(((found.pseudo - model.value(found.q, data)) / data.stderr_n) ** 2))
    pseudo = replace(data, friction_n=found.pseudo)
    for exponent, lorentzian in SHAPES:
        if (exponent, lorentzian) == (model.exponent, model.lorentzian):
            continue
        shape = replace(model, exponent=exponent, lorentzian=lorentzian)
        near = replace(estimate(shape, pseudo, loss="linear"), pseudo=found.pseudo, variance=found.variance)
        more = profile_intervals(shape, data, near, student(dof), least)
        for name in (n for n in more if not n.startswith("stribeck_")):
            out[name] = (min(out[name][0], more[name][0]), max(out[name][1], more[name][1]))
    return out


def _excess_p_value(model: FrictionModel, data: Observations, found: RobustEstimate, dof: int) -> float | None:
    """Return the p-value of the Stribeck part by an F-test against the law without it, on the same pseudo-values."""
    from scipy.special import fdtrc

    if not model.stribeck or dof < 1:
        return None
    smaller = model.without_stribeck()
    pseudo = replace(data, friction_n=found.pseudo)
    without = estimate(smaller, pseudo, loss="linear")
    cost = float(np.sum(((found.pseudo - model.value(found.q, data)) / data.stderr_n) ** 2))
    extra = len(model.names) - len(smaller.names)
    gain = float(np.sum(without.residual**2)) - cost
    return float(fdtrc(extra, dof, max(gain, 0.0) / extra / found.variance))
