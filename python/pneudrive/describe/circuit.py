"""Circuits from a file or from Python: named components, joined at their ports."""

from __future__ import annotations

import hashlib
import json
import re
from functools import cached_property, partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, Literal

from pydantic import Field, ValidationError, model_validator

from pneudrive.describe.base import as_tables, inline
from pneudrive.describe.components import Component, component, component_class, unusual, within_component
from pneudrive.describe.connections import AMBIENT, ARROW, Part, Wiring
from pneudrive.describe.files import catalogue, toml
from pneudrive.describe.formulas import formula_of, law_of, read_file
from pneudrive.describe.kinds import COMMAND, component_kinds
from pneudrive.describe.system import DRIVE_NAMES, PISTON, DescribedSystem, System
from pneudrive.describe.tables.parts import assumed_stops
from pneudrive.describe.tables.starts import PRESSURE, Starts, check_platforms, start_place, start_values
from pneudrive.describe.tables.valve_flow import FLOW_KEYS, NEEDLE, without_other_sizes
from pneudrive.errors import DescriptionError, Problems, invalid, nearest, together, warn, wrong
from pneudrive.lazy_names import upper
from pneudrive.repr_tables import Card

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    import xarray as xr

    from pneudrive.arrays import Keyed, NamedNumbers, Plain
    from pneudrive.describe.files.sourced import Value
    from pneudrive.describe.marks import Positions, Signal
    from pneudrive.describe.system import ShortNames
    from pneudrive.progress import Flag, Progress
    from pneudrive.simulation.command import Commands

#: Valid name of a component.
_NAME = re.compile(r"[A-Za-z_][A-Za-z0-9_-]*")
STOP_KEYS = ("stiffness", "damping", "damping_depth")


# --- Short form of a circuit: conversion of the tables of a drive file to components with default connections.
#
# [supply], [valve] and [cylinder] become components with these names. [friction] belongs to the cylinder, and [load]
# moves with the piston. [tubing] and [flow_control] are between valve and cylinder, for each chamber. Keys are only
# renamed; no value is computed.

#: Tables of a drive file that describe components.
TABLES = ("supply", "valve", "cylinder", "friction", "load", "tubing", "flow_control")
#: Chamber -> port of the valve that is connected to the chamber.
CHAMBERS = {"a": "4", "b": "2"}
#: Prefix of the keys for the size of a flow control's check valve.
_CHECK = "check_"
_SAME = "assumed as large as that of the needle"


class Short:
    """Components and connections that the tables of a drive file describe.

    Parameters
    ----------
    data : mapping
        Tables of a drive file or a circuit file.
    problems : Problems
        Collects the errors.

    Attributes
    ----------
    components : dict
        Tables of components by name.
    places : dict
        Key in a circuit file -> key in the short form. The longest matching key is used.
    chains : list of str
        Default connections that `connections` and `plugged` do not replace.
    """

    def __init__(self, data: Keyed, problems: Problems) -> None:
        self.components: dict[str, dict[str, Any]] = {}
        self.places: dict[str, str] = {}
        given = _tables(data, problems)
        if "supply" in given:
            self._add("supply", "supply", {"kind": "reservoir"} | given["supply"])
        for name in ("valve", "cylinder"):
            if name in given:
                kind = given[name].get("kind")
                is_short = isinstance(kind, str) and not kind.startswith(f"{name}/")
                self._add(name, name, dict(given[name]) | ({"kind": f"{name}/{kind}"} if is_short else {}))
        if "friction" in given:
            self.components["cylinder"]["friction"] = given["friction"]
            self.places["components.cylinder.friction"] = "friction"
        load = dict(given.get("load", {}))
        spring = load.pop("spring", None)
        if load:
            self._add("load", "load", {"kind": "load"} | load)
        if spring is not None:
            self._add("spring", "load.spring", {"kind": "spring"} | (spring if isinstance(spring, dict) else {}))
        for key, (part, kind, renamed) in _LINES.items():
            for chamber, table in given.get(key, {}).items():
                where, name = f"{key}.{chamber}", f"{part}_{chamber}"
                with problems.caught():
                    if chamber not in CHAMBERS:
                        raise invalid(where, "describe.not-a-chamber", shown=where, remedy=nearest(chamber, CHAMBERS))
                    if not isinstance(table, dict):
                        raise wrong(where, f"{where} = {table!r} is not a table", remedy="Write { ... }.")
                    self._add(name, where, {"kind": kind} | renamed(table, where))
                    for size in set(FLOW_KEYS) & set(table) if key == "flow_control" else ():
                        self.places[f"components.{name}.{NEEDLE}{size}"] = f"{where}.{size}"
        self.chains = _chains(self.components, data)
        connections = data.get("connections", ())
        self._given = len(connections) if isinstance(connections, list | tuple) else 0  # without default ones

    def _add(self, name: str, place: str, table: Plain) -> None:
        self.components[name] = table
        self.places[f"components.{name}"] = place

    def located(self, key: str | None) -> str | None:
        """Return the key of the short form for a key of a circuit file."""
        for known in sorted(self.places, key=len, reverse=True):
            if key is not None and (key == known or key.startswith(f"{known}.")):
                return f"{self.places[known]}{key[len(known) :]}"
        table, _, number = (key or "").partition(".")
        return "valve" if table == "connections" and number.isdigit() and int(number) >= self._given else key


def _tables(data: Keyed, problems: Problems) -> Plain:
    """Return the given tables of a drive file, without those that need a missing [cylinder] or [valve]."""
    given = {key: data[key] for key in TABLES if key in data}
    for key, table in list(given.items()):
        if hasattr(table, "to_dict") and key != "friction":
            given[key] = table.to_dict()
        elif not isinstance(table, dict) and key != "friction":
            problems.add(wrong(key, f"{key} = {table!r} is not a table"))
            del given[key]
    for key, needs in (("friction", ["cylinder"]), ("load", ["cylinder"]), *((key, _ENDS) for key in _LINES)):
        missing = [need for need in needs if need not in given]
        if key in given and missing:
            what = f"[{key}] belongs to a [cylinder]" + (" behind a [valve]" if key in _LINES else "")
            rest = " and ".join(f"[{one}]" for one in missing)
            remedy = f"Add {rest}, or write it as [components.NAME]."
            problems.add(wrong(key, f"{what}; missing: {rest}", remedy=remedy))
            del given[key]
    return given


def _flow_control(table: Keyed, where: str) -> Plain:
    """Return the table of a flow control. A check valve without a size has the size of the needle."""
    for size in (size for size in FLOW_KEYS if size in table and f"{NEEDLE}{size}" in table):
        raise invalid(f"{where}.{size}", "describe.size-twice", shown=where, size=size, needle=NEEDLE)
    out = {f"{NEEDLE}{key}" if key in FLOW_KEYS else key: given for key, given in table.items()}
    needle = {size: out[f"{NEEDLE}{size}"] for size in FLOW_KEYS if f"{NEEDLE}{size}" in out}
    if not any(f"{_CHECK}{size}" in out for size in FLOW_KEYS):
        plain = {size: given for size, given in needle.items() if not isinstance(given, dict)}
        out |= {f"{_CHECK}{size}": {"value": given, "assumed": _SAME} for size, given in plain.items()}
    return out


def _tube(table: Keyed, where: str) -> Plain:
    """Return the table of a tube. The key `model` gives its kind."""
    out = dict(table)
    if "model" in out:
        model = out.pop("model")
        if "kind" in out or not isinstance(model, str) or model not in TUBES:
            what = "both model and kind are given" if "kind" in out else f"model = {model!r} is not known"
            remedy = "Keep one of them." if "kind" in out else nearest(str(model), TUBES)
            raise wrong(f"{where}.model", f"{where}: {what}", remedy=remedy)
        out["kind"] = TUBES[model]
    return out


_ENDS = ["valve", "cylinder"]
#: Kind of a tube by its `model`.
TUBES = {"auto": "tube/auto", "steady": "tube", "lumped": "tube/lumped", "distributed": "tube/distributed"}
#: Table of a line -> first part of component names, kind, conversion of the table; in the order from valve to chamber.
_LINES: dict[str, tuple[str, str, Any]] = {
    "tubing": ("tube", "tube", _tube),
    "flow_control": ("flow_control", "flow-control", _flow_control),
}


def _chains(has: Keyed, data: Keyed) -> list[str]:
    """Return the default connections. Valve ports and lines named in `connections` or `plugged` are left out."""
    lists = (one for key in ("connections", "plugged") if isinstance(one := data.get(key), list | tuple))
    texts = (text for one in lists for text in one if isinstance(text, str))
    words = {word.strip() for text in texts for word in text.split(ARROW)}
    named = words | {word.partition(".")[0] for word in words if "." in word}
    chains = []
    if "valve" in has and "supply" in has and "valve.1" not in named and _has_ports(has["valve"], "1"):
        chains.append(f"supply {ARROW} valve.1")
    for chamber, port in CHAMBERS.items():
        if "valve" in has and "cylinder" in has and _has_ports(has["valve"], *CHAMBERS.values()):
            lines = [f"{part}_{chamber}" for part, *_ in _LINES.values() if f"{part}_{chamber}" in has]
            if not {f"valve.{port}", *lines} & named:
                chains.append(f" {ARROW} ".join([f"valve.{port}", *lines, f"cylinder.{chamber}"]))
    return chains + [f"{name} {ARROW} cylinder.rod" for name in ("load", "spring") if name in has]


def _has_ports(table: Keyed, *names: str) -> bool:
    """Return whether a valve has the named ports. True for a valve of the catalogue, whose kind is not known yet."""
    kind = table.get("kind")
    entry = component_kinds().get(kind) if isinstance(kind, str) else None
    return entry is None or set(names) <= {port["name"] for port in entry["ports"]}


# --- Circuits.


class Circuit(DescribedSystem):
    """A pneumatic circuit: components by name, and connections between their ports.

    A circuit is frozen; `replace` returns a changed copy. `connections` are chains, ``"valve.4 -> hose ->
    cylinder.a"``. `plugged` lists closed ports. `junctions` selects the model of a joint between two restrictions.
    `initial` is the default start state of a run. Tables of a drive file, such as ``supply`` and ``cylinder``, define
    components with these names and with default connections.

    Examples
    --------
    >>> discharge = Circuit(
    ...     components={
    ...         "tank": {"kind": "tank", "volume": "2 l"},
    ...         "nozzle": {"kind": "fitting", "conductance": "0.5 dm3/(s bar)", "critical_pressure_ratio": 0.5},
    ...     },
    ...     connections=["tank -> nozzle -> ambient"],
    ...     initial={"tank": "7 bar abs"},
    ... )
    >>> run = discharge.simulate(None, "2 s")
    >>> bool(run["tank.pressure"][-1] < 4e5)
    True
    """

    #: Name of the kind of file, and prefix of component names in the keys of the file.
    file_kind: ClassVar[str] = "circuit"
    key_prefix: ClassVar[str] = "components."
    derived: ClassVar[tuple[str, ...]] = (*DescribedSystem.derived, "wiring", "start_names", "origin_of")

    name: str = "unnamed circuit"
    components: dict[str, Component]
    connections: tuple[str, ...] = ()
    plugged: tuple[str, ...] = ()
    junctions: Literal["volume", "series"] = Field(
        default="volume",
        description="Joints of two restrictions: with a small volume, or without (both restrictions are merged)",
    )
    initial: dict[str, Any] = Field(default_factory=dict)
    labels: dict[str, str] = Field(default_factory=dict)

    @model_validator(mode="wrap")
    @classmethod
    def _whole(cls, data: Any, handler: Callable[[Any], Circuit]) -> Circuit:  # noqa: ANN401
        """Check the whole circuit, then raise one error that lists all problems."""
        if not isinstance(data, dict):
            return handler(data)
        problems = Problems()
        short = Short(data, problems)
        data = _completed(data, short, problems)
        components, parts, templates = _read_components(data.get("components"), problems)
        lists = (data.get(key) for key in ("connections", "plugged"))
        chains, plugged = (one if isinstance(one, list | tuple) else () for one in lists)
        wiring = Wiring(parts, chains, plugged, templates, problems)
        check_platforms(wiring, components, problems)
        whole = None
        try:
            whole = handler(data | {"components": components})
        except ValidationError as error:
            problems.add(cls.explain(error))
        for one in problems.found.values():
            _relocate(one, short, {})
        problems.tell()
        assert whole is not None  # otherwise there was a problem
        vars(whole)["wiring"] = wiring
        try:
            whole.core_initial()
        except DescriptionError as error:
            raise together([_relocate(one, short, parts) for one in error.each()]) from None
        for warning in wiring.warnings:
            warn(warning)
        return whole

    @model_validator(mode="after")
    def _dew_point_at_a_pressure(self) -> Circuit:
        assert self.dew_point_pressure_pa or self.gas.dew_point_k is None  # raises an error if it is wrong
        return self

    @property
    def dew_point_pressure_pa(self) -> float | None:
        """Absolute pressure in Pa to which the dew point of the gas refers; None without a dew point.

        If the description does not state this pressure, the highest pressure of the circuit's reservoirs is used.
        """
        ambient = self.ambient.pressure_pa
        holding = (one for one in self.components.values() if one.entry["ports"][0]["holds"] == "pressure")
        pressures = [one.numbers(ambient)["pressure"] for one in holding]
        return self.gas.dew_point_pressure_pa(ambient, max(pressures, default=None))

    @classmethod
    def load(cls, source: str | Path) -> Circuit:
        """Read a circuit from a TOML file.

        Parameters
        ----------
        source : path-like
            Path of the file, or its text if `source` has more than one line.

        Raises
        ------
        DescriptionError
            The file is not valid; the message gives file, line, value, rule and remedy.

        Warns
        -----
        PneudriveWarning
            The gas of a component is not connected to a reservoir, or a friction table names no law.
        """
        if isinstance(source, str) and "\n" in source:
            return cls.from_tables(toml.parse(source, "circuit"), source, Path("circuit"))
        return cls.from_tables(*toml.read(source), Path(source)).read_from(source)

    @classmethod
    def from_tables(cls, tables: Plain, text: str, path: Path) -> Circuit:
        """Make a circuit from the tables of a file.

        Errors show lines of `text`. Paths of custom laws and formulas are relative to the folder of `path`.

        Raises
        ------
        DescriptionError
            As for `load`.
        """
        with toml.locating(path, text):
            read_file(tables.get("friction"), "law", "friction", law_of, path)
            components = tables.get("components")
            for name, table in components.items() if isinstance(components, dict) else ():
                if isinstance(table, dict):
                    key, entry = f"components.{name}", component_kinds().get(str(table.get("kind")))
                    read_file(table.get("friction"), "law", f"{key}.friction", law_of, path)
                    if entry is not None and entry["formula"]:
                        read_file(table, "formula", key, partial(formula_of, entry=entry), path)
            return cls.model_validate(tables)

    def replace(self, changes: Plain) -> Circuit:
        """Return a checked circuit with some values changed.

        Parameters
        ----------
        changes : dict
            Dotted keys of the circuit file, each with a quantity, a list or a table:
            ``{"components.left.bore": "40 mm"}``, or ``"left.bore"`` as in results.
        """
        tables = self.to_dict()
        for key, value in changes.items():
            *path, last = key.split(".")
            if path and path[0] in self.components and path[0] not in tables:
                path = ["components", *path]
            one = self.components.get(path[1]) if len(path) == 2 and path[0] == "components" else None
            if one is not None:
                last = one.renamed.get(last, last)
                tables["components"][path[1]] = without_other_sizes(tables["components"][path[1]], [last])
            toml.put(tables, ".".join([*path, last]), as_tables(value))
        return type(self).model_validate(tables).read_from(self.source_file)

    @cached_property
    def wiring(self) -> Wiring:
        """Joints of the circuit: ports that share their gas or their motion."""
        parts = {name: Part(one.entry, f"components.{name}") for name, one in self.components.items()}
        return Wiring(parts, self.connections, self.plugged, {}, Problems())

    @property
    def commandable(self) -> dict[str, Signal | Positions | None]:
        """Components with a command, each with its switching positions or its electrical input (None if not given)."""
        return {name: one.command_input for name, one in self.components.items() if hasattr(one, COMMAND)}

    #: Whether model errors are known. They are known only for a drive without lines.
    is_plain: ClassVar[bool] = False

    @property
    def axis_names(self) -> ShortNames:
        """Short names, as in a drive, for the columns of a circuit with one cylinder and one commanded component.

        Raises
        ------
        DescriptionError
            If the circuit does not have exactly one cylinder and one commanded component.
        """
        cylinders = [name for name, one in self.components.items() if one.kind.startswith(f"{PISTON}/")]
        parts = {PISTON: cylinders, "valve": list(self.commandable)}
        for part, names in parts.items():
            if len(names) != 1:
                raise DescriptionError.of("describe.not-one-axis", name=self.name, part=part, names=", ".join(names))
        full = {short: name.partition(".") for short, name in DRIVE_NAMES.items()}
        own = [(short, f"{parts.get(of, [of])[0]}{dot}{key}") for short, (of, dot, key) in full.items()]
        return cylinders[0], tuple(own), False

    @property
    def meanings(self) -> dict[str, str]:
        """Meaning of the columns of a trajectory, by name."""
        return {
            f"{name}.{output['name']}": f"{name}: {output['meaning']}"
            for name, one in self.components.items()
            for output in one.entry["outputs"]
        }

    @cached_property
    def system(self) -> System:
        """Circuit in the core's form, with the names of its components."""
        ambient = self.ambient.core()
        problems = Problems()
        components: list[Plain] = []
        for name, one in self.components.items():
            with problems.caught(), within_component(name, {}):
                component: Plain = {"name": name} | one.core(self.ambient.pressure_pa)
                if one.kind == "platform/linear-delta":  # its carriages have the same positions in two poses
                    component["numbers"] = start_place(self.initial, name) | component["numbers"]
                components.append(component)
        problems.tell()
        form = {
            "gas": self.gas.core(),
            "ambient": ambient,
            "components": components,
            "joints": self.wiring.core(),
        }
        if self.junctions != "volume":
            form["junctions"] = self.junctions
        return System(json.dumps(form, sort_keys=True))

    @property
    def core_parts(self) -> dict[str, Plain]:
        """Components in the core's form, by name."""
        return {one["name"]: one for one in json.loads(self.core_json())["components"]}

    @property
    def circuit(self) -> Circuit:
        """The circuit itself, for calls that accept drives (`Drive.circuit`) and circuits."""
        return self

    def circuit_values(self, given: object) -> Keyed:
        """Return start values as a table. `given` is a dict or a text."""
        return start_values(given)

    @cached_property
    def origin_of(self) -> dict[str, Value]:
        """Origins of values, by key in the circuit file."""
        components = self.components.items()
        return {f"components.{name}.{key}": value for name, one in components for key, value in one.origins.items()}

    @property
    def component_places(self) -> list[tuple[str, str]]:
        """Pairs as in `Drive.component_places`: both entries are the key of the component in the circuit file."""
        return [(f"components.{name}", f"components.{name}") for name in self.components]

    @property
    def description_hash(self) -> str:
        """SHA-256 of the simulated values, without name, labels and start state."""
        return hashlib.sha256(self.core_json().encode()).hexdigest()

    def core_initial(self, initial: object = None) -> NamedNumbers:
        """Return the start state in the core's form, in SI. `initial` (dict or text) overrides `self.initial`.

        Raises
        ------
        CommandError
            The argument has another type, or a text does not have the form ``key = quantity, ...``.
        DescriptionError
            A start value is unknown or does not fit, or the core rejects the circuit.
        """
        return Starts(self).values(self.initial, start_values(initial))[0]

    @cached_property
    def start_names(self) -> dict[str, str]:
        """Names of the start values in the core, by the names that users write."""
        starts = Starts(self)
        return starts.keys | {key: key for key in starts.coordinates}

    def simulate(
        self,
        commands: Commands,
        duration: str | float,
        *,
        initial: Keyed | str | None = None,
        sample_rate: str | float = "1 kHz",
        rtol: float = 1e-6,
        ledger: bool = False,
        budget: int | None = None,
        progress: Progress | None = None,
        cancel: Flag | None = None,
    ) -> xr.Dataset:
        """Simulate the circuit, as ``pn.simulate(circuit, ...)`` does.

        Parameters
        ----------
        commands : dict, str, number, sequence or None
            Commands by component: ``{"valve_l": "0 s: 1, 0.5 s: -1", "valve_r": 0.4}``, each in a form that
            `pneudrive.simulate` accepts. A text may begin with the name, ``"valve_l: 0 s: 1, 0.5 s: -1"``. The name is
            optional if only one component has a command. A valve without a command stays closed.
        duration, sample_rate, rtol, ledger, budget, progress, cancel
            See `pneudrive.simulate`.
        initial : dict or str, optional
            Start values, see `start`.

        Returns
        -------
        xarray.Dataset
            As from `pneudrive.simulate`; names of variables are ``left.position``, ``left.a.pressure``, ...

        Raises
        ------
        CommandError, DescriptionError, SimulationError, Cancelled
            As `pneudrive.simulate`.
        """
        options = {"initial": initial, "sample_rate": sample_rate, "rtol": rtol, "ledger": ledger, "budget": budget}
        return upper("simulate")(self, commands, duration, **options, progress=progress, cancel=cancel)

    @cached_property
    def assumptions(self) -> list[tuple[str, str]]:
        """Assumptions as pairs (text, name). The name of a component or joint, if any, replaces ``{}`` in the text."""
        out: list[tuple[str, str]] = []
        starts, settled = Starts(self).values(self.initial)
        highest = max((value for name, value in starts.items() if name.endswith(PRESSURE)), default=0.0)
        stops = self.system.compiled().end_stops(highest)
        for name, one in self.components.items():
            lines = list(one.assumed())
            if name in stops:
                given = [key for key in STOP_KEYS if one.fields[f"end_stop_{key}"] in one.model_fields_set]
                lines = [line for line in lines if not line.startswith("end_stop_")]
                lines += assumed_stops("end_stop_", given, stops[name])
            out += [("{}." + line, name) for line in lines]
        heat = "" if any(one.has_heat_law for one in self.components.values()) else ", and no heat exchange"
        for name, volume in self.joint_volumes:
            line = f"the joint of {{}} has {1e6 * volume:.3g} cm3, from the volumes of its ports{heat}"
            out.append((line, name))
        return out + [(line, "") for line in settled]

    @property
    def joint_volumes(self) -> list[tuple[str, float]]:
        """Gas joints with a volume outside the components: first port of each joint, and volume of its ports in m3."""
        return self.system.compiled().joint_volumes

    @property
    def notes(self) -> list[str]:
        """Warnings from reading the circuit."""
        laws = ((name, getattr(one, "friction", None)) for name, one in self.components.items())
        said = [f"{name}.friction {friction.note}" for name, friction in laws if friction and friction.note]
        idle = [f"{name}.{line}" for name, one in self.components.items() for line in one.idle]
        return self.wiring.warnings + said + idle + self.unusual

    @property
    def unusual(self) -> list[str]:
        """Unusually large or small sizes of components, which may have a wrong unit."""
        return [line for name, one in self.components.items() for line in unusual(name, one)]

    def _card(self) -> Card:
        """Return a card with a line for each component, and the connections."""
        rows = [(name, inline(one.plain())) for name, one in self.components.items()]
        return Card(self.name, rows=rows, notes=[*self.connections, f"assumed: {', '.join(self.assumed())}"])

    def to_toml(self) -> str:
        """Return the circuit as TOML text, from which `load` reads exactly the same values."""
        tables: Plain = {"schema": self.schema_version} | self.to_dict()
        components = tables.pop("components").items()
        blocks = [block for name, one in components for block in toml.blocks(one, f"components.{name}", 2)]
        return "\n".join([toml.write(tables), "\n\n".join(blocks), ""])


# --- Tables of components: merging with catalogue and drive tables, copies, reading.


def _completed(data: Plain, short: Short, problems: Problems) -> Plain:
    """Replace the tables of a drive file by components and connections."""
    out = {key: value for key, value in data.items() if key not in TABLES}
    given = out.get("components", {})
    if not short.components or not isinstance(given, dict):
        return out
    both = dict(short.components)
    for name, table in given.items():
        if name not in both:
            both[name] = table
        elif isinstance(table, dict) and not {"kind", "use", "copies"} & set(table):
            both[name] = both[name] | table  # adds to the short form
            short.places |= {f"components.{name}.{key}": f"components.{name}.{key}" for key in table}
        else:
            what = f'two components have the name "{name}"; the other one is [{short.places[f"components.{name}"]}]'
            remedy = "Rename this component. To add keys to the other component, leave out kind."
            problems.add(
                wrong(f"components.{name}.kind", what, rule="each component needs a different name", remedy=remedy)
            )
            short.places[f"components.{name}.kind"] = f"components.{name}.kind"
    connections = out.get("connections", ())
    if isinstance(connections, list | tuple):
        out["connections"] = [*connections, *short.chains]
    return out | {"components": both}


def _read_components(
    given: object, problems: Problems
) -> tuple[dict[str, Component], dict[str, Part], dict[str, list[str]]]:
    """Read all tables of components.

    Returns
    -------
    components : dict
        Valid components by name.
    parts : dict
        Data of all components for the wiring, by name.
    templates : dict
        Names of the copies, by name of their table. A table with copies is not a component.
    """
    components: dict[str, Component] = {}
    parts: dict[str, Part] = {}
    templates: dict[str, list[str]] = {}
    if not isinstance(given, dict) or not given:
        what = "the circuit has no components" if not given else f"components = {given!r} is not a table"
        problems.add(wrong("components", what, remedy="Write [components.NAME]."))
        return components, parts, templates
    for name, table in given.items():
        key, copies, kind = f"components.{name}", [name], getattr(table, "kind", None)
        if isinstance(table, dict):
            table = {**table}  # noqa: PLW2901 - the table without its copies
            copies = table.pop("copies", copies)
            if "use" in table:
                table = problems.take(_used, name, table)  # noqa: PLW2901 - the table over that of the part
            kind = table and table.get("kind")
        if not isinstance(copies, list | tuple) or not copies or not all(isinstance(one, str) for one in copies):
            what = f"{name}.copies = {copies!r} is not a list of names"
            problems.add(wrong(f"{key}.copies", what, remedy='Write copies = ["left", "right"].'))
            copies = [name]
        elif name not in copies:
            templates[name] = list(copies)
        component = None if table is None else problems.take(_component, name, table)
        stated = ", ".join(map(str, component.pressures())) if component is not None else ""
        entry = component_kinds().get(kind) if isinstance(kind, str) else None
        for number, own in enumerate(copies):
            here = f"{key}.copies.{number}" if len(copies) > 1 or own != name else key
            if own in parts or (own != name and own in given):
                problems.add(invalid(here, "describe.name-taken", own=own))
                continue
            if own == AMBIENT or not _NAME.fullmatch(str(own)):
                rule = 'a letter or "_", then letters, digits, "_" or "-"; "ambient" is reserved'
                problems.add(wrong(here, f'"{own}" is not valid as the name of a component', rule=rule))
            parts[own] = Part(entry, here, stated)
            if component is not None:
                components[own] = component
    return components, parts, templates


def _used(name: str, table: Plain) -> Plain:
    """Merge a component's table into the table of the catalogue part that the component's key `use` names."""
    own = {key: value for key, value in table.items() if key != "use"}
    with within_component(name, table):
        part = catalogue.part_table(table["use"])
        kind = own.setdefault("kind", part["kind"])
        if kind != part["kind"]:
            raise invalid("kind", "describe.other-kind", kind=kind, table=table["use"], part=part["kind"])
        return component_class(kind).over(part, own)


def _component(name: str, table: object) -> Component:
    if isinstance(table, Component):
        return table
    if not isinstance(table, dict):
        raise wrong(f"components.{name}", f"components.{name} = {table!r} is not a table")
    with within_component(name, table):
        return component(table)


def _relocate(error: Any, short: Short, parts: Mapping[str, Part]) -> Any:  # noqa: ANN401 - an error
    """Set the key of an error to its key in the file: in a component's table, a table of copies, or the short form."""
    table, _, rest = (getattr(error, "key", None) or "").partition(".")
    name, dot, inner = rest.partition(".")
    written = parts[name].table if table == "components" and name in parts else ""
    error.key = short.located(f"{written}{dot}{inner}" if written else getattr(error, "key", None))
    return error
