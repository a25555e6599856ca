"""Numbers of a drive or a circuit that can be free parameters, and their names.

In a drive, names are those of its file (``friction.coulomb``, ``cylinder.dead_volume.a``, ``valve.conductance``). In a
circuit, names begin with the component (``left.friction.coulomb``). Values are in SI; pressures are absolute. Each
number of the description can be free.
"""

from __future__ import annotations

import json
import math
from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING, Any, cast

import numpy as np

from pneudrive import units
from pneudrive.describe.components import parameter_quantity
from pneudrive.describe.files.provenance import marks, values
from pneudrive.describe.kinds import FLOW, STATED, component_kinds, flow_keys
from pneudrive.describe.marks import Quantity, StatedPressure, parameter_quantities
from pneudrive.describe.system import System
from pneudrive.describe.tables import valve_flow
from pneudrive.describe.tables.dependences import Acting
from pneudrive.describe.tables.friction import ASSUMED_DIGITS, assumed_from
from pneudrive.describe.tables.starts import start_mark
from pneudrive.errors import CommandError, FitError, SimulationError, nearest, package_table
from pneudrive.progress import UNWATCHED, Watch
from pneudrive.simulation import command as commands
from pneudrive.simulation.start import DriveOrCircuit, StartState

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence

    from numpy.typing import ArrayLike

    from pneudrive._core import Circuit as CoreCircuit
    from pneudrive._core import Shooting, Shot
    from pneudrive.arrays import Array, ArrayPair, NamedNumbers, Pair, Plain
    from pneudrive.describe import Circuit, Drive
    from pneudrive.describe.system import ShortNames
    from pneudrive.describe.tables.friction import Friction
    from pneudrive.describe.tables.parts import Ambient


# --- Numbers of a drive's circuit by their names in the drive file, and the gas of its tubes.

_NUMBERS = package_table(__file__, "numbers.toml")
CYLINDER_FRICTION = "cylinder.friction."
#: Path of a parameter of a friction law in a component of the core's form.
LAW = "friction.parameters."


def component_numbers(form: Plain) -> Iterator[tuple[str, str, float, Plain]]:
    """Yield each number of the components, except friction: name in the drive file, path, value, the core's entry.

    The entry has ``discrete`` = True if runs have no derivative with respect to the number.
    """
    for component in form["components"]:
        own, kind = component["name"], component_kinds()[component["kind"]]
        rows = {row["key"]: row | {"discrete": row["key"] in kind["discrete"]} for row in kind["parameters"]}
        for key, value in component["numbers"].items():
            if key not in rows:  # a parameter of the user's formula
                continue
            name = f"{_NUMBERS['tables'].get(own, own)}.{_NUMBERS['keys'].get(key, key)}"
            yield name, f"{own}.{key}", value, rows[key]


def at_rest(name: str, pressures: ArrayPair | Pair, temperature_k: float) -> Array | float:
    """Return the start value of a friction state or of gas in a tube, from both chamber pressures in Pa.

    Examples
    --------
    >>> at_rest("tube_b.pressure_pa", (3e5, 2e5), 293.15), at_rest("presliding_deflection_m", (3e5, 2e5), 293.15)
    (200000.0, 0.0)
    """
    if name.endswith(".pressure_pa"):
        return pressures["ab".index(side_of(name))]
    return temperature_k if name.endswith(".temperature_k") else 0.0


def side_of(name: str) -> str:
    """Return the chamber, a or b, to which the gas of a tube or a joint belongs.

    Examples
    --------
    >>> side_of("tube_a.cell_0.pressure_pa"), side_of("valve.2.pressure_pa")
    ('a', 'b')
    """
    own = name.partition(".")[0]
    return "a" if own.endswith("_a") or name.startswith("valve.4.") else "b"


# --- Numbers of a drive that can be free, and their names.

#: Numbers that may be negative, by the last key of their names or by their unit, with the size of a usual change.
_SIGNED: NamedNumbers = _NUMBERS["signed"]
_SIGNED_UNITS: NamedNumbers = _NUMBERS["signed_units"]
#: Parameters of a valve that act on the command schedule -> finite-difference step.
COMMAND_STEPS: NamedNumbers = _NUMBERS["command_steps"]


@dataclass(frozen=True)
class Parameter:
    """A number of the description or of the start state, which can be free in a search or vary between runs.

    Attributes
    ----------
    name : str
        Name in the drive file.
    core : str
        Path in the core's form; empty for a number of the start state.
    unit : str
        SI unit.
    value : float
        Start value; NaN for a number that can vary, but cannot be free.
    lower, upper : float
        Bounds. The value must lie strictly between them.
    size : float
        Typical change: tabulated for a number that may be negative, otherwise the magnitude of its value.
    discrete : bool
        Whether runs have no derivative with respect to this number.
    mark : Quantity, StatedPressure or None
        Form in which a file states the number: its unit, gauge or absolute.
    """

    name: str
    core: str
    unit: str
    value: float
    lower: float
    upper: float
    size: float
    discrete: bool = False
    mark: Quantity | StatedPressure | None = None

    @property
    def file_name(self) -> str:
        """Name of the parameter's column in a file, including the unit."""
        return units.column_name(self.name, self.unit)

    def written(self, si: float) -> str | float:
        """Return a value, given in SI, in the form of the drive file."""
        if self.unit == "Pa" and isinstance(self.mark, StatedPressure):
            return f"{si!r} Pa abs"
        return si if self.unit in ("1", "") else units.write(si, self.unit)


#: Prefix of names of the start state in a design.
INITIAL = "initial."


def start_numbers(marks: Mapping[str, Quantity | StatedPressure]) -> dict[str, Parameter]:
    """Return the numbers of a start state by name, such as ``initial.position``, from the annotations of its keys."""
    names = {f"{INITIAL}{key}": mark for key, mark in marks.items()}
    return {name: _number(name, "", np.nan, mark) for name, mark in names.items()}


def mark_unit(mark: Quantity | StatedPressure) -> str:
    """Return the SI unit of an annotation."""
    return "Pa" if isinstance(mark, StatedPressure) else mark.si_unit or "1"


def numbers_of(described: DriveOrCircuit) -> dict[str, Parameter]:
    """Return every number of a drive or a circuit that can be free, by its name in the file."""
    if described.system.names is None:
        return {name: p for name, p in circuit_numbers(described.circuit).items() if not math.isnan(p.value)}
    drive = cast("Drive", described)
    form, written = json.loads(drive.core_json()), marks(drive)
    found = [*_numbers_of_table("ambient", "ambient", drive.ambient)]
    found += _numbers_of_law(drive.friction, "friction", "cylinder")
    for key, table, _ in drive.friction.entries():
        if isinstance(table, Acting):
            found += _numbers_of_table(f"friction.{key}", f"{CYLINDER_FRICTION}{key}", table)
    for name, path, value, entry in component_numbers(form):
        mark = StatedPressure() if entry["unit"] == STATED else parameter_quantity(entry)
        usual = _SIGNED.get(path.rpartition(".")[2])
        found.append(_number(name, path, value, mark, usual, discrete=entry["discrete"]))
    found.sort(key=lambda p: p.core.replace(CYLINDER_FRICTION, "friction."))
    return {p.name: replace(p, mark=written.get(p.name) or p.mark) for p in found}


def with_shape(drive: Drive, names: Iterable[str]) -> Drive:
    """Return a drive whose valve has overlap and leakage if `names` contain them. Missing values are assumed."""
    shape = _NUMBERS["valve_shape"]
    lacking = [n for n in names if n in shape and getattr(drive.valve, n.removeprefix("valve.")) is None]
    return drive.replace({name: shape[name] for name in lacking}) if lacking else drive


def find(described: DriveOrCircuit, names: Sequence[str], *, shifts: bool = False) -> list[Parameter]:
    """Find numbers of a drive or a circuit by their names in the file.

    If `shifts` is True, delay and hysteresis of a valve can also be free.

    Raises
    ------
    CommandError
        A name is unknown or repeated, or runs have no derivative with respect to this number.
    """
    elsewhere: set[str] = set()  # valve parameters that only a circuit file can have: the lag of the valve
    if described.system.names is not None:
        valve = cast("Drive", described).valve
        keys = {row["key"] for row in component_kinds()[f"valve/{valve.kind}"]["parameters"]}
        elsewhere = {f"valve.{key}" for key in keys.difference(valve.keys())}
    known = {name: number for name, number in numbers_of(described).items() if name not in elsewhere}
    shifting = set(COMMAND_STEPS) if shifts else set()
    discrete = {n for n, number in known.items() if number.discrete and n.rpartition(".")[2] not in shifting}
    for name in names:
        if name in elsewhere:
            raise CommandError.of("free.of-circuits", name=name)
        if name not in known:
            kind = described.file_kind
            part, _, key = name.rpartition(".")
            meant = f"{part}.conductance" if key in valve_flow.FLOW_KEYS else name  # the number of any stated size
            offered = nearest(meant, (name for name in known if name not in discrete))
            raise CommandError.of("free.unknown", name=name, kind=kind, nearest=offered)
        if name in discrete:
            raise CommandError.of("free.cannot-be-free", name=name)
    if len(set(names)) < len(names):
        raise CommandError("a parameter is given twice", value=", ".join(names))
    return [known[name] for name in names]


def chosen(drive: DriveOrCircuit, free: Sequence[str]) -> list[Parameter]:
    """Find the free parameters of a search by their names.

    Raises
    ------
    FitError
        A name is unknown or repeated, or a start value is at a bound.
    """
    if not free:
        raise FitError("no parameter is free", remedy='Name free parameters, e.g. free=["friction.coulomb"].')
    try:
        found = find(drive, free, shifts=True)
    except CommandError as error:
        raise error.turned(FitError) from None
    for p in found:
        if not p.lower < p.value < p.upper:
            raise FitError.of("free.start-at-bound", p=p)
    return found


def _numbers_of_law(friction: Friction, name: str, component: str) -> Iterator[Parameter]:
    """Yield the parameters of the friction law of a component."""
    quantities = parameter_quantities(friction.entry)
    for key, value in friction.parameters.items():
        yield _number(f"{name}.{key}", f"{component}.{LAW}{key}", value, quantities[key])


def _numbers_of_table(name: str, path: str, table: Ambient | Acting) -> Iterator[Parameter]:
    """Yield the numbers of the ambient air or of a friction modifier."""
    keys = (key for key, value in table.core().items() if isinstance(value, float))
    for key, (own, number) in zip(keys, values(table).items(), strict=True):
        is_signed = math.isinf(number.mark.ends[0])
        usual = _SIGNED.get(own) or _SIGNED_UNITS.get(mark_unit(number.mark)) if is_signed else None
        yield _number(f"{name}.{own}", f"{path}.{key}", number.si, number.mark, usual)


def _number(
    name: str,
    core: str,
    value: float,
    mark: Quantity | StatedPressure,
    usual: float | None = None,
    *,
    discrete: bool = False,
) -> Parameter:
    """Return a number with the bounds of its annotation, or without bounds if `usual`, a typical change, is given."""
    lower, upper = (-np.inf, np.inf) if usual else mark.ends
    return Parameter(name, core, mark_unit(mark), value, lower, upper, usual or abs(value) or 1.0, discrete, mark)


# --- Derived defaults: values of a drive that follow from other values if they are not given.
#
# Code that changes a value (a search, the application of a fit) must update the values derived from this value.


@dataclass(frozen=True)
class Derived:
    """Value derived from other values.

    Attributes
    ----------
    name : str
        Name in the drive file.
    path : str
        Path in the circuit of the drive.
    sources : tuple of str
        Paths of the values on which the derived value depends. These values may also be derived.
    value : callable
        Function that returns the derived value, from the values of `sources` in SI.
    digits : int or None
        Number of significant digits to which a description rounds the value. None: not rounded.
    """

    name: str
    path: str
    sources: tuple[str, ...]
    value: Callable[..., float]
    digits: int | None = None


def derived(drive: Drive) -> Iterator[Derived]:
    """Yield the derived values of a drive. Each value comes after the values on which it depends.

    Examples
    --------
    >>> from pneudrive.describe import Drive
    >>> [d.name for d in derived(Drive.load("catalogue:reference"))]
    ['supply.temperature', 'cylinder.wall_temperature']
    """
    for key, (sources, value) in assumed_from(drive.friction).items():
        paths = tuple(f"cylinder.{LAW}{source}" for source in sources)
        yield Derived(f"friction.{key}", f"cylinder.{LAW}{key}", paths, value, ASSUMED_DIGITS)
    ambient, supply, valve = "ambient.temperature_k", drive.supply, drive.valve
    if supply.temperature_k is None:
        yield Derived("supply.temperature", "supply.temperature", (ambient,), float)
    if drive.cylinder.wall_temperature_k is None:
        yield Derived("cylinder.wall_temperature", "cylinder.wall_temperature", (ambient,), float)
    if supply.pressure.gauge:
        yield Derived("supply.pressure", "supply.pressure", ("ambient.pressure_pa",), supply.pressure.absolute_pa)
    if valve.nominal_flow_m3_s_anr is not None:
        conductance = partial(valve_flow.conductance_from_nominal_flow, valve.nominal_flow_m3_s_anr)
        yield Derived("valve.conductance", "valve.conductance", tuple(f"valve.{key}" for key in FLOW), conductance)


def derived_in_circuit(circuit: Circuit) -> Iterator[Derived]:
    """Yield the derived numbers of a circuit: pressures given as gauge, and conductances given by other sizes."""
    for name, one in circuit.components.items():
        for key in (parameter["key"] for parameter in one.entry["parameters"]):
            value, *sizes = (getattr(one, one.fields[size]) for size in flow_keys(one.entry, key))
            if isinstance(value, units.Pressure) and value.gauge:
                yield Derived(f"{name}.{key}", f"{name}.{key}", ("ambient.pressure_pa",), value.absolute_pa)
            elif any(sizes):
                sources = tuple(f"{name}.{source}" for source in FLOW)
                conductance = partial(valve_flow.conductance_of, [None, *sizes])
                yield Derived(f"{name}.{key}", f"{name}.{key}", sources, conductance)


#: Relative step for derivatives of a derived value with respect to its sources.
_STEP = 1e-6


class DriveFamily:
    """A drive as a function of its free numbers, including derived values.

    Parameters
    ----------
    form : dict
        Circuit of a drive in the core's form.
    free : sequence of str
        Paths of the free numbers in `form`.
    every : iterable of Derived
        All derived values. The core computes those that `form` does not contain.
    names : tuple, optional
        Names of the drive, see `pneudrive.describe.system.System`.

    Attributes
    ----------
    paths : list of str
        Numbers with respect to which a run has derivatives: free parameters, then derived values that depend on them.
    moving : list of Derived
        Derived values that depend on free parameters.
    piston : str
        Name of the cylinder's component; empty without `names`.
    """

    def __init__(
        self,
        form: Plain,
        free: Sequence[str],
        every: Iterable[Derived] = (),
        names: ShortNames | None = None,
    ) -> None:
        self._form, self._names, self.size = form, names, len(free)
        self.piston = names[0] if names else ""
        self.moving: list[Derived] = []
        for one in every:
            if not all(key in table for table, key in map(self._place, (one.path, *one.sources))):
                continue
            if one.path not in free and {*free, *(m.path for m in self.moving)}.intersection(one.sources):
                self.moving.append(one)
        self.settled: list[Derived] = []
        self.paths = [*free, *(m.path for m in self.moving)]

    def core(self, values: Array) -> CoreCircuit:
        """Return the core's circuit for given values of the free numbers.

        Raises
        ------
        DescriptionError
            The core rejects the drive.
        """
        return System(self.json(values), self._names).compiled()

    def shoot(self, core: Any, asked: Shooting, look: Callable[[float], object]) -> Shot:  # noqa: ANN401 - from `core`
        """Simulate the segments that `asked` describes, under the command of the drive."""
        return core.shoot("command", asked, look)

    def _place(self, path: str) -> tuple[Plain, str]:
        """Return the table of the form that contains the number at a path, and the key of the number."""
        own, *names, key = path.split(".")
        component = next((one for one in self._form["components"] if one["name"] == own), None)
        table = self._form[own] if component is None else component
        for name in names or ([] if component is None else ["numbers"]):
            table = table[name]
        return table, key

    @property
    def exact(self) -> list[str]:
        """The `paths` with respect to which the core computes exact derivatives."""
        return [path for path in self.paths if path.rpartition(".")[2] not in COMMAND_STEPS]

    def get(self, path: str) -> float:
        """Return the number at a path."""
        table, key = self._place(path)
        return float(table[key])

    def put(self, path: str, value: float) -> None:
        """Set the number at a path."""
        table, key = self._place(path)
        table[key] = float(value)

    def _set(self, values: Array) -> None:
        for path, value in zip(self.paths, values, strict=False):
            self.put(path, value)
        for one in self.moving:
            self.put(one.path, one.value(*map(self.get, one.sources)))

    def json(self, values: Array) -> str:
        """Return the core's form as JSON, for given values of the free numbers."""
        self._set(values)
        return json.dumps(self._form, sort_keys=True)

    def settle(self, values: Array) -> bool:
        """Round derived values as a description does, and keep the rounded ones constant. Return whether any exist."""
        self._set(values)
        rounded = [one for one in self.moving if one.digits is not None]
        for one in rounded:
            self.put(one.path, float(f"{self.get(one.path):.{one.digits}g}"))
        self.settled += rounded
        self.moving = [one for one in self.moving if one not in rounded]
        self.paths = [*self.paths[: self.size], *(one.path for one in self.moving)]
        return bool(rounded)

    def many(self, rows: Array) -> Array:
        """Return the numbers at `paths` for each row of free values, rounded as in a description (shape (n, paths)).

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
        values = np.array([columns[path] for path in self.paths])
        return values.reshape(len(self.paths), len(rows)).T.copy()

    def derived_values(self, values: Array) -> NamedNumbers:
        """Return the derived values for given values of the free numbers, by name in the drive file."""
        self._set(values)
        return {one.name: self.get(one.path) for one in (*self.settled, *self.moving)}

    def by_free(self, values: Array) -> Array:
        """Return the derivatives of the numbers at `paths` with respect to the free numbers (shape (paths, free))."""
        self._set(values)
        out = np.zeros((len(self.paths), self.size))
        out[: self.size] = np.eye(self.size)
        for row, one in enumerate(self.moving, start=self.size):
            at = [self.get(path) for path in one.sources]
            for k, path in enumerate(one.sources):
                if path not in self.paths:
                    continue
                step = _STEP * max(abs(at[k]), 1e-300)
                left, right = at[:k], at[k + 1 :]
                after, before = (one.value(*left, at[k] + change, *right) for change in (step, -step))
                slope = (after - before) / (2.0 * step)
                out[row] += slope * out[self.paths.index(path)]
        return out


def family_of(
    described: DriveOrCircuit, parameters: Sequence[Parameter], axis: ShortNames | None = None
) -> DriveFamily:
    """Return the family of a drive or a circuit for some free parameters. `axis` has short names for a circuit."""
    free, (form, names) = [p.core for p in parameters], described.system
    every = derived_in_circuit(described.circuit) if names is None else derived(cast("Drive", described))
    return DriveFamily(json.loads(form), free, every, names or axis)


# --- Numbers of a circuit by name, and circuits for any values of some of them.

AMBIENT = ("ambient.pressure", "ambient.temperature")


def circuit_numbers(circuit: Circuit) -> dict[str, Parameter]:
    """Return every number of a circuit and of its start state that may vary, by name.

    Names are those of components and their keys, ``left.bore``, ``left.friction.coulomb``. Further names are
    ``ambient.pressure``, ``ambient.temperature`` and ``initial.left.position``.
    """
    found = list[Parameter]()
    for name, one in circuit.components.items():
        written, discrete = one.marks(), one.entry["discrete"]
        for key, number in one.numbers(circuit.ambient.pressure_pa).items():
            path, value = f"{name}.{key}", number if math.isfinite(number) else np.nan
            found.append(_number(path, path, value, written[key], _SIGNED.get(key), discrete=key in discrete))
        if (friction := getattr(one, "friction", None)) is not None:
            found += _numbers_of_law(friction, f"{name}.friction", name)
    found += _numbers_of_table("ambient", "ambient", circuit.ambient)
    lasts = {key: name.rpartition(".")[2] for key, name in circuit.start_names.items()}
    starts = {key: start_mark(last)[1] for key, last in lasts.items() if last != "contact_age_s"}
    return {p.name: p for p in found} | start_numbers(starts)


# --- Exact derivatives of the numerical solution with respect to numbers of the drive, including events.


class Differentiator:
    """Simulation of a drive as a function of some of its numbers, with derivatives.

    Parameters
    ----------
    drive : Drive or Circuit
    names : sequence of str
        Names in the file, ``"friction.coulomb"``; in a circuit ``"left.friction.coulomb"``.
    command : as for `pneudrive.simulate`
        A function of time is not accepted, because the steps must be known in advance.
    initial : as for `pneudrive.simulate`
        The start state does not depend on the parameters.
    rtol : float

    Raises
    ------
    CommandError
        A name is unknown or repeated, the command is a function, or a contact age at the start is not zero.
    """

    def __init__(
        self,
        drive: DriveOrCircuit,
        names: Sequence[str],
        command: commands.Commands,
        initial: StartState = None,
        rtol: float = 1e-6,
    ) -> None:
        if callable(command):
            raise CommandError.of("free.command-in-advance")
        names = [names] if isinstance(names, str) else names
        self.parameters = find(drive, names)
        self._family = family_of(drive, self.parameters)
        self._commands = commands.inputs(command, drive.commandable)
        core, self._start, self._rtol = drive.system.compiled(), drive.core_initial(initial), rtol
        if not self._commands:  # a run has one command
            force = next(name for name, *_ in core.inputs if name.endswith("load_force_n"))
            self._commands = [(force, ((0.0,), (0.0,)))]
        if any(value for name, value in self._start.items() if name.endswith("contact_age_s")):
            raise CommandError("derivatives of a run that starts with an aged contact are not available")

    def run(
        self,
        values: ArrayLike,
        times: Array,
        columns: Sequence[str],
        *,
        derivatives: bool = True,
        watch: Watch = UNWATCHED,
    ) -> ArrayPair:
        """Simulate the drive.

        Parameters
        ----------
        values : array_like, shape (p,)
            Values of the parameters, in SI.
        times : ndarray, shape (n,)
            Times of the samples in s, increasing from the start.
        columns : sequence of str
            Columns of a trajectory file.
        derivatives : bool
            Whether to compute derivatives. If False, their last axis has length 0.
        watch : Watch
            Its cancel flag can end the run.

        Returns
        -------
        values : ndarray, shape (n, c)
        derivatives : ndarray, shape (n, c, p)
            In SI, with respect to each parameter. They include the effect of a parameter on derived values
            (`derived`).

        Raises
        ------
        SimulationError
            The solver cannot continue, or the core rejects the values.
        """
        family, numbers = self._family, np.asarray(values, dtype=float)
        try:
            core = family.core(numbers)
            (first, (begun, held)), *others = self._commands
            asked: Shooting = {
                "times": list(begun),
                "commands": list(held),
                "others": [(name, list(times), list(steps)) for name, (times, steps) in others],
                "sample_times": times,
                "starts": [0],
                "initial": np.array([[self._start.get(name, 0.0) for name in core.segment_names]]),
                "parameters": family.paths if derivatives else [],
                "outputs": list(columns),
                "rtol": self._rtol,
            }
            found = core.shoot(first, asked, lambda _: watch.look())
        except ValueError as error:
            raise SimulationError(str(error)) from None
        if found["failures"][0] is not None:
            raise SimulationError(found["failures"][0])
        by_free = found["sensitivities"]
        if derivatives:
            by_free = by_free @ family.by_free(numbers)
        return found["values"], by_free
