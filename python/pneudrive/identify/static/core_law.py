"""Any law of the core, or a custom law, as a function of its free parameters."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from pneudrive.estimate.transforms import Transforms
from pneudrive.identify.static.model import StaticLaw

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from pneudrive.describe.tables.friction import Friction
    from pneudrive.identify.static.model import Observations

    Array = NDArray[np.float64]

#: Number of starts of a search, the given values included, and factor about these values.
STARTS, FACTOR = 5, 5.0


@dataclass(frozen=True)
class AnyLaw(StaticLaw):
    """Law of the core as a function of its free parameters, as a model for `estimate`.

    Parameters
    ----------
    friction : Friction
        Law, with the values of held parameters.
    names : tuple of str
        Free parameters of the law.
    start : tuple of float
        Start values, SI; the default is the values of `friction`.
    seed : int
        Seed of the further starts, within a factor of five of the given values.
    held : dict
        Further held parameter -> value, SI, in place of that of `friction`.
    """

    friction: Friction
    names: tuple[str, ...]
    start: tuple[float, ...] = field(default=(), compare=False)
    seed: int = field(default=1, compare=False)
    held: dict[str, float] = field(default_factory=dict, compare=False)
    stribeck: bool = field(default=False, init=False)  # not linear in its forces
    chosen: int = field(default=0, init=False)

    @cached_property
    def _core(self) -> tuple[str, dict[str, float], dict[str, Any]]:
        tables = self.friction.core()
        law, values = tables.pop("law"), tables.pop("parameters")
        return law, values | self.held, {key: value for key, value in tables.items() if value is not None}

    @cached_property
    def positive(self) -> NDArray[np.bool_]:
        """Mask of parameters whose coordinate is their logarithm, shape (p,)."""
        lower = {p["key"]: p["lower"] for p in self.friction.entry["parameters"]}
        return np.array([lower[n] is not None and lower[n] >= 0.0 for n in self.names])

    @property
    def given(self) -> Array:
        """Start values, shape (p,), SI."""
        return np.array(self.start or [self.friction.parameters[n] for n in self.names])

    @cached_property
    def transforms(self) -> Transforms:
        """Transforms of the parameters: logarithm of positive ones, and of Fs - Fc if both are free."""
        both = {"coulomb", "breakaway"} <= set(self.names)
        c, s = (self.names.index(n) if both else 0 for n in ("coulomb", "breakaway"))
        lower = np.where(self.positive, 0.0, -np.inf)
        return Transforms(lower, excess=s if both else None, over=c, least_excess=1e-6)

    def internal(self, theta: Array) -> Array:
        """Convert parameters to coordinates; zero becomes a small value."""
        return self.transforms.internal(np.where(self.positive, np.maximum(theta, 1e-12), theta))

    def bounds(self, data: Observations) -> tuple[Array, Array]:
        """Return the bounds of the coordinates: those of the law, and six decades around the given values."""
        del data
        given = self.internal(self.given)
        lower, upper = np.full(given.size, -np.inf), np.full(given.size, np.inf)
        lower[self.positive], upper[self.positive] = given[self.positive] - 14.0, given[self.positive] + 14.0
        for k, entry in enumerate(self.entries()):
            if entry["upper"] is not None and np.isfinite(entry["upper"]):
                top = self.internal(np.full(given.size, float(entry["upper"])))[k]
                upper[k] = min(upper[k], top)
        if self.transforms.excess is None:  # a held one of both bounds the other
            other = dict(self.friction.parameters) | self.held
            for k, name in enumerate(self.names):
                if name == "coulomb" and "breakaway" in other:
                    upper[k] = min(upper[k], np.log(other["breakaway"]))
                if name == "breakaway" and "coulomb" in other:
                    lower[k] = max(lower[k], np.log(other["coulomb"]))
        return lower, upper

    def without(self, name: str, value: float, start: Array) -> AnyLaw:
        """Return the law with one parameter held; `start`, shape (p,), has the start values of all, SI."""
        keep = [k for k, n in enumerate(self.names) if n != name]
        names, others = tuple(self.names[k] for k in keep), tuple(float(start[k]) for k in keep)
        return replace(self, names=names, start=others, held=self.held | {name: value})

    def value_and_jacobian(self, q: Array, data: Observations) -> tuple[Array, Array]:
        """Return friction and its derivative by the coordinates, shapes (n,) and (n, p)."""
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

    def starting_points(self, data: Observations) -> list[Array]:
        """Return start points: the given values and points near them."""
        given, (lower, upper) = self.internal(self.given), self.bounds(data)
        noise = np.random.default_rng(self.seed).uniform(-1.0, 1.0, (STARTS, given.size)) * np.log(FACTOR)
        steps = np.where(self.positive, np.vstack([np.zeros(given.size), noise]), 0.0)
        return list(np.clip(given + steps, lower, upper))

    def entries(self) -> list[dict[str, Any]]:
        """Return the entry of the core for each free parameter: bounds, unit, meaning."""
        by_key = {p["key"]: p for p in self.friction.entry["parameters"]}
        return [by_key[n] for n in self.names]

    def __str__(self) -> str:
        """Return the law's name."""
        return self.friction.law
