"""Connection to the nodes of a map: values in SI by name, and a heartbeat, in one thread."""

from __future__ import annotations

import asyncio
import contextlib
import logging
import threading
import time
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np
from asyncua.client.client import Client
from asyncua.common.connection import TransportLimits
from asyncua.common.utils import ServiceError
from asyncua.server.internal_session import InternalSession

from pneudrive.errors import RigError
from pneudrive.rig.opcua.access import Access, secure, ua
from pneudrive.rig.opcua.nodes import IN_RING, Node, NodeMap

if TYPE_CHECKING:
    from collections.abc import Coroutine


Answer = TypeVar("Answer")
COUNTER = 2**31 - 1  # counters wrap below this, which fits a signed integer of a PLC
BEATS = 4  # heartbeats sent in each heartbeat time
NODES_A_REQUEST = 64  # nodes in one request; small PLCs support this
#: s; a server on a busy machine may need this long for an answer; a closed connection is noticed at once.
LEAST_TIMEOUT_S = 5.0
CLOSING_S = 2.0
# Words in the status codes of a server that rejects the client: trying again does not help.
REFUSALS = ("ertificate", "Identity", "UserAccess", "Security", "Signature", "No matching endpoints", "Nonce")


def quieten() -> None:
    """Silence the logging of asyncua unless its level is set: errors of this module report the problems."""
    for noisy in ("asyncua", "asyncuagds"):
        if logging.getLogger(noisy).level == logging.NOTSET:
            logging.getLogger(noisy).setLevel(logging.CRITICAL)


class LinkError(ConnectionError):
    """The connection is lost."""


class HungUpError(LinkError):
    """The server closed the connection; it may have too many connections."""


@dataclass(frozen=True)
class ServedNode:
    """Node on this server: ids (one, or one for each slot), type, length of an array (0: any)."""

    node: Node
    ids: tuple[Any, ...]
    type: Any
    length: int


class LoopThread:
    """Event loop in a separate thread."""

    def __init__(self) -> None:
        self.loop = asyncio.new_event_loop()
        self.thread = threading.Thread(target=self.loop.run_forever, name="opc-ua", daemon=True)
        self.thread.start()

    def run(self, work: Coroutine[Any, Any, Answer], timeout_s: float | None = None) -> Answer:
        """Run a coroutine in the loop and wait for its result; an interruption cancels it."""
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
    """Connection to a server; after a loss, `connect` opens another one.

    Parameters
    ----------
    url : str
        Address such as ``opc.tcp://127.0.0.1:4840``.
    nodes : NodeMap
    access : Access
    """

    def __init__(self, url: str, nodes: NodeMap, access: Access) -> None:
        quieten()
        self.url, self.nodes, self.access = url, nodes, access
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
            The server rejects the client, or lacks a node.
        """
        self._loop.run(self._connect())

    def beat(self) -> None:
        """Start the heartbeat if it is not running; a client that only reads needs no heartbeat."""
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
            self._loop.run(self._leave(), CLOSING_S)
        except (LinkError, TimeoutError, asyncio.TimeoutError):
            pass
        finally:
            self.lost = "the connection is closed"
            self._loop.close()

    def read(self, *names: str, slot: int = 0) -> list[Any]:
        """Read nodes in one request, in SI; arrays become ndarray."""
        return self._loop.run(self._read(names, slot))

    def write(self, values: dict[str, Any]) -> None:
        """Write nodes in one request, SI."""
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
            await secure(client, self.access)
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
            hung_up = not waited and not getattr(error, "errno", None)  # the server did answer
            says = " (a server is silent, or closes the connection, if server_certificate is not its certificate)"
            hint = says if (waited or hung_up) and self.access.certificate is not None else ""
            raise (HungUpError if hung_up else LinkError)(f"{_reason(error)}{hint}") from None
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
        """Read the type of each node, and the length of an array."""
        uris = await self._request(self._client.get_namespace_array())
        ids = {
            name: tuple(_node_id(text, self.nodes.namespace, uris, self.url) for text in self.nodes.node_ids(name))
            for name in self.nodes.nodes
        }
        flat = [(name, node_id) for name in ids for node_id in ids[name]]
        values: dict[str, Any] = {}
        for start in range(0, len(flat), NODES_A_REQUEST):
            part = flat[start : start + NODES_A_REQUEST]
            for (name, node_id), value in zip(part, await self._values([i for _, i in part]), strict=True):
                self._good(value.StatusCode, name, node_id)
                values[name] = value.Value
        for name, node in self.nodes.nodes.items():
            variant = values.get(name)
            kind, length = ua.VariantType[node.type], 0
            if variant is not None and variant.VariantType is not ua.VariantType.Null:  # None: a constant
                kind, length = variant.VariantType, len(variant.Value) if isinstance(variant.Value, list) else 0
            self.served[name] = ServedNode(node, ids[name], kind, length)

    async def _start_heart(self) -> None:
        (self._stops,) = await self._read(("heartbeat.stops",))
        beat = int(time.time()) % COUNTER
        await self._write({"heartbeat.client": beat})
        self._heart = asyncio.create_task(self._beat(self._client, beat))

    async def _beat(self, client: Any, beat: int) -> None:  # noqa: ANN401 - asyncua's client
        """Increment the client's heartbeat and monitor the server's."""
        seen, since = None, time.monotonic()
        try:
            while True:
                await asyncio.sleep(self.nodes.handshake.heartbeat_s / BEATS)
                beat = (beat + 1) % COUNTER
                await self._write({"heartbeat.client": beat})
                theirs, stops = await self._read(("heartbeat.server", "heartbeat.stops"))
                self.check_stops(stops)
                now = time.monotonic()
                if theirs != seen:
                    seen, since = theirs, now
                elif now - since > 2.0 * self.nodes.handshake.heartbeat_s:
                    raise LinkError("the server's heartbeat has stopped")
        except (LinkError, RigError) as error:
            if self._client is client:
                self.lost = self.lost or str(error)
                await _hang_up(client)

    async def _read(self, names: tuple[str, ...], slot: int = 0) -> list[Any]:
        nodes = {name: self.served[name] for name in names}
        ids = [node.ids[slot if name in IN_RING else 0] for name, node in nodes.items() if node.ids]
        raw = iter(await self._values(ids) if ids else [])
        answers = []
        for name, served in nodes.items():
            if not served.ids:
                answers.append(served.node.constant)
                continue
            value = next(raw)
            self._good(value.StatusCode, name, served.ids[0])
            answers.append(self._to_si(served, value.Value.Value))
        return answers

    async def _values(self, ids: list[Any]) -> list[Any]:
        return await self._request(self._connected().uaclient.read_attributes(ids, ua.AttributeIds.Value))

    async def _write(self, values: dict[str, Any]) -> None:
        ids, data = [], []
        for name, value in values.items():
            served = self.served[name]
            variant = ua.Variant(self._to_raw(served, value), served.type)
            ids.append(served.ids[0])
            data.append(ua.DataValue(variant, StatusCode=None))  # PLCs reject writing of status or time stamp
        results = await self._request(self._connected().uaclient.write_attributes(ids, data, ua.AttributeIds.Value))
        for name, node_id, status in zip(values, ids, results, strict=True):
            self._good(status, name, node_id)

    def _connected(self) -> Any:  # noqa: ANN401 - asyncua's client
        if self._client is None:  # another thread is connecting again
            raise LinkError(self.lost or "the connection is closed")
        return self._client

    async def _request(self, request: Coroutine[Any, Any, Answer]) -> Answer:
        """Send a request; any loss of the connection becomes a LinkError."""
        if self.lost is not None or self._client is None:
            request.close()
            raise LinkError(self.lost or "the connection is closed")
        try:
            return await request
        except (OSError, TimeoutError, asyncio.TimeoutError, ua.UaError) as error:
            self.lost = self.lost or _reason(error)
            raise HungUpError(self.lost) from None

    def _good(self, status: Any, name: str, node_id: Any) -> None:  # noqa: ANN401 - asyncua's types
        if status is not None and not status.is_good():
            raise RigError.of("rig.node", where=self.url, name=name, id=node_id.to_string(), status=status)

    def _to_si(self, served: ServedNode, raw: Any) -> Any:  # noqa: ANN401
        kind = served.node.kind
        if kind.type == "Double":
            numbers = np.asarray(raw, dtype=np.float64) if kind.array else float(raw)
            return served.node.scale.to_si(numbers, self.ambient_pa)
        return np.asarray(raw, dtype=np.int64) if kind.array else raw

    def _to_raw(self, served: ServedNode, value: Any) -> Any:  # noqa: ANN401
        kind = served.node.kind
        if kind.type == "Double":
            value = served.node.scale.from_si(np.asarray(value, dtype=np.float64), self.ambient_pa).tolist()
        if kind.array and served.length:
            value = [*value, *[type(value[0])(0) if value else 0] * (served.length - len(value))]
        return value


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
    """Close a connection, by the protocol if the server still answers."""
    transport = getattr(client.uaclient.protocol, "transport", None)
    with contextlib.suppress(Exception):  # any exception of a half-closed connection is ignored
        await asyncio.wait_for(client.disconnect(), CLOSING_S / 2)
    with contextlib.suppress(Exception):
        client.disconnect_socket()
    if transport is not None:
        transport.abort()  # do not wait for unsent data


def _reason(error: BaseException) -> str:
    """Return the reason of an error in one line; asyncua repeats the name of a status at the end."""
    name = type(error).__name__
    text = str(error).replace(f"({name})", "").strip()
    return f"{name}: {text}" if text else name


# --- Session of the client of a served rig: it reads all nodes and writes those of commands. Nothing else is served.

CODES = ua.StatusCodes
BUFFER = 65535  # bytes of a chunk, in both directions
LARGEST_MESSAGE = 1 << 22  # bytes of a request or an answer


class ServedSession(InternalSession):
    """Session on a served rig, at most one at a time."""

    def __init__(self, internal: Any, served: Any, name: Any) -> None:  # noqa: ANN401
        super().__init__(internal, internal.aspace, internal.subscription_service, name, external=True)
        self.served = served

    def activate_session(self, params: Any, peer_certificate: Any) -> Any:  # noqa: ANN401
        """Admit the client, unless another one is served."""
        if self.is_activated() or not self.served.is_free:
            raise ServiceError(CODES.BadTooManySessions)
        result = super().activate_session(params, peer_certificate)
        self.served.enter(self)
        return result

    async def write(self, params: Any) -> list[Any]:  # noqa: ANN401
        """Write nodes that the client of a rig may write, and no others."""
        return [
            await self.served.write(request.NodeId, request.Value)
            if request.AttributeId == ua.AttributeIds.Value and self.served.session is self
            else ua.StatusCode(CODES.BadUserAccessDenied)
            for request in params.NodesToWrite
        ]

    async def create_subscription(self, *_: Any, **__: Any) -> Any:  # noqa: ANN401
        """Reject subscriptions, as a session with a subscription would outlive its connection."""
        raise ServiceError(CODES.BadServiceUnsupported)

    async def close_session(self, delete_subs: bool = True) -> None:
        """Close the session."""
        await super().close_session(delete_subs)
        self.served.leave(self)


class ServerLimits(TransportLimits):
    """Limits of messages, the same for all clients: asyncua would take those of the last one for all."""

    def create_acknowledge_and_set_limits(self, msg: Any) -> Any:  # noqa: ANN401
        """Answer the hello message of a client; a client with smaller buffers is rejected."""
        if msg.ReceiveBufferSize < BUFFER:
            raise ua.UaStatusCodeError(CODES.BadConnectionRejected)
        return TransportLimits(**vars(self)).create_acknowledge_and_set_limits(msg)
