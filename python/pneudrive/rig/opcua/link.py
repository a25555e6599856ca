"""Connection to the nodes of a map: values in SI by name, and a heartbeat, in one thread."""

from __future__ import annotations

import asyncio
import logging
import threading
from collections.abc import Callable, Coroutine
from contextlib import suppress
from dataclasses import dataclass, replace
from time import monotonic, time
from typing import Any, TypeVar

from asyncua.client.client import Client

from pneudrive.errors import RigError
from pneudrive.rig.opcua.access import OpcUaFile, ua
from pneudrive.rig.opcua.nodes import IN_RING, Node, NodeMap

Answer = TypeVar("Answer")
COUNTER = 2**31 - 1  # counters wrap below this, which fits a signed integer of a PLC
BEATS = 4  # heartbeats sent in each heartbeat time
NODES_A_REQUEST = 64  # nodes in one request; small PLCs support this
#: Smallest time-out of an answer, s: a server on a busy machine may need this time. A closed connection is detected at
#: once.
LEAST_TIMEOUT_S = 5.0
CLOSING_S = 2.0
# Words in the status codes of a server that rejects the client: trying again does not help.
REFUSALS = ("ertificate", "Identity", "UserAccess", "Security", "Signature", "No matching endpoints", "Nonce")


def quieten() -> None:
    """Silence the logging of asyncua unless its level is set, because errors of this module report the problems."""
    for noisy in ("asyncua", "asyncuagds"):
        if logging.getLogger(noisy).level == logging.NOTSET:
            logging.getLogger(noisy).setLevel(logging.CRITICAL)


class LinkError(ConnectionError):
    """The connection is lost."""


@dataclass(frozen=True)
class ServedNode:
    """Node on the connected server: id (or one for each slot), type, and length of an array (0: any)."""

    node: Node
    ids: tuple[Any, ...]
    type: Any
    length: int = 0

    def to_raw(self, value: Any, ambient_pa: float) -> Any:  # noqa: ANN401
        """Convert a value in SI to a raw value, as an OPC UA variant. An array is padded to its length."""
        raw = self.node.from_si(value, ambient_pa)
        if self.node.kind.array and self.length:
            raw = [*raw, *[type(raw[0])(0) if raw else 0] * (self.length - len(raw))]
        return ua.Variant(raw, self.type)


class LoopThread:
    """Event loop in a separate thread."""

    def __init__(self) -> None:
        self.loop = asyncio.new_event_loop()
        self.thread = threading.Thread(target=self.loop.run_forever, name="opc-ua", daemon=True)
        self.thread.start()

    def run(self, work: Coroutine[Any, Any, Answer], timeout_s: float | None = None) -> Answer:
        """Run a coroutine in the loop and wait for its result. An interruption cancels the coroutine."""
        future = asyncio.run_coroutine_threadsafe(work, self.loop)
        try:
            return future.result(timeout_s)
        except BaseException:
            future.cancel()
            raise

    def close(self) -> None:
        """End the thread and the coroutines that still run in it."""
        if self.loop.is_closed():
            return

        async def end() -> None:
            tasks = [task for task in asyncio.all_tasks() if task is not asyncio.current_task()]
            for task in tasks:
                task.cancel()
            await asyncio.gather(*tasks, return_exceptions=True)

        self.run(end(), CLOSING_S)
        self.loop.call_soon_threadsafe(self.loop.stop)
        self.thread.join(CLOSING_S)
        self.loop.close()


class Link:
    """Connection to a server. After a loss, `connect` opens a new connection.

    Parameters
    ----------
    file : OpcUaFile
        Address and credentials.
    nodes : NodeMap
    """

    def __init__(self, file: OpcUaFile, nodes: NodeMap) -> None:
        quieten()
        self.file, self.url, self.nodes = file, file.url, nodes
        self.ambient_pa = 0.0
        self.timeout_s = max(2.0 * nodes.handshake.heartbeat_s, LEAST_TIMEOUT_S)
        self.served: dict[str, ServedNode] = {}
        self.lost: str | None = "there is no connection yet"
        self.number = 0  # number of the connection
        self._loop = LoopThread()
        self._client: Any = None
        self._heart: asyncio.Task[None] | None = None
        self._stops = 0

    def connect(self) -> None:
        """Connect and find the nodes.

        Raises
        ------
        LinkError
            The server does not answer.
        RigError
            The server rejects the client, or does not have a node.
        """
        self._loop.run(self._connect())

    def beat(self) -> None:
        """Start the heartbeat if it is not running. A client that only reads does not need a heartbeat."""
        if self._heart is None:
            self._loop.run(self._start_heart())

    def check_stops(self, stops: int) -> None:
        """Treat the connection as lost if the server has stopped the axis since the connection began."""
        if self._heart is not None and stops != self._stops:
            self.lost = self.lost or "the server missed the heartbeat and stopped the axis"
            raise LinkError(self.lost)

    def close(self) -> None:
        """Close the connection and end the thread."""
        try:
            with suppress(LinkError, TimeoutError, asyncio.TimeoutError):
                self._loop.run(self._leave(), CLOSING_S)
        finally:
            self.lost = "the connection is closed"
            self._loop.close()

    def read(self, *names: str, slot: int = 0) -> list[Any]:
        """Read nodes in one request, in SI; arrays become ndarray."""
        return self._loop.run(self._read(names, slot))

    def write(self, values: dict[str, Any]) -> None:
        """Write values in SI to nodes, in one request."""
        self._loop.run(self._write(values))

    async def _connect(self) -> None:
        await self._leave()
        self._client = await self._log_in()
        self.number += 1
        self.lost = None
        try:
            await self._find_nodes()
        except BaseException:
            await self._leave()
            raise

    async def _log_in(self) -> Any:  # noqa: ANN401 - asyncua's client
        client = Client(self.url, timeout=self.timeout_s, watchdog_intervall=self.nodes.handshake.heartbeat_s)
        client.name = client.description = "pneudrive"
        try:
            await self.file.secure(client)
            await client.connect()
        except ua.UaError as error:
            await _hang_up(client)
            name = type(error).__name__
            if any(word in name + str(error) for word in REFUSALS):
                raise RigError.of("rig.rejected", where=self.url, reason=_reason(error)) from None
            raise LinkError(_reason(error)) from None
        except (OSError, TimeoutError, asyncio.TimeoutError) as error:
            await _hang_up(client)
            waited = isinstance(error, (TimeoutError, asyncio.TimeoutError))
            hint = " (a server is silent, or closes the connection, if server_certificate is not its certificate)"
            if self.file.certificate is None or (getattr(error, "errno", None) and not waited):  # no server at all
                hint = ""
            raise LinkError(f"{_reason(error)}{hint}") from None
        return client

    async def _leave(self) -> None:
        heart, client = self._heart, self._client
        self._heart = self._client = None
        if heart is not None:
            heart.cancel()
            await asyncio.gather(heart, return_exceptions=True)
        if client is not None:
            await _hang_up(client)

    async def _find_nodes(self) -> None:
        """Read the type of each node, and the length of each array."""
        uris = await self._request(lambda client: client.get_namespace_array())
        for name, node in self.nodes.nodes.items():
            ids = tuple(_node_id(text, self.nodes.namespace, uris, self.url) for text in self.nodes.node_ids(name))
            self.served[name] = ServedNode(node, ids, ua.VariantType[node.type])
        every = [(name, node_id) for name, node in self.served.items() for node_id in node.ids]
        for start in range(0, len(every), NODES_A_REQUEST):
            part = every[start : start + NODES_A_REQUEST]
            for (name, _), variant in zip(part, await self._values(part), strict=True):
                if variant.VariantType is not ua.VariantType.Null:
                    length = len(variant.Value) if isinstance(variant.Value, list) else 0
                    self.served[name] = replace(self.served[name], type=variant.VariantType, length=length)

    async def _start_heart(self) -> None:
        (self._stops,) = await self._read(("heartbeat.stops",))
        beat = int(time()) % COUNTER
        await self._write({"heartbeat.client": beat})
        self._heart = asyncio.create_task(self._beat(self._client, beat))

    async def _beat(self, client: Any, beat: int) -> None:  # noqa: ANN401 - asyncua's client
        """Increment the client's heartbeat and monitor the server's."""
        seen, since = None, monotonic()
        try:
            while True:
                await asyncio.sleep(self.nodes.handshake.heartbeat_s / BEATS)
                beat = (beat + 1) % COUNTER
                await self._write({"heartbeat.client": beat})
                theirs, stops = await self._read(("heartbeat.server", "heartbeat.stops"))
                self.check_stops(stops)
                now = monotonic()
                if theirs != seen:
                    seen, since = theirs, now
                elif now - since > 2.0 * self.nodes.handshake.heartbeat_s:
                    raise LinkError("the server's heartbeat has stopped")
        except (LinkError, RigError) as error:
            if self._client is client:
                self.lost = self.lost or str(error)
                await _hang_up(client)

    async def _read(self, names: tuple[str, ...], slot: int = 0) -> list[Any]:
        nodes = [self.served[name] for name in names]
        asked = [
            (name, node.ids[slot if name in IN_RING else 0])
            for name, node in zip(names, nodes, strict=True)
            if node.ids  # otherwise a constant
        ]
        raw = iter(await self._values(asked) if asked else [])
        return [node.node.to_si(next(raw).Value, self.ambient_pa) if node.ids else node.node.constant for node in nodes]

    async def _values(self, asked: list[tuple[str, Any]]) -> list[Any]:
        """Return the raw values of nodes, given by name and id."""
        ids = [node_id for _, node_id in asked]
        read = await self._request(lambda client: client.uaclient.read_attributes(ids, ua.AttributeIds.Value))
        self._check(asked, [value.StatusCode for value in read])
        return [value.Value for value in read]

    async def _write(self, values: dict[str, Any]) -> None:
        ids = [self.served[name].ids[0] for name in values]
        raw = [self.served[name].to_raw(value, self.ambient_pa) for name, value in values.items()]
        data = [ua.DataValue(value, StatusCode=None) for value in raw]  # PLCs reject writing of status or time stamp
        results = await self._request(lambda client: client.uaclient.write_attributes(ids, data, ua.AttributeIds.Value))
        self._check(list(zip(values, ids, strict=True)), results)

    async def _request(self, request: Callable[[Any], Coroutine[Any, Any, Answer]]) -> Answer:
        """Send a request; any loss of the connection becomes a LinkError."""
        if self.lost is not None or self._client is None:  # None: another thread is connecting again
            raise LinkError(self.lost or "the connection is closed")
        try:
            return await request(self._client)
        except (OSError, TimeoutError, asyncio.TimeoutError, ua.UaError) as error:
            self.lost = self.lost or _reason(error)
            raise LinkError(self.lost) from None

    def _check(self, asked: list[tuple[str, Any]], statuses: list[Any]) -> None:
        for (name, node_id), status in zip(asked, statuses, strict=True):
            if status is not None and not status.is_good():
                raise RigError.of("rig.node", where=self.url, name=name, id=node_id.to_string(), status=status)


def _node_id(text: str, namespace: str, uris: list[str], url: str) -> Any:  # noqa: ANN401 - asyncua's node id
    if not text.startswith("ns="):
        if namespace not in uris:
            raise RigError.of("rig.namespace", where=url, value=", ".join(uris), namespace=namespace)
        text = f"ns={uris.index(namespace)};{text}"
    try:
        return ua.NodeId.from_string(text)
    except ua.UaError as error:
        raise RigError(f"{text} is not a node id: {error}") from None


async def _hang_up(client: Any) -> None:  # noqa: ANN401 - asyncua's client
    """Close a connection. If the server still answers, close it as the protocol requires."""
    transport = getattr(client.uaclient.protocol, "transport", None)
    with suppress(Exception):  # any exception of a half-closed connection is ignored
        await asyncio.wait_for(client.disconnect(), CLOSING_S / 2)
    with suppress(Exception):
        client.disconnect_socket()
    if transport is not None:
        transport.abort()  # do not wait for unsent data


def _reason(error: BaseException) -> str:
    """Return the reason of an error in one line, without the name of the status that asyncua repeats at the end."""
    name = type(error).__name__
    text = str(error).replace(f"({name})", "").strip()
    return f"{name}: {text}" if text else name
