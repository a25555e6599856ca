"""Numbers of a drive that can be free, and their names.

Names are those of the drive file (``friction.coulomb``, ``cylinder.dead_volume.a``, ``valve.conductance``); values are
in SI, pressures absolute. Any number of the description can be free.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from pneudrive import units
from pneudrive.describe.components import parameter_quantity
from pneudrive.describe.kinds import STATED
from pneudrive.describe.marks import Quantity, StatedPressure
from pneudrive.describe.system import compiled
from pneudrive.describe.tables.derived import derived
from pneudrive.errors import CommandError, FitError, nearest
from pneudrive.free import lines

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Sequence

    from numpy.typing import NDArray

    from pneudrive._core import Circuit as CoreCircuit
    from pneudrive._core import Shooting, Shot
    from pneudrive.describe.base import Described
    from pneudrive.describe.drive import Drive
    from pneudrive.describe.system import ShortNames
    from pneudrive.describe.tables.derived import Derived

    Array = NDArray[np.float64]

# Endings of the names in the core's form, longest first, and their units.
_ENDINGS = {
    "_m3_s_pa": "m^3/(s Pa)",
    "_w_m2_k": "W/(m^2 K)",
    "_j_kg_k": "J/(kg K)",
    "_n_s_m": "N s/m",
    "_per_m": "1/m",
    "_n_m": "N/m",
    "_m_s": "m/s",
    "_rad": "rad",
    "_m3": "m^3",
    "_kg": "kg",
    "_pa": "Pa",
    "_k": "K",
    "_m": "m",
    "_n": "N",
    "_s": "s",
}
# Numbers that may be negative, with the size of a usual change; all others are positive.
_SIGNED = {
    "load.force": 10.0,
    "cylinder.incline": 0.1,
    "load.spring.rest_position": 0.1,
    "valve.overlap": 0.05,
    "friction.position.slope": 1.0,
}
#: Start values of the valve's shape for a drive without it (assumed): leakage has no logarithm at 0.
VALVE_SHAPE = {"valve.overlap": 0.0, "valve.leakage": 1e-3}
_SEAL_SLOPE = 1e-5  # N/Pa: 1 N/bar
_AGEING_SLOPE = 1e-6  # 1/Pa: 0.1/bar


@dataclass(frozen=True)
class Parameter:
    """A number of the description.

    Attributes
    ----------
    name : str
        Name in the drive file.
    core : str
        Path in the core's form.
    unit : str
        SI unit.
    value : float
        Start value.
    lower, upper : float
        Open bounds.
    size : float
        Usual change, for a number that may be negative.
    discrete : bool
        Whether runs have no derivative by it.
    """

    name: str
    core: str
    unit: str
    value: float
    lower: float
    upper: float
    size: float
    discrete: bool = False


#: Names of the start state in a design begin so.
INITIAL = "initial."


class Varied(NamedTuple):
    """A number that varies: its name in the drive file, its SI unit, and its written form."""

    name: str
    unit: str
    mark: Quantity | StatedPressure | None

    @property
    def file_name(self) -> str:
        """Name of its column in a file, which carries the unit."""
        return units.column_name(self.name, self.unit)

    def written(self, si: float) -> str | float:
        """Write a value in the form of the drive file."""
        if self.unit == "Pa" and isinstance(self.mark, StatedPressure):
            return f"{si!r} Pa abs"
        return si if self.unit in ("1", "") else units.write(si, self.unit)


def field_marks(kind: type[Described]) -> dict[str, Quantity | StatedPressure]:
    """Return the written form of each quantity of a table, by its key."""
    fields = zip(kind.keys(), kind.model_fields.values(), strict=True)
    marked = ((key, mark) for key, field in fields for mark in field.metadata)
    return {key: mark for key, mark in marked if isinstance(mark, Quantity | StatedPressure)}


def mark_unit(mark: Quantity | StatedPressure) -> str:
    """Return the SI unit for a written form."""
    return "Pa" if isinstance(mark, StatedPressure) else mark.si_unit or "1"


def numbers_of(drive: Drive) -> dict[str, Parameter]:
    """Return every number of a drive that can be free, by its name in the drive file."""
    laws = {p["key"]: p for p in drive.friction.entry["parameters"]}
    form = json.loads(drive.core_json())
    own = {"ambient": form["ambient"], "friction": drive.friction.core()}
    found = [_parameter(path, value, laws) for path, value in _leaves(own, "")]
    found += [_of_component(*number) for number in lines.numbers(form)]
    return {p.name: p for p in sorted(found, key=lambda p: p.core.replace(lines.FRICTION, "friction."))}


def with_shape(drive: Drive, names: Iterable[str]) -> Drive:
    """Return a drive whose valve has overlap or leakage if they are among names; the start values are assumed."""
    lacking = {
        name for name in names if name in VALVE_SHAPE and getattr(drive.valve, name.removeprefix("valve.")) is None
    }
    return drive.replace({name: VALVE_SHAPE[name] for name in lacking}) if lacking else drive


def find(drive: Drive, names: Sequence[str]) -> list[Parameter]:
    """Find numbers of a drive by their names in the drive file.

    Raises
    ------
    CommandError
        A name is unknown or repeated, or runs have no derivative by its number.
    """
    known = numbers_of(drive)
    for name in names:
        if name not in known:
            raise CommandError(
                f"{name} is not a number of this drive",
                remedy=nearest(name, known)
                + " For a number that the drive lacks, first give a start value in the drive.",
            )
        if known[name].discrete:
            raise CommandError(
                f"{name} cannot be free: it acts on the schedule, or is rounded to whole cells",
                rule="each free number must have a derivative",
            )
    if len(set(names)) < len(names):
        raise CommandError("a parameter is given twice", value=", ".join(names))
    return [known[name] for name in names]


def chosen(drive: Drive, free: Sequence[str]) -> list[Parameter]:
    """Find the free parameters of a search by their names.

    Raises
    ------
    FitError
        A name is unknown or repeated, or a start value is at a bound.
    """
    if not free:
        raise FitError("no parameter is free", remedy='Name free parameters, e.g. free=["friction.coulomb"].')
    try:
        found = find(drive, free)
    except CommandError as error:
        raise FitError(error.what, value=error.value, rule=error.rule, remedy=error.remedy) from None
    for p in found:
        if not p.lower < p.value < p.upper:
            raise FitError(
                f"the search for {p.name} cannot start at {p.value:g} {p.unit}",
                rule=f"between {p.lower:g} and {p.upper:g}, ends excluded",
                remedy=f'Give the drive another start value: drive.replace({{"{p.name}": ...}}).',
            )
    return found


def _leaves(table: Any, path: str) -> Iterator[tuple[str, float]]:  # noqa: ANN401 - a tree of JSON
    if isinstance(table, dict):
        for key, value in table.items():
            yield from _leaves(value, f"{path}.{key}" if path else key)
    elif isinstance(table, (int, float)) and not isinstance(table, bool):
        yield path, float(table)


def _parameter(path: str, value: float, laws: dict[str, dict[str, Any]]) -> Parameter:
    head, _, key = path.rpartition(".")
    if head == "friction.parameters":
        about = laws[key]
        lower = 0.0 if about["lower"] is None else max(about["lower"], -np.inf)
        upper = np.inf if about["upper"] is None else about["upper"]
        unit = "1" if about["unit"] == "-" else about["unit"]
        return Parameter(f"friction.{key}", f"cylinder.{path}", unit, value, lower, upper, abs(value) or 1.0)
    stem, unit = _without_unit(key)
    if stem.endswith(("_a", "_b")):
        stem = f"{stem[:-2]}.{stem[-1]}"
    name = f"{head}.{stem}" if head else stem
    path = f"cylinder.{path}" if name.startswith("friction.") else path
    if head == "friction.pressure":
        return Parameter(name, path, "N/Pa", value, -np.inf, np.inf, _SEAL_SLOPE)
    if name.startswith("friction.dwell.pressure"):
        return Parameter(name, path, "1/Pa", value, -np.inf, np.inf, _AGEING_SLOPE)
    if name in _SIGNED:
        return Parameter(name, path, unit, value, -np.inf, np.inf, _SIGNED[name])
    return Parameter(name, path, unit, value, 0.0, np.inf, abs(value))


def _of_component(name: str, path: str, value: float, entry: dict[str, Any]) -> Parameter:
    """Return a number of a component with the unit and the bounds of its table."""
    unit = "Pa" if entry["unit"] == STATED else parameter_quantity(entry).si_unit or "1"
    if name in _SIGNED or not np.isfinite(entry["lower"]):
        return Parameter(name, path, unit, value, -np.inf, np.inf, _SIGNED.get(name, abs(value) or 1.0))
    bounds = (entry["lower"], entry["upper"])
    return Parameter(name, path, unit, value, *bounds, abs(value), discrete=entry["discrete"])


@lru_cache(maxsize=256)
def _without_unit(key: str) -> tuple[str, str]:
    for ending, unit in _ENDINGS.items():
        if key.endswith(ending):
            return key.removesuffix(ending), unit
    return key, "1"


#: Relative step for derivatives of a derived value by its sources.
_STEP = 1e-6


class DriveFamily:
    """Family of drives for any values of free numbers, with derived values.

    Parameters
    ----------
    form : dict
        Circuit of a drive in the core's form.
    free : sequence of str
        Paths of the free numbers in `form`.
    every : iterable of Derived
        All derived values; the core derives those that `form` lacks.
    names : tuple, optional
        Names of the drive, see `pneudrive.describe.system.System`.

    Attributes
    ----------
    paths : list of str
        Numbers of the derivatives of a run: free parameters, then derived values that depend on them.
    moving : list of Derived
        These derived values.
    """

    def __init__(
        self,
        form: dict[str, Any],
        free: Sequence[str],
        every: Iterable[Derived] = (),
        names: ShortNames | None = None,
    ) -> None:
        self._form, self._names, self.size = form, names, len(free)
        self.moving: list[Derived] = []
        for one in every:
            if not self._has(one.path, *one.sources):
                continue
            if one.path not in free and {*free, *(m.path for m in self.moving)}.intersection(one.sources):
                self.moving.append(one)
        self.settled: list[Derived] = []
        self.paths = [*free, *(m.path for m in self.moving)]

    def core(self, values: Array) -> CoreCircuit:
        """Return the core's circuit with these values.

        Raises
        ------
        DescriptionError
            The core rejects the drive.
        """
        return compiled(self.json(values), self._names)

    def shoot(self, core: Any, asked: Shooting, look: Callable[[float], object]) -> Shot:  # noqa: ANN401 - from `core`
        """Run segments under the command of the drive."""
        return core.shoot("command", asked, look)

    def _place(self, path: str) -> tuple[dict[str, Any], str]:
        return lines.place(self._form, path)

    def _has(self, *paths: str) -> bool:
        return all(key in table for table, key in map(self._place, paths))

    def get(self, path: str) -> float:
        """Return the number at a path."""
        table, key = self._place(path)
        return float(table[key])

    def _set(self, values: Array) -> None:
        for path, value in zip(self.paths, values, strict=False):
            table, key = self._place(path)
            table[key] = float(value)
        for one in self.moving:
            table, key = self._place(one.path)
            table[key] = one.value(*(self.get(path) for path in one.sources))

    def json(self, values: Array) -> str:
        """Return the core's form with these values."""
        self._set(values)
        return json.dumps(self._form, sort_keys=True)

    def settle(self, values: Array) -> bool:
        """Fix derived values that are rounded at these values; return whether there are any."""
        self._set(values)
        rounded = [one for one in self.moving if one.digits is not None]
        for one in rounded:
            table, key = self._place(one.path)
            table[key] = float(f"{table[key]:.{one.digits}g}")
        self.settled += rounded
        self.moving = [one for one in self.moving if one not in rounded]
        self.paths = [*self.paths[: self.size], *(one.path for one in self.moving)]
        return bool(rounded)

    def many(self, rows: Array) -> Array:
        """Return the numbers at `paths` of many descriptions, shape (n, paths); rounded as a description rounds them.

        Parameters
        ----------
        rows : ndarray, shape (n, free)
        """
        columns = dict(zip(self.paths, rows.T, strict=False))
        for one in self.moving:
            sources = [columns.get(path, self.get(path)) for path in one.sources]
            values = np.array([one.value(*at) for at in np.broadcast(*sources)])
            if one.digits is not None:
                values = np.array([float(f"{value:.{one.digits}g}") for value in values])
            columns[one.path] = values
        return np.array([columns[path] for path in self.paths]).reshape(len(self.paths), len(rows)).T.copy()

    def derived_values(self, values: Array) -> dict[str, float]:
        """Return the derived values for these values, by their names in the drive file."""
        self._set(values)
        return {one.name: self.get(one.path) for one in (*self.settled, *self.moving)}

    def by_free(self, values: Array) -> Array:
        """Return the derivatives of the numbers at `paths` by the free values, shape (paths, free)."""
        self._set(values)
        out = np.zeros((len(self.paths), self.size))
        out[: self.size] = np.eye(self.size)
        for row, one in enumerate(self.moving, start=self.size):
            at = [self.get(path) for path in one.sources]
            for k, path in enumerate(one.sources):
                if path not in self.paths:
                    continue
                step = _STEP * max(abs(at[k]), 1e-300)
                ends = [one.value(*at[:k], at[k] + sign * step, *at[k + 1 :]) for sign in (1.0, -1.0)]
                out[row] += (ends[0] - ends[1]) / (2.0 * step) * out[self.paths.index(path)]
        return out


def family_of(drive: Drive, parameters: Sequence[Parameter]) -> DriveFamily:
    """Return the family of a drive for some free parameters."""
    free = [p.core for p in parameters]
    return DriveFamily(json.loads(drive.core_json()), free, derived(drive), drive.system.names)
