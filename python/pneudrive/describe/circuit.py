"""A circuit: components by name, joined by their ports, from a file or from Python."""

from __future__ import annotations

import hashlib
import json
import re
from functools import cached_property, lru_cache, partial
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from pydantic import Field, ValidationError, model_validator

from pneudrive.describe import catalogue, end_stops, toml, written
from pneudrive.describe.base import Described, as_tables, escaped, inline, wrong
from pneudrive.describe.components import COMMAND, Component, component, component_class, component_kinds, within
from pneudrive.describe.connections import AMBIENT, Part, Wiring
from pneudrive.describe.formula import ComponentFormula, formula_of
from pneudrive.describe.law import law_of
from pneudrive.describe.parts import Ambient, Gas
from pneudrive.describe.short import TABLES, Short, expanded
from pneudrive.describe.starts import PRESSURE, Starts
from pneudrive.errors import DescriptionError, Problems, together, warn
from pneudrive.references import entries as references
from pneudrive.show import Card

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    import xarray as xr

    from pneudrive._core import Circuit as CoreCircuit
    from pneudrive.command import Commands
    from pneudrive.describe.signal import Signal
    from pneudrive.errors import PneudriveError
    from pneudrive.session import Session
    from pneudrive.watch import Flag

STOP_KEYS = ("stiffness", "damping", "damping_depth")
_NAME = re.compile(r"[A-Za-z_][A-Za-z0-9_-]*")


class Circuit(Described):
    """A pneumatic circuit: components by name, and connections between their ports.

    Frozen: `replace` makes another one. `connections` are chains, ``"valve.4 -> hose -> cylinder.a"``; a port that
    leads nowhere on purpose stands in `plugged`; `junctions` says what becomes of joints of two restrictions.
    `initial` is the start state where a run says nothing else. Tables of a drive file (``supply``, ``valve``,
    ``cylinder``, ...) stand for the components of these names and their usual joints.

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

    schema_version: Literal[1] = Field(default=1, alias="schema")
    name: str = "unnamed circuit"
    gas: Gas = Gas()
    ambient: Ambient = Ambient()
    components: dict[str, Component]
    connections: tuple[str, ...] = ()
    plugged: tuple[str, ...] = ()
    junctions: Literal["volume", "series"] = Field(
        default="volume", description="Joints of two restrictions: a small volume, or none and the two merged"
    )
    initial: dict[str, Any] = Field(default_factory=dict)
    labels: dict[str, str] = Field(default_factory=dict)

    @model_validator(mode="wrap")
    @classmethod
    def _whole(cls, data: Any, handler: Callable[[Any], Circuit]) -> Circuit:  # noqa: ANN401
        """Look at all of it, then tell of everything that is wrong."""
        if not isinstance(data, dict):
            return handler(data)
        problems = Problems()
        short = expanded(data, problems)
        data = _completed(data, short, problems)
        tables, keys, templates = _copied(_used(data.get("components"), problems), problems)
        read = {name: _component(keys[name], table, problems) for name, table in tables.items()}
        components = {name: one for name, one in read.items() if one is not None}
        parts = {name: _part(table, keys[name], read[name]) for name, table in tables.items()}
        lists = [data.get(key, ()) for key in ("connections", "plugged")]
        chains, plugged = ([] if isinstance(one, str) or not isinstance(one, list | tuple) else one for one in lists)
        wiring = Wiring(parts, chains, plugged, templates, problems)
        whole = None
        try:
            whole = handler(data | {"components": components})
        except ValidationError as error:
            for one in cls.explain(error):
                problems.add(one)
        for one in problems.found.values():
            _relocate(one, short)
        problems.tell()
        assert whole is not None  # or there was a problem
        vars(whole)["wiring"] = wiring
        try:
            whole.core_initial()
        except DescriptionError as error:
            raise together([_relocate(_in_file(one, keys), short) for one in error.each()]) from None
        for warning in wiring.warnings:
            warn(warning)
        return whole

    @model_validator(mode="after")
    def _dew_point_at_a_pressure(self) -> Circuit:
        assert self.dew_point_pressure_pa or self.gas.dew_point_k is None  # or it says what is wrong
        return self

    @property
    def dew_point_pressure_pa(self) -> float | None:
        """Absolute pressure at which the dew point of the gas is given, Pa; None where it has none.

        Where nothing is said the highest pressure of its reservoirs.
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
            The file, or the text of one: whatever has more than one line.

        Raises
        ------
        DescriptionError
            Something is wrong; the message names file, line, value, rule and remedy.

        Warns
        -----
        PneudriveWarning
            Gas of a component cannot come or go; a friction table names no law.
        """
        if isinstance(source, str) and "\n" in source:
            origin, folder, text = "circuit", Path(), source
            tables = toml.parse(text, origin)
        else:
            origin, folder = str(source), Path(source)
            tables, text = toml.read(source)
        with toml.locating(origin, text):
            written.read_file(tables.get("friction"), "law", "friction", law_of, folder)
            components = tables.get("components")
            for name, table in components.items() if isinstance(components, dict) else ():
                if isinstance(table, dict):
                    key, entry = f"components.{name}", component_kinds().get(str(table.get("kind")))
                    written.read_file(table.get("friction"), "law", f"{key}.friction", law_of, folder)
                    if entry is not None and entry["formula"]:
                        written.read_file(table, "formula", key, partial(_formula_of, entry), folder)
            return cls.model_validate(tables)

    def replace(self, changes: dict[str, Any]) -> Circuit:
        """Return a circuit with some values changed, checked anew.

        Parameters
        ----------
        changes : dict
            Dotted keys of the circuit file, each with a quantity, a list or a table:
            ``{"components.left.bore": "40 mm"}``.
        """
        tables = self.to_dict()
        for key, value in changes.items():
            *path, last = key.split(".")
            one = self.components.get(path[1]) if len(path) == 2 and path[0] == "components" else None
            if one is not None:
                last = one.renamed.get(last, last)
                for other in one.same_size(last):
                    tables["components"][path[1]].pop(other, None)
            toml.put(tables, ".".join([*path, last]), as_tables(value))
        return type(self).model_validate(tables)

    @cached_property
    def wiring(self) -> Wiring:
        """The joints: which ports share their gas or their motion."""
        parts = {name: Part(one.entry, f"components.{name}") for name, one in self.components.items()}
        return Wiring(parts, self.connections, self.plugged, {}, Problems())

    @property
    def commandable(self) -> dict[str, Signal | None]:
        """Components that take a command, each with its electrical input where one is described."""
        taking = {
            name for name, one in self.components.items() if any(i["name"] == COMMAND for i in one.entry["inputs"])
        }
        return {name: getattr(one, COMMAND) for name, one in self.components.items() if name in taking}

    @property
    def meanings(self) -> dict[str, str]:
        """What the columns of a run mean, by name."""
        return {
            f"{name}.{output['name']}": f"{name}: {output['meaning']}"
            for name, one in self.components.items()
            for output in one.entry["outputs"]
        }

    @cached_property
    def si_form(self) -> str:
        """What `core_json` returns, made once."""
        ambient = self.ambient.core()
        problems = Problems()
        components = [problems.take(self._core_of, name, one) for name, one in self.components.items()]
        problems.tell()
        form = {"gas": self.gas.core(), "ambient": ambient, "components": components, "joints": self.wiring.core()}
        if self.junctions != "volume":
            form["junctions"] = self.junctions
        return json.dumps(form, sort_keys=True)

    def _core_of(self, name: str, one: Component) -> dict[str, Any]:
        try:
            return {"name": name} | one.core(self.ambient.pressure_pa)
        except DescriptionError as error:
            raise within(error, name, {}) from None

    def core_json(self) -> str:
        """Return the SI form of the description that the core takes."""
        return self.si_form

    @property
    def description_hash(self) -> str:
        """SHA-256 of what is simulated: name, labels and the start state do not count."""
        return hashlib.sha256(self.core_json().encode()).hexdigest()

    def core_initial(self, initial: Mapping[str, Any] | None = None) -> dict[str, float]:
        """Return the SI start state that the core takes; what is given here goes before `self.initial`.

        Raises
        ------
        DescriptionError
            Unknown start value, or one that does not fit; the core refuses the circuit.
        """
        return self._starts(initial)[0]

    @property
    def start_keys(self) -> set[str]:
        """Names of the start values, as users write them."""
        names = compiled(self.core_json()).start_names
        return set(Starts(names, self.components, self.wiring, self.ambient).keys)

    def _starts(self, initial: Mapping[str, Any] | None = None) -> tuple[dict[str, float], list[str]]:
        names = compiled(self.core_json()).start_names
        return Starts(names, self.components, self.wiring, self.ambient).values(self.initial, initial or {})

    def start(self, initial: Mapping[str, Any] | str | None = None, *, rtol: float = 1e-6) -> Session:
        """Start the circuit: a session that runs as long as its caller advances it.

        Parameters
        ----------
        initial : dict or str, optional
            Start values that differ from those of the circuit: ``{"left.position": "20 mm"}`` or
            ``"left.position = 20 mm, tank = 5 bar abs"``.
        rtol : float
            Relative tolerance of the solver.

        Returns
        -------
        Session
            See `pneudrive.session.Session`; its inputs are ``"valve.command"``, ``"left.load_force_n"``, ...

        Raises
        ------
        CommandError
            The tolerance is not valid.
        DescriptionError
            The start state does not fit the circuit.
        """
        # What runs knows what is described, not the other way round: it is found when it is asked for.
        return import_module("pneudrive.start").start(self, initial, rtol)

    def simulate(
        self,
        commands: Commands,
        duration: str | float,
        *,
        initial: Mapping[str, Any] | str | None = None,
        sample_rate: str | float = "1 kHz",
        rtol: float = 1e-6,
        ledger: bool = False,
        budget: int | None = None,
        progress: Callable[[float, float, str], None] | None = None,
        cancel: Flag | None = None,
    ) -> xr.Dataset:
        """Simulate the circuit; ``pn.simulate(circuit, ...)`` is the same.

        Parameters
        ----------
        commands : dict, str, number, sequence or None
            By component: ``{"valve_l": "0 s: 1, 0.5 s: -1", "valve_r": 0.4}``, each as `pneudrive.simulate` takes a
            command, or texts with the name in front, ``"valve_l: 0 s: 1, 0.5 s: -1"``. Where one component alone
            takes a command no name is needed. Without a command a valve stays shut.
        duration, sample_rate, rtol, ledger, budget, progress, cancel
            See `pneudrive.simulate`.
        initial : dict or str, optional
            As for `start`.

        Returns
        -------
        xarray.Dataset
            As from `pneudrive.simulate`; variables are called ``left.position``, ``left.a.pressure``, ...

        Raises
        ------
        CommandError, DescriptionError, SimulationError, Cancelled
            As `pneudrive.simulate`.
        """
        options = {"initial": initial, "sample_rate": sample_rate, "rtol": rtol, "ledger": ledger, "budget": budget}
        simulate = import_module("pneudrive.simulate").simulate
        return simulate(self, commands, duration, **options, progress=progress, cancel=cancel)

    def sources(self) -> list[str]:
        """Return values that say where they come from, ``NAME.key = value [source]``."""
        return [f"{name}.{line} [{source}]" for name, one in self.components.items() for line, source in one.sources()]

    @property
    def cited(self) -> list[str]:
        """Keys of references.bib that its values name as their source."""
        keys = {source for one in self.components.values() for _, source in one.sources()}
        return sorted(keys & references().keys())

    def assumed(self) -> list[str]:
        """Return what was assumed because no source backs it."""
        return [line.format(name) for line, name in self.assumptions()]

    def assumptions(self) -> list[tuple[str, str]]:
        """Return what was assumed, with ``{}`` in place of the component or joint that it is of, and its name."""
        out: list[tuple[str, str]] = []
        starts, settled = self._starts()
        highest = max((value for name, value in starts.items() if name.endswith(PRESSURE)), default=0.0)
        stops = compiled(self.core_json()).end_stops(highest)
        for name, one in self.components.items():
            lines = list(one.assumed())
            if name in stops:
                given = [key for key in STOP_KEYS if one.fields[f"end_stop_{key}"] in one.model_fields_set]
                lines = [line for line in lines if not line.startswith("end_stop_")]
                lines += end_stops.assumed("end_stop_", given, stops[name])
            out += [("{}." + escaped(line), name) for line in lines]
        for name, volume in self.joint_volumes:
            line = f"the joint of {{}} has {1e6 * volume:.3g} cm3, from what is joined there, and no heat exchange"
            out.append((line, name))
        return out + [(escaped(line), "") for line in settled]

    @property
    def joint_volumes(self) -> list[tuple[str, float]]:
        """Joints of gas whose volume is no component's: a port of each, and what its ports bring, m3."""
        return compiled(self.core_json()).joint_volumes

    @property
    def notes(self) -> list[str]:
        """What reading it warned of."""
        frictions = {name: getattr(one, "friction", None) for name, one in self.components.items()}
        said = [
            f"{name}.friction {friction.note}" for name, friction in frictions.items() if friction and friction.note
        ]
        idle = [f"{name}.{line}" for name, one in self.components.items() for line in one.idle]
        return self.wiring.warnings + said + idle

    def _card(self) -> Card:
        """Show a line for each component, and how they are joined."""
        rows = [(name, inline(one.plain())) for name, one in self.components.items()]
        return Card(self.name, rows=rows, notes=[*self.connections, f"assumed: {', '.join(self.assumed())}"])

    def to_toml(self) -> str:
        """Write the circuit as a file that `load` reads back to the same bits."""
        tables: dict[str, Any] = {"schema": self.schema_version} | self.to_dict()
        components = tables.pop("components").items()
        blocks = [block for name, one in components for block in toml.tables_of(f"components.{name}", one)]
        return "\n".join([toml.write(tables), "\n\n".join(blocks), ""])


@lru_cache(maxsize=64)
def compiled(core_json: str) -> CoreCircuit:
    """Return the core's form of a circuit, made once for each description.

    Raises
    ------
    DescriptionError
        The core refuses it.
    """
    from pneudrive import _core

    try:
        return _core.Circuit(core_json)
    except ValueError as error:
        refusal = DescriptionError(str(error))
        names = [one["name"] for one in json.loads(core_json)["components"]]
        named = re.match(rf"({'|'.join(map(re.escape, names))})\b(?:\.(\w+))?", str(error))
        if named and named[1]:
            refusal.key = f"components.{named[1]}.{named[2] or ''}".rstrip(".")
        raise refusal from None


def _formula_of(entry: Mapping[str, Any], given: str, folder: Path) -> ComponentFormula:
    return formula_of(given, entry, folder)


def _part(table: object, key: str, read: Component | None) -> Part:
    kind = table.get("kind") if isinstance(table, dict) else getattr(table, "kind", None)
    stated = ", ".join(map(str, read.pressures())) if read is not None else ""
    return Part(component_kinds().get(kind) if isinstance(kind, str) else None, key, stated)


def _in_file(error: PneudriveError, keys: Mapping[str, str]) -> DescriptionError:
    """Return an error of a component, which may be a copy, with the key that the file has."""
    key = getattr(error, "key", None) or ""
    table, _, rest = key.partition(".")
    name, dot, inner = rest.partition(".")
    written = keys.get(name, "").partition(".copies")[0]
    if table == "components" and written:
        key = f"{written}{dot}{inner}"
    return wrong(key, error.what, rule=error.rule, remedy=error.remedy)


def _relocate(error: Any, short: Short) -> Any:  # noqa: ANN401 - an error
    """Give an error the key that the short form has."""
    error.key = short.located(getattr(error, "key", None))
    return error


def _completed(data: dict[str, Any], short: Short, problems: Problems) -> dict[str, Any]:
    """Return a description in which tables of a drive file stand as components and connections."""
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
            what = f'two components are called "{name}": [{short.places[f"components.{name}"]}] is one already'
            remedy = "Rename it, or leave kind out to add keys."
            problems.add(
                wrong(f"components.{name}.kind", what, rule="a component has a name of its own", remedy=remedy)
            )
            short.places[f"components.{name}.kind"] = f"components.{name}.kind"
    connections = out.get("connections", ())
    if isinstance(connections, list | tuple):
        out["connections"] = [*connections, *short.chains]
    return out | {"components": both}


class _Told(dict[str, Any]):
    """In place of a table that was refused: of it only its copies are left."""


def _used(given: object, problems: Problems) -> object:
    """Return the components' tables, those that use a part of the catalogue with its values under their own."""
    if not isinstance(given, dict):
        return given
    out = dict(given)
    for name, table in given.items():
        if isinstance(table, dict) and "use" in table:
            own = {key: value for key, value in table.items() if key not in ("use", "copies")}
            copies = {"copies": table["copies"]} if "copies" in table else {}
            try:
                part = catalogue.part_table(table["use"])
                kind = own.setdefault("kind", part["kind"])
                if kind != part["kind"]:
                    what = f"kind = {kind!r}, and {table['use']} is a {part['kind']}"
                    raise wrong("kind", what, remedy="Leave kind out.")
                out[name] = component_class(kind).over(part, own) | copies
            except DescriptionError as error:
                problems.add(error if error.where else within(error, name, table))
                out[name] = _Told(copies)
    return out


def _copied(given: object, problems: Problems) -> tuple[dict[str, Any], dict[str, str], dict[str, list[str]]]:
    """Return each component's table and where it stands, by name; and the tables that stand for copies."""
    tables: dict[str, Any] = {}
    keys: dict[str, str] = {}
    templates: dict[str, list[str]] = {}
    if not isinstance(given, dict) or not given:
        what = "a circuit has no components" if not given else f"components = {given!r} is not a table"
        problems.add(wrong("components", what, remedy="Write [components.NAME]."))
    given = given if isinstance(given, dict) else {}
    for name, table in given.items():
        key, copies = f"components.{name}", [name]
        if isinstance(table, dict) and "copies" in table:
            copies = table["copies"]
            table = type(table)((key, value) for key, value in table.items() if key != "copies")  # noqa: PLW2901
            if not isinstance(copies, list | tuple) or not copies or not all(isinstance(one, str) for one in copies):
                what = f"{name}.copies = {copies!r} is no list of names"
                problems.add(wrong(f"{key}.copies", what, remedy='Write copies = ["left", "right"].'))
                copies = [name]
            elif name not in copies:
                templates[name] = list(copies)
        for number, own in enumerate(copies):
            here = f"{key}.copies.{number}" if len(copies) > 1 or own != name else key
            if own in tables or (own != name and own in given):
                rule = "a component has a name of its own"
                problems.add(wrong(here, f'two components are called "{own}"', rule=rule, remedy="Rename one of them."))
            elif own == AMBIENT or not _NAME.fullmatch(str(own)):
                rule = 'letters, digits, "_" and "-", a letter first; not ambient'
                problems.add(wrong(here, f'"{own}" is no name for a component', rule=rule))
            if own not in tables and (own == name or own not in given):
                tables[own], keys[own] = table, here
    return tables, keys, templates


def _component(key: str, table: object, problems: Problems) -> Component | None:
    """Read one component; what is wrong with a table that has copies is told once."""
    if isinstance(table, Component):
        return table
    name = key.split(".")[1]
    if isinstance(table, _Told):
        return None
    if not isinstance(table, dict):
        problems.add(wrong(key, f"components.{name} = {table!r} is not a table"))
        return None
    try:
        return component(table)
    except DescriptionError as error:
        problems.add(within(error, name, table))
    return None
