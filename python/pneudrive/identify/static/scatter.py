"""Scatter between levels beyond their standard errors.

Two runs of one seal can differ much more than the strokes within each run. If values were weighted only by the standard
error of the strokes, the run with the least noise would dominate the fit. As in the random-effects model of a
meta-analysis, one variance
for all levels is added to those of the strokes, so that the residuals agree with it [paule1982].
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from pneudrive.identify.static.robust import RobustEstimate, deviance, estimate

if TYPE_CHECKING:
    from pneudrive.identify.static.model import FrictionModel, Observations

#: p-value of the residuals, against their standard errors, below which a scatter is added.
CHANCE = 0.01
#: Least degrees of freedom to detect a scatter.
LEAST_DOF = 3
#: Gain of deviance above which a common factor on the standard errors is preferred (p = 0.01 for one parameter);
#: a scatter is the usual and safe choice.
CLEARLY = 6.6


def with_scatter(
    model: FrictionModel, data: Observations, found: RobustEstimate, *, loss: str
) -> tuple[Observations, RobustEstimate, float]:
    """Add a scatter to the standard errors if the residuals are too large and this makes them more likely.

    The alternative is an estimate without scatter, whose standard errors are too small by a common factor. The scatter
    is kept only if it is clearly more likely.

    Parameters
    ----------
    model, data, found
        Law, values, and estimate without scatter.
    loss : str
        As for the estimate.

    Returns
    -------
    Observations, RobustEstimate, float
        Values, estimate, and standard deviation of the scatter in N (0 without one).
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
    if excess(low) <= 0.0 or excess(high) >= 0.0:  # a scatter does not explain them
        return data, found, 0.0
    scatter = float(np.exp(brentq(excess, low, high, xtol=1e-2)))  # pyright: ignore[reportCallIssue, reportArgumentType]
    wider = spread(scatter)
    again = estimate(model, wider, loss=loss)
    if deviance(wider, again) < deviance(data, found) + CLEARLY:
        return wider, again, scatter
    return data, found, 0.0
