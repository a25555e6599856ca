"""Circuits in the core's form with the names of their variables, and the base class of drives and circuits."""

from __future__ import annotations

import json
import re
from functools import cached_property, lru_cache
from typing import TYPE_CHECKING, Any, ClassVar, NamedTuple

from pneudrive import _core
from pneudrive.describe.base import DescribedFile, inline, key_of
from pneudrive.describe.files.toml import above, leaves
from pneudrive.describe.tables.parts import Ambient, Gas
from pneudrive.errors import DescriptionError, package_table
from pneudrive.lazy_names import upper
from pneudrive.references import entries as references

if TYPE_CHECKING:
    from typing_extensions import Self

    from pneudrive.arrays import Keyed, Plain
    from pneudrive.describe.files.sourced import Value
    from pneudrive.describe.tables.starts import StartState
    from pneudrive.simulation.session import Session

    ShortNames = tuple[str, tuple[tuple[str, str], ...], bool]

#: Component whose name a drive leaves out of its variable names.
PISTON = "cylinder"
#: Names of a drive -> names of its circuit.
DRIVE_NAMES = package_table(__file__, "drive_names.toml")
#: Name in the circuit -> name of the drive.
_SHORT_NAMES = {full: short for short, full in DRIVE_NAMES.items()}


class System(NamedTuple):
    """Circuit of a description in the core's form, with the names of its variables.

    Attributes
    ----------
    json : str
        Circuit in the core's form, in SI.
    names : tuple, optional
        Component whose name is omitted, pairs of short and full name, and whether columns without a short name are
        omitted.
    """

    json: str
    names: ShortNames | None = None

    @classmethod
    def of_drive(cls, form: Plain) -> System:
        """Return the system of a drive without lines. Columns without a short name are omitted.

        Parameters
        ----------
        form : dict
            Tables of the drive file in SI, with units in the keys (`Drive.short_form`).
        """
        cylinder, valve, load = (dict(form[table]) for table in ("cylinder", "valve", "load"))
        choices = {"chamber_law": cylinder.pop("chamber_law")}
        stops = {f"end_stop_{key}": value for key, value in cylinder.pop("end_stop").items()}
        kind, spring = cylinder.pop("kind"), load.pop("spring")
        components = [
            core_part("supply", "reservoir", form["supply"]),
            core_part("valve", f"valve/{valve.pop('kind')}", valve),
            core_part(PISTON, f"cylinder/{kind}", cylinder | stops, choices=choices, friction=form["friction"]),
            core_part("load", "load", load),
        ]
        rod = [f"{PISTON}.rod", "load.1"]
        if spring is not None:
            components.append(core_part("spring", "spring", spring))
            rod.append("spring.1")
        joints = [["supply.1", "valve.1"], ["valve.4", f"{PISTON}.a"], ["valve.2", f"{PISTON}.b"], rod]
        circuit = {"gas": form["gas"], "ambient": form["ambient"], "components": components, "joints": joints}
        return cls(json.dumps(circuit, sort_keys=True), (PISTON, tuple(DRIVE_NAMES.items()), True))

    @lru_cache(maxsize=256)  # noqa: B019 - a system consists of texts
    def compiled(self) -> _core.Circuit:
        """Return the core's circuit; each system is compiled once.

        Raises
        ------
        DescriptionError
            The core rejects the system.
        """
        try:
            return _core.Circuit(self.json, self.names)
        except ValueError as error:
            refusal = DescriptionError(str(error))
            known = [one["name"] for one in json.loads(self.json)["components"]]
            named = re.match(rf"({'|'.join(map(re.escape, known))})\b(?:\.(\w+))?", str(error))
            if named and named[1]:
                refusal.key = f"components.{named[1]}.{named[2] or ''}".rstrip(".")
            raise refusal from None


def core_part(name: str, kind: str, table: Keyed, **more: object) -> Plain:
    """Return a component in the core's form, from a table in SI with units in the keys."""
    numbers = {key_of(key): value for key, value in table.items() if value is not None}
    return {"name": name, "kind": kind, "numbers": numbers} | more


def short_name(name: str, piston: str = PISTON) -> str:
    """Return the drive's name for a variable of its circuit. A variable without a drive name keeps its name.

    Examples
    --------
    >>> short_name("cylinder.a.pressure_pa"), short_name("valve.command"), short_name("tube_a.mass_flow_kg_s")
    ('pressure_a_pa', 'command', 'tube_a.mass_flow_kg_s')
    """
    of, _, last = name.partition(".")
    return _SHORT_NAMES.get(f"{PISTON}.{last}", last) if of == piston else _SHORT_NAMES.get(name, name)


class DescribedSystem(DescribedFile):
    """Base of drives and circuits: form of the file, gas, ambient air, and the sources of values."""

    #: Prefix of component names in the keys of the file.
    key_prefix: ClassVar[str] = ""
    #: Cached values that follow from the fields.
    derived: ClassVar[tuple[str, ...]] = ("system", "description_hash", "assumptions")

    name: str
    gas: Gas = Gas()
    ambient: Ambient = Ambient()

    def model_copy(self, *, update: Any = None, deep: bool = False) -> Self:  # noqa: ANN401 - pydantic's signature
        """Return a copy without the cached values, because `update` may make them wrong."""
        copy = super().model_copy(update=update, deep=deep)
        for name in self.derived:
            vars(copy).pop(name, None)
        return copy

    def _repr_html_(self) -> str:
        try:
            picture = upper("circuit_svg")(self)
        except DescriptionError:  # a circuit without a drawing still has a card
            picture = ""
        return picture + super()._repr_html_()

    @cached_property
    def system(self) -> System:
        """Circuit in the core's form, and the names of its variables."""
        raise NotImplementedError

    @cached_property
    def origin_of(self) -> dict[str, Value]:
        """Origins of values, by key in the file. Comparisons ignore the origins."""
        return {}

    @cached_property
    def assumptions(self) -> list[tuple[str, str]]:
        """Assumptions as pairs (text, name). The name of a component or joint, if any, replaces ``{}`` in the text."""
        raise NotImplementedError

    def assumed(self) -> list[str]:
        """Return the assumed values, which are not given and have no source, as ``key = value``."""
        return [line.replace("{}", name, 1) if name else line for line, name in self.assumptions]

    def core_json(self) -> str:
        """Return the circuit in the core's form, in SI."""
        return self.system.json

    def start(self, initial: StartState = None, *, rtol: float = 1e-6) -> Session:
        """Start a session of the drive or circuit. The caller advances the session in time.

        Parameters
        ----------
        initial : Initial, dict or str, optional
            Start values that differ from those of the description. For a drive: ``"position = 50 mm"``. For a circuit:
            ``{"left.position": "20 mm"}`` or ``"left.position = 20 mm, tank = 5 bar abs"``. Valves are closed until the
            session's first command.
        rtol : float
            Relative tolerance of the solver.

        Returns
        -------
        Session
            See `pneudrive.simulation.session.Session`; in a circuit, inputs are ``"valve.command"``,
            ``"left.load_force_n"``, ...

        Raises
        ------
        CommandError
            The tolerance is not valid.
        DescriptionError
            The start state does not fit the drive or circuit.

        Examples
        --------
        >>> from pneudrive.describe import Drive
        >>> session = Drive.load("catalogue:reference").start("position = 50 mm")
        >>> session.set("command", 0.6)
        >>> session.advance(0.1)
        >>> session.read("velocity_m_s") > 0.5
        True
        """
        return upper("start")(self, initial, rtol)

    def sources(self) -> list[str]:
        """Return the values with a source, as ``key = value [source]``. In a circuit, keys begin with the component."""
        known = ((key.removeprefix(self.key_prefix), value) for key, value in self.origin_of.items())
        return [f"{key} = {inline(value.value)} [{value.source}]" for key, value in known if value.source is not None]

    @property
    def cited(self) -> list[str]:
        """Keys of references.bib that are sources of values."""
        sources = {value.source for value in self.origin_of.values()}
        return sorted(references().keys() & sources) if sources else []


# --- Every value of a drive or a circuit in one list, each with its source.

_BESIDE = ("schema", "name", "labels", "provenance", "connections", "plugged", "junctions", "initial")


class DescribedValue(NamedTuple):
    """One value of a description.

    Attributes
    ----------
    key : str
        Dotted key, in the form for `replace`.
    value : object
        Value as users write it: ``"25 mm"``, a number or a word.
    origin : str
        Source in words. Empty if the user gave the value without a source.
    kind : str
        ``"given"``, ``"source"``, ``"identified"``, ``"assumed"`` or ``"default"``.
    """

    key: str
    value: Any
    origin: str
    kind: str


def values_of(described: DescribedSystem) -> list[DescribedValue]:
    """Return every value of a drive or a circuit, including defaults, in the order of the file.

    Examples
    --------
    >>> from pneudrive.describe.drive import Drive
    >>> found = {one.key: one for one in values_of(Drive.load("catalogue:starter"))}
    >>> found["cylinder.bore"].value, found["cylinder.bore"].kind, found["load.mass"].kind
    ('25 mm', 'source', 'default')
    """
    lines = (line.partition(" = ") for line in described.assumed())
    assumed = {
        described.key_prefix + key: reason.partition(", ")[2] or "usual"
        for key, equals, reason in lines
        if equals and " " not in key
    }
    origins = described.origin_of
    identified = getattr(described, "provenance", None) or {}
    # Also the keys of the tables that contain a given key: the defaults have a name where a custom law has a table.
    given = {one for key, _ in leaves(described.to_dict()) for one in above(key)}
    out = []
    for key, value in leaves(described.with_defaults()):
        if key.partition(".")[0] in _BESIDE:
            continue
        source = next((origins[one] for one in above(key) if one in origins), None)
        if key in identified:
            origin, kind = f"identified: {inline(identified[key].to_dict())}", "identified"
        elif source is not None:
            origin, kind = source.said, "assumed" if source.source is None else "source"
        elif key in assumed:
            origin, kind = assumed[key], "assumed"
        else:
            origin, kind = "", "given" if key in given else "default"
        out.append(DescribedValue(key, value, origin, kind))
    return out
