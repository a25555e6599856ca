"""Variables of a drive or a circuit in an FMU, and the plan that the library runs."""

from __future__ import annotations

import hashlib
import json
import uuid
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from typing import Any

from pneudrive._core import Session as CoreSession
from pneudrive.arrays import NamedNumbers, Plain
from pneudrive.describe.components import parameter_quantity
from pneudrive.describe.drive import Drive
from pneudrive.describe.kinds import STATED
from pneudrive.describe.system import System, short_name
from pneudrive.errors import DescriptionError
from pneudrive.free.parameters import component_numbers, side_of
from pneudrive.simulation.start import DriveOrCircuit, StartState
from pneudrive.simulation.trajectory import meaning

#: Parameters of a valve that are fixed in an FMU, because they change the number of states or delay the command.
_HISTORY = ("frequency", "delay", "hysteresis", "overlap", "leakage")
_PISTON = "cylinder.position_m"
#: Relative tolerance of co-simulation: a tenth of that of a run, because communication steps interrupt the solver.
RTOL = 1e-7


@dataclass(frozen=True)
class FmuVariable:
    """Variable of an FMU.

    Attributes
    ----------
    name : str
        Name in the drive file or in a trajectory.
    unit : str
        SI unit; ``"1"`` for a dimensionless number.
    meaning : str
    causality : str
        ``independent``, ``parameter``, ``input``, ``output`` or ``local``.
    role : dict
        Role of the variable in the library. Its entry ``discrete`` states whether an input changes only at events.
    start : float or None
        Start value of a parameter or an input.
    rate_of : str
        Name of the state of which this variable is the rate.
    nominal : float or None
        Nominal value of a state, from which a tool derives its absolute tolerance. If it is absent, tools assume 1.
    """

    name: str
    unit: str
    meaning: str
    causality: str
    role: Plain
    start: float | None = None
    rate_of: str = ""
    nominal: float | None = None


TIME = FmuVariable("time", "s", "time", "independent", {"role": "time"})


@dataclass(frozen=True)
class FmuPlan:
    """Content of an FMU: a circuit, its start and its variables.

    Attributes
    ----------
    title : str
    variables : tuple of FmuVariable
        The index of a variable is its value reference.
    form : dict
        The circuit in the core's form; empty for a controller.
    start : dict
        Start values in SI by the core's names; empty for a controller.
    rtol : float
    is_actuator : bool
        Whether position and velocity of the piston are inputs.
    notes : tuple of str
        Warnings and assumed values of the description.
    law : dict or None
        A controller instead of a circuit, in the form of `pneudrive.control`.
    period_s : float or None
        Sampling period of a controller in s.
    code : tuple of (str, str)
        Source code of a controller in C99 instead of the library: names and texts of files, including
        ``conformance.txt``, a file for checking a compiled copy.
    identifier : str
        Name of the library without its suffix, and prefix of the names in the source code.
    """

    title: str
    variables: tuple[FmuVariable, ...]
    form: Plain = field(default_factory=dict)
    start: NamedNumbers = field(default_factory=dict)
    rtol: float = 1e-6
    is_actuator: bool = False
    notes: tuple[str, ...] = ()
    law: Plain | None = None
    period_s: float | None = None
    code: tuple[tuple[str, str], ...] = ()
    identifier: str = "pneudrive"

    def json(self) -> str:
        """Return the plan with its token as JSON, in the form that the library reads."""
        own = {
            **({} if self.law is None else {"law": self.law}),
            "circuit": self.form,
            "start": self.start,
            "rtol": self.rtol,
            "actuator": _PISTON if self.is_actuator else None,
            "variables": [
                {"name": one.name, **one.role, **({} if one.start is None else {"start": one.start})}
                for one in self.variables
            ],
        }
        return json.dumps({"token": self.token, **own}, indent=1)

    @property
    def token(self) -> str:
        """Token that binds the description of an FMU to its plan: a hash of all data that affect a run."""
        roles = [[one.name, one.role, one.start] for one in self.variables]
        law = [] if self.law is None else [self.law]
        law += [self.code] if self.code else []
        text = json.dumps([self.form, self.start, self.rtol, roles, self.is_actuator, *law], sort_keys=True)
        return f"{{{uuid.UUID(hashlib.sha256(text.encode()).hexdigest()[:32])}}}"


def plan_of(described: DriveOrCircuit, initial: StartState = None, *, actuator: bool = False) -> FmuPlan:
    """Return the plan of an FMU.

    Parameters
    ----------
    described : Drive or Circuit
    initial : Initial, dict or str, optional
        Start state, as for `pneudrive.simulate`. Each of its values can be changed in the other tool.
    actuator : bool
        Whether the other tool moves the piston: position and velocity are inputs, the force is an output.

    Raises
    ------
    DescriptionError
        The start does not fit, or the description cannot be an actuator.
    """
    if actuator:
        if not isinstance(described, Drive):
            raise DescriptionError("an actuator needs a drive, not a circuit", remedy="Export a drive file.")
        # The other tool models force and spring of the load.
        load = described.carried.model_copy(update={"force_n": 0.0, "spring": None})
        described = described.model_copy(update={"carried": load})
    form = json.loads(described.circuit.core_json())
    if actuator:
        next(one for one in form["components"] if one["name"] == "cylinder")["numbers"].pop("incline", None)
    start = described.circuit.core_initial(described.circuit_values(initial))
    age_s = described.core_initial(initial).get("contact_age_s", 0.0)
    session = System(json.dumps(form, sort_keys=True)).compiled().start(start, RTOL)
    is_short = described.system.names is not None
    variables = [TIME]
    variables += _inputs(session, form, is_short, actuator)
    named, results = {one.name for one in variables}, list(_results(session, described, actuator))
    taken = {one.name for one in results}
    own = (one for one in _parameters(described, form) if one.name not in named)
    variables += [replace(one, name=f"given.{one.name}") if one.name in taken else one for one in own]
    variables += _starts(start, is_short, actuator)
    if is_short and "cylinder.contact_age_s" in session.columns:
        what = "At the start: age of the contact"
        variables.append(FmuVariable("start.contact_age", "s", what, "parameter", {"role": "age"}, age_s))
    variables += results
    names = [one.name for one in variables]
    assert len(set(names)) == len(names), "names of variables are unique"
    notes = (*described.circuit.system.compiled().warnings, *described.assumed())
    return FmuPlan(described.name, tuple(variables), form, start, RTOL, actuator, notes)


def _named(core: str, is_short: bool) -> tuple[str, str, str]:
    """Return name, unit and meaning of a variable of the core."""
    return meaning(short_name(core) if is_short else core)


def _inputs(session: CoreSession, form: Plain, is_short: bool, actuator: bool) -> Iterator[FmuVariable]:
    components = {one["name"]: one for one in form["components"]}
    for core, unit, bounds, what in session.inputs:
        of, _, last = core.rpartition(".")
        if last in ("pressure_pa", "temperature_k"):
            continue  # the command of a supply is a parameter
        name = {"load_force_n": "force", "command": "command"}.get(last, meaning(last)[0])
        if actuator and last == "load_force_n":
            continue
        own = components[of]
        at_once = own["kind"] == "valve/proportional-5/3" and not own.get("points")
        at_once = at_once and not any(own["numbers"].get(key) for key in _HISTORY)
        discrete = last == "command" and not at_once
        value = session.read(core)
        yield FmuVariable(
            name if is_short else f"{of}.{name}",
            unit,
            f"{what}, {bounds}" if last == "command" else what,
            "input",
            {"role": "input", "of": core, "discrete": discrete},
            value if value == value else 0.0,
        )
    if actuator:
        for column in ("position_m", "velocity_m_s"):
            name, unit, what = meaning(column)
            yield FmuVariable(name, unit, what, "input", {"role": name}, session.read(f"cylinder.{column}"))


def _parameters(described: DriveOrCircuit, form: Plain) -> Iterator[FmuVariable]:
    """Yield the numbers of the circuit as parameters, named by their keys in the file."""
    is_short = described.system.names is not None
    components = {one["name"]: (i, one) for i, one in enumerate(form["components"])}
    for name, path, value, row in component_numbers(form):
        of, _, key = path.partition(".")
        i, own = components[of]
        is_fixed = row["discrete"] or (key in _HISTORY and own["kind"].startswith("valve/"))
        is_unused = not own["numbers"].get(row["only"], True)
        if is_fixed or is_unused or (own["kind"], key) == ("load", "force"):
            continue  # the force of a load is an input of its piston
        is_pressure = row["unit"] == STATED
        unit = "Pa" if is_pressure else parameter_quantity(row).si_unit or "1"
        what = f"{row['meaning']}, absolute" if is_pressure else row["meaning"]
        role = {"role": "parameter", "of": f"/components/{i}/numbers/{key}"}
        yield FmuVariable(name if is_short else path, unit, what, "parameter", role, float(value))
    for i, own in enumerate(form["components"]):
        if own.get("friction"):
            prefix = "friction" if is_short else f"{own['name']}.friction"
            component: Any = described.circuit.components[own["name"]]
            rows = {row["key"]: row for row in component.friction.entry["parameters"]}
            for key, value in own["friction"]["parameters"].items():
                unit = "1" if rows[key]["unit"] in ("-", "") else rows[key]["unit"]
                role = {"role": "parameter", "of": f"/components/{i}/friction/parameters/{key}"}
                yield FmuVariable(f"{prefix}.{key}", unit, rows[key]["meaning"], "parameter", role, float(value))
    ambient = {"pressure": ("Pa", "Ambient pressure, absolute"), "temperature": ("K", "Ambient temperature")}
    for key, (unit, what) in ambient.items():
        place = f"{key}_{unit.lower()}"
        role = {"role": "parameter", "of": f"/ambient/{place}"}
        yield FmuVariable(f"ambient.{key}", unit, what, "parameter", role, float(form["ambient"][place]))


def _starts(start: NamedNumbers, is_short: bool, actuator: bool) -> Iterator[FmuVariable]:
    """Yield the start values as parameters. Gas in a tube of a drive starts at the pressure of its chamber."""
    followers: dict[str, list[str]] = {}
    for core in start:
        last = core.rpartition(".")[2]
        if is_short and not core.startswith("cylinder.") and last == "pressure_pa":
            followers.setdefault(f"cylinder.{side_of(core)}.{last}", []).append(core)
    follow = {core for each in followers.values() for core in each}
    for core, value in start.items():
        if core in follow or (actuator and core in (_PISTON, "cylinder.velocity_m_s")):
            continue
        name, unit, what = _named(core, is_short)
        role = {"role": "start", "of": [core, *followers.get(core, ())]}
        yield FmuVariable(f"start.{name}", unit, f"At the start: {what}", "parameter", role, value)


def _results(session: CoreSession, described: DriveOrCircuit, actuator: bool) -> Iterator[FmuVariable]:
    is_short = described.system.names is not None
    hides = bool(described.system.names and described.system.names[2])
    moved = (_PISTON, "cylinder.velocity_m_s") if actuator else ()
    seen: dict[str, str] = {}  # name in the core -> name of the output
    for core in session.columns:
        last = core.rpartition(".")[2]
        name, unit, what = _named(core, is_short)
        foreign = hides and "." in name
        if last in ("time_s", "command") or core in moved or foreign or (actuator and last == "acceleration_m_s2"):
            continue
        seen[core] = name
        yield FmuVariable(name, unit, what, "output", {"role": "output", "of": core})
    if actuator:
        what = "force of the drive on the moved body, towards +x, without the drive's mass"
        yield FmuVariable("force", "N", what, "output", {"role": "force"})
    for core, _ in session.states:
        name, unit, what = _named(core, is_short)
        if core in moved:
            continue
        if core not in seen and name in seen.values():  # a tilt: the state is e, and the output the angle 2 asin(e)
            name, what = f"state.{name}", f"{what}, as the core integrates it"
        if core not in seen:
            yield FmuVariable(name, unit, what, "local", {"role": "state", "of": core})
        change, rate = f"{name}_change", _per_second(unit)
        since = f"change of {name} since the start or, in model exchange, since the last event"
        yield FmuVariable(change, unit, since, "local", {"role": "change", "of": core})
        role = {"role": "rate", "of": core}
        yield FmuVariable(f"der({name})", rate, f"rate of {name}", "local", role, rate_of=change)


def _per_second(unit: str) -> str:
    """Return the unit of a rate.

    Examples
    --------
    >>> [_per_second(unit) for unit in ("m", "m/s", "m/s^2", "1", "J/(kg K)")]
    ['m/s', 'm/s^2', 'm/s^3', '1/s', 'J/(s kg K)']
    """
    above, slash, below = unit.partition("/")
    if not slash:
        return f"{unit}/s"
    power = {"s": 2, "s^2": 3}.get(below)
    return f"{above}/s^{power}" if power else f"{above}/(s {below.strip('()')})"
