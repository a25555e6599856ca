"""Fit a sliding friction law to a friction map."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from pneudrive import __version__
from pneudrive.characterise.pressure_line import CONFOUNDED
from pneudrive.characterise.spread import student
from pneudrive.errors import FitError
from pneudrive.identify.diagnose import Undetermined, choose_model, diagnose, without_support
from pneudrive.identify.model import PRESSURE_NAMES, UNITS, FrictionModel, Observations
from pneudrive.identify.observations import observations
from pneudrive.identify.profile import profile_intervals
from pneudrive.identify.result import FrictionFit
from pneudrive.identify.robust import Estimate, deviance, estimate
from pneudrive.identify.scatter import with_scatter

if TYPE_CHECKING:
    from collections.abc import Collection

    import xarray as xr
    from numpy.typing import NDArray

    Array = NDArray[np.float64]

LAWS = ("coulomb", "stribeck")


def fit_friction(
    friction_map: xr.Dataset,
    law: str = "stribeck",
    *,
    pressure_dependence: bool = False,
    direction: int | None = None,
    stribeck_exponent: float | None = 2.0,
    robust: bool = True,
    ambient_pressure_pa: float | None = None,
    exclude_flags: Collection[str] = (),
) -> FrictionFit:
    """Fit a sliding friction law to a friction map by weighted robust least squares.

    Parameters
    ----------
    friction_map : xarray.Dataset
        As returned by :func:`pneudrive.characterise`: one dimension ``row``, SI units.
    law : str
        ``coulomb`` (with a viscous part) or ``stribeck``.
    pressure_dependence : bool
        Coulomb and breakaway force linear in the gauge pressure of each chamber.
    direction : int or None
        None: friction of paired directions. +1 or -1: that direction alone, from the force balance; the force
        zero is then part of the Coulomb force.
    stribeck_exponent : float or None
        Fixed exponent (2 is Gauss, 1 is Tustin's exponential), or None to fit it.
    robust : bool
        Huber's loss, so that single outlying levels do not move the fit.
    ambient_pressure_pa : float or None
        Pressure from which gauge pressures count; None takes ``friction_map.attrs["ambient_pressure_pa"]``.
        Needed with `pressure_dependence` only.
    exclude_flags : collection of str
        Rows with any of these flags are left out.

    Returns
    -------
    FrictionFit
        Estimates, covariance, 95 % intervals, what the data cannot determine.

    Raises
    ------
    FitError
        If the law is unknown, the map lacks columns, or no usable rows remain.

    Notes
    -----
    Rows are weighted by their statistical standard error. Its common scale is estimated from the residuals, so
    that intervals (Student's t; profile likelihood, which for the Stribeck velocity and the breakaway force is far
    from symmetric) also hold where the stated errors are too small by a factor. Systematic uncertainty, which all
    rows share, is carried to each parameter separately (`FrictionFit.systematic`). Methods: [huber2009],
    [bates1988], [smyth2004], [paule1982].
    """
    _check(law, stribeck_exponent, direction)
    ambient = _ambient(friction_map, ambient_pressure_pa, pressure_dependence)
    data, notes = observations(
        friction_map, direction=direction, ambient_pressure_pa=ambient, exclude_flags=exclude_flags
    )
    model, lost = choose_model(law, data, exponent=stribeck_exponent, pressure_dependence=pressure_dependence)
    notes += _confounding(data, pressure_dependence)
    support = _shrunk_to_the_data(model, data, robust)
    model, data, found, intervals = support.model, support.data, support.found, support.intervals
    lost += support.lost + diagnose(model, data, found, intervals)
    if support.scatter_n > 0.0:
        notes.append(
            f"the levels scatter by {support.scatter_n:.2g} N more than their standard errors say (runs differ, or the "
            "law does not hold); the weights and the intervals count it"
        )
    if len(data) == len(model.names):
        notes.append(
            "as many values as parameters: the intervals rest on the stated standard errors alone, and a further run "
            "may lie far outside them"
        )
    provenance = {
        "version": __version__,
        "map_sha256": fingerprint(data),
        "direction": "both" if direction is None else f"{direction:+d}",
        "robust": robust,
        "pressure_dependence": pressure_dependence,
        "ambient_pressure_pa": ambient,
        "exclude_flags": sorted(exclude_flags),
    }
    return _result(law, support, lost, notes, provenance)


def fit_directions(friction_map: xr.Dataset, law: str = "stribeck", **options: object) -> dict[int, FrictionFit]:
    """Fit each direction alone: {+1: fit, -1: fit}; options as of :func:`fit_friction`.

    Lip seals are directional by 10 to 40 %. A force zero or an area error looks the same: it adds to one Coulomb
    force what it takes from the other, and only a fit of the pairs is free of it.
    """
    return {d: fit_friction(friction_map, law, direction=d, **options) for d in (1, -1)}  # type: ignore[arg-type]


@dataclass(frozen=True)
class _Support:
    """The part of a law that the values support, with its estimate."""

    model: FrictionModel
    data: Observations
    found: Estimate
    scatter_n: float
    intervals: dict[str, tuple[float, float]]
    lost: list[Undetermined]


def _shrunk_to_the_data(model: FrictionModel, stated: Observations, robust: bool) -> _Support:
    """Fit, and leave out the parts of the law that the values do not support: they would only blur the others."""
    lost: list[Undetermined] = []
    while True:
        dof = len(stated) - len(model.names)
        found = estimate(model, stated, robust=robust and dof > 0, fixed_scale=dof == 0)
        data, found, scatter = with_scatter(model, stated, found, robust=robust)
        intervals = profile_intervals(model, data, found, student(dof))
        smaller, statements = without_support(model, data, found, intervals, _excess_p_value(model, data, found, dof))
        if smaller == model:
            return _Support(model, data, found, scatter, intervals, lost)
        model, lost = smaller, lost + statements


def fingerprint(data: Observations) -> str:
    """SHA-256 of the values that the fit used."""
    import hashlib

    columns = (data.speed_m_s, data.friction_n, data.stderr_n, data.gauge_a_pa, data.gauge_b_pa)
    return hashlib.sha256(np.ascontiguousarray(np.stack(columns), dtype="<f8").tobytes()).hexdigest()


def _check(law: str, exponent: float | None, direction: int | None) -> None:
    if law not in LAWS:
        import difflib

        near = difflib.get_close_matches(str(law), LAWS, 1)
        raise FitError(
            f"there is no sliding law {law!r} to fit",
            rule="laws that can be fitted to a friction map: " + ", ".join(LAWS),
            remedy=f"did you mean {near[0]!r}?" if near else "bristle parameters need presliding recordings",
        )
    if exponent is not None and not 0.0 < exponent < np.inf:
        raise FitError("the Stribeck exponent must be positive", value=f"stribeck_exponent = {exponent}")
    if direction not in (None, 1, -1):
        raise FitError("direction must be None, +1 or -1", value=f"direction = {direction!r}")


def _ambient(friction_map: xr.Dataset, given: float | None, needed: bool) -> float:
    value = given if given is not None else friction_map.attrs.get("ambient_pressure_pa")
    if value is None:
        if needed:
            raise FitError(
                "the friction map does not say the ambient pressure",
                rule="with pressure_dependence forces are linear in gauge pressure",
                remedy="pass ambient_pressure_pa, for example 101300.0",
            )
        return 0.0
    if not np.isfinite(value) or value <= 0.0:
        raise FitError("the ambient pressure must be positive", value=f"ambient_pressure_pa = {value}")
    return float(value)


def _confounding(data: Observations, pressure_dependence: bool) -> list[str]:
    notes = []
    pressure = data.gauge_a_pa + data.gauge_b_pa
    if len(data) < 3 or np.ptp(pressure) < 1e4:
        return notes
    if not pressure_dependence:
        span = 1e-5 * np.ptp(pressure)
        notes.append(
            f"the chamber pressures of the rows differ by {span:.2g} bar in sum and the fit averages over them; "
            "fit with pressure_dependence or select rows of one pressure"
        )
    if np.ptp(np.log(data.speed_m_s)) > 0.0:
        correlation = float(np.corrcoef(np.log(data.speed_m_s), pressure)[0, 1])
        if abs(correlation) > CONFOUNDED:
            notes.append(
                f"speed and pressure change together over the rows (correlation {correlation:+.2f}): "
                "what the fit gives to speed may belong to pressure, and the other way round"
            )
    return notes


def _excess_p_value(model: FrictionModel, data: Observations, found: Estimate, dof: int) -> float | None:
    """F test of the Stribeck part against the same law without it, on the same pseudo-values."""
    from dataclasses import replace

    from scipy.special import fdtrc

    if not model.stribeck or dof < 1:
        return None
    smaller = FrictionModel("coulomb", chambers=model.chambers, viscous=model.viscous)
    pseudo = replace(data, friction_n=found.pseudo)
    without = estimate(smaller, pseudo, robust=False)
    cost = float(np.sum(((found.pseudo - model.value(found.q, data)) / data.stderr_n) ** 2))
    extra = len(model.names) - len(smaller.names)
    gain = float(np.sum(without.residual**2)) - cost
    return float(fdtrc(extra, dof, max(gain, 0.0) / extra / found.variance))


def _covariance(model: FrictionModel, found: Estimate) -> Array:
    """Covariance in natural units; directions that the data do not determine are left out (the intervals are open)."""
    size = np.linalg.norm(found.jacobian, axis=0)
    size[size == 0.0] = 1.0
    scaled = found.jacobian / size
    inner = np.linalg.pinv(scaled.T @ scaled, rcond=1e-8, hermitian=True) / np.outer(size, size)
    to_natural = model.natural_jacobian(found.q)
    covariance = found.variance * to_natural @ inner @ to_natural.T
    return 0.5 * (covariance + covariance.T)


def _systematic(model: FrictionModel, data: Observations, found: Estimate) -> Array:
    """Carry what all rows share to a standard uncertainty of each parameter, to first order."""
    size = np.linalg.norm(found.jacobian, axis=0)
    size[size == 0.0] = 1.0
    shift = np.linalg.pinv(found.jacobian / size, rcond=1e-4) @ (data.u_systematic_n / data.stderr_n) / size
    return np.abs(model.natural_jacobian(found.q) @ shift)


def information_criteria(model: FrictionModel, data: Observations, found: Estimate) -> dict[str, float]:
    """AICc and BIC from the deviance, see `robust.deviance`."""
    n, k, fit = len(data), len(model.names) + 1, deviance(data, found)
    small = 2.0 * k * (k + 1) / (n - k - 1) if n > k + 1 else np.inf
    return {"aicc": fit + 2.0 * k + small, "bic": fit + k * float(np.log(n))}


def _result(law: str, support: _Support, lost: list[Undetermined], notes: list[str], provenance: dict) -> FrictionFit:
    model, data, found, intervals = support.model, support.data, support.found, support.intervals
    theta = dict(zip(model.names, map(float, model.natural(found.q)), strict=True))
    systematic = dict(zip(model.names, map(float, _systematic(model, data, found)), strict=True))
    parameters = {name: theta.get(name, float("nan")) for name in ("coulomb", "viscous")}
    if law == "stribeck":
        exponent = theta.get("stribeck_exponent", model.exponent if model.stribeck else float("nan"))
        parameters = {
            "coulomb": theta["coulomb"],
            "breakaway": theta.get("breakaway", float("nan")),
            "stribeck_velocity": theta.get("stribeck_velocity", float("nan")),
            "stribeck_exponent": float(exponent if exponent is not None else np.nan),
            "viscous": theta.get("viscous", float("nan")),
        }
    for name in UNITS:
        if name in theta and name not in parameters:
            parameters[name] = theta[name]
        elif f"{name}b" in theta:  # coulomb_ab -> both chambers
            parameters[name] = parameters[f"{name[:-1]}b"] = theta[f"{name}b"]
    for name in parameters:
        if name not in theta and f"{name[:-1]}ab" not in theta and not (name == "stribeck_exponent" and model.stribeck):
            intervals = intervals | {name: (-np.inf if name in PRESSURE_NAMES else 0.0, np.inf)}
    residual = found.residual
    weighted_mean = float(np.average(data.friction_n, weights=data.stderr_n**-2))
    spread = float(np.sum(((data.friction_n - weighted_mean) / data.stderr_n) ** 2))
    statistics = {
        "values": float(len(data)),
        "degrees_of_freedom": float(len(data) - len(model.names)),
        "scale": found.scale,
        "variance": found.variance,
        "scatter_n": support.scatter_n,
        "rms_n": float(np.sqrt(np.mean((residual * data.stderr_n) ** 2))),
        "outlying": float(np.sum(found.weight < 0.5)),
        "fit_percent": 100.0 * (1.0 - float(np.sqrt(np.sum(residual**2) / spread))) if spread > 0.0 else float("nan"),
        **information_criteria(model, data, found),
    }
    return FrictionFit(
        law=law,
        parameters=parameters,
        free=model.names,
        covariance=_covariance(model, found),
        intervals=intervals,
        systematic=systematic,
        undetermined=tuple(lost),
        notes=tuple(notes),
        statistics=statistics,
        provenance=provenance,
        model=model,
        observations=data,
        weights=found.weight,
    )
