"""Scatter between levels beyond their standard errors.

Two runs of one seal can differ by far more than the strokes of each run do. Weighted by the standard error of the
strokes alone, the quietest run would then decide the fit. As in the random-effects model of a meta-analysis, one
variance for all levels is added to those of the strokes, such that the residuals become as large as they should be
[paule1982].
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from pneudrive.identify.robust import RobustEstimate, deviance, estimate

if TYPE_CHECKING:
    from pneudrive.identify.model import FrictionModel, Observations

#: Residuals that are larger than stated by more than chance makes them this often ask for a scatter.
CHANCE = 0.01
#: Degrees of freedom below which a scatter cannot be told from chance.
LEAST_DOF = 3
#: Deviance by which one wrong factor has to be the better explanation before it is taken (p = 0.01 for one parameter):
#: a scatter is the usual one, and the safe one.
CLEARLY = 6.6


def with_scatter(
    model: FrictionModel, data: Observations, found: RobustEstimate, *, loss: str
) -> tuple[Observations, RobustEstimate, float]:
    """Add a scatter to the standard errors where the residuals ask for it and are then more likely.

    The other explanation of large residuals, standard errors that are too small by one factor, is what an estimate
    without scatter assumes already; it is kept only where it is clearly more likely.

    Parameters
    ----------
    model, data, found
        The law, the values, and the estimate without scatter.
    loss : str
        As of the estimate.

    Returns
    -------
    Observations, RobustEstimate, float
        With the scatter's standard deviation in N (0 where there is none).
    """
    from scipy.optimize import brentq
    from scipy.special import chdtrc

    dof = len(data) - len(model.names) - model.chosen
    even = np.ptp(data.stderr_n) <= 1e-6 * data.stderr_n.max()
    if dof < LEAST_DOF or even or chdtrc(dof, dof * found.scale**2) > CHANCE:
        return data, found, 0.0

    def spread(scatter: float) -> Observations:
        return replace(data, stderr_n=np.hypot(data.stderr_n, scatter))

    def excess(log_scatter: float) -> float:
        nearer = estimate(model, spread(float(np.exp(log_scatter))), loss=loss, starts=[found.q])
        return float(np.log(nearer.scale))

    most = 2.0 * found.scale * float(data.stderr_n.max()) + 2.0 * float(np.ptp(data.friction_n))
    low, high = float(np.log(0.1 * data.stderr_n.min())), float(np.log(most))
    if excess(low) <= 0.0 or excess(high) >= 0.0:  # no scatter explains them
        return data, found, 0.0
    scatter = float(np.exp(brentq(excess, low, high, xtol=1e-2)))  # pyright: ignore[reportCallIssue, reportArgumentType]
    wider = spread(scatter)
    again = estimate(model, wider, loss=loss)
    if deviance(wider, again) < deviance(data, found) + CLEARLY:
        return wider, again, scatter
    return data, found, 0.0
