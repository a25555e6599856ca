"""Descriptions of drives, from a file, from the catalogue or from Python, and their form in the core."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Iterable
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

from pydantic import Field, model_validator

from pneudrive.arrays import Keyed, NamedNumbers, Plain
from pneudrive.describe.base import as_tables, inline, key_of
from pneudrive.describe.circuit import TABLES, Circuit, Short
from pneudrive.describe.components import merge, unusual
from pneudrive.describe.files import catalogue, provenance, sourced, toml
from pneudrive.describe.files.provenance import Origin
from pneudrive.describe.formulas import law_of, read_file
from pneudrive.describe.marks import Positions, Signal, absolute_above_vacuum
from pneudrive.describe.system import DRIVE_NAMES, PISTON, DescribedSystem, System, short_name
from pneudrive.describe.tables.friction import Friction
from pneudrive.describe.tables.parts import Cylinder, EndStop, Initial, Load, Supply, Valve, assumed_stops
from pneudrive.describe.tables.starts import StartState, read_initial, start_state
from pneudrive.describe.tables.valve_flow import NEEDLE, conductance_key
from pneudrive.errors import Problems, invalid, wrong
from pneudrive.repr_tables import Card

_FLOW_SHAPE = ("critical_pressure_ratio", "subsonic_index", "linear_above")
#: Defaults without a source. Results that depend on these defaults state this.
_ASSUMED = {"cylinder": ("heat_transfer_scale",), "valve": _FLOW_SHAPE}


class _FileOrTable(classmethod):
    """Descriptor: ``Drive.load("drive.toml")`` reads a file, and ``drive.load`` is the table [load] of a drive."""

    def __get__(self, instance: Any, owner: Any = None) -> Any:  # noqa: ANN401 - either
        return super().__get__(None, owner) if instance is None else instance.carried


class Drive(DescribedSystem):
    """Pneumatic drive: supply, valve, cylinder with friction, load.

    A drive is frozen; `replace` returns a changed copy. Every value has two names: ``drive.cylinder.bore`` is a
    quantity with unit, as in the drive file, and ``drive.cylinder.bore_m`` is the plain number in SI.

    Examples
    --------
    >>> drive = Drive.load("catalogue:reference")
    >>> drive.cylinder.bore, drive.cylinder.bore_m, drive.friction.coulomb
    (25 mm, 0.025, 30 N)
    """

    #: Name of the kind of file.
    file_kind: ClassVar[str] = "drive"
    derived: ClassVar[tuple[str, ...]] = (*DescribedSystem.derived, "circuit")

    name: str = "unnamed drive"
    supply: Supply
    cylinder: Cylinder
    valve: Valve
    friction: Friction
    carried: Load = Field(default=Load(), alias="load")  # `load` reads a file
    tubing: dict[str, Any] = Field(default_factory=dict)
    flow_control: dict[str, Any] = Field(default_factory=dict)
    labels: dict[str, str] = Field(default_factory=dict)
    provenance: dict[str, Origin] = Field(default_factory=dict)

    @model_validator(mode="wrap")
    @classmethod
    def _fits_together(cls, data: Any, handler: Callable[[Any], Drive]) -> Drive:  # noqa: ANN401
        if isinstance(data, dict) and "components" in data:
            raise invalid("components", "describe.circuit-for-drive")
        values, origins = sourced.parted(data) if isinstance(data, dict) else (data, {})
        drive = handler(values)
        vars(drive)["origin_of"] = origins | drive.friction.origins
        if not drive.is_plain:
            assert drive.circuit  # raises an error if it is wrong
        ambient_pa = drive.ambient.pressure_pa
        supply_pa = absolute_above_vacuum(drive.supply.pressure, ambient_pa, "supply.pressure")
        drive.gas.dew_point_pressure_pa(ambient_pa, supply_pa)  # raises an error if it is wrong
        if drive.provenance:
            provenance.check(drive, drive.provenance)
        return drive

    @classmethod
    def load(cls, source: str | Path) -> Drive:
        """Read a drive from a TOML file or from the catalogue.

        Parameters
        ----------
        source : path-like
            A TOML file, or ``catalogue:NAME``.

        Raises
        ------
        DescriptionError
            The file is not valid; the message gives file, line, value, rule and remedy.
        """
        if str(source).startswith(catalogue.PREFIX):
            return cls._from_catalogue(str(source), {})
        return cls.from_tables(*toml.read(source), Path(source)).read_from(source)

    @classmethod
    def from_tables(cls, tables: Plain, text: str, path: Path) -> Drive:
        """Make a drive from the tables of a file.

        Errors show lines of `text`. Paths of custom laws are relative to the folder of `path`.

        Raises
        ------
        DescriptionError
            As for `load`.
        """
        with toml.locating(path, text):
            read_file(tables.get("friction"), "law", "friction", law_of, path)
            base = tables.pop("drive", None)
            if base is None:
                return cls.model_validate(tables)
            if not isinstance(base, str) or not base.startswith(catalogue.PREFIX):
                raise invalid("drive", "describe.not-a-drive", base=base, prefix=catalogue.PREFIX)
            return cls._from_catalogue(base, tables)

    if not TYPE_CHECKING:
        load = _FileOrTable(load.__func__)

    @classmethod
    def _from_catalogue(cls, reference: str, changes: Plain) -> Drive:
        entry = catalogue.entry(reference, catalogue.DRIVE, "drive")
        values = catalogue.all_values(entry)
        tables = {"schema": 1, "name": entry.title} | toml.nested((v.key, v.value) for v in values)
        origins = _untouched(values, changes)
        made = cls.model_validate(sourced.put_back(merge(tables, changes, NEEDLE), origins))
        vars(made)["origin_of"] = origins | made.origin_of
        return made.read_from(reference)

    def replace(self, changes: Plain) -> Drive:
        """Return a checked drive with some values changed.

        Parameters
        ----------
        changes : dict
            Dotted keys of the drive file, each with a quantity or a table: ``{"friction.coulomb": "31 N"}``. The
            provenance of a changed value is dropped. The key ``"provenance"`` adds the provenance of new values.

        Examples
        --------
        >>> Drive.load("catalogue:reference").replace({"supply.pressure": "5 bar gauge"}).supply_pressure_pa
        601300.0
        """
        values = ((key, as_tables(value)) for key, value in changes.items() if key != "provenance")
        nested, origins = toml.nested(values), changes.get("provenance", {})
        untouched = _untouched(self.origin_of.values(), nested)
        tables = sourced.put_back(merge(self.to_dict(), nested, NEEDLE), untouched)
        tables.pop("provenance", None)
        after = type(self).model_validate(tables)
        known = provenance.kept(self, after, self.provenance) | origins if self.provenance or origins else {}
        if known:
            after = type(self).model_validate(tables | {"provenance": known})
        vars(after)["origin_of"] = untouched | after.origin_of
        return after.read_from(self.source_file)

    def with_origins(self) -> Plain:
        """Return the table in the form of `to_dict`, with the origin of each value if it is known."""
        return sourced.put_back(self.to_dict(), self.origin_of)

    @property
    def supply_pressure_pa(self) -> float:
        """Absolute supply pressure in Pa."""
        return self.supply.pressure.absolute_pa(self.ambient.pressure_pa)

    @property
    def dew_point_pressure_pa(self) -> float | None:
        """Absolute pressure in Pa to which the dew point of the gas refers; None without a dew point."""
        return self.gas.dew_point_pressure_pa(self.ambient.pressure_pa, self.supply_pressure_pa)

    @property
    def component_places(self) -> list[tuple[str, str]]:
        """Key of each component in a circuit file, and its key in the drive file. The longest drive keys come first."""
        places = Short(self.to_dict() | {"friction": self.friction}, Problems()).places
        out = sorted((places | {"components.supply.gas": "gas"}).items(), key=lambda one: -len(one[1]))
        return out if "components.load" in places else [*out, ("components.cylinder", "load")]

    @property
    def is_plain(self) -> bool:
        """Whether the drive has no tubes, no flow controls, and a proportional valve without overlap and leakage."""
        return not (self.tubing or self.flow_control or self.valve.has_shape or self.valve.is_switching)

    @property
    def plain(self) -> Drive:
        """The drive without tubes and flow controls, with a proportional valve without overlap and leakage."""
        if self.is_plain:
            return self
        shape = {"kind": "proportional-5/3", **dict.fromkeys(("overlap", "leakage", "time_on_s", "time_off_s"))}
        valve = self.valve.model_copy(update=shape)
        return self.model_copy(update={"tubing": {}, "flow_control": {}, "valve": valve})

    @cached_property
    def circuit(self) -> Circuit:
        """The drive as a circuit of components."""
        tables, sourced_tables = self.to_dict(), self.with_origins()
        about = {key: tables[key] for key in ("gas", "ambient", "labels") if key in tables}
        parts = {key: sourced_tables[key] for key in TABLES if key in tables}
        if self.valve.is_switching:  # its load can be varied; a drive with lines keeps its hash
            parts.setdefault("load", {"mass": "0 kg"})
        # Friction is passed as an object: a custom law from a file has no complete text.
        circuit = Circuit.model_validate({"name": self.name} | about | parts | {"friction": self.friction})
        friction = {key: value for key, value in self.origin_of.items() if key.partition(".")[0] == "friction"}
        vars(circuit.components[PISTON])["origins"] |= friction
        return circuit.read_from(self.source_file)

    @cached_property
    def system(self) -> System:
        """Circuit of the drive in the core's form, with the drive's short names of the variables."""
        if self.is_plain:
            return System.of_drive(self.short_form())
        return System(self.circuit.core_json(), (PISTON, tuple(DRIVE_NAMES.items()), False))

    @property
    def commandable(self) -> dict[str, Signal | Positions | None]:
        """Switching positions or electrical input of the valve (None if not given), under an empty name."""
        return {"": Positions((-1.0, 0.0, 1.0)) if self.valve.is_switching else self.valve.command}

    @property
    def meanings(self) -> dict[str, str]:
        """Meaning of the trajectory columns that the components of the circuit add, by name; empty if `is_plain`."""
        return {} if self.is_plain else self.circuit.meanings

    @cached_property
    def description_hash(self) -> str:
        """SHA-256 of the simulated values, without name and labels."""
        if not self.is_plain:
            return self.circuit.description_hash
        return hashlib.sha256(json.dumps(self.short_form(), sort_keys=True).encode()).hexdigest()

    def short_form(self) -> Plain:
        """Return the tables of the drive in SI, without tubes, flow controls, and overlap and leakage of the valve."""
        ambient, spring = self.ambient.core(), self.carried.spring
        # The supply and the walls have ambient temperature by default.
        supply = ambient | self.supply.stored() | {"pressure_pa": self.supply_pressure_pa}
        supply.pop("pressure")
        cylinder: Plain = {"rod_diameter_m": 0.0, "wall_temperature_k": self.ambient.temperature_k}
        cylinder |= self.cylinder.stored() | {"end_stop": self.cylinder.end_stop.stored()}
        cylinder["dead_volume_a_m3"], cylinder["dead_volume_b_m3"] = cylinder.pop("dead_volume_m3")
        if "heat_transfer_w_m2_k" in cylinder:  # replaces the law that the scale multiplies
            del cylinder["heat_transfer_scale"]
        if not cylinder["leakage_m3_s_pa"]:
            del cylinder["leakage_m3_s_pa"]
        return {
            "gas": self.gas.core(),
            "ambient": ambient,
            "supply": supply,
            "cylinder": cylinder,
            "valve": {key: getattr(self.valve, key) for key in ("kind", "conductance_m3_s_pa", *_FLOW_SHAPE)},
            "friction": self.friction.core(),
            "load": self.carried.stored() | {"spring": None if spring is None else spring.stored()},
        }

    def core_initial(self, initial: StartState = None) -> NamedNumbers:
        """Return the start state in SI, by the drive's names of the variables. Pressures are absolute.

        `initial` is an `Initial`, or its keys as a dict or a text.

        Raises
        ------
        DescriptionError
            The position is outside the stroke, or a pressure is below vacuum.
        """
        start = read_initial(initial) or Initial.model_construct()  # the defaults need no check
        stroke = self.cylinder.stroke_m
        state = start_state(start, stroke, self.ambient.pressure_pa, self.ambient.temperature_k)
        position = state["position_m"]
        if not 0.0 <= position <= stroke:
            ends = {"position": position * 1e3, "stroke": stroke * 1e3}
            raise invalid("initial.position", "describe.start-outside-stroke", **ends)
        for chamber in "ab":
            if not state[f"pressure_{chamber}_pa"] > 0.0:
                pressure = getattr(start, f"pressure_{chamber}")
                raise wrong(f"initial.pressure_{chamber}", f"initial pressure_{chamber} = {pressure} is below vacuum")
        if self.is_plain:
            return state
        # Tubes start at the pressure of their chamber.
        whole = self.circuit.core_initial(self.circuit_values(start))
        return {short_name(name): value for name, value in whole.items()} | {"contact_age_s": start.contact_age_s}

    def circuit_values(self, given: StartState) -> Plain:
        """Return the given start values by their keys in a circuit, without the contact age."""
        values = (read_initial(given) or Initial()).to_dict()
        values.pop("contact_age", None)
        ends = {f"{key}_{chamber}": f"{chamber}.{key}" for chamber in "ab" for key in ("pressure", "temperature")}
        return {f"cylinder.{ends.get(key, key)}": value for key, value in values.items()}

    @property
    def end_stop(self) -> NamedNumbers:
        """End stop parameters in SI, by field name of `EndStop`. Missing parameters are derived from the drive."""
        stops, _ = self.plain.system.compiled().end_stops(0.0)[PISTON]
        return dict(zip(EndStop.model_fields, stops, strict=True))

    @cached_property
    def assumptions(self) -> list[tuple[str, str]]:
        """Assumptions as pairs (text, name of a component or joint). The name is empty if the drive `is_plain`."""
        assumed = [value for value in self.origin_of.values() if value.assumed is not None]
        out = [f"{value.key} = {inline(value.value)}, {value.assumed}" for value in assumed]
        if not self.is_plain:
            listed = tuple(f", {value.assumed}" for value in assumed)
            more = [one for one in self.circuit.assumptions if not one[0].endswith(listed)]
            return [(line, "") for line in out] + more
        for table, keys in _ASSUMED.items():
            part = getattr(self, table)
            given = part.model_fields_set
            # A stated coefficient replaces the law that the scale multiplies.
            given = given | {"heat_transfer_scale"} if "heat_transfer_w_m2_k" in given else given
            out += [f"{table}.{key} = {getattr(part, key)}" for key in keys if key not in given]
        given = [key_of(name) for name in self.cylinder.end_stop.stored()]
        out += assumed_stops("cylinder.end_stop.", given, self.system.compiled().end_stops(0.0)[PISTON])
        return [(line, "") for line in out]

    @property
    def notes(self) -> list[str]:
        """Warnings from reading the drive: a friction table without a law, unusual sizes."""
        notes = [f"friction {self.friction.note}"] if self.friction.note else []
        if not self.is_plain:
            return notes + self.circuit.unusual
        return notes + unusual("valve", self.valve) + unusual("cylinder", self.cylinder)

    def _card(self) -> Card:
        """Return a card with a line for each table and its given values."""
        tables = {key: inline(value) for key, value in self.to_dict().items() if isinstance(value, dict)}
        origins = tables.pop("provenance", "")
        notes = [f"identified, with interval and source: {', '.join(self.provenance)}"] if origins else []
        notes += [f"assumed: {', '.join(self.assumed())}"] if self.assumed() else []
        return Card(self.name, rows=list(tables.items()), notes=notes)


def _untouched(values: Iterable[sourced.Value], changes: Keyed) -> dict[str, sourced.Value]:
    """Return the values of the catalogue that the user's tables do not change, by key in the drive file."""
    touched = {conductance_key(one) for key, _ in toml.leaves(changes) for one in toml.above(key)}
    other_law = isinstance(changes.get("friction"), dict) and "law" in changes["friction"]
    return {
        value.key: value
        for value in values
        if conductance_key(value.key) not in touched and not (other_law and value.key.startswith("friction."))
    }
