"""Nodes of a served rig: those of the map, initial values, and conversion between SI and raw values."""

from __future__ import annotations

import json
import math
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

from pneudrive.rig.interface import Changeable, Reproducible
from pneudrive.rig.opcua.access import opcua
from pneudrive.rig.opcua.nodes import IN_RING, Node, NodeMap, Verb

if TYPE_CHECKING:
    from pneudrive.rig.interface import Rig

FAULT, STOPS = "state.fault", "heartbeat.stops"
#: Nodes with a separate value for each client, beside those that clients write.
OWN = (FAULT, STOPS, "answer.fault", "answer.done", "simulation.answer")
LONGEST_TEXT = 1 << 15
SIMULATED = {
    Verb.BEGIN_CYCLE: Reproducible,
    Verb.MEMORY: Reproducible,
    Verb.RESTORE: Reproducible,
    Verb.TRUTH: Reproducible,
    Verb.LEVELS: Changeable,
    Verb.CHANGE: Changeable,
}


class Space:
    """Nodes of a map on a server.

    Parameters
    ----------
    server : asyncua.Server
    rig : Rig
    nodes : NodeMap

    Attributes
    ----------
    places : dict
        Name of a node -> its ids: one, or one for each slot. Empty for a constant.
    names : dict
        Id -> name, of the nodes with a separate value for each client.
    """

    def __init__(self, server: Any, rig: Rig, nodes: NodeMap) -> None:  # noqa: ANN401
        self._server, self._rig, self._nodes = server, rig, nodes
        self._ambient_pa = rig.identity().ambient_pressure_pa
        self.places: dict[str, list[Any]] = {}
        self.names: dict[Any, str] = {}

    async def fill(self) -> None:
        """Add every node of the map; nodes of the client are writable."""
        ua, server = opcua("asyncua.ua"), self._server
        space = await server.register_namespace(self._nodes.namespace) if self._nodes.namespace else 0
        folder = await server.nodes.objects.add_object(max(space, 1), "Rig")
        for name, node in self._nodes.nodes.items():
            for text in self._nodes.node_ids(name):
                node_id = ua.NodeId.from_string(text if text.startswith("ns=") else f"ns={space};{text}")
                while len(await server.get_namespace_array()) <= node_id.NamespaceIndex:
                    await server.register_namespace(f"urn:pneudrive:rig:{len(await server.get_namespace_array())}")
                kind, first = ua.VariantType[node.type], self.first(name)
                label = text.rpartition("=")[2]
                variable = await folder.add_variable(node_id, label, ua.Variant(first, kind), kind)
                if node.kind.client:
                    await variable.set_writable()
                if node.kind.client or name in OWN:
                    self.names[node_id] = name
                self.places.setdefault(name, []).append(node_id)

    def first(self, name: str) -> Any:  # noqa: ANN401 - a value of the node's type
        """Return the initial value of a node."""
        node, rig = self._nodes.nodes[name], self._rig
        texts = {
            "rig.identity": lambda: json.dumps(asdict(rig.identity())),
            "rig.limits": lambda: json.dumps(asdict(rig.limits())),
            "simulation.abilities": lambda: " ".join(
                verb.name.lower() for verb, ability in SIMULATED.items() if isinstance(rig, ability)
            ),
        }
        if name in texts:
            return texts[name]()
        if node.kind.array:
            size = self._nodes.chunk if name in IN_RING else self._nodes.steps
            return [0.0 if node.kind.type == "Double" else 0] * size
        return {"Double": 0.0, "Boolean": False, "String": ""}.get(node.kind.type, 0)

    def to_si(self, name: str, raw: Any) -> Any:  # noqa: ANN401
        """Convert a raw value to SI."""
        node = self._nodes.nodes[name]
        if node.kind.type != "Double":
            return raw
        if node.kind.array:
            return [node.scale.to_si(value, self._ambient_pa) for value in raw]
        return node.scale.to_si(raw, self._ambient_pa)

    def data(self, name: str, value: Any) -> Any:  # noqa: ANN401 - asyncua's value
        """Convert a value in SI to a raw value."""
        ua, node = opcua("asyncua.ua"), self._nodes.nodes[name]
        raw = node.scale.from_si(value, self._ambient_pa) if node.kind.type == "Double" else value
        raw = raw.tolist() if hasattr(raw, "tolist") else raw
        return ua.DataValue(ua.Variant(raw, ua.VariantType[node.type]))

    async def show(self, name: str, data: Any, slot: int = 0) -> None:  # noqa: ANN401
        """Publish a value to all clients."""
        place = self.places[name][slot if name in IN_RING else 0]
        await self._server.iserver.write_attribute_value(place, data)

    def wrong(self, node: Node, value: Any) -> int | None:  # noqa: ANN401 - asyncua's value
        """Return the error status of a value that a client writes to a node; None for a valid value."""
        ua, variant = opcua("asyncua.ua"), value.Value
        if variant is None or variant.VariantType is not ua.VariantType[node.type]:
            return ua.StatusCodes.BadTypeMismatch
        content, longest = variant.Value, LONGEST_TEXT if node.kind.type == "String" else self._nodes.steps
        if content is None or isinstance(content, list) != node.kind.array:
            return ua.StatusCodes.BadTypeMismatch
        is_text = isinstance(content, str)
        numbers: Any = content if node.kind.array or is_text else [content]
        if len(numbers) > longest or variant.Dimensions not in (None, [], [len(numbers)]):
            return ua.StatusCodes.BadOutOfRange
        if not is_text and not all(math.isfinite(number) for number in numbers):
            return ua.StatusCodes.BadOutOfRange
        return None
