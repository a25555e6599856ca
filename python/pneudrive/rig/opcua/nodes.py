"""The node map: behind which nodes of an OPC UA server a rig is found, in which units, and the times of the handshake.

The handshake needs nothing but variables, so that every PLC can do it:

- A command is its verb and arguments, then a new ``command.id``. The server sets ``answer.fault`` and then
  ``answer.done`` to that id. Halt and stop are taken at any time, of anybody, and end what runs; any other verb while
  one runs is a fault, and so is one of a client while another one commands.
- Samples come in chunks through a ring of slots. The server writes a slot, its sequence number, then
  ``samples.written``; the client reads it and raises ``samples.acknowledged``; a slot is not written again before that.
  ``answer.done`` comes after the last chunk.
- Both sides count up their heartbeat, the client from its first command on. A server whose client falls silent brings
  the axis to rest, releases the pressure, counts up ``heartbeat.stops``, and takes no command until the heartbeat is
  back. A client that sees ``heartbeat.stops`` change knows that what it did before is undone.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, replace
from enum import IntEnum
from pathlib import Path
from typing import Any

from pneudrive.errors import DescriptionError, Problems
from pneudrive.rig.rig_file import RigFile
from pneudrive.units import converter, parse, parse_pressure

DEFAULT_MAP = Path(__file__).with_name("nodes.toml")
SCHEMA = 1
HOLD, RELEASED, SHUT = 1, 2, 4  # bits of step.kind


class Verb(IntEnum):
    """What a command asks for. From 101 on: simulated rigs only."""

    HOME = 1
    MOVE = 2
    HOLD = 3
    SET_PRESSURE = 4
    ACQUIRE = 5
    HALT = 6  # come to rest, pressures stay
    STOP = 7  # come to rest and release the pressure
    BEGIN_CYCLE = 101
    MEMORY = 102
    RESTORE = 103
    TRUTH = 104
    LEVELS = 105
    CHANGE = 106


@dataclass(frozen=True)
class Kind:
    """What a node is: OPC UA type, SI unit ("" for no quantity), scalar or array, who writes it."""

    type: str
    unit: str = ""
    array: bool = False
    client: bool = False
    optional: bool = False


def _kinds() -> dict[str, Kind]:
    counter, number, text = Kind("UInt32"), Kind("Int32"), Kind("String")
    channels = {"position": "m", "force": "N", "pressure_a": "Pa", "pressure_b": "Pa", "temperature": "K"}
    writes: dict[str, Kind] = {
        "command.verb": number,
        "command.pressure_a": Kind("Double", "Pa"),
        "command.pressure_b": Kind("Double", "Pa"),
        "command.id": counter,
        "step.count": number,
        "step.kind": Kind("Int32", array=True),
        "step.position": Kind("Double", "m", array=True),
        "step.speed": Kind("Double", "m/s", array=True),
        "step.duration": Kind("Double", "s", array=True),
        "step.weight": Kind("Double", "N", array=True, optional=True),
        "sampling.samples_per_stroke": replace(number, optional=True),  # a PLC may sample as it can
        "sampling.burst_rate": Kind("Double", "1/s", optional=True),
        "sampling.burst_before": Kind("Double", "s", optional=True),
        "sampling.burst_after": Kind("Double", "s", optional=True),
        "sampling.hold_rate": Kind("Double", "1/s", optional=True),
        "samples.acknowledged": counter,
        "heartbeat.client": counter,
        "simulation.text": replace(text, optional=True),
    }
    reads: dict[str, Kind] = {
        "heartbeat.server": counter,
        "heartbeat.stops": counter,
        "answer.fault": text,
        "answer.done": counter,
        "samples.written": counter,
        "samples.sequence": counter,
        "samples.count": number,
        "samples.time": Kind("Double", "s", array=True),
        **{f"samples.{name}": Kind("Double", unit, array=True) for name, unit in channels.items()},
        "samples.step": Kind("Int32", array=True),
        **{f"state.{name}": Kind("Double", unit) for name, unit in channels.items()},
        "state.supply_pressure": Kind("Double", "Pa"),
        "state.time": Kind("Double", "s"),
        "state.moving": Kind("Boolean"),
        "state.fault": text,
        **{
            name: replace(text, optional=True)
            for name in ("rig.identity", "rig.limits", "simulation.abilities", "simulation.answer")
        },
    }
    return {**{name: replace(kind, client=True) for name, kind in writes.items()}, **reads}


KINDS = _kinds()
IN_RING = {name for name in KINDS if name.startswith("samples.")} - {"samples.written", "samples.acknowledged"}
TYPES = {
    "Double": ("Double", "Float"),
    "UInt32": ("UInt32", "UInt16", "UInt64", "Int32", "Int64"),
    "Int32": ("Int32", "Int16", "Int64", "UInt16", "UInt32"),
    "Boolean": ("Boolean",),
    "String": ("String",),
}
HANDSHAKE = {"heartbeat", "poll", "patience", "slots", "first_slot", "chunk", "steps"}


@dataclass(frozen=True)
class Scale:
    """SI value = raw * factor + offset, plus the ambient pressure where ``gauge``."""

    factor: float = 1.0
    offset: float = 0.0
    gauge: bool = False

    def to_si(self, raw: Any, ambient_pa: float) -> Any:  # noqa: ANN401 - a number or an array
        """Bring raw numbers to SI; those in SI already keep their bits."""
        if self == Scale():
            return raw
        return raw * self.factor + (self.offset + (ambient_pa if self.gauge else 0.0))

    def from_si(self, value: Any, ambient_pa: float) -> Any:  # noqa: ANN401
        """Bring SI values to raw numbers."""
        if self == Scale():
            return value
        return (value - (self.offset + (ambient_pa if self.gauge else 0.0))) / self.factor


@dataclass(frozen=True)
class Node:
    """One node of the map; ``id`` is None where ``constant`` (SI, pressures absolute) stands for it."""

    name: str
    id: str | None
    kind: Kind
    type: str
    scale: Scale = Scale()
    constant: float | None = None


@dataclass(frozen=True)
class NodeMap:
    """All nodes by name, and the times of the handshake.

    Attributes
    ----------
    nodes : dict of str to Node
        Optional ones may be absent. Ids of the ring hold ``{slot}``.
    namespace : str
        URI of the namespace of ids without ``ns=``.
    heartbeat_s, poll_s, patience_s : float
    slots, first_slot, chunk, steps : int
    """

    nodes: dict[str, Node]
    namespace: str
    heartbeat_s: float
    poll_s: float
    patience_s: float
    slots: int
    first_slot: int
    chunk: int
    steps: int

    def __contains__(self, name: str) -> bool:
        """Whether there is such a node."""
        return name in self.nodes

    def slot_of(self, sequence: int) -> int:
        """Slot in which chunk number ``sequence`` = 1, 2, ... lies."""
        return (sequence - 1) % self.slots

    def node_ids(self, name: str) -> list[str]:
        """Ids of a node: one, or one for each slot of the ring."""
        node_id = self.nodes[name].id
        if node_id is None:
            return []
        if name not in IN_RING:
            return [node_id]
        return [node_id.replace("{slot}", str(self.first_slot + slot)) for slot in range(self.slots)]


def load_map(path: str | Path | None = None) -> NodeMap:
    """Read a node map; None takes the default one.

    Raises
    ------
    RigError
        With file, line, value, rule and remedy.
    """
    file = RigFile.load(DEFAULT_MAP if path is None else path)
    tables = {name.partition(".")[0] for name in KINDS}
    file.only("", {"schema", "namespace", "handshake", *tables})
    if file.get("schema") != SCHEMA:
        raise file.fail("this is no node map of this version", "schema", rule=f"schema = {SCHEMA}")
    problems = Problems()
    take = problems.take
    for table in tables:
        take(file.only, table, [name.partition(".")[2] for name in KINDS if name.startswith(f"{table}.")])
    take(file.only, "handshake", HANDSHAKE)
    nodes = {}
    for name, kind in KINDS.items():
        node = take(_node, file, name, kind)
        if node is not None:
            nodes[name] = node
        elif not kind.optional and file.get(name) is None:
            problems.add(file.fail(f"the map has no node {name}", name.partition(".")[0]))
    shake = {
        "heartbeat_s": take(file.quantity, "handshake.heartbeat", "s", True) or 1.0,
        "poll_s": take(file.quantity, "handshake.poll", "s", True) or 0.02,
        "patience_s": take(file.quantity, "handshake.patience", "s", True) or 120.0,
        "slots": take(file.count, "handshake.slots", 8, 2),
        "first_slot": take(file.count, "handshake.first_slot", 0),
        "chunk": take(file.count, "handshake.chunk", 1000, 1),
        "steps": take(file.count, "handshake.steps", 256, 1),
    }
    namespace = take(file.string, "namespace") or ""
    problems.tell()
    return NodeMap(nodes=nodes, namespace=namespace, **shake)


def _node(file: RigFile, name: str, kind: Kind) -> Node | None:
    said = file.get(name)
    if said is None:
        return None
    table = {"node": said} if isinstance(said, str) else said
    if not isinstance(table, dict) or ("node" in table) == ("constant" in table):
        raise file.fail(f"{name} must be a node's id or a table", name, remedy='{ node = "ns=4;s=...", unit = "mm" }')
    if isinstance(said, dict):
        file.only(name, _keys(kind))
    if "constant" in table:
        return Node(name, None, kind, kind.type, constant=_constant(file, name, kind))
    node_id = _node_id(file, name, table["node"])
    node_type = table.get("type", kind.type)
    if node_type not in TYPES[kind.type]:
        rule = f"one of {', '.join(TYPES[kind.type])}"
        raise file.fail(f"{name}.type = {node_type!r} does not fit", name, rule=rule)
    return Node(name, node_id, kind, node_type, _scale(file, name, kind, table))


def _keys(kind: Kind) -> set[str]:
    return {"node", "type", "constant"} | ({"unit", "positive"} if kind.unit else set())


def _node_id(file: RigFile, name: str, text: object) -> str:
    if not isinstance(text, str) or not re.fullmatch(r"(ns=\d+;)?[isgb]=.+", text):
        raise file.fail(
            f"{name}: {text!r} is no node id", name, rule='"ns=4;s=NAME", "ns=4;i=NUMBER", or "s=NAME" in the namespace'
        )
    if not text.startswith("ns=") and not file.string("namespace"):
        raise file.fail(f"{name} names no namespace", name, remedy='namespace = "urn:..." at the top, or ns=4;...')
    if ("{slot}" in text) != (name in IN_RING):
        rule = "the nodes of the ring, and only these, have {slot} in their id"
        raise file.fail(f"{name}: {text}", name, rule=rule)
    return text


def _constant(file: RigFile, name: str, kind: Kind) -> float:
    channel = name.partition(".")[2]
    if kind.client or not kind.unit or channel in ("time", "position", "force"):
        raise file.fail(f"{name} cannot be a constant", name, rule="a pressure or temperature that is not measured can")
    if kind.unit == "Pa":
        pressure = file.said(f"{name}.constant", parse_pressure)
        if pressure.gauge:
            raise file.fail(f"{name}: a constant pressure is absolute", name, remedy='"1.013 bar abs"')
        return pressure.value_pa
    return file.said(f"{name}.constant", lambda text: parse(text, kind.unit))


def _scale(file: RigFile, name: str, kind: Kind, table: dict[str, Any]) -> Scale:
    sign = {"+x": 1.0, "-x": -1.0}.get(table.get("positive", "+x"))
    if sign is None or ("positive" in table and kind.unit not in ("m", "N")):
        raise file.fail(
            f"{name}.positive: {table.get('positive')!r}", name, rule='"+x" or "-x", of a position or force'
        )
    if "unit" not in table:
        return Scale(sign)
    from pneudrive.characterise.column_units import column_unit

    if kind.unit == "Pa":
        unit = file.said(f"{name}.unit", lambda text: column_unit(text, "Pa"))
        return Scale(unit.factor, 0.0, bool(unit.gauge))
    factor, offset = file.said(f"{name}.unit", lambda text: _converter(text, kind.unit))
    return Scale(sign * factor, offset)


def _converter(text: object, unit: str) -> tuple[float, float]:
    if not isinstance(text, str):
        raise DescriptionError(f"{text!r} is no unit")
    return converter(text, unit)
