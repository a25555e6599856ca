"""View of a description (problems by line, values as fields, drawing), changes of its text, and view of an FMU.

A change sets a value, inserts a part of the catalogue, or adds, joins or removes components of a circuit.
"""

from __future__ import annotations

import hashlib
import re
import zipfile
from collections.abc import Sequence
from contextlib import suppress
from copy import copy
from itertools import count, pairwise
from pathlib import Path
from typing import Any, Literal

import tomlkit
from pydantic import StrictStr
from tomlkit.exceptions import TOMLKitError
from tomlkit.items import InlineTable

from pneudrive.arrays import Plain, attributes_of
from pneudrive.describe.circuit import Circuit, Short
from pneudrive.describe.connections import AMBIENT, ARROW, PILOT_LINE, Part, Port, Wiring
from pneudrive.describe.files import toml
from pneudrive.describe.files.catalogue import entries
from pneudrive.describe.formulas import FILE_PREFIX
from pneudrive.describe.kinds import COMMAND, component_kinds
from pneudrive.describe.system import DescribedValue, values_of
from pneudrive.errors import CommandError, PneudriveError, Problems, package_table
from pneudrive.files.content import read_bytes
from pneudrive.fmu.package import read_fmu
from pneudrive.fmu.variables import FmuVariable
from pneudrive.simulation.start import start
from pneudrive.units import in_unit, like
from pneudrive.views import ShownTable, View
from pneudrive.web.drive.run_request import Described, described_at
from pneudrive.web.messages import Value, problems_of, python
from pneudrive.web.workspace import FMUS, Workspace, is_in_catalogue

_QUANTITY = re.compile(r"([-+]?(?:\d+(?:\.\d*)?|\.\d+)(?:[eE][-+]?\d+)?)\s+(\S.*)")
#: Causality of the variables of an FMU -> title of their table.
TABLES_OF_VARIABLES = {"input": "Inputs", "output": "Outputs", "parameter": "Parameters, set before a run"}
FULL_OPENING = 1.0  # command that every valve takes, also one that switches
#: Values that must be given for both chambers or not at all.
_PAIR = re.compile(r"dwell\.pressure\.[ab]$")
#: Range of a slider, as multiples of its value. A value of 0 gets a range by its unit.
LOW, HIGH = 0.2, 3.0
_FROM_ZERO = {"deg": (-90.0, 90.0), "N": (-200.0, 200.0), "kg": (0.0, 20.0)}
#: Initial sliders of a new page, if the description contains them.
FIRST_SLIDERS = ("friction.coulomb", "supply.pressure", "load.mass", "cylinder.moving_mass", "moving_mass")
MOST_SLIDERS = 4
#: Tables whose values are listed first. Other tables follow; values that rarely change come last.
FIRST = ("cylinder", "load", "friction", "valve", "supply")
ORDER = {name: place for place, name in enumerate(FIRST)} | {"ambient": 98, "gas": 99}


def checked_text(workspace: Workspace, path: str, text: str) -> Plain:
    """Check a text and return its problems, or its name, values, assumptions and commands."""
    try:
        described = described_at(workspace, path, text)
    except PneudriveError as error:
        return {"problems": problems_of(error)}
    found = fields_of(described)
    tables = {f"components.{name}.": part.table for name, part in described.circuit.wiring.parts.items()}
    for one in found["values"]:
        table = next((table for start, table in tables.items() if one["key"].startswith(start)), "")
        copies = [start.split(".")[1] for start, other in tables.items() if other == table]
        if len(copies) > 1:
            one["copies"] = copies
    return {"problems": [], **found}


def fields_of(described: Described) -> Plain:
    """Return the name, values, assumptions and commands of a description, and the initial sliders."""
    # An inner table comes before its outer table: [load.spring] is one component, the rest of [load] is another.
    places, every = described.component_places, values_of(described)
    # Defaults that are valid only with other values, such as those of a missing cushion, are left out.
    logs = [one.key for one in every if one.key.endswith("dwell.growth") and one.value != "saturating"]
    absent = {f"{key.removesuffix('growth')}exponent" for key in logs}
    given = {key for key, _ in toml.leaves(described.to_dict())}
    absent |= {one.key for one in every if _PAIR.search(one.key) and one.key not in given}
    for name, component in getattr(described, "components", {}).items():
        known = component.numbers(described.ambient.pressure_pa)
        keys = (each["key"] for each in component.entry["parameters"] if each["within"])
        absent |= {f"components.{name}.{key}" for key in keys if key not in known}
    named = [name for name in described.commandable if name]
    try:
        bounds = {one.name: one.bounds for one in start(described).variables if one.kind == "input"} if named else {}
    except PneudriveError:  # the view Simulate reports why it cannot run
        bounds = {}
    every = sorted(every, key=lambda one: ORDER.get(one.key.partition(".")[0], len(FIRST)))
    values = [field_of(one) | {"component": _owner(one.key, places)} for one in every if one.key not in absent]
    slides = [one["key"] for end in FIRST_SLIDERS for one in values if "low" in one and _ends(one["key"], end)]
    return {
        **attributes_of(described, "name", "notes"),
        "kind": described.file_kind,
        # The lowest command of each component that has one: -1, or 0 for an on-off valve.
        "valves": {name: 0 if "not less than 0" in bounds.get(f"{name}.{COMMAND}", "") else -1 for name in named},
        "values": values,
        "sliders": list(dict.fromkeys(slides))[:MOST_SLIDERS],
    }


def _owner(key: str, places: Sequence[tuple[str, str]]) -> str:
    """Return the component in the drawing to which a key belongs, or an empty text."""
    return next((at.split(".")[1] for at, own in places if key == own or key.startswith(f"{own}.")), "")


def _ends(key: str, end: str) -> bool:
    return key == end or (("." not in end or key.startswith("components.")) and key.endswith(f".{end}"))


def field_of(one: DescribedValue) -> Plain:
    """Return a value as a field of a form. A numeric value is also a slider."""
    out = attributes_of(one, "key", "origin", "kind") | {"text": str(one.value)}
    found = _QUANTITY.fullmatch(one.value) if isinstance(one.value, str) else None
    if found:
        number, unit = float(found[1]), found[2]
    elif isinstance(one.value, int | float) and not isinstance(one.value, bool):
        number, unit = float(one.value), ""
    else:
        return out
    low, high = sorted((LOW * number, HIGH * number)) if number else _FROM_ZERO.get(unit, (0.0, 1.0))
    if not unit and 0.0 < number < 1.0:
        high = min(high, 1.0)
    return {**out, "number": number, "unit": unit, "units": like(unit) if unit else [], "low": low, "high": high}


def first_platform() -> Plain:
    """Return the initial text of a platform."""
    return {"text": Path(__file__).with_name("first_platform.toml").read_text(encoding="utf-8")}


def drawing(workspace: Workspace, path: str, text: str) -> Plain:
    """Return the drawing of a description as shapes, with its pistons, title and notes. Lengths are in modules, y up.

    Raises
    ------
    PneudriveError
        The description is not valid.
    """
    from pneudrive.report.circuit.svg import circuit_shapes, pistons  # drawing module: the server starts without it

    found = circuit_shapes(described_at(workspace, path, text))
    words = [one.text for one in found.shapes if one.word == "text" and not one.component]  # title and notes come last
    shapes = [one._replace(points=one.outline(steps=48)) for one in found.shapes[: -len(words) or None]]
    moving = {name: one._asdict() for name, one in pistons(shapes).items()}
    drawn = {"shapes": [one._asdict() for one in shapes], "pistons": moving, "words": words}
    return drawn | attributes_of(found, "nets", "ports", "box")


def edited_as_asked(text: str, key: str, value: Value, unit: str | None = None) -> Plain:
    """Return a text with one value changed as requested; if a unit is given, the value is written in this unit."""
    return {"text": edited(text, key, value if unit is None else in_unit(str(value), unit))}


def fitting_parts(workspace: Workspace, path: str, text: str, table: str, family: str) -> Plain:
    """List the parts of a catalogue family that one table of a description accepts, each with name and title."""
    found = []
    for name, entry in entries().items():
        if entry.kind.startswith(f"{family}/"):
            with suppress(PneudriveError):
                described_at(workspace, path, with_part(text, table, name)["text"])
                found.append({"name": name, "title": entry.title})
    return {"parts": found}


def with_part(text: str, table: str, part: str) -> Plain:
    """Return a text in which a table has the values of a catalogue part. A custom stroke is kept.

    Raises
    ------
    CommandError
        The part does not exist, or the text is not TOML.
    """
    if part not in entries():
        raise CommandError(f"the catalogue has no part {part[:80]!r}", remedy="Choose a part from the menu.")
    is_circuit = table.startswith("components.")
    for one in entries()[part].values:
        if one.key == "stroke" and one.source is None:
            continue
        is_family = one.key == "kind" and table in ("cylinder", "valve")
        value = one.value.split("/", 1)[-1] if is_family else one.value
        owner = "" if one.key.startswith("friction.") and not is_circuit else f"{table}."
        pairs = value.items() if isinstance(value, dict) else (("", value),)
        for end, each in pairs:
            key = f"{owner}{one.key}.{end}".rstrip(".")
            text = edited(text, key, each if one.key == "kind" else {"value": each} | one.origin)
    return {"text": text}


def _has_keys(entry: Any) -> bool:  # noqa: ANN401 - of tomlkit
    """Return whether an entry is a table of values, instead of a single value with its origin."""
    return hasattr(entry, "keys") and ("value" not in entry or hasattr(entry["value"], "keys"))


def edited(text: str, key: str, value: str | float | Plain) -> str:
    """Return a TOML text with one value changed. The value may have its origin. Comments and order are kept.

    Raises
    ------
    CommandError
        The text is not TOML, or a part of the key is not a table.
    """
    try:
        document = tomlkit.parse(text)
    except TOMLKitError:
        raise CommandError("the text is not TOML", remedy="First correct the marked lines.") from None
    at: Any = document
    *tables, last = _written_as(document, key)
    while tables or last not in at:
        name = tables[0] if tables else last
        # dead_volume_a, in a file with dead_volume = { a = ..., b = ... }
        outer = next((key for key, own in at.items() if _has_keys(own) and name.startswith(f"{key}_")), None)
        if name not in at and outer is not None:
            name, inner = outer, name.removeprefix(f"{outer}_")
            tables, last = ([inner, *tables[1:]], last) if tables else ([], inner)
        elif tables:
            tables.pop(0)
            if name not in at:
                at[name] = tomlkit.inline_table() if isinstance(at, InlineTable) else tomlkit.table()
        else:
            break
        above, at = at, at[name]
        if (file := str(at)).startswith(FILE_PREFIX):
            file = file.removeprefix(FILE_PREFIX).strip()
            raise CommandError(f"{key} is set in {file}", remedy="Change it in that file.")
        if hasattr(at, "keys") and hasattr(at.get("value"), "keys"):
            # { value = { a = ..., b = ... }, assumed = ... }: the origin no longer applies to all values
            above[name] = at["value"]
            at = above[name]
        if not hasattr(at, "keys"):
            raise CommandError(f"{key}: {name} is not a table of values in this file", remedy="Change it in the text.")
    if last == "kind":
        at.pop("model", None)  # the tube of a drive: the same keys under other names
    old = at.get(last)
    if isinstance(old, list):
        raise CommandError(f"{key} is a table of points", remedy="Change it in the text.")
    at[last] = tomlkit.value(toml.value_text(value))  # without the origin of the old value
    return tomlkit.dumps(document)


def _written_as(document: tomlkit.TOMLDocument, key: str) -> list[str]:
    """Return the parts of a key as written in the text. For a copied component, this is the key of the original."""
    names = key.split(".")
    if names[0] != "components" or len(names) < 3:
        return names
    tables = document.unwrap()
    own = tables.get("components", {})
    if not isinstance(own, dict):
        raise CommandError("components is not a table in this file", remedy="Change it in the text.")
    if names[1] in own:
        return names
    lists = {name: table.get("copies") for name, table in own.items() if isinstance(table, dict)}
    many = [name for name, copies in lists.items() if isinstance(copies, list) and names[1] in copies]
    if many:
        return [names[0], many[0], *names[2:]]
    return str(Short(tables, Problems()).located(key)).split(".")


def shown_file(workspace: Workspace, path: str) -> Plain:
    """Return the text of a file and its version.

    For a drive of the catalogue, return a text that uses this drive, and None as the version.
    """
    text, version = (f'drive = "{path}"\n', None) if is_in_catalogue(path) else workspace.read(path)
    return {"text": text, "sha256": version}


def written_file(workspace: Workspace, path: str, text: str, if_match: str) -> Plain:
    """Write a file that has not changed since the page read it."""
    if path.rpartition("/")[2] == "layout.toml":  # an unreadable recording must not hide the others
        from pneudrive.signals.layout import Layout

        Layout.loads(text, "layout.toml")
    return {"sha256": workspace.write(path, text, if_match or None)}


def fmu_bytes(workspace: Workspace, path: str) -> bytes:
    """Return the content of an FMU of the workspace, to save it elsewhere."""
    return read_bytes(workspace.path(path, FMUS), CommandError)


def shown_fmu(workspace: Workspace, path: str) -> Plain:
    """Return the description of an FMU of the workspace, its hash, and the lines that run it in FMPy.

    Raises
    ------
    CommandError
        The file is not an FMU.
    """
    file = workspace.path(path, FMUS)
    data, fmu = read_bytes(file, CommandError), read_fmu(file)
    inputs, outputs = ([one.name for one in fmu.variables if one.causality == kind] for kind in ("input", "output"))
    commands = {name: FULL_OPENING for name in inputs if name.rpartition(".")[2] == COMMAND}
    start = f", start_values={commands}" if commands else ""
    last = f'run["{outputs[0]}"][-1]' if outputs else "run[-1]"
    with zipfile.ZipFile(file) as archive:
        systems = {name.split("/")[1] for name in archive.namelist() if name.startswith("binaries/")}
    kinds = " and ".join("co-simulation" if kind == "CoSimulation" else "model exchange" for kind in fmu.kinds)
    digest = hashlib.sha256(data).hexdigest()
    view = View(
        f"{fmu.title}: FMI {fmu.version}, {kinds}; written by {fmu.tool}",
        notes=(
            f"{len(data) / 1e6:.3g} MB, SHA-256 {digest}, token {fmu.token}. Pressures are absolute.",
            f"Compiled for {', '.join(sorted(systems - {''}))} only.",
        ),
        tables=tuple(
            ShownTable(title, ("name", "unit", "start", "meaning"), rows)
            for kind, title in TABLES_OF_VARIABLES.items()
            if (rows := tuple(_row(v) for v in fmu.variables if v.causality == kind))
        ),
    )
    fmpy = python("fmu", path=path, start=start, last=last)
    return {"view": view.data(), "sha256": digest, "fmpy": fmpy}


def _row(variable: FmuVariable) -> tuple[str, ...]:
    start = "" if variable.start is None else f"{variable.start:.6g}"
    return variable.name, variable.unit, start, variable.meaning


# --- Adding, joining and removing components of a circuit in the drawing, as changes of its TOML text.

#: Kind -> initial values of a component.
STARTERS = package_table(__file__, "starters.toml")


def kinds() -> Plain:
    """Return the kinds that can be added, with their titles."""
    return {"kinds": [(one, component_kinds()[one]["title"]) for one in STARTERS]}


def restructured(
    workspace: Workspace,
    path: StrictStr,
    text: StrictStr,
    act: Literal["open", "add", "join", "cut", "remove"],
    one: StrictStr = "",
    other: StrictStr = "",
    kind: StrictStr = "",
) -> Plain:
    """Return the text of a circuit after a change of its structure, and the component to show.

    Parameters
    ----------
    workspace : Workspace
    path, text : str
        Name of the description, and its text in the page.
    act : str
        ``"add"`` a component of `kind` at the port `one`, ``"join"`` the ports `one` and `other`, ``"cut"`` the lines
        of the port `one`, ``"remove"`` the component `one`, or ``"open"`` a drive as a circuit.
    one, other, kind : str

    Raises
    ------
    CommandError
        The request is not valid, or the description is not a circuit.
    DescriptionError
        The text before the change is not valid.
    """
    described = described_at(workspace, path, text)
    if act == "open":
        return {"text": described.circuit.to_toml(), "chosen": ""}
    if not isinstance(described, Circuit):
        raise CommandError("a drive has a fixed structure", remedy="Open it as a circuit first.")
    change = CircuitText(text, described.wiring)
    arguments = {"add": (kind, one), "join": (one, other), "cut": (one,), "remove": (one,)}[act]
    chosen = getattr(change, act)(*arguments)  # the name of an added component
    return {"text": change.written(), "chosen": chosen or ""}


class CircuitText:
    """Text of a valid circuit, for step-by-step changes of its structure. Comments and order are kept.

    Parameters
    ----------
    text : str
    wiring : Wiring
        Wiring of the circuit.
    """

    def __init__(self, text: str, wiring: Wiring) -> None:
        self.document, self.wiring = tomlkit.parse(text), copy(wiring)
        self.wiring.parts = self.parts = dict(wiring.parts)
        if "connections" not in self.document:
            raise CommandError("this file has no list of connections", remedy="Edit the text instead.")

    @property
    def _chains(self) -> Any:  # noqa: ANN401 - an array of tomlkit
        return self.document["connections"]

    def ports(self, name: str) -> list[Port]:
        """Return the ports of a component."""
        if name not in self.parts:
            raise CommandError(f'there is no component "{name[:80]}"')
        return self.wiring.ports(name)

    def _ends(self, chain: str) -> list[tuple[Any, Any]]:
        """Return the ports at which a chain enters and leaves each of its components."""
        words = _words(chain)
        last = len(words) - 1
        return [self.wiring.element(word, "", first=at == 0, last=at == last) for at, word in enumerate(words)]

    def _port(self, text: str) -> Port:
        name, _, port = text.partition(".")
        found = next((one for one in self.ports(name) if one.name == port), None)
        if found is None:
            raise CommandError(f"{text[:80]} is not a port")
        return found

    def add(self, kind: str, at: str) -> str:
        """Add a component at a port and return its name. A component with gas flow is put into the port's line."""
        if kind not in STARTERS:
            raise CommandError(f"{kind[:80]!r} cannot be added here", rule=", ".join(STARTERS))
        port = self._port(at)
        stem = re.sub(r"[^a-z_]", "_", kind.partition("/")[0])
        taken = {*self.parts, *self.document["components"]}  # type: ignore[misc]
        name = next(one for number in count(1) if (one := f"{stem}_{number}" if number > 1 else stem) not in taken)
        self.parts[name] = Part(component_kinds()[kind], name)
        own = [one for one in self.ports(name) if not one.is_pilot and one.kind == port.kind]
        if not own:
            raise CommandError(f"{kind} has no port for {port.kind}", remedy=f"Choose another port than {at}.")
        through = [one for one in own if not (one.exhaust or one.optional)]
        self._open(at)
        places = [(k, words[0]) for k, words in self._lines(port).items() if PILOT_LINE not in self._chains[k]]
        if places and (_is_passed(through) or (port.is_single and [one.holds for one in own] == ["volume"])):
            number, word = places[0]
            words = _words(self._chains[number])
            self._chains[number] = f" {ARROW} ".join([*words[: word + 1], name, *words[word + 1 :]])
        elif places and port.is_single:
            raise CommandError.of("web.joined", port=at)
        else:
            self._chains.append(f"{at} {ARROW} {(through or own)[0].id}")
        table = tomlkit.table()
        table.comment("Assumed initial values.")
        table["kind"] = kind
        for key, value in STARTERS[kind].items():
            table[key] = tomlkit.value(toml.value_text(value))
        table.add(tomlkit.nl())
        self.document["components"][name] = table  # type: ignore[index]
        return name

    def _lines(self, port: Port) -> dict[int, list[int]]:
        """Return the lines of a port: index of a chain -> indices of the components before the lines."""
        lines = {}
        for number, chain in enumerate(map(str, self._chains)):
            gaps = enumerate(pairwise(self._ends(chain)))
            lines[number] = [word for word, ((_, left), (right, _)) in gaps if port in (left, right)]
        return {number: words for number, words in lines.items() if words}

    def join(self, one: str, other: str) -> None:
        """Join two ports."""
        ends = [self._port(one), self._port(other)]
        if ends[0] == ends[1]:
            raise CommandError(f"{one} cannot be joined to itself")
        for end in (one, other):
            self._open(end)
        mark = PILOT_LINE if any(end.is_pilot for end in ends) else ARROW
        self._chains.append(f"{one} {mark} {other}")

    def _open(self, at: str) -> None:
        """Remove the opening to the ambient air that `written` added to a port."""
        for number in reversed(range(len(self._chains))):
            if _words(self._chains[number]) == [at, AMBIENT]:
                del self._chains[number]

    def cut(self, at: str) -> None:
        """Remove the lines of a port."""
        for number, words in reversed(self._lines(self._port(at)).items()):
            self._divide(number, [word + 1 for word in words])

    def _divide(self, number: int, before: list[int]) -> None:
        """Divide a chain before some of its components.

        A remaining part with a single component is dropped, because it joins nothing.
        """
        mark, words = PILOT_LINE if PILOT_LINE in self._chains[number] else ARROW, _words(self._chains[number])
        parts = [words[low:high] for low, high in pairwise(sorted({0, *before, len(words)}))]
        kept = [f" {mark} ".join(part) for part in parts if len(part) > 1]
        if kept:
            self._chains[number] = kept[0]
            for at, one in enumerate(kept[1:], start=1):
                self._chains.insert(number + at, one)
        else:
            del self._chains[number]

    def remove(self, name: str) -> None:
        """Remove a component. If it has two ports, the lines at both ports become one line."""
        self.ports(name)
        for number in reversed(range(len(self._chains))):
            words = _words(self._chains[number])
            at = [place for place, word in enumerate(words) if word.partition(".")[0] == name]
            if not at:
                continue
            is_inside = len(at) == 1 and 0 < at[0] < len(words) - 1
            if is_inside and words[at[0]] == name:
                self._chains[number] = f" {ARROW} ".join(word for word in words if word != name)
            else:
                self._divide(number, [*at, *(place + 1 for place in at)])
        components: Any = self.document["components"]
        if name in components:
            del components[name]
        else:
            table = next(one for one in components.values() if name in one.get("copies", ()))
            table["copies"].remove(name)
        initial: Any = self.document.get("initial", {})
        for key in [one for one in initial if one.partition(".")[0] == name]:
            del initial[key]
        del self.parts[name]

    def written(self) -> str:
        """Return the text.

        Ports that need a line, but have none, are plugged, or opened to the ambient air if gas flows through the
        component. A plug at a restriction would make a joint without any gas volume.
        """
        if not len(self._chains):
            raise CommandError("no connection would remain", remedy="Remove the file instead.")
        ends = [end for chain in self._chains for both in self._ends(str(chain)) for end in both]
        named = {end.id for end in ends if isinstance(end, Port)}
        before = [str(one) for one in self.document.get("plugged", ())]
        every = [one for name in self.parts for one in self.ports(name)]
        plugged = [one for one in before if one not in named and one.partition(".")[0] in self.parts]
        for port in every:
            if port.kind != "gas" or not _is_needed(port) or port.id in {*named, *plugged}:
                continue
            if _is_passed([each for each in self.ports(port.component) if _is_needed(each)]):
                self._chains.append(f"{port.id} {ARROW} {AMBIENT}")
            else:
                plugged.append(port.id)
        if plugged != before:
            if plugged:
                self.document["plugged"] = plugged
            else:
                del self.document["plugged"]
        return tomlkit.dumps(self.document)


def _is_needed(port: Port) -> bool:
    """Return whether a port must be joined or plugged."""
    return not (port.exhaust or port.optional or port.is_pilot)


def _is_passed(needed: list[Port]) -> bool:
    """Return whether gas flows through a component with these ports without being stored."""
    return len(needed) == 2 and all(one.is_single for one in needed)


def _words(chain: object) -> list[str]:
    mark = PILOT_LINE if PILOT_LINE in str(chain) else ARROW
    return [word.strip() for word in str(chain).split(mark)]
