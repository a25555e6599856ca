"""Catalogue of parts and drives: every value has a source or is marked as assumed.

A file contains a drive, a part, or several parts as ``[[part]]``. Each value is a table with ``value``, and either
``source`` or ``assumed``. ``source`` is a key of references.bib, or of ``[sources]`` in the same file. ``assumed`` is
the reason. A part has the keys of its kind of component, and a drive has the keys of the drive file. A drive names its
parts and adds the values that its parts do not have. Kinds of components are loaded only when a part is used.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import replace
from fnmatch import fnmatchcase
from functools import cached_property, lru_cache
from pathlib import Path
from typing import Annotated, Any

from pydantic import ConfigDict, Field

from pneudrive import units
from pneudrive.arrays import Plain
from pneudrive.describe.base import Described
from pneudrive.describe.files import sourced, toml
from pneudrive.describe.files.sourced import Value
from pneudrive.describe.kinds import component_kinds, is_needed
from pneudrive.describe.marks import CONDUCTANCE, NOMINAL_FLOW, SIZES, Reads, Text
from pneudrive.describe.tables.valve_flow import conductance_key, conductance_of
from pneudrive.errors import DescriptionError, Problems, invalid, nearest, together, warn, wrong
from pneudrive.references import entries as references

PREFIX = "catalogue:"
FOLDER = Path(__file__).resolve().parents[2] / "data" / "catalogue"
DRIVE = "drive"
#: Keys of `printed` that the sizing reads, although no part of the built-in catalogue has them.
PRINTED = {"max_stroke", "max_speed", "cushion_energy", "absorber_energy_per_hour", "b10_cycles"}

_own: ContextVar[tuple[Path, ...]] = ContextVar("folders of the user's catalogue", default=())


def _values(given: object) -> tuple[Value, ...]:
    """Read values with their origins, in tables of any depth.

    If one value is a friction table, each parameter in the table gets the origin of this value.
    """
    if not isinstance(given, dict):
        raise DescriptionError(f"{given!r} is not a table")
    problems, origins = Problems(), {"value", "source", "assumed"}
    inner = toml.leaves(given, is_inner=lambda one: bool(isinstance(one, dict) and one and not origins & set(one)))
    found = [problems.take(sourced.read, key, one) for key, one in inner]
    problems.tell()
    each = []
    for one in found:
        is_law = one.key == "friction" and isinstance(one.value, dict)
        values = {f"friction.{key}": value for key, value in one.value.items()} if is_law else {one.key: one.value}
        each += [replace(one, key=key, value=value) for key, value in values.items()]
    return tuple(each)


class Entry(Described):
    """Part or drive of the catalogue.

    `kind` is "drive", or the part's kind of component. `parts` names the part for each table of a drive. `printed`
    contains data of the source that the model does not use.
    """

    name: str
    title: str
    kind: str = ""
    note: str = ""
    parts: dict[str, str] = Field(default_factory=dict)
    values: Annotated[tuple[Value, ...], Reads(_values)] = ()
    printed: Annotated[tuple[Value, ...], Reads(_values)] = ()

    @cached_property
    def key(self) -> str:
        """Prefix of the entry's keys in the file."""
        return ""

    @property
    def is_drive(self) -> bool:
        """Whether the entry is a whole drive."""
        return self.kind == DRIVE

    @property
    def open(self) -> list[str]:
        """Keys that the user of a part must give."""
        from pneudrive.describe.components import component_class

        entry = component_kinds()[self.kind]
        kind = component_class(self.kind)
        given = kind.flat({value.key: value.value for value in self.values})
        known = set(map(conductance_key, given))
        needed = [one["key"] for one in entry["parameters"] if is_needed(one, given) and one["key"] not in known]
        has_friction = any(value.key.startswith("friction.") for value in self.values)
        friction = "the rest of friction" if has_friction else "friction"
        return [*needed, friction] if entry["friction"] == "needed" else needed


@contextmanager
def catalogue_folders(*paths: str | Path) -> Iterator[None]:
    """Add the user's folders to the catalogue within a ``with`` block.

    Parameters
    ----------
    *paths : path-like
        Folders of TOML files. Later folders override earlier ones, and all override the built-in catalogue.

    Raises
    ------
    DescriptionError
        A folder does not exist.

    Examples
    --------
    >>> import pneudrive as pn
    >>> with pn.catalogue_folders("my_parts"):  # doctest: +SKIP
    ...     circuit = pn.Circuit.load("circuit.toml")
    """
    for path in map(Path, paths):
        if not path.is_dir():
            raise DescriptionError(f"there is no folder {path}", remedy="Give a folder with TOML files.")
    before = _own.set((*_own.get(), *map(Path, paths)))
    try:
        yield
    finally:
        _own.reset(before)


def entries() -> dict[str, Entry]:
    """Return all parts and drives by name.

    Raises
    ------
    DescriptionError
        An entry is not valid, for instance because a value has neither a source nor a reason.

    Warns
    -----
    PneudriveWarning
        A part or drive of the user replaces another one of the same name.
    """
    found = dict(_built_in())
    known = PRINTED | {value.key for one in found.values() for value in one.printed}
    for folder in _own.get():
        for path in sorted(folder.rglob("*.toml")):
            for own in _read(path, path.stat().st_mtime_ns):
                before = found.get(own.name)
                if before is not None:
                    home = before.source_file
                    whose = "the built-in catalogue" if Path(home).is_relative_to(FOLDER) else home
                    warn(f"{own.name} of {path} replaces {own.name} of {whose}")
                found[own.name] = own
                for key in {value.key for value in own.printed} - known:
                    warn(f"printed.{key} of {own.name}, {path}, is not used. {nearest(key, known)}")
    return found


@lru_cache(maxsize=1)
def _built_in() -> dict[str, Entry]:
    paths = [*sorted((FOLDER / "drives").glob("*.toml")), *sorted((FOLDER / "parts").glob("*.toml"))]
    return {one.name: one for path in paths for one in _read(path, path.stat().st_mtime_ns)}


def entry(name: str, what: str = "", key: str = "") -> Entry:
    """Return the part or drive with this name.

    Parameters
    ----------
    name : str
        Name, or ``catalogue:NAME``.
    what : str
        ``"drive"`` or ``"part"``; empty for both.
    key : str
        Key of the file at which the name is given, for the error.

    Raises
    ------
    DescriptionError
        The catalogue has no entry of this name; the message gives the nearest name.
    """
    known = {one: found for one, found in entries().items() if not what or found.is_drive == (what == DRIVE)}
    name = name.removeprefix(PREFIX)
    if name not in known:
        missing = f"{what} '{name}'".lstrip()
        raise wrong(key, f"the catalogue has no {missing}", remedy=nearest(name, known))
    return known[name]


def all_values(found: Entry) -> list[Value]:
    """Return the values of a part, or those of a drive and its parts with their keys in the drive file."""
    out = {}
    for table, name in found.parts.items():
        for v in entry(name).values:
            key = v.key if v.key.startswith("friction.") else f"{table}.{v.key}"
            value = v.value.partition("/")[2] if v.key == "kind" else v.value
            out[key] = replace(v, key=key, value=value)
    out |= {v.key: v for v in found.values}
    return list(out.values())


def part_table(reference: object) -> dict[str, Any]:
    """Return the table of a component for ``catalogue:NAME``, each value with its source.

    Raises
    ------
    DescriptionError
        The catalogue has no such part, or the part is not valid.
    """
    if not isinstance(reference, str) or not reference.startswith(PREFIX):
        raise wrong("use", f"use = {reference!r} is not a part of the catalogue", remedy=f'Write use = "{PREFIX}NAME".')
    part = entry(reference, "part", "use")
    check(part)
    given = [(v.key, {"value": v.value} | v.origin) for v in part.values if v.key != "kind"]
    return {"kind": part.kind} | toml.nested(given)


def check(part: Entry) -> None:
    """Check a part in the same way as a component of a circuit: keys, units, bounds.

    Raises
    ------
    DescriptionError
        The part is not valid; the message gives file and line.
    """
    from pneudrive.describe.components import component_class

    kinds, errors = component_kinds(), list[DescriptionError]()
    values = toml.nested((v.key, v.value) for v in part.values if v.key != "kind")
    try:
        if part.kind not in kinds:
            raise wrong("kind", f"kind = {part.kind!r} is not known", remedy=nearest(part.kind, kinds))
        component_class(part.kind).model_validate({"kind": part.kind} | values)
    except DescriptionError as error:
        errors = [one for one in error.each() if " is missing" not in one.what]  # the user of the part gives this value
    if not errors:
        return
    text = toml.read(part.source_file)[1]
    lines = toml.line_numbers(text)
    for error in errors:
        whole = f"{part.key}values.{error.key or ''}"
        while whole and whole not in lines:  # dead_volume_a is written in dead_volume
            whole = whole[: max(whole.rfind("."), whole.rfind("_"), 0)]
        error.key = whole or part.key.rstrip(".")
        error.what = f"{part.name}: {error.what}"
    raise toml.located(together(errors), part.source_file, text)


class SourceTable(Described):
    """Source described in a catalogue file, because references.bib does not contain it."""

    model_config = ConfigDict(extra="ignore")
    title: str
    address: str
    date: Text


class _Sources(Described):
    sources: dict[str, SourceTable] = Field(default_factory=dict)


class SingleEntry(Entry, _Sources):
    """Catalogue file with one entry."""


class _Parts(_Sources):
    """Catalogue file with several parts."""

    part: tuple[Entry, ...]


@lru_cache(maxsize=512)
def _read(path: Path, _changed: int) -> tuple[Entry, ...]:
    """Read a file of the catalogue. The result is cached until the modification time of the file changes."""
    tables, text = toml.read(path)
    problems = Problems()
    with toml.locating(path, text):
        if "part" in tables:
            file = _Parts.model_validate(tables)
            parts = {f"part.{number}.": one for number, one in enumerate(file.part)}
        else:
            file = SingleEntry.model_validate({"name": path.stem} | tables)
            parts = {"": file}
        found = [problems.take(_sourced, one, at, file.sources) for at, one in parts.items()]
        problems.tell()
    return tuple(one.read_from(path) for one in found)


def _sourced(entry: Entry, at: str, sources: Mapping[str, SourceTable]) -> Entry:
    """Return an entry with its kind and its key, and each source as text or as a key of references.bib."""
    kind = entry.kind or next((value.value for value in entry.values if value.key == "kind"), None)
    if not isinstance(kind, str):
        raise invalid(f"{at}kind", "describe.entry-without-kind", name=entry.name, drive=DRIVE)
    problems, changes = Problems(), Plain(kind=kind, key=at)
    for name in ("values", "printed"):
        keyed = ((v, f"{at}{name}.{v.key}") for v in getattr(entry, name))
        changes[name] = tuple(replace(v, source=problems.take(_source, v.source, sources, key)) for v, key in keyed)
    problems.tell()
    return entry.model_copy(update=changes)


def _source(key: str | None, sources: Mapping[str, SourceTable], where: str) -> str | None:
    """Return the key of a source in references.bib unchanged, or a source of [sources] in words."""
    if key is None or key in references():
        return key
    if key not in sources:
        raise invalid(where, "describe.unknown-source", key=key, key_text=toml.key_text(key))
    return f"{sources[key].title}, {sources[key].address}, {sources[key].date}"


# --- Parts of the catalogue by kind and size: bore, stroke, flow.

#: Default critical pressure ratio of a part (assumed: that of a fitting), and usual subsonic index.
ASSUMED_B, USUAL_INDEX = 0.3, 0.5
#: Relative difference below which two values count as equal.
NEAR = 1e-3


def find_parts(
    kind: str | None = None, bore: str | None = None, stroke: str | None = None, flow: str | None = None
) -> list[Entry]:
    """Return the parts of the catalogue that match all arguments, sorted by name.

    Parameters
    ----------
    kind : str, optional
        Kind of component, the first part of a kind, or a pattern: ``"valve"``, ``"cylinder/rodless"``, ``"*5/3"``.
    bore, stroke : str, optional
        A length, or a range: ``"25 mm"``, ``"20 mm .. 40 mm"``. A part without a fixed stroke is made to order and fits
        any stroke.
    flow : str, optional
        Sonic conductance or nominal flow, or a range: ``"1 dm3/(s bar) .. 3 dm3/(s bar)"``, ``"500 l/min ANR .. 800
        l/min ANR"``. For a flow control, it refers to the fully open needle.

    Raises
    ------
    DescriptionError
        A quantity cannot be read, or the catalogue has no part of this kind.

    Examples
    --------
    >>> [one.name for one in find_parts("cylinder", bore="25 mm")]
    ['parker-osp-p25', 'smc-c55-25', 'smc-cd85n25', 'smc-cm2y-25', 'smc-cy1b25h', 'smc-cy1b25l', 'smc-mgpm25']
    """
    found = [entry for entry in entries().values() if not entry.is_drive]
    if kind is not None:
        kinds = sorted({one.kind for one in found})
        found = [one for one in found if one.kind.startswith(kind) or fnmatchcase(one.kind, kind)]
        if not found:
            raise wrong("kind", f'the catalogue has no part of the kind "{kind}"', remedy=nearest(kind, kinds))
    for key, given in (("bore", bore), ("stroke", stroke), ("flow", flow)):
        if given is not None:
            unit = "m" if key != "flow" else (NOMINAL_FLOW if "ANR" in given else CONDUCTANCE).si_unit
            if ".." in given:
                low, high = units.parse_range(given, unit)
            else:
                low = high = units.parse(given, unit)
                if not low > 0.0:
                    raise wrong(key, f'{key}: "{given}" is out of bounds', rule="greater than 0")
            found = [one for one in found if _fits(one, key, unit, low, high)]
    return sorted(found, key=lambda one: one.name)


def _fits(entry: Entry, key: str, unit: str, low: float, high: float) -> bool:
    """Return whether a size of a part is in a range. A cylinder whose data sheet states no stroke fits any range."""
    own = {value.key: value for value in entry.values}
    if key == "stroke" and entry.kind.startswith("cylinder/") and (key not in own or own[key].source is None):
        return True
    plain = {name: value.value for name, value in own.items()}
    size = _flow(plain, unit) if key == "flow" else units.parse(plain[key], unit) if key in plain else None
    return size is not None and (1.0 - NEAR) * low <= size <= (1.0 + NEAR) * high


def _flow(own: Mapping[str, Any], unit: str) -> float | None:
    """Return the sonic conductance or the nominal flow of a part, as `unit` requires; None without a stated flow."""
    before = next((before for before in ("", "needle_") if any(before + key in own for key in SIZES)), None)
    if before is None:
        return None
    b, m = own.get("critical_pressure_ratio", ASSUMED_B), own.get("subsonic_index", USUAL_INDEX)
    sizes = [mark.read(own[before + key]) if before + key in own else None for key, mark in SIZES.items()]
    conductance = conductance_of(sizes, b, m)
    return conductance if unit == CONDUCTANCE.si_unit else conductance / conductance_of((None, 1.0, None, None), b, m)
