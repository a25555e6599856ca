"""Varied numbers of a drive or a circuit: their names and quantities, and the simulation of members by the core."""

from __future__ import annotations

from functools import cached_property, lru_cache
from itertools import product
from typing import TYPE_CHECKING, Any, NamedTuple, TypeAlias

import numpy as np

from pneudrive import units
from pneudrive.arrays import Array, Columns, Plain, by_name
from pneudrive.batching import processors
from pneudrive.describe.marks import StatedPressure
from pneudrive.describe.tables.parts import Initial
from pneudrive.describe.tables.starts import read_initial, start_state, start_table, start_values
from pneudrive.errors import CommandError, DescriptionError, SimulationError, naming, nearest
from pneudrive.free import parameters as free
from pneudrive.simulation.simulate import number_of

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from numpy.typing import NDArray

    from pneudrive._core import Ensemble
    from pneudrive._core import Output as CoreOutput
    from pneudrive.describe import Circuit, Drive
    from pneudrive.describe.system import System
    from pneudrive.ensemble.outputs import MemberPlans, Reduction
    from pneudrive.free.parameters import DriveFamily, Parameter


#: Name of a start value -> one number for all members, or an array with one number for each member; in SI.
Starts: TypeAlias = dict[str, float | Array]
#: Pairs of parameters of which the first must not exceed the second, by the ends of their names. Only the most critical
#: row of a design is checked.
COUPLED = (
    ("rod_diameter", "bore"),
    ("friction.coulomb", "friction.breakaway"),
    ("critical_pressure_ratio", "linear_above"),
    ("initial.position", "cylinder.stroke"),
)
#: Parameters of the drive that determine the default start state.
STARTS_FROM = ("cylinder.stroke", "ambient.pressure", "ambient.temperature")
#: Step of varied numbers (relative; absolute for 0), to find other start values that depend on these numbers.
NUDGE = 1e-3


def all_numbers(described: Drive | Circuit) -> dict[str, Parameter]:
    """Return every number of a drive or a circuit and of its start state that may vary, by name."""
    if described.system.names is None:
        return free.circuit_numbers(described.circuit)
    starts = {key: mark for key, mark in Initial.marks().items() if key != "contact_age"}  # the same for all members
    return free.numbers_of(described) | free.start_numbers(starts)


class CoreMembers(NamedTuple):
    """Members in the form of the core.

    Attributes
    ----------
    paths : list of str
        Core names of the varied numbers, and of the numbers that depend on them.
    values : ndarray, shape (n, paths)
    starts : dict
        See `Starts`.
    """

    paths: list[str]
    values: Array
    starts: Starts

    def at(self, places: NDArray[np.intp]) -> CoreMembers:
        """Return the members at these indices."""
        starts = dict(self.starts)
        starts |= {name: one[places] for name, one in starts.items() if isinstance(one, np.ndarray)}
        return CoreMembers(self.paths, self.values[places], starts)


class Variation:
    """Numbers of a drive or a circuit and of its start state that a design sets.

    Parameters
    ----------
    drive : Drive or Circuit
    names : sequence of str
        Names as in the drive file, or as in `circuit_numbers`. ``initial.position`` and similar names belong to the
        start state.
    initial : Initial, mapping or str, optional
        Start state of all members.

    Raises
    ------
    CommandError
        A name is unknown or repeated.
    """

    def __init__(self, drive: Any, names: Sequence[str], initial: Any = None) -> None:  # noqa: ANN401
        self.drive = drive
        self.is_circuit = drive.system.names is None
        #: Start state of all members in the form of a file. The start state of a drive is already checked.
        self.initial = dict(start_values(initial) if self.is_circuit else start_table(read_initial(initial)))
        known = all_numbers(drive)
        for name in names:
            if name not in known:
                raise CommandError(
                    f"vary: {name} is not a number of this {drive.file_kind}", remedy=nearest(name, known)
                )
            if list(names).count(name) > 1:
                raise CommandError(f"vary: {name} is given twice", remedy="Keep one of them.")
        self.numbers = [known[name] for name in names]
        #: Name of a varied start value -> its key in the start state.
        self.start_keys = {name: name.removeprefix(free.INITIAL) for name in names if name.startswith(free.INITIAL)}

    @cached_property
    def family(self) -> DriveFamily:
        """Family of drives that differ in the varied numbers. Numbers of the start state are not included."""
        names = [name for name in self.names if name not in self.start_keys]
        return free.family_of(self.drive, free.find(self.drive, names))

    @property
    def names(self) -> list[str]:
        """Names of the numbers that vary."""
        return [number.name for number in self.numbers]

    def columns(self, rows: Array) -> Columns:
        """Return the values of each number in the given rows in SI, by name."""
        return by_name(self.names, list(rows.T))

    def reader(self, name: str) -> QuantityReader:
        """Return the reader of quantities, such as ``"25 mm"``, for a varied number."""
        gauge_from = None if "ambient.pressure" in self.names else self.drive.ambient.pressure_pa
        return QuantityReader(self.numbers[self.names.index(name)], gauge_from)

    def single(self, row: Array) -> tuple[Any, Plain]:
        """Return the drive or the circuit of a member, and its start state in the form of files.

        Raises
        ------
        DescriptionError
            The description is not valid.
        """
        texts = {number.name: number.written(float(value)) for number, value in zip(self.numbers, row, strict=True)}
        own = {name: text for name, text in texts.items() if name not in self.start_keys}
        changes = {name if name in free.AMBIENT else self.drive.key_prefix + name: text for name, text in own.items()}
        start = self.initial | {key: texts[name] for name, key in self.start_keys.items()}
        return self.drive.replace(changes) if changes else self.drive, start

    def check(self, rows: Array, first: int = 0) -> None:
        """Reject invalid rows. Only extreme rows are checked. `first` is the index of the first row in the design.

        Raises
        ------
        CommandError
            A row is not valid. The message names the row.
        """
        columns = self.columns(rows)
        extremes = [*rows.argmin(axis=0), *rows.argmax(axis=0)]
        for name, (low, high) in product(columns, COUPLED):  # both of one drive or component
            other = name.removesuffix(low) + high
            if f".{name}".endswith(f".{low}") and other in columns:
                extremes.append((columns[name] / columns[other]).argmax())
        for place in sorted({int(extreme) for extreme in extremes}):
            if error := self.fault(rows[place]):
                values = zip(self.numbers, rows[place], strict=True)
                shown = ", ".join(f"{number.name} = {number.written(float(si))}" for number, si in values)
                what = f"row {first + place} of the design: {error.what}"
                raise CommandError(what, value=shown, rule=error.rule, remedy=error.remedy)

    def fault(self, row: Array) -> DescriptionError | None:
        """Return the error of a row that is not valid."""
        try:
            drive, initial = self.single(row)
            drive.core_json()
            drive.core_initial(initial)
        except DescriptionError as error:
            return error
        return None

    def members(self, rows: Array) -> CoreMembers:
        """Return members in the form of the core.

        Parameters
        ----------
        rows : ndarray, shape (n, names)
            Values of the numbers in SI.
        """
        own = [place for place, name in enumerate(self.names) if name not in self.start_keys]
        return CoreMembers(self.family.paths, self.family.many(rows[:, own]), self._starts(rows))

    def _starts(self, rows: Array) -> Starts:
        """Return the start values. They are read member by member if other start values depend on varied numbers."""
        columns = self.columns(rows)
        state: Starts = dict(self.drive.core_initial(self.initial))
        if self.is_circuit:
            starts = self._start_columns
            if starts is None:
                return self._each_start(rows)
            return state | {column: columns[name] for name, column in starts.items()}
        if not self.start_keys and columns.keys().isdisjoint(STARTS_FROM):
            return state
        if not self.drive.is_plain:
            return state | self._each_start(rows)
        nominal = (self.drive.cylinder.stroke_m, self.drive.ambient.pressure_pa, self.drive.ambient.temperature_k)
        by = [columns.get(name, at) for name, at in zip(STARTS_FROM, nominal, strict=True)]
        state |= start_state(Initial.model_validate(self.initial), *by)
        for name, key in self.start_keys.items():
            state[next(column for column in state if column.startswith(f"{key}_"))] = columns[name]
        return state

    def _each_start(self, rows: Array) -> Starts:
        """Return the start values of all members, read one by one."""
        each = [described.core_initial(initial) for described, initial in map(self.single, rows)]
        return {name: np.array([start[name] for start in each]) for name in each[0] if name != "contact_age_s"}

    @cached_property
    def _start_columns(self) -> dict[str, str] | None:
        """Varied start values of a circuit by name; None if other start values may depend on a varied number."""
        known, state = free.numbers_of(self.drive), self.drive.core_initial(self.initial)
        starts = {name: self.drive.start_names[key] for name, key in self.start_keys.items()}
        nominal = np.array([state[starts[name]] if name in starts else known[name].value for name in self.names])
        nudged = nominal + NUDGE * np.where(nominal, np.abs(nominal), 1.0)
        try:
            base, moved = self._each_start(nominal[None]), self._each_start(nudged[None])
        except DescriptionError:  # at a bound
            return None
        return starts if all(moved[key] == base[key] for key in base.keys() - set(starts.values())) else None


class QuantityReader:
    """Reader of the values of one parameter: quantities as users write them, or numbers in SI."""

    def __init__(self, number: Parameter, gauge_from: float | None) -> None:
        self.number, self._gauge_from, self.name = number, gauge_from, f"vary: {number.name}"

    def value(self, given: object) -> float:
        """Read a value and return it in SI. A gauge pressure becomes an absolute pressure.

        Raises
        ------
        CommandError
            The value cannot be read.
        """
        with naming(self.name):
            if isinstance(given, float):  # the check of a row names the row of a number that is not finite
                return given.si_as(self.number.unit) if isinstance(given, units.UnitFloat) else given
            if not isinstance(given, str) or not isinstance(self.number.mark, StatedPressure):
                return number_of(given, self.number.unit, self.name)  # type: ignore[arg-type]
            pressure = units.parse_pressure(given)
        if pressure.gauge and self._gauge_from is None:
            what = f'{self.name}: "{pressure}" is relative to the ambient pressure, which varies'
            raise CommandError(what, remedy="Write an absolute pressure, with abs.")
        return pressure.absolute_pa(self._gauge_from or 0.0)

    def width(self, given: object, about: float) -> float:
        """Read a difference, such as a standard deviation, and return it in SI. ``"10 %"`` is a fraction of `about`.

        Raises
        ------
        CommandError
            The value cannot be read.
        """
        share = units.share_of(given)
        if share is not None:
            return share * abs(about)
        if not isinstance(given, str) or self.number.unit in ("1", ""):
            return self.value(given)
        with naming(self.name):
            number, _ = units.split_mark(given)
            unit = number.strip().partition(" ")[2]
            return units.parse(number, self.number.unit) - units.parse(f"0 {unit}", self.number.unit)


# --- Simulation of members in the core. Only this module calls the core for ensembles.

#: Status of a member that was simulated to the end.
DONE = 0


def run_members(
    system: System,
    members: CoreMembers,
    plans: MemberPlans,
    rtol: float,
    kept: Sequence[Reduction],
    threads: int | None = None,
    look: Callable[[float], object] | None = None,
) -> tuple[list[Array], NDArray[np.uint8], dict[int, str]]:
    """Run members and return the requested outputs.

    Parameters
    ----------
    system : System
    members : CoreMembers
        n members.
    plans : MemberPlans
        Commands of these members.
    rtol : float
    kept : sequence of Reduction
        Reductions without user functions.
    threads : int, optional
        Default: all processors.
    look : callable, optional
        Called with the number of finished members. An exception ends the run.

    Returns
    -------
    list of ndarray
        An array for each reduction, shape (n,) or (n, samples); NaN if a member failed.
    ndarray of uint8, shape (n,)
        0 done, 1 the run failed, 2 the numbers are inconsistent.
    dict
        Index of a failed member -> reason.

    Raises
    ------
    CommandError
        The core cannot vary one of the numbers, or a value is out of bounds.
    """
    core, n, done = _ensemble(system, *members.paths), len(members.values), 0
    values: dict[int, Array] = {}
    status, reasons = np.zeros(n, np.uint8), {}

    tell = None if look is None else lambda count: look(done + count)
    for at, steps, durations in plans.alike():  # members whose commands change at the same times
        places = np.arange(n)[at]
        part = members if len(places) == n else members.at(places)
        starts = [part.starts[name] for name in core.start_names]
        rows = 1 if all(np.ndim(start) == 0 for start in starts) else len(places)
        request: Any = {
            "values": part.values,
            "plans": steps,
            "duration": durations,
            "initial": np.column_stack([np.broadcast_to(start, rows) for start in starts]),
            "contact_age_s": float(part.starts.get("contact_age_s", 0.0)),
            "rtol": rtol,
            "threads": threads or processors(),
        }
        rates: list[float | None] = [*sorted({one.rate_hz for one in kept if one.word == "samples"})] or [None]
        for rate in rates:  # the core samples at one rate in a run; unsampled outputs come with the first rate
            asked = [k for k, one in enumerate(kept) if (one.rate_hz if one.word == "samples" else rates[0]) == rate]
            try:
                outcome = core.run(request | {"outputs": [_output(kept[k]) for k in asked]}, tell)
            except ValueError as error:
                raise CommandError(str(error)) from None
            except RuntimeError as error:
                raise SimulationError(str(error)) from None
            for k, value in zip(asked, outcome["outputs"], strict=True):
                values.setdefault(k, np.empty((n, *value.shape[1:])))[places] = value
            status[places] = outcome["status"]
            reasons |= {int(places[place]): why for place, why in outcome["reasons"].items()}
        done += len(places)
    return [values[k] for k in range(len(kept))], status, reasons


@lru_cache(maxsize=8)
def _ensemble(system: System, *paths: str) -> Ensemble:
    """Return the core's ensemble of a system. It is created once and cached."""
    from pneudrive import _core

    try:
        return _core.Ensemble(system.json, list(paths), system.names)
    except ValueError as error:
        raise CommandError.of("ensemble.held", error=error) from None


def _output(one: Reduction) -> CoreOutput:
    """Return the output in the form that the core expects."""
    what: Any = one.word
    level = one.rate_hz if what == "samples" else one.level
    return {"column": one.columns[0], "what": what, "value": level, "above": one.above}
