"""Short form of a circuit: conversion of the tables of a drive file to components with default connections.

``[supply]``, ``[valve]`` and ``[cylinder]`` become components with these names. ``[friction]`` belongs to the cylinder,
and ``[load]`` moves with the piston. ``[tubing]`` and ``[flow_control]`` are between valve and cylinder, for each
chamber. Keys are only renamed; no value is computed.
"""

from __future__ import annotations

from typing import Any

from pneudrive.arrays import Keyed, Plain
from pneudrive.describe.connections import ARROW
from pneudrive.describe.kinds import component_kinds
from pneudrive.describe.tables.valve_flow import FLOW_KEYS, NEEDLE
from pneudrive.errors import Problems, invalid, nearest, wrong

#: Tables of a drive file that describe components.
TABLES = ("supply", "valve", "cylinder", "friction", "load", "tubing", "flow_control")
#: Chamber -> port of the valve that is connected to the chamber.
CHAMBERS = {"a": "4", "b": "2"}
#: Prefix of the sizes of a flow control's check valve.
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
        Key of a circuit file -> its key in the short form; the longest match counts.
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
        self._given = len(connections) if isinstance(connections, list | tuple) else 0  # before the default ones

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
    """Return the table of a tube, with its kind from the key `model`."""
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
#: Table of lines -> name of its components, their kind, conversion of keys. The order is from the valve to the chamber.
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
