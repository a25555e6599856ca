"""Fit any law of the core, or a custom law, to a friction map; the core gives values and derivatives.

`fit_friction` is for laws that are linear in their forces. It gives profile intervals, and fits a part of the law if
the data do not determine more. This module uses only the bounds of a law: the search has several starts, and the
intervals are
first order, in
the logarithm of positive parameters. Parameters without effect on steady sliding keep their given values.
"""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from pneudrive import __version__
from pneudrive.errors import FitError
from pneudrive.estimate.estimates import student
from pneudrive.estimate.information import weak_coordinates
from pneudrive.estimate.profile import profile_interval
from pneudrive.estimate.transforms import intervals
from pneudrive.identify.static.assemble import covariance, statistics_of, systematic
from pneudrive.identify.static.core_law import AnyLaw
from pneudrive.identify.static.fit import ambient_of, fingerprint, recordings_of, simulated
from pneudrive.identify.static.law_fit import LawFit
from pneudrive.identify.static.observations import observations
from pneudrive.identify.static.robust import estimate

if TYPE_CHECKING:
    from collections.abc import Collection, Sequence

    import xarray as xr
    from numpy.typing import NDArray

    from pneudrive.describe.tables.friction import Friction
    from pneudrive.identify.static.model import Observations
    from pneudrive.identify.static.robust import RobustEstimate

    Array = NDArray[np.float64]

#: Relative sensitivity of friction below which a parameter counts as without effect.
NO_EFFECT = 1e-9
#: Distance of an end of a profile from the estimate, in the logarithm, beyond which a side is open: as the search's.
FARTHEST_LOG = 14.0


def fit_any_law(
    friction_map: xr.Dataset,
    friction: Friction,
    free: Sequence[str] | None = None,
    *,
    direction: int | None = None,
    ambient_pressure_pa: float | None = None,
    exclude_flags: Collection[str] = (),
    loss: str = "huber",
    seed: int = 1,
) -> LawFit:
    """Fit the steady sliding of any law to a friction map.

    Parameters
    ----------
    friction_map : xarray.Dataset
        As for :func:`fit_friction`.
    friction : Friction
        Law, also a custom one, with guesses of its parameters; its modifiers (pressure, direction) are kept.
    free : sequence of str, optional
        Parameters to fit; by default all with an effect on steady sliding.
    direction, ambient_pressure_pa, exclude_flags, loss
        As for :func:`fit_friction`.
    seed : int
        Seed of the further starts, within a factor of five of the guesses.

    Returns
    -------
    LawFit
    """
    ambient = ambient_of(friction_map, ambient_pressure_pa, needed=True)
    data, _ = observations(friction_map, direction=direction, ambient_pressure_pa=ambient, exclude_flags=exclude_flags)
    known = tuple(friction.parameters)
    unknown = [n for n in free or () if n not in known]
    if unknown:
        raise FitError(
            f"law {friction.law!r} has no parameter {unknown[0]!r}", rule="parameters of the law: " + ", ".join(known)
        )
    seen = _seen(_with_sizes(AnyLaw(friction, known), data), data)
    model = _with_sizes(AnyLaw(friction, tuple(free) if free else seen, seed=seed), data)
    if not model.names:
        raise FitError("none of the free parameters has an effect on steady sliding", value=", ".join(free or known))
    if len(data) <= len(model.names):
        raise FitError(
            "the friction map has too few values for this law",
            value=f"{len(data)} values, {len(model.names)} parameters",
        )
    found = estimate(model, data, loss=loss)
    matrix, theta = covariance(model, found), model.natural(found.q)
    reach = student(len(data) - len(model.names)) * np.sqrt(np.diag(matrix))
    low, high = intervals(theta, reach, model.transforms.lower)
    lost = weak_coordinates(found.jacobian) | found.active
    origin = {
        "version": __version__,
        "map_sha256": fingerprint(data),
        "loss": loss,
        "seed": seed,
        "direction": "both" if direction is None else f"{direction:+d}",
        "ambient_pressure_pa": ambient,
        "recordings": recordings_of(friction_map),
    }
    return LawFit(
        model=model,
        values=dict(zip(model.names, theta.tolist(), strict=True)),
        units={entry["key"]: entry["unit"] for entry in model.entries()},
        free=model.names,
        covariance=matrix,
        intervals={n: (float(a), float(b)) for n, a, b in zip(model.names, low, high, strict=True)},
        systematic=dict(zip(model.names, systematic(model, data, found).tolist(), strict=True)),
        undetermined=tuple(n for n, is_lost in zip(model.names, lost, strict=True) if is_lost),
        unseen=tuple(n for n in known if n not in seen),
        notes=tuple(simulated(friction_map)),
        statistics=statistics_of(model, data, found),
        provenance=origin,
        observations=data,
        profiler=partial(_profile, model, data, found),
    )


def _profile(model: AnyLaw, data: Observations, found: RobustEstimate, name: str) -> tuple[float, float]:
    """Return the interval of one parameter by profile likelihood, on the pseudo-values of the estimate."""
    k, theta = model.names.index(name), model.natural(found.q)
    is_positive, spread = bool(model.positive[k]), float(np.sqrt(covariance(model, found)[k, k]))
    pseudo = replace(data, friction_n=found.pseudo)
    reach = student(len(data) - len(model.names))
    top = model.entries()[k]["upper"]
    upper = np.inf if top is None else float(top)

    def natural(coordinate: float) -> float:
        return min(float(np.exp(coordinate)) if is_positive else coordinate, upper)

    def held(coordinate: float, start: Array) -> tuple[float, Array]:
        tried = model.without(name, natural(coordinate), start)
        q = tried.internal(tried.given)
        if tried.names:
            q = estimate(tried, pseudo, loss="linear", starts=[q]).q
        cost = float(np.sum(((found.pseudo - tried.value(q, data)) / data.stderr_n) ** 2))
        return cost, np.insert(tried.natural(q), k, natural(coordinate))

    at, step = (float(np.log(theta[k])), spread / theta[k]) if is_positive else (float(theta[k]), spread)
    least = float(np.sum(((found.pseudo - model.value(found.q, data)) / data.stderr_n) ** 2))
    farthest = FARTHEST_LOG if is_positive else np.inf
    low, high = profile_interval(held, theta, at, reach * step, least, found.variance * reach**2, farthest)
    return natural(low), natural(high)


def _with_sizes(model: AnyLaw, data: Observations) -> AnyLaw:
    """Replace guesses of zero, which have no logarithm, by values that change friction by about a tenth."""
    start = model.given
    zero = model.positive & (start == 0.0)
    if not zero.any():
        return model
    q = model.internal(start)
    value, jac = model.value_and_jacobian(q, data)
    slope = np.abs(jac).max(axis=0) / np.diag(model.natural_jacobian(q))
    sizes = 0.1 * float(np.median(np.abs(value))) / np.where(slope > 0.0, slope, np.inf)
    uppers = [entry["upper"] for entry in model.entries()]
    most = np.array([np.inf if top is None else 0.5 * top for top in uppers])
    return replace(model, start=tuple(np.where(zero, np.minimum(sizes, most), start).tolist()))


def _seen(model: AnyLaw, data: Observations) -> tuple[str, ...]:
    value, jac = model.value_and_jacobian(model.internal(model.given), data)
    size = np.abs(jac).max(axis=0)
    return tuple(n for n, s in zip(model.names, size, strict=True) if s > NO_EFFECT * np.abs(value).max())
