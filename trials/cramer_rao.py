"""The least half-width that a 95 % interval of a parameter of the Stribeck law can have, whatever the fit."""

from __future__ import annotations

import numpy as np

from pneudrive import _core


def half_widths(names, truth, speed, sigma):
    """Return the Cramer-Rao bound of each of `names`, from finite differences of the core's friction.

    `truth` holds all parameters in SI, `sigma` the standard deviation of friction at each `speed`, N.
    """
    columns = []
    for name in names:
        h = 1e-5 * truth[name]
        up = _core.steady_friction("stribeck", truth | {name: truth[name] + h}, speed, 0.0, 0.0)
        down = _core.steady_friction("stribeck", truth | {name: truth[name] - h}, speed, 0.0, 0.0)
        columns.append((up - down) / (2.0 * h * sigma))
    jac = np.column_stack(columns)
    return 1.96 * np.sqrt(np.diag(np.linalg.inv(jac.T @ jac)))
