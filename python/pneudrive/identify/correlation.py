"""Parameters that change together, and the measurement that would tell them apart."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pneudrive.identify.model import UNITS, at_conditions, unit_of

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from pneudrive.identify.result import FrictionFit

    Array = NDArray[np.float64]

#: Correlation beyond which two parameters are said to change together.
TOGETHER = 0.9
#: Speeds that are tried as remedies: this far beyond the measured ones on either side.
BEYOND = 10.0
CANDIDATES = 60


def correlated(fit: FrictionFit) -> list[str]:
    """Say which pairs of parameters change together, and what would separate them."""
    matrix = fit.correlation
    out = []
    for i in range(len(fit.free)):
        for j in range(i + 1, len(fit.free)):
            if abs(matrix[i, j]) > TOGETHER:
                pair = f"{fit.free[i]} and {fit.free[j]} change together (correlation {matrix[i, j]:+.2f})"
                out.append(f"{pair}: {_remedy(fit, i, j)}")
    return out


def _remedy(fit: FrictionFit, i: int, j: int) -> str:
    """Find the speed at which one more value lowers the correlation most; pressures are named without a search."""
    names = (fit.free[i], fit.free[j])
    if any(UNITS.get(name, unit_of(name)).startswith("N/Pa") for name in names):
        return "pressures further apart, and not varied together, would separate them"
    if fit.observations is None:
        return "more speeds would separate them"
    speed = fit.observations.speed_m_s
    low, high = float(speed.min()), float(speed.max())
    tried = np.geomspace(low / BEYOND, high * BEYOND, CANDIDATES)
    gauge_a, gauge_b = (float(np.median(g)) for g in (fit.observations.gauge_a_pa, fit.observations.gauge_b_pa))
    at = at_conditions(tried, np.full(tried.size, gauge_a), np.full(tried.size, gauge_b))
    q = fit.coordinates
    to_natural = fit.model.natural_jacobian(q)
    gradient = np.linalg.solve(to_natural.T, fit.model.value_and_jacobian(q, at)[1].T).T
    noise = fit.statistics["variance"] * float(np.median(fit.observations.stderr_n)) ** 2
    carried = gradient @ fit.covariance  # (c, p)
    added = 1.0 / (noise + np.einsum("cp,cp->c", gradient, carried))
    after = fit.covariance[None] - added[:, None, None] * carried[:, :, None] * carried[:, None, :]
    together = np.abs(after[:, i, j]) / np.sqrt(after[:, i, i] * after[:, j, j])
    best = float(tried[int(np.argmin(together))])
    if best < low:
        return f"speeds below {1e3 * low:.3g} mm/s would separate them"
    if best > high:
        return f"speeds above {1e3 * high:.3g} mm/s would separate them"
    return f"more values near {1e3 * best:.2g} mm/s would separate them"
