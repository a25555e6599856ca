"""Tables of components in a circuit file: merging with catalogue and drive tables, copies, reading."""

from __future__ import annotations

import re

from pneudrive.arrays import Plain
from pneudrive.describe.components import Component, component, component_class, within_component
from pneudrive.describe.connections import AMBIENT, Part
from pneudrive.describe.files import catalogue
from pneudrive.describe.kinds import component_kinds
from pneudrive.describe.short import TABLES, Short
from pneudrive.errors import Problems, invalid, wrong

_NAME = re.compile(r"[A-Za-z_][A-Za-z0-9_-]*")


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
            what = f'two components have the name "{name}"; the other one is [{short.places[f"components.{name}"]}]'
            remedy = "Rename this component. To add keys to the other component, leave out kind."
            problems.add(
                wrong(f"components.{name}.kind", what, rule="each component has a different name", remedy=remedy)
            )
            short.places[f"components.{name}.kind"] = f"components.{name}.kind"
    connections = out.get("connections", ())
    if isinstance(connections, list | tuple):
        out["connections"] = [*connections, *short.chains]
    return out | {"components": both}


def read_components(
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
        Names of the copies, by name of their table. Such a table is not a component.
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
            table, copies = {**table}, table.get("copies", copies)  # noqa: PLW2901 - the table without its copies
            table.pop("copies", None)
            if "use" in table:
                table = problems.take(_used, name, table)  # noqa: PLW2901 - the table over that of the part
            kind = table.get("kind") if table is not None else None
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
    """Merge a component's table over the table of the catalogue part that its key `use` names."""
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
