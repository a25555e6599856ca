"""Tables of components in a circuit file: merging with catalogue and drive tables, copies, reading."""

from __future__ import annotations

import re
from typing import Any

from pneudrive.arrays import Plain
from pneudrive.describe.components import Component, component, component_class, within_component
from pneudrive.describe.connections import AMBIENT, Part
from pneudrive.describe.files import catalogue
from pneudrive.describe.kinds import component_kinds
from pneudrive.describe.short import TABLES, Short
from pneudrive.errors import DescriptionError, Problems, invalid, wrong

_NAME = re.compile(r"[A-Za-z_][A-Za-z0-9_-]*")


def part_of(table: object, key: str, read: Component | None) -> Part:
    """Return the data of a component for the wiring: its kind, its key in the file, stated pressures."""
    kind = table.get("kind") if isinstance(table, dict) else getattr(table, "kind", None)
    stated = ", ".join(map(str, read.pressures())) if read is not None else ""
    return Part(component_kinds().get(kind) if isinstance(kind, str) else None, key, stated)


def completed(data: Plain, short: Short, problems: Problems) -> Plain:
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
            what = f'two components have the name "{name}": [{short.places[f"components.{name}"]}] has it already'
            remedy = "Rename it. To add keys to that component, leave out kind."
            problems.add(
                wrong(f"components.{name}.kind", what, rule="each component has a different name", remedy=remedy)
            )
            short.places[f"components.{name}.kind"] = f"components.{name}.kind"
    connections = out.get("connections", ())
    if isinstance(connections, list | tuple):
        out["connections"] = [*connections, *short.chains]
    return out | {"components": both}


class _Rejected(dict[str, Any]):
    """Placeholder for a rejected table; it keeps only the names of its copies."""


def used(given: object, problems: Problems) -> object:
    """Return the tables of components. A table that uses a catalogue part is merged over the part."""
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
                    raise invalid("kind", "describe.other-kind", kind=kind, table=table["use"], part=part["kind"])
                out[name] = component_class(kind).over(part, own) | copies
            except DescriptionError as error:
                problems.add(error if error.where else within_component(error, name, table))
                out[name] = _Rejected(copies)
    return out


def copied(given: object, problems: Problems) -> tuple[Plain, dict[str, str], dict[str, list[str]]]:
    """Return table and key of each component by name, and the names of copies for each table that has copies."""
    tables: Plain = {}
    keys: dict[str, str] = {}
    templates: dict[str, list[str]] = {}
    if not isinstance(given, dict) or not given:
        what = "the circuit has no components" if not given else f"components = {given!r} is not a table"
        problems.add(wrong("components", what, remedy="Write [components.NAME]."))
    given = given if isinstance(given, dict) else {}
    for name, table in given.items():
        key, copies = f"components.{name}", [name]
        if isinstance(table, dict) and "copies" in table:
            copies = table["copies"]
            table = type(table)((key, value) for key, value in table.items() if key != "copies")  # noqa: PLW2901
            if not isinstance(copies, list | tuple) or not copies or not all(isinstance(one, str) for one in copies):
                what = f"{name}.copies = {copies!r} is not a list of names"
                problems.add(wrong(f"{key}.copies", what, remedy='Write copies = ["left", "right"].'))
                copies = [name]
            elif name not in copies:
                templates[name] = list(copies)
        for number, own in enumerate(copies):
            here = f"{key}.copies.{number}" if len(copies) > 1 or own != name else key
            is_taken = own in tables or (own != name and own in given)
            if is_taken:
                problems.add(invalid(here, "describe.name-taken", own=own))
            elif own == AMBIENT or not _NAME.fullmatch(str(own)):
                rule = 'letters, digits, "_" and "-", a letter first; not ambient'
                problems.add(wrong(here, f'"{own}" is not valid as the name of a component', rule=rule))
            if not is_taken:
                tables[own], keys[own] = table, here
    return tables, keys, templates


def read_component(key: str, table: object, problems: Problems) -> Component | None:
    """Read one component; errors in a table with copies are reported only once."""
    if isinstance(table, Component):
        return table
    name = key.split(".")[1]
    if isinstance(table, _Rejected):
        return None
    with problems.caught():
        if not isinstance(table, dict):
            raise wrong(key, f"components.{name} = {table!r} is not a table")
        try:
            return component(table)
        except DescriptionError as error:
            raise within_component(error, name, table) from None
    return None
