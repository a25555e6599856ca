"""Sliding friction laws as functions of their parameters, for least squares.

The core evaluates a law and its derivatives (``pneudrive._core.steady_friction_sensitivity``). `AnyLaw` represents any
law of the core, or a custom law. The laws of `FrictionModel` are linear in their forces at a given Stribeck velocity
and exponent,

    F(|v|) = Fc b_c(|v|) + Fs b_s(|v|) + Fv |v|,

with forces that depend on the chambers' pressures. The columns b are the core's derivatives with respect to the forces.
"""

from __future__ import annotations

import hashlib
from dataclasses import asdict, dataclass, field, fields, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from pneudrive import _core
from pneudrive.arrays import Array, ArrayPair, Bools, Columns, Ints, Keyed, NamedNumbers, Plain, by_name, rows_of
from pneudrive.constants import STANDARD_ATMOSPHERE_PA
from pneudrive.errors import FitError
from pneudrive.estimate.autocorrelation import moderate
from pneudrive.estimate.estimates import Transforms
from pneudrive.files.inputs import INPUTS, stored_input
from pneudrive.friction.friction_map import FILE, read_map
from pneudrive.identify.base import SIMULATED
from pneudrive.identify.identified import number_table, sentence
from pneudrive.units import parse, parse_pressure

if TYPE_CHECKING:
    from collections.abc import Collection

    import xarray as xr
    from numpy.typing import ArrayLike, NDArray

    from pneudrive.describe.tables.friction import Friction
    from pneudrive.friction.characterisation import Characterisation

    AnyMap = xr.Dataset | Characterisation | str | Path


#: Forces that may depend on pressure.
FORCES = ("coulomb", "breakaway")
#: Slopes over the gauge pressures of the chambers, in the order of a fit.
PRESSURE_NAMES = ("coulomb_a", "coulomb_b", "breakaway_a", "breakaway_b")
#: Terms of the gauge pressures g of the chambers: linear only; with squares; with g/(1 + |g|/knee) instead of g; with
#: the product of both gauge pressures.
PRESSURE_FORMS = ("linear", "quadratic", "saturating", "interaction")
UNITS: dict[str, str] = number_table("friction_units")
#: Bounds of the Stribeck exponent; values in the literature lie in 0.5 to 2 [armstrong1994].
EXPONENT_BOUNDS = (0.3, 4.0)
#: Start values of a free Stribeck exponent: Tustin's exponential, Gauss, and one between.
EXPONENT_STARTS = (1.0, 1.5, 2.0)
STARTS_PER_DECADE = 8
KEPT_STARTS = 3
#: Smallest excess Fs - Fc relative to the largest friction: far below any noise.
EXCESS_FLOOR = 1e-9


def unit_of(name: str) -> str:
    """Return the SI unit of a free parameter; a coefficient shared by both chambers (``_ab``) has the same unit."""
    return UNITS[name.removesuffix("b") if name.endswith("_ab") else name]


@dataclass(frozen=True)
class Observations:
    """Mean friction values for a fit, one row for each independent value.

    Attributes
    ----------
    speed_m_s, friction_n, stderr_n : ndarray, shape (n,)
        Speed (> 0), friction (> 0 opposes the motion), and its standard error (shrunk towards a trend over speed).
    gauge_a_pa, gauge_b_pa : ndarray, shape (n,)
        Gauge pressures of the chambers.
    u_systematic_n : ndarray, shape (n,)
        Standard uncertainty of errors shared by all rows (zero if the map does not state it).
    recording : ndarray, shape (n,)
        Name of the recording of each row.
    """

    speed_m_s: Array
    friction_n: Array
    stderr_n: Array
    gauge_a_pa: Array
    gauge_b_pa: Array
    u_systematic_n: Array
    recording: NDArray

    @property
    def gauges_pa(self) -> ArrayPair:
        """Gauge pressures of chambers a and b in Pa; one value for each row."""
        return self.gauge_a_pa, self.gauge_b_pa

    def __len__(self) -> int:
        return int(self.speed_m_s.size)

    def take(self, rows: Bools | Ints) -> Observations:
        """Return the observations in these rows."""
        return Observations(*(getattr(self, field.name)[rows] for field in fields(self)))


def at_conditions(
    speed_m_s: ArrayLike, gauge_a_pa: ArrayLike, gauge_b_pa: ArrayLike, ambient_pa: float = STANDARD_ATMOSPHERE_PA
) -> Observations:
    """Return rows to evaluate a law at given speeds and gauge pressures (broadcast); their friction is a dummy value.

    Each condition is a number or an array in SI, or a quantity such as ``"3 bar abs"``. `ambient_pa` converts absolute
    pressures to gauge. The sign of a speed is ignored.
    """
    given: list[Any] = [parse(speed_m_s, "m/s") if isinstance(speed_m_s, str) else speed_m_s]
    for gauge in (gauge_a_pa, gauge_b_pa):
        is_text = isinstance(gauge, str)
        given.append(parse_pressure(gauge).absolute_pa(ambient_pa) - ambient_pa if is_text else gauge)
    speed, a, b = (values.ravel() for values in np.broadcast_arrays(*(np.asarray(v, dtype=float) for v in given)))
    one = np.ones(speed.size)
    return Observations(np.abs(speed), one, one, a, b, 0.0 * one, np.full(one.size, ""))


class StaticLaw:
    """Interface of a friction law: steady sliding friction as a function of its free parameters."""

    names: Any  # tuple of str
    stribeck: Any = False  # whether the law has a Stribeck part and is linear in its forces
    chosen: Any = 0  # numbers chosen by the data in addition to the parameters
    transforms: Any  # `Transforms` of the parameters
    bounds: Any  # values -> lower and upper bounds of the internal coordinates
    starting_points: Any  # values -> start coordinates, best first
    force_and_slopes: Any  # parameters, values -> friction (n,) and its derivatives with respect to parameters (n, p)

    def internal(self, theta: Array) -> Array:
        """Convert parameters to internal coordinates."""
        return self.transforms.internal(theta)

    def value(self, q: Array, data: Observations) -> Array:
        """Return the friction at the rows of `data` in N, shape (n,)."""
        return self.force_and_slopes(self.transforms.natural(q), data)[0]

    def value_and_jacobian(self, q: Array, data: Observations) -> ArrayPair:
        """Return friction and its derivatives with respect to the internal coordinates, shapes (n,) and (n, p)."""
        force, slopes = self.force_and_slopes(self.transforms.natural(q), data)
        return force, slopes @ self.transforms.jacobian(q)


@dataclass(frozen=True)
class FrictionModel(StaticLaw):
    """Sliding law with the choice of its free parameters.

    Parameters
    ----------
    law : str
        ``coulomb`` (with viscous) or ``stribeck``.
    exponent : float or None
        Fixed Stribeck exponent; None makes it a free parameter.
    chambers : tuple of str
        Chambers whose gauge pressure acts on the forces: (), ("a",), ("b",), ("a", "b"), or ("ab",) if both chambers
        have the same slope, which is then one free parameter.
    viscous : bool
        Whether the viscous coefficient is free; otherwise it is zero.
    lorentzian : bool
        Stribeck curve 1/(1 + (v/vs)^2), without an exponent, instead of exp(-(v/vs)^n).
    pressure : str
        Dependence of the forces on the chambers' pressures, one of ``PRESSURE_FORMS``.
    knee_pa : float or None
        Gauge pressure at which a saturating dependence has half of the force that its initial slope would give.
    """

    law: str
    exponent: float | None = 2.0
    chambers: tuple[str, ...] = ()
    viscous: bool = True
    lorentzian: bool = False
    pressure: str = "linear"
    knee_pa: float | None = None

    @property
    def stribeck(self) -> bool:
        """Whether the law has a Stribeck part."""
        return self.law == "stribeck"

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Free parameters in natural units, in the order of every vector and matrix of the fit."""
        names = ["coulomb"]
        if self.stribeck:
            names += ["breakaway", "stribeck_velocity"]
            if self.exponent is None:
                names.append("stribeck_exponent")
        if self.viscous:
            names.append("viscous")
        names += [f"coulomb_{c}" for c in self.terms]
        if self.stribeck:
            names += [f"breakaway_{c}" for c in self.terms]
        return tuple(names)

    def without_stribeck(self) -> FrictionModel:
        """Return the law without its Stribeck part."""
        return replace(self, law="coulomb", exponent=2.0, lorentzian=False)

    @property
    def terms(self) -> tuple[str, ...]:
        """Suffixes of the parameters that describe the dependence of a force on pressure, slopes first."""
        terms = self.chambers
        if self.pressure == "quadratic":
            terms += tuple(f"curve_{c}" for c in self.chambers)
        if self.pressure == "interaction" and len(self.chambers) == 2:
            terms += ("product",)
        return terms

    @property
    def chosen(self) -> int:
        """Number of values chosen from candidates, such as a knee, in addition to the free parameters."""
        return int(self.knee_pa is not None)

    def table(self) -> Plain:
        """Return the model as a table for a file."""
        table: Plain = asdict(self) | {"chambers": list(self.chambers)}
        exponent, law = table.pop("exponent"), table.pop("law")
        table = {key: value for key, value in table.items() if value is not None}
        return {"law": law, "stribeck_exponent": "free" if exponent is None else exponent} | table

    @classmethod
    def of_table(cls, table: Keyed) -> FrictionModel:
        """Return the model of a table."""
        known: Plain = {**table, "chambers": tuple(table["chambers"])}
        exponent = known.pop("stribeck_exponent")
        return cls(exponent=None if exponent == "free" else float(exponent), **known)

    @cached_property
    def transforms(self) -> Transforms:
        """Transformation to internal coordinates: log(Fs - Fc), log vs, log n; others unchanged."""
        positive = [name.startswith("stribeck_") for name in self.names]
        excess = 1 if self.stribeck else None
        return Transforms(np.where(positive, 0.0, -np.inf), excess=excess, over=0, least_excess=EXCESS_FLOOR)

    def bounds(self, data: Observations) -> ArrayPair:
        """Return lower and upper bounds of the internal coordinates for these data.

        Forces are not negative. The Stribeck velocity may be outside the measured speeds by a factor of 30. Beyond this
        factor, the Stribeck part is a constant or a step for these data.
        """
        lower = np.full(len(self.names), -np.inf)
        upper = np.full(len(self.names), np.inf)
        lower[0] = 0.0
        top = np.max(np.abs(data.friction_n))
        if self.stribeck:
            lower[1], upper[1] = np.log(top * EXCESS_FLOOR), np.log(top * 1e3)
            lower[2] = np.log(data.speed_m_s.min() / 30.0)
            upper[2] = np.log(data.speed_m_s.max() * 30.0)
            if self.exponent is None:
                lower[3], upper[3] = np.log(EXPONENT_BOUNDS)
        if self.viscous:
            lower[self.names.index("viscous")] = 0.0
        return lower, upper

    # -- values and derivatives -------------------------------------------------------------------------------

    def _curve(self, speed: Array, velocity: float, exponent: float | None) -> Columns:
        """Return the core's derivatives with respect to forces and shape parameters, for an excess Fs - Fc of 1 N."""
        values, choices, names = {"coulomb": 1.0, "viscous": 0.0}, None, ["coulomb"]
        if self.stribeck:
            values |= {"breakaway": 2.0, "stribeck_velocity": velocity}
            names += ["breakaway", "stribeck_velocity"]
            choices = {"stribeck_shape": "lorentzian" if self.lorentzian else "free"}
        if self.stribeck and not self.lorentzian:
            values["stribeck_exponent"] = exponent or 2.0
        if self.exponent is None:
            names.append("stribeck_exponent")
        zero = np.zeros(speed.size)
        paths = [f"friction.parameters.{name}" for name in names]
        _, slopes = _core.steady_friction_sensitivity(self.law, values, paths, speed, zero, zero, zero, choices)
        if self.stribeck:  # as exact as a difference of frictions: what is below their rounding error has no effect
            slopes[:, 1] = (1.0 + slopes[:, 1]) - 1.0
            slopes[slopes[:, 1] == 0.0, 2:] = 0.0
        return dict(zip(names, slopes.T, strict=True))

    def _by_force(self, curve: Columns, data: Observations) -> Columns:
        """Return the derivatives with respect to forces, pressure terms and viscous coefficient, shape (..., n)."""
        out = {"viscous": np.broadcast_to(data.speed_m_s, curve["coulomb"].shape)}
        for term, pressure in self._pressures(data).items():
            for force in FORCES[: 1 + self.stribeck]:
                out[f"{force}{term}"] = curve[force] * pressure
        return {name: out[name] for name in self.names if name in out}

    def force_and_slopes(self, theta: Array, data: Observations) -> ArrayPair:
        """Return friction and its derivatives with respect to the parameters, shapes (n,) and (n, p)."""
        value = by_name(self.names, theta)
        velocity = value.get("stribeck_velocity", 1.0)
        exponent = value.get("stribeck_exponent", self.exponent)
        curve = self._curve(np.ascontiguousarray(data.speed_m_s), velocity, exponent)
        columns = self._by_force(curve, data)
        force = np.sum([value[name] * column for name, column in columns.items()], axis=0)
        if self.stribeck:
            excess = np.zeros(len(data))
            for term, pressure in self._pressures(data).items():
                excess += (value[f"breakaway{term}"] - value[f"coulomb{term}"]) * pressure
            for name in self.names:
                if name.startswith("stribeck_"):
                    columns[name] = excess * curve[name]
        return force, np.column_stack([columns[name] for name in self.names])

    def linear_columns(self, data: Observations, log_velocities: Array, log_exponent: float | None) -> Array:
        """Return the derivatives with respect to the forces at each Stribeck velocity, shape (g, n, p).

        The Stribeck curve depends only on v / vs, so that one call of the core covers all g velocities.
        """
        exponent = self.exponent or (None if log_exponent is None else float(np.exp(log_exponent)))
        relative = (data.speed_m_s / np.exp(log_velocities)[:, None]).ravel()
        curve = self._curve(relative, 1.0, exponent).items()
        columns = self._by_force({name: column.reshape(log_velocities.size, -1) for name, column in curve}, data)
        return np.stack([*columns.values()], axis=-1)

    def starting_points(self, data: Observations) -> list[Array]:
        """Return start coordinates, best first.

        At each Stribeck velocity of a logarithmic grid, non-negative forces and excess follow from a linear problem.
        The best local minima of the grid are kept; minima with an excess beyond its bound come last.
        """
        if not self.stribeck:
            return [self._linear_start(data, self.linear_columns(data, np.zeros(1), None)[0], 0.0, None)[1]]
        lower, upper = self.bounds(data)
        count = max(3, round((upper[2] - lower[2]) / np.log(10.0) * STARTS_PER_DECADE))
        exponents = [None] if self.exponent is not None else [float(np.log(n)) for n in EXPONENT_STARTS]
        kept: list[tuple[float, Array]] = []
        for log_n in exponents:
            grid = np.linspace(lower[2] + 0.1, upper[2] - 0.1, count)
            columns = self.linear_columns(data, grid, log_n)
            scored = [self._linear_start(data, own, lv, log_n) for own, lv in zip(columns, grid, strict=True)]
            scored = [(cost if q[1] <= upper[1] else np.inf, q) for cost, q in scored]  # clipped, it is another curve
            costs = np.array([s[0] for s in scored])
            padded = np.r_[np.inf, costs, np.inf]
            minima = np.flatnonzero((costs <= padded[:-2]) & (costs <= padded[2:]))
            kept += [scored[i] for i in minima]
        kept.sort(key=lambda s: s[0])
        return [np.clip(q, lower + 1e-12, upper) for _, q in kept[:KEPT_STARTS]]

    def _linear_start(
        self, data: Observations, columns: Array, log_velocity: float, log_exponent: float | None
    ) -> tuple[float, Array]:
        """Return the sum of absolute residuals and the best coordinates at a Stribeck velocity and exponent."""
        from scipy.optimize import nnls

        names = [n for n in self.names if not n.startswith("stribeck_")]
        if self.stribeck:  # from (Fc, Fs) to (Fc, Fs - Fc), both not negative
            columns[:, 0] += columns[:, 1]
        signed = [i for i, n in enumerate(names) if n not in ("coulomb", "breakaway", "viscous")]
        weight = 1.0 / data.stderr_n
        size = np.linalg.norm(columns * weight[:, None], axis=0)
        size[size == 0.0] = 1.0
        design = np.hstack([columns / size, -columns[:, signed] / size[signed]])
        solution, residual = np.zeros(design.shape[1]), data.friction_n
        for _ in range(3):  # three reweightings towards least absolute deviations: outliers must not choose the basin
            solution, _ = nnls(design * weight[:, None], data.friction_n * weight, maxiter=30 * design.shape[1])
            residual = (data.friction_n - design @ solution) / data.stderr_n
            typical = np.median(np.abs(residual)) + 1e-12 * np.max(np.abs(data.friction_n / data.stderr_n))
            weight = 1.0 / (data.stderr_n * np.sqrt(np.maximum(np.abs(residual) / (2.0 * typical), 1.0)))
        forces = solution[: len(names)]
        forces[signed] -= solution[len(names) :]
        value = dict(zip(names, forces / size, strict=True))
        if self.stribeck:
            value["breakaway"] += value["coulomb"]
            value["stribeck_velocity"] = np.exp(log_velocity)
            value["stribeck_exponent"] = 2.0 if log_exponent is None else np.exp(log_exponent)
        q = self.internal(np.array([value[n] for n in self.names]))
        return float(np.sum(np.abs(residual))), q

    def _pressures(self, data: Observations) -> Columns:
        """Return the factors of a force and of its pressure terms at each row, by suffix of the parameter name."""
        a, b = data.gauges_pa
        of = {"a": a, "b": b}
        if self.knee_pa is not None:
            of = {c: g / (1.0 + np.abs(g) / self.knee_pa) for c, g in of.items()}
        of |= {"curve_a": a**2, "curve_b": b**2, "product": a * b}
        of |= {"ab": of["a"] + of["b"], "curve_ab": of["curve_a"] + of["curve_b"]}
        return {"": np.ones(len(data))} | {f"_{term}": of[term] for term in self.terms}


#: Laws by name, without a dependence on pressure.
CANDIDATES = {
    "coulomb": FrictionModel("coulomb"),
    "stribeck gaussian": FrictionModel("stribeck"),
    "stribeck exponential": FrictionModel("stribeck", exponent=1.0),
    "stribeck lorentzian": FrictionModel("stribeck", lorentzian=True),
    "stribeck free": FrictionModel("stribeck", exponent=None),
}
#: Names of laws in commands and options -> name of the law.
NAMES = {"stribeck": "stribeck gaussian"} | {name: name for name in CANDIDATES}
#: Number of starts of a search, including the given values; and range of further starts, as a factor.
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
        Start values in SI; default: the values of `friction`.
    held : dict
        Further held parameter -> value in SI, which replaces the value in `friction`.
    """

    friction: Friction
    names: tuple[str, ...]
    start: tuple[float, ...] = field(default=(), compare=False)
    held: NamedNumbers = field(default_factory=dict, compare=False)

    @cached_property
    def _core(self) -> tuple[str, NamedNumbers, Plain]:
        tables = self.friction.core()
        law, values = tables.pop("law"), tables.pop("parameters")
        return law, values | self.held, {key: value for key, value in tables.items() if value is not None}

    @cached_property
    def positive(self) -> Bools:
        """Mask of parameters whose coordinate is their logarithm, shape (p,)."""
        return np.array([entry["lower"] >= 0.0 for entry in self.entries()])

    @property
    def uppers(self) -> Array:
        """Upper bounds of the law in SI, shape (p,); infinite without a bound."""
        return np.array([entry["upper"] for entry in self.entries()])

    @property
    def given(self) -> Array:
        """Start values in SI, shape (p,)."""
        return np.array(self.start or [self.friction.parameters[n] for n in self.names])

    @cached_property
    def transforms(self) -> Transforms:
        """Transformation of the parameters: logarithms of positive parameters, and of Fs - Fc if both are free."""
        both = {"coulomb", "breakaway"} <= set(self.names)
        c, s = (self.names.index(n) if both else 0 for n in ("coulomb", "breakaway"))
        lower = np.where(self.positive, 0.0, -np.inf)
        return Transforms(lower, excess=s if both else None, over=c, least_excess=1e-6)

    def internal(self, theta: Array) -> Array:
        """Convert parameters to coordinates; zero becomes a small value."""
        return self.transforms.internal(np.where(self.positive, np.maximum(theta, 1e-12), theta))

    def bounds(self, data: Observations) -> ArrayPair:
        """Return the bounds of the coordinates: those of the law, but at most six decades from the start values."""
        del data
        given = self.internal(self.given)
        reach = np.where(self.positive, 14.0, np.inf)
        lower, upper = given - reach, given + reach
        for k, top in enumerate(self.uppers):
            if np.isfinite(top):
                upper[k] = min(upper[k], self.internal(np.full(given.size, top))[k])
        if self.transforms.excess is None:  # a held one of both bounds the other
            other = dict(self.friction.parameters) | self.held
            for k, name in enumerate(self.names):
                if name == "coulomb" and "breakaway" in other:
                    upper[k] = min(upper[k], np.log(other["breakaway"]))
                if name == "breakaway" and "coulomb" in other:
                    lower[k] = max(lower[k], np.log(other["coulomb"]))
        return lower, upper

    def without(self, name: str, value: float, start: Array) -> AnyLaw:
        """Return the law with one parameter held at `value`; `start` has start values of all parameters, (p,)."""
        keep = [k for k, n in enumerate(self.names) if n != name]
        names = tuple(self.names[k] for k in keep)
        others = tuple(float(start[k]) for k in keep)
        return replace(self, names=names, start=others, held=self.held | {name: value})

    def force_and_slopes(self, theta: Array, data: Observations) -> ArrayPair:
        """Return friction and its derivatives with respect to the parameters, shapes (n,) and (n, p)."""
        law, values, tables = self._core
        at = values | by_name(self.names, theta)
        names, zero = [f"friction.parameters.{n}" for n in self.names], np.zeros(len(data))
        return _core.steady_friction_sensitivity(law, at, names, data.speed_m_s, *data.gauges_pa, zero, tables)

    def starting_points(self, data: Observations) -> list[Array]:
        """Return start points: the given values and points near them."""
        given, (lower, upper) = self.internal(self.given), self.bounds(data)
        noise = np.random.default_rng(1).uniform(-1.0, 1.0, (STARTS, given.size)) * np.log(FACTOR)
        steps = np.where(self.positive, np.vstack([np.zeros(given.size), noise]), 0.0)
        return list(np.clip(given + steps, lower, upper))

    def entries(self) -> list[Plain]:
        """Return bounds, unit and meaning of each free parameter, as stated by the core."""
        by_key = {p["key"]: p for p in self.friction.entry["parameters"]}
        return [by_key[n] for n in self.names]


# --- Selection of the independent values of a friction map for a fit.

REQUIRED = ("recording", "direction", "velocity_m_s", "pressure_a_pa", "pressure_b_pa", "balance_n", "friction_n")
#: Further columns of a map that a fit uses.
OPTIONAL = ("stderr_n", "u_systematic_n", "strokes", "flags")
#: Flags that exclude rows from F(v): in stick-slip, the mean force does not belong to the mean speed.
NOT_SLIDING = ("stick_slip",)
#: Smallest friction of a map, N. If all values are smaller, they are rounding errors, and their squares would
#: underflow.
NO_FRICTION_N = 1e-12


def map_of(given: Any) -> xr.Dataset:  # noqa: ANN401 - anything with a map
    """Return the friction map of an argument: a map, the file of a map, or a result with a map."""
    return read_map(given) if isinstance(given, str | Path) else getattr(given, "friction_map", given)


def selected(
    friction_map: AnyMap,
    direction: int | None = None,
    exclude_flags: Collection[str] = NOT_SLIDING,
    *,
    needs_ambient: bool = True,
    ambient_pressure_pa: float | None = None,
) -> tuple[Observations, list[str], Plain]:
    """Select and combine the rows of a friction map for a fit.

    Both rows of a pair have the same friction (half the difference of both directions) and count as one value. A fit to
    one direction uses ``direction * balance_n`` of its rows instead.

    Parameters
    ----------
    friction_map : xarray.Dataset, path-like or Characterisation
        One dimension ``row``, variables of the friction map format, SI; or a file or a result with such a map.
    direction : int or None
        None for the paired friction, +1 or -1 for one direction.
    exclude_flags : collection of str
        Rows with any of these flags are left out.
    needs_ambient : bool
        Whether to reject a map without its ambient pressure.
    ambient_pressure_pa : float, optional
        Reference of gauge pressures; default: that of the map.

    Returns
    -------
    Observations, list of str, dict
        Values, notes on omissions and assumptions, and the provenance of the values.

    Raises
    ------
    FitError
        A variable is missing, a value is not valid, or no row is left.
    """
    friction_map = map_of(friction_map)
    column = _columns(friction_map)
    ambient = ambient_pressure_pa
    if ambient is None:  # zero if it is neither known nor needed
        stated = friction_map.attrs.get("ambient_pressure_pa")
        if stated is None and needs_ambient:
            raise FitError.of("identify.no_ambient")
        if stated is not None and not 0.0 < stated < np.inf:
            raise FitError("the ambient pressure must be positive", value=f"ambient_pressure_pa = {stated}")
        ambient = float(stated or 0.0)
    column["value_n"] = column["friction_n"] if direction is None else direction * column["balance_n"]
    keep, notes = _usable(column, direction, exclude_flags)
    if not keep.any():
        raise FitError.of("identify.no_row", notes="; ".join(notes) or "the map is empty")
    value = _paired(rows_of(column, keep))
    if np.abs(value["value_n"]).max() < NO_FRICTION_N:
        raise FitError("friction is zero in every row of the map", rule="a fit needs measured friction")
    stderr, more = _standard_errors(value)
    shared_n = np.nan_to_num(value["u_systematic_n"])
    if direction is not None:
        zero_n = np.nan_to_num(np.abs(value["value_n"] - value["friction_n"]))
        name = "zero_known" if zero_n.max() > NO_FRICTION_N else "zero"
        more.append(sentence("notes", name, half=zero_n.max()))
        shared_n = np.hypot(shared_n, zero_n)
    a, b = (value[f"pressure_{side}_pa"] - ambient for side in "ab")
    data = Observations(value["speed_m_s"], value["value_n"], stderr, a, b, shared_n, value["recording"])
    provenance = {
        "direction": "both" if direction is None else f"{direction:+d}",
        "ambient_pressure_pa": ambient,
        "exclude_flags": sorted(exclude_flags),
        "recordings": recordings_of(friction_map),
        INPUTS: [stored_input("friction map", "friction map", friction_map.attrs.get(FILE), fingerprint(data))],
    }
    more += [SIMULATED] if friction_map.attrs.get("synthetic", False) else []
    return data, notes + more, provenance


def _columns(friction_map: xr.Dataset) -> dict[str, NDArray]:
    """Return the columns of a map that a fit uses. A missing optional column is NaN."""
    missing = [name for name in REQUIRED if name not in getattr(friction_map, "data_vars", ())]
    if missing:
        raise FitError.of(
            "identify.columns", where="friction map", missing=", ".join(missing), required=", ".join(REQUIRED)
        )
    rows = friction_map["friction_n"].shape
    if len(rows) != 1:
        raise FitError("row must be the only dimension of the map", value=f"shape {rows}", where="friction map")
    kinds = dict.fromkeys((*REQUIRED, *OPTIONAL), float) | {"recording": str, "flags": str}
    column = {name: np.asarray(friction_map.get(name, np.full(rows, np.nan)), kind) for name, kind in kinds.items()}
    direction, stderr = column["direction"], column["stderr_n"]
    if (wrong := abs(direction) != 1.0).any():
        row = int(wrong.argmax())
        raise FitError.of("identify.direction", where=f"friction map, row {row}", found=direction[row])
    if (wrong := stderr < 0.0).any():
        row = int(wrong.argmax())
        raise FitError.of("identify.stderr", where=f"friction map, row {row}", found=stderr[row])
    return column


def _usable(
    column: dict[str, NDArray], direction: int | None, exclude_flags: Collection[str]
) -> tuple[Bools, list[str]]:
    """Return a mask of the rows that a fit uses, and notes on the others."""
    notes, unwanted = [], set(exclude_flags)
    needed = [column[name] for name in ("value_n", "velocity_m_s", "pressure_a_pa", "pressure_b_pa")]
    finite = np.isfinite(needed).all(axis=0) & (column["velocity_m_s"] != 0.0)
    if not finite.all():
        notes.append(f"{np.sum(~finite)} rows left out: a value is not finite or the speed is zero")
    flagged = np.array([not unwanted.isdisjoint(map(str.strip, text.split(","))) for text in column["flags"]], bool)
    if (flagged & finite).any():
        notes.append(f"{np.sum(flagged & finite)} rows left out for their flags ({', '.join(sorted(unwanted))})")
    return finite & ~flagged & (direction is None or column["direction"] == direction), notes


def _paired(column: dict[str, NDArray]) -> dict[str, NDArray]:
    """Return the means over both rows of each pair: one recording, same friction, opposite directions.

    A row without a partner is a separate value.
    """
    import polars as pl

    rows = pl.DataFrame(column).with_columns(
        speed_m_s=pl.col("velocity_m_s").abs(),
        stated_n2=pl.col("stderr_n") ** 2,
        turn=pl.int_range(pl.len()).over("recording", "friction_n", "direction"),
    )
    pairs = rows.group_by("recording", "friction_n", "turn", maintain_order=True)
    means = pl.col("speed_m_s", "value_n", "stated_n2", "pressure_a_pa", "pressure_b_pa", "u_systematic_n").mean()
    return {series.name: series.to_numpy() for series in pairs.agg(means, pl.col("strokes").sum())}


def _standard_errors(value: dict[str, NDArray]) -> tuple[Array, list[str]]:
    """Return the standard error of each value, and notes on missing errors."""
    stated = np.sqrt(value["stated_n2"])
    known = np.isfinite(stated) & (stated > 0.0)
    if not known.any():
        typical = max(np.max(np.abs(value["value_n"])), 1e-12)
        return np.full(stated.size, 0.01 * typical), ["the map has no standard errors: all rows have the same weight"]
    notes = []
    if not known.all():
        stated = np.where(known, stated, np.median(stated[known]))
        notes.append(f"{np.sum(~known)} rows have no standard error: the median of the others is used")
    dof = np.where(np.isfinite(value["strokes"]), np.maximum(value["strokes"] - 2.0, 1.0), np.inf)
    return np.sqrt(moderate(stated**2, dof, value["speed_m_s"])), notes


#: Largest number of listed recordings. More recordings are given by their number, first and last name.
MOST_RECORDINGS = 50


def recordings_of(friction_map: xr.Dataset) -> list[str]:
    """Return the names of the recordings of a map."""
    names = list(dict.fromkeys(str(name) for name in friction_map["recording"].to_numpy()))
    return names if len(names) <= MOST_RECORDINGS else [f"{len(names)} recordings from {names[0]} to {names[-1]}"]


def fingerprint(data: Observations) -> str:
    """Return the SHA-256 of the values of the fit."""
    columns = (data.speed_m_s, data.friction_n, data.stderr_n, *data.gauges_pa)
    return hashlib.sha256(np.ascontiguousarray(np.stack(columns), dtype="<f8").tobytes()).hexdigest()
