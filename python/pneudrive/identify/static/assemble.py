"""Results of fits from their estimates: natural parameters, covariance, statistics."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pneudrive.estimate.information import covariance_of, shift_of
from pneudrive.identify.static.model import UNITS, unit_of
from pneudrive.identify.static.result import FrictionFit
from pneudrive.identify.static.robust import deviance

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from pneudrive.identify.determined import Undetermined
    from pneudrive.identify.static.model import FrictionModel, Observations, StaticLaw
    from pneudrive.identify.static.model_selection import Support
    from pneudrive.identify.static.robust import RobustEstimate

    Array = NDArray[np.float64]


def assembled(law: str, support: Support, lost: list[Undetermined], notes: list[str], provenance: dict) -> FrictionFit:
    """Return the fit of an estimate: natural parameters with covariance, intervals and statistics."""
    model, data, found = support.model, support.data, support.found
    theta = dict(zip(model.names, map(float, model.natural(found.q)), strict=True))
    shared = dict(zip(model.names, map(float, systematic(model, data, found)), strict=True))
    parameters = _parameters(law, model, theta)
    return FrictionFit(
        law=law,
        values=parameters,
        units={n: unit_of(n) for n in (*parameters, *model.names)},
        free=model.names,
        covariance=covariance(model, found),
        intervals=support.intervals,
        systematic=shared,
        undetermined=tuple(lost),
        notes=tuple(notes),
        statistics=statistics_of(model, data, found, support.scatter_n),
        provenance=provenance,
        model=model,
        observations=data,
        weights=found.weight,
        profiler=support.intervals.__getitem__,
    )


def _parameters(law: str, model: FrictionModel, theta: dict[str, float]) -> dict[str, float]:
    """Return every parameter of the requested law; NaN if its value is not determined."""
    names = ["coulomb", "viscous"]
    if law == "stribeck":
        names = ["coulomb", "breakaway", "stribeck_velocity", "stribeck_exponent", "viscous"]
        if model.lorentzian:
            names.remove("stribeck_exponent")
    parameters = {name: theta.get(name, float("nan")) for name in names}
    if "stribeck_exponent" in parameters and model.stribeck and model.exponent is not None:
        parameters["stribeck_exponent"] = float(model.exponent)
    for name in UNITS:
        if name in theta:
            parameters[name] = theta[name]
        elif f"{name}b" in theta:  # coulomb_ab -> both chambers
            parameters[name] = parameters[f"{name[:-1]}b"] = theta[f"{name}b"]
    return parameters


def statistics_of(
    model: StaticLaw, data: Observations, found: RobustEstimate, scatter_n: float = 0.0
) -> dict[str, float]:
    """Return the statistics of a fit; AICc and BIC come from the deviance."""
    residual, n = found.residual, len(data)
    weighted_mean = float(np.average(data.friction_n, weights=data.stderr_n**-2))
    spread = float(np.sum(((data.friction_n - weighted_mean) / data.stderr_n) ** 2))
    k, fit = len(model.names) + model.chosen + 1, deviance(data, found)
    small = 2.0 * k * (k + 1) / (n - k - 1) if n > k + 1 else np.inf
    return {
        "values": float(n),
        "degrees_of_freedom": float(n - len(model.names) - model.chosen),
        "scale": found.scale,
        "variance": found.variance,
        "scatter_n": scatter_n,
        "rms_n": float(np.sqrt(np.mean((residual * data.stderr_n) ** 2))),
        "outlying": float(np.sum(found.weight < 0.5)),
        "fit_percent": 100.0 * (1.0 - float(np.sqrt(np.sum(residual**2) / spread))) if spread > 0.0 else float("nan"),
        "starts": float(found.starts),
        "starts_agreeing": float(found.agreeing),
        "aicc": fit + 2.0 * k + small,
        "bic": fit + k * float(np.log(n)),
    }


def covariance(model: StaticLaw, found: RobustEstimate) -> Array:
    """Return the covariance in natural units, without directions that the data do not determine (open intervals)."""
    to_natural = model.natural_jacobian(found.q)
    matrix = to_natural @ covariance_of(found.jacobian, found.variance) @ to_natural.T
    return 0.5 * (matrix + matrix.T)


def systematic(model: StaticLaw, data: Observations, found: RobustEstimate) -> Array:
    """Return the standard uncertainty of each parameter from errors shared by all rows, to first order."""
    shift = shift_of(found.jacobian, data.u_systematic_n / data.stderr_n)
    return np.abs(model.natural_jacobian(found.q) @ shift)
