"""Node map: nodes of a rig on an OPC UA server with their units, and the times of the handshake.

The handshake uses only variables, so that every PLC can implement it:

- A client writes verb and arguments of a command, then a new ``command.id``. The server sets ``answer.fault``, then
  ``answer.done`` to that id. Halt and stop are accepted at any time from any client, and end the running verb. Any
  other verb is answered with a fault while a verb runs, or while another client is in command.
- Samples come in chunks through a ring of slots. The server writes a slot, its sequence number, then
  ``samples.written``. The client reads the slot and increments ``samples.acknowledged``. The server
  writes the slot again only after this acknowledgement. ``answer.done`` follows the last chunk.
- Both sides increment their heartbeats, the client from its first command on. If the client's heartbeat stops, the
  server brings the axis to rest, releases the pressure, and increments ``heartbeat.stops``. The server accepts no
  command until the heartbeat has returned. A change of ``heartbeat.stops`` informs the client that its earlier commands
  are no longer in effect.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from enum import IntEnum
from functools import cache, cached_property, partial
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field, create_model, model_validator

from pneudrive.describe.base import Described
from pneudrive.describe.files import toml
from pneudrive.describe.marks import POSITIVE, Quantity, Reads, StatedPressure, Whole
from pneudrive.errors import DescriptionError, RigError, nearest, package_table, wrong
from pneudrive.rig.interface import WORDS
from pneudrive.signals.columns import column_unit

DEFAULT_MAP = Path(__file__).with_name("nodes.toml")
HOLD, RELEASED, SHUT = 1, 2, 4  # bits of step.kind
#: Arrays of a program of steps -> fields of `Move` and `Hold`.
STEPS = {"step.position": "to_m", "step.speed": "speed_m_s", "step.duration": "duration_s", "step.weight": "weight_n"}


class Verb(IntEnum):
    """Code of a command. Codes from 101 are for simulated rigs only."""

    HOME = 1
    MOVE = 2
    HOLD = 3
    SET_PRESSURE = 4
    ACQUIRE = 5
    HALT = 6  # bring the axis to rest, pressures stay
    STOP = 7  # bring the axis to rest and release the pressure
    BEGIN_CYCLE = 101
    MEMORY = 102
    RESTORE = 103
    LEVELS = 105
    CHANGE = 106


@dataclass(frozen=True)
class NodeKind:
    """Kind of a node, as listed in ``kinds.toml``; unit and field may be empty."""

    type: str
    unit: str = ""
    array: bool = False
    field: str = ""
    client: bool = False
    optional: bool = False


_TABLES = package_table(__file__, "kinds.toml")
KINDS = {f"{table}.{key}": NodeKind(**row) for table, rows in _TABLES.items() for key, row in rows.items()}
IN_RING = {name for name in KINDS if name.startswith("samples.")} - {"samples.written", "samples.acknowledged"}
#: Nodes -> fields of `RigState`, `Samples` and `Sampling`.
STATE, SAMPLES, SAMPLING = (
    {f"{table}.{key}": row["field"] for key, row in _TABLES[table].items() if "field" in row}
    for table in ("state", "samples", "sampling")
)
TYPES: dict[str, list[str]] = WORDS["types"]
Duration = Annotated[float, Quantity("s", bounds=POSITIVE)]


@dataclass(frozen=True)
class Node:
    """Node of the map: SI value = raw * factor + offset, plus the ambient pressure if ``gauge``.

    A ``constant`` (in SI, with absolute pressures) has no ``id``.
    """

    kind: NodeKind
    type: str
    id: str | None = None
    constant: float | None = None
    factor: float = 1.0
    offset: float = 0.0
    gauge: bool = False

    def to_si(self, raw: Any, ambient_pa: float) -> Any:  # noqa: ANN401 - a value of the node's type
        """Convert a raw value to SI. Numbers already in SI stay unchanged. A list becomes an array."""
        if self.kind.array:
            raw = np.asarray(raw, dtype=float if self.kind.type == "Double" else np.int64)
        return raw * self.factor + self._zero(ambient_pa) if self._scaled else raw

    def from_si(self, value: Any, ambient_pa: float) -> Any:  # noqa: ANN401
        """Convert a value in SI to a raw value, as plain data."""
        value = (np.asarray(value) - self._zero(ambient_pa)) / self.factor if self._scaled else value
        return value.tolist() if hasattr(value, "tolist") else value

    @property
    def _scaled(self) -> bool:
        return self.gauge or (self.factor, self.offset) != (1.0, 0.0)

    def _zero(self, ambient_pa: float) -> float:
        return self.offset + (ambient_pa if self.gauge else 0.0)


class Handshake(Described):
    """Table ``[handshake]``: times, slots of the ring, samples of a slot, and steps of a command."""

    table_name = "handshake"
    heartbeat_s: Duration = 1.0
    poll_s: Duration = 0.02
    patience_s: Duration = 120.0
    slots: Annotated[int, Whole(at_least=2, bound=None)] = 8
    first_slot: Annotated[int, Whole(at_least=0, bound=None)] = 0
    chunk: Annotated[int, Whole(bound=None)] = 1000
    steps: Annotated[int, Whole(bound=None)] = 256


class NodeMap(Described):
    """File of a node map: a table for each group of nodes, made from `KINDS`, and the times and sizes of the handshake.

    Attributes
    ----------
    namespace : str
        URI of the namespace of ids without ``ns=``.
    handshake : Handshake
    """

    schema_version: Literal[1] = Field(alias="schema")
    namespace: str = ""
    handshake: Handshake = Handshake()

    @cached_property
    def nodes(self) -> dict[str, Node]:
        """All nodes by name. Optional nodes may be absent. Ids of the ring contain ``{slot}``."""
        return {f"{table}.{key}": node for table in _TABLES for key, node in getattr(self, table).stored().items()}

    @model_validator(mode="after")
    def _ids_have_a_namespace(self) -> NodeMap:
        for name, node in self.nodes.items():
            if node.id is not None and not node.id.startswith("ns=") and not self.namespace:
                remedy = 'Write namespace = "urn:..." at the top, or an id with ns=4;...'
                raise wrong(name, f"the id of {name} has no namespace", remedy=remedy)
        return self

    def __contains__(self, name: str) -> bool:
        """Return whether the map has a node."""
        return name in self.nodes

    def slot_of(self, sequence: int) -> int:
        """Return the slot of chunk number ``sequence`` = 1, 2, ..."""
        return (sequence - 1) % self.handshake.slots

    def node_ids(self, name: str) -> list[str]:
        """Return the ids of a node: one id, or one for each slot of the ring."""
        node_id = self.nodes[name].id
        if node_id is None:
            return []
        if name not in IN_RING:
            return [node_id]
        ring = self.handshake
        return [node_id.replace("{slot}", str(ring.first_slot + slot)) for slot in range(ring.slots)]


def load_map(path: str | Path | None = None) -> NodeMap:
    """Read a node map from a file, or the default map.

    Raises
    ------
    RigError
        The file is not valid; the message gives file, line, value, rule and remedy.
    """
    start = "The default map, nodes.toml, is an example."
    return toml.load(_map_class().model_validate, DEFAULT_MAP if path is None else path, RigError, start=start)


def _node(name: str, given: object) -> Node:
    """Read a node: its id, or a table."""
    kind = KINDS[name]
    table = {"node": given} if isinstance(given, str) else given
    if not isinstance(table, dict) or ("node" in table) == ("constant" in table):
        what = f"{given!r} is neither the id nor the table of a node"
        raise DescriptionError(what, remedy='Write { node = "ns=4;s=...", unit = "mm" }.')
    known = ["node", "type", "constant", *(["unit", "positive"] if kind.unit else [])]
    for key in table:
        if key not in known:
            raise DescriptionError(f"{key} is not a known key", remedy=nearest(key, known))
    if "constant" in table:
        if kind.client or not kind.unit or name.partition(".")[2] in ("time", "position", "force"):
            rule = "only unmeasured pressures and temperatures can be constant"
            raise DescriptionError("the node cannot be a constant", rule=rule)
        is_pressure, stated = kind.unit == "Pa", table["constant"]
        value = (
            StatedPressure(gauge_allowed=False).read(stated).value_pa
            if is_pressure
            else Quantity(kind.unit).read(stated)
        )
        return Node(kind, kind.type, constant=value)
    node_type = table.get("type", kind.type)
    if node_type not in TYPES[kind.type]:
        raise DescriptionError(f"type = {node_type!r} is not supported", rule=f"one of {', '.join(TYPES[kind.type])}")
    return Node(kind, node_type, _node_id(name, table["node"]), None, *_scale(kind, table))


@cache
def _map_class() -> type[NodeMap]:
    """Return the class of a map file, with a table for each group of nodes."""
    made: dict[str, Any] = {}
    for table, rows in _TABLES.items():
        nodes: dict[str, Any] = {
            key: (Annotated[Node | None, Reads(partial(_node, f"{table}.{key}"))], None if "optional" in row else ...)
            for key, row in rows.items()
        }
        model = create_model(f"{table.title()}Nodes", __base__=Described, **nodes)
        made[table] = (model, model() if all("optional" in row for row in rows.values()) else ...)
    return create_model("WholeNodeMap", __base__=NodeMap, **made)


def _node_id(name: str, text: object) -> str:
    if not isinstance(text, str) or not re.fullmatch(r"(ns=\d+;)?[isgb]=.+", text):
        rule = '"ns=4;s=NAME", "ns=4;i=NUMBER", or "s=NAME" in the namespace'
        raise DescriptionError(f"{text!r} is not a node id", rule=rule)
    if ("{slot}" in text) != (name in IN_RING):
        raise DescriptionError(f"id {text!r} is not allowed", rule="only ids of nodes in the ring contain {slot}")
    return text


def _scale(kind: NodeKind, table: dict[str, Any]) -> tuple[float, float, bool]:
    """Return factor, offset and gauge of a node."""
    sign = {"+x": 1.0, "-x": -1.0}.get(table.get("positive", "+x"))
    if sign is None or ("positive" in table and kind.unit not in ("m", "N")):
        raise DescriptionError(f"positive = {table.get('positive')!r}", rule='"+x" or "-x", for positions and forces')
    if "unit" not in table:
        return sign, 0.0, False
    unit = column_unit(table["unit"], kind.unit)
    return (1.0 if kind.unit == "Pa" else sign) * unit.factor, unit.shift, bool(unit.gauge)
