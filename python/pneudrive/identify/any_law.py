"""Fit any law of the core, or a law of one's own, to a friction map: values and derivatives come from the core.

`fit_friction` knows the laws that are linear in their forces and uses it: profile intervals, a smaller law where the
data carry no more. Here nothing is known of the law but its bounds, so that the search starts from several places and
the intervals are first order, in the logarithm of what is positive. What steady sliding does not show stays as given.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from pneudrive import __version__
from pneudrive.characterise.spread import student
from pneudrive.errors import FitError
from pneudrive.identify.assemble import SINGULAR_SHARE, covariance, internal_covariance, systematic
from pneudrive.identify.fit import ambient_of, fingerprint, recordings_of
from pneudrive.identify.law_fit import LawFit
from pneudrive.identify.observations import observations
from pneudrive.identify.robust import deviance, estimate
from pneudrive.identify.support import information_criteria

if TYPE_CHECKING:
    from collections.abc import Collection, Sequence

    import xarray as xr
    from numpy.typing import NDArray

    from pneudrive.describe import Friction
    from pneudrive.identify.model import Observations
    from pneudrive.identify.robust import Estimate

    Array = NDArray[np.float64]

#: Starts: the given values, and as many more within this factor of them.
STARTS, FACTOR = 5, 5.0
#: A derivative below this share of the largest friction, over the parameter's whole size, is none.
NO_EFFECT = 1e-9


@dataclass(frozen=True)
class AnyLaw:
    """A law of the core as a function of its free parameters; what `estimate` asks of a model.

    Parameters
    ----------
    friction : Friction
        Law, and the values of what is not free.
    names : tuple of str
        Free parameters of the law.
    start : tuple of float
        Where to search, SI; the values of `friction` where nothing is said.
    """

    friction: Friction
    names: tuple[str, ...]
    start: tuple[float, ...] = field(default=(), compare=False)
    stribeck: bool = field(default=False, init=False)  # no shortcuts of the Stribeck laws
    chosen: int = field(default=0, init=False)

    @cached_property
    def _core(self) -> tuple[str, dict[str, float], dict[str, Any]]:
        tables = self.friction.core()
        law, values = tables.pop("law"), tables.pop("parameters")
        return law, values, {key: value for key, value in tables.items() if value is not None}

    @cached_property
    def positive(self) -> NDArray[np.bool_]:
        """Parameters whose logarithm is the coordinate, shape (p,)."""
        lower = {p["key"]: p["lower"] for p in self.friction.entry["parameters"]}
        return np.array([lower[n] is not None and lower[n] >= 0.0 for n in self.names])

    @property
    def given(self) -> Array:
        """Where to search, shape (p,), SI."""
        return np.array(self.start or [self.friction.parameters[n] for n in self.names])

    @cached_property
    def excess(self) -> tuple[int, int] | None:
        """Places of Coulomb and breakaway force, where both are free: the coordinate is then ln(Fs - Fc)."""
        both = {"coulomb", "breakaway"} <= set(self.names)
        return (self.names.index("coulomb"), self.names.index("breakaway")) if both else None

    def natural(self, q: Array) -> Array:
        """Convert coordinates to parameters."""
        theta = np.where(self.positive, np.exp(np.where(self.positive, q, 0.0)), q)
        if self.excess is not None:
            c, s = self.excess
            theta[s] += theta[c]
        return theta

    def internal(self, theta: Array) -> Array:
        """Convert parameters to coordinates."""
        theta = np.array(theta, dtype=float)
        if self.excess is not None:
            c, s = self.excess
            theta[s] = max(theta[s] - theta[c], 1e-6 * theta[c])
        return np.where(self.positive, np.log(np.where(self.positive, np.maximum(theta, 1e-12), 1.0)), theta)

    def natural_jacobian(self, q: Array) -> Array:
        """Differentiate parameters by coordinates, shape (p, p)."""
        jac = np.diag(np.where(self.positive, np.exp(np.where(self.positive, q, 0.0)), 1.0))
        if self.excess is not None:
            c, s = self.excess
            jac[s, c] = jac[c, c]
        return jac

    def bounds(self, data: Observations) -> tuple[Array, Array]:
        """Bounds of the coordinates: the law's own, and six decades about the given values."""
        del data
        given = self.internal(self.given)
        lower, upper = np.full(given.size, -np.inf), np.full(given.size, np.inf)
        lower[self.positive], upper[self.positive] = given[self.positive] - 14.0, given[self.positive] + 14.0
        for k, entry in enumerate(self.entries()):
            if entry["upper"] is not None and np.isfinite(entry["upper"]):
                top = self.internal(np.full(given.size, float(entry["upper"])))[k]
                upper[k] = min(upper[k], top)
        if self.excess is None:  # one of both is fixed and bounds the other
            for k, name in enumerate(self.names):
                if name == "coulomb" and "breakaway" in self.friction.parameters:
                    upper[k] = min(upper[k], np.log(self.friction.parameters["breakaway"]))
                if name == "breakaway" and "coulomb" in self.friction.parameters:
                    lower[k] = max(lower[k], np.log(self.friction.parameters["coulomb"]))
        return lower, upper

    def value(self, q: Array, data: Observations) -> Array:
        """Friction at the rows of `data`, shape (n,), N."""
        return self.value_and_jacobian(q, data)[0]

    def value_and_jacobian(self, q: Array, data: Observations) -> tuple[Array, Array]:
        """Friction and its derivative by the coordinates, shapes (n,) and (n, p)."""
        from pneudrive import _core

        law, values, tables = self._core
        theta = self.natural(q)
        at = values | dict(zip(self.names, theta.tolist(), strict=True))
        names = [f"friction.parameters.{n}" for n in self.names]
        zero = np.zeros(len(data))
        force, slopes = _core.steady_friction_sensitivity(
            law, at, names, data.speed_m_s, data.gauge_a_pa, data.gauge_b_pa, zero, tables
        )
        return force, slopes @ self.natural_jacobian(q)

    def entries(self) -> list[dict[str, Any]]:
        """Return what the core says of each free parameter: bounds, unit, meaning."""
        by_key = {p["key"]: p for p in self.friction.entry["parameters"]}
        return [by_key[n] for n in self.names]

    def __str__(self) -> str:
        """Return the law's name."""
        return self.friction.law


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
        As of :func:`fit_friction`.
    friction : Friction
        The law, one's own too, with guesses of its parameters; what acts on it (pressure, direction) is kept.
    free : sequence of str, optional
        Parameters to be fitted; by default all that steady sliding shows.
    direction, ambient_pressure_pa, exclude_flags, loss
        As of :func:`fit_friction`.
    seed : int
        Of the further starts, within a factor of five of the guesses.

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
            f"law {friction.law!r} has no parameter {unknown[0]!r}", rule="its parameters: " + ", ".join(known)
        )
    seen = _seen(_with_sizes(AnyLaw(friction, known), data), data)
    model = _with_sizes(AnyLaw(friction, tuple(free) if free else seen), data)
    if not model.names:
        raise FitError("steady sliding shows none of the free parameters", value=", ".join(free or known))
    if len(data) <= len(model.names):
        raise FitError(
            "the friction map has too few values for this law",
            value=f"{len(data)} values, {len(model.names)} parameters",
        )
    found, starts, agreeing = _best(model, data, loss, seed)
    fit = _described(model, data, found, tuple(n for n in known if n not in seen), (starts, agreeing))
    origin = {
        "version": __version__,
        "map_sha256": fingerprint(data),
        "loss": loss,
        "seed": seed,
        "direction": "both" if direction is None else f"{direction:+d}",
        "ambient_pressure_pa": ambient,
        "recordings": recordings_of(friction_map),
    }
    return replace(fit, provenance=origin)


def _with_sizes(model: AnyLaw, data: Observations) -> AnyLaw:
    """Give guesses of zero a size: in a logarithm zero has none. It is that which changes friction by about a tenth."""
    start = model.given
    zero = model.positive & (start == 0.0)
    if not zero.any():
        return model
    q = model.internal(start)
    value, jac = model.value_and_jacobian(q, data)
    slope = np.abs(jac).max(axis=0) / np.diag(model.natural_jacobian(q))
    sizes = 0.1 * float(np.median(np.abs(value))) / np.where(slope > 0.0, slope, np.inf)
    uppers = [one["upper"] for one in model.entries()]
    most = np.array([np.inf if top is None else 0.5 * top for top in uppers])
    return replace(model, start=tuple(np.where(zero, np.minimum(sizes, most), start).tolist()))


def _seen(model: AnyLaw, data: Observations) -> tuple[str, ...]:
    value, jac = model.value_and_jacobian(model.internal(model.given), data)
    size = np.abs(jac).max(axis=0)
    return tuple(n for n, s in zip(model.names, size, strict=True) if s > NO_EFFECT * np.abs(value).max())


def _best(model: AnyLaw, data: Observations, loss: str, seed: int) -> tuple[Estimate, int, int]:
    """Estimate from the guesses and from places about them; the most likely one."""
    given = model.internal(model.given)
    noise = np.random.default_rng(seed).uniform(-1.0, 1.0, (STARTS, given.size)) * np.log(FACTOR)
    lower, upper = model.bounds(data)
    found = []
    for step in np.vstack([np.zeros(given.size), noise]):
        start = np.clip(given + np.where(model.positive, step, 0.0), lower, upper)
        found.append(estimate(model, data, loss=loss, start=start))  # pyright: ignore[reportArgumentType]
    sizes = np.array([deviance(data, one) for one in found])
    agreeing = int(np.sum(sizes < sizes.min() + 0.01))
    return found[int(np.argmin(sizes))], len(found), agreeing


def _described(
    model: AnyLaw, data: Observations, found: Estimate, unseen: tuple[str, ...], starts: tuple[int, int]
) -> LawFit:
    size = np.linalg.norm(found.jacobian, axis=0)
    dead = size == 0.0
    scaled = found.jacobian / np.where(dead, 1.0, size)
    _, singular, vt = np.linalg.svd(scaled, full_matrices=False)
    weak = vt[singular < SINGULAR_SHARE * singular[0]]
    open_ones = dead | found.active | (np.abs(weak) > 0.3).any(axis=0)
    dof = len(data) - len(model.names)
    low, high = _interval(model, found.q, internal_covariance(found), student(dof))
    statistics = {
        "values": float(len(data)),
        "degrees_of_freedom": float(dof),
        "scale": found.scale,
        "rms_n": float(np.sqrt(np.mean((found.residual * data.stderr_n) ** 2))),
        **information_criteria(model, data, found),
        "starts": float(starts[0]),
        "starts_agreeing": float(starts[1]),
    }
    return LawFit(
        model=model,
        parameters=dict(zip(model.names, model.natural(found.q).tolist(), strict=True)),
        intervals={n: (float(a), float(b)) for n, a, b in zip(model.names, low, high, strict=True)},
        systematic=dict(zip(model.names, systematic(model, data, found).tolist(), strict=True)),
        covariance=covariance(model, found),
        undetermined=tuple(n for n, is_open in zip(model.names, open_ones, strict=True) if is_open),
        unseen=unseen,
        statistics=statistics,
    )


def _interval(model: AnyLaw, q: Array, inner: Array, quantile: float) -> tuple[Array, Array]:
    """First-order intervals: of what is positive, in its logarithm."""
    theta, jac = model.natural(q), model.natural_jacobian(q)
    reach = quantile * np.sqrt(np.diag(jac @ inner @ jac.T))
    safe = np.where(model.positive, theta, 1.0)
    factor = np.exp(np.minimum(reach / safe, 50.0))
    return np.where(model.positive, theta / factor, theta - reach), np.where(
        model.positive, theta * factor, theta + reach
    )
