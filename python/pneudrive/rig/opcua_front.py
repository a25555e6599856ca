"""The front of a served rig: few connections, short requests, everyone has a turn, and a session is one client.

asyncua reads and writes OPC UA; here stands whom it serves, and when. Who has used the server least comes next, so that
a request to stop waits for one other request at most, whatever others send. Who has no session is gone after seconds;
where there are too many, the oldest of the address that has most goes. A session ends with its connection: it cannot
be taken over on another one.
"""

from __future__ import annotations

import asyncio
import logging
import math
import time
from collections import Counter, deque
from typing import TYPE_CHECKING, Any, Protocol

from asyncua.common.connection import TransportLimits
from asyncua.common.utils import Buffer, ServiceError
from asyncua.crypto.security_policies import SecurityPolicyNone
from asyncua.server.internal_session import InternalSession, SessionState
from asyncua.server.uaprocessor import UaProcessor
from asyncua.ua.ua_binary import header_from_binary, struct_from_binary

from pneudrive.rig.opcua_access import opcua

if TYPE_CHECKING:
    from collections.abc import Awaitable, Callable, Iterable

    from pneudrive.rig.opcua_access import Protection

ua: Any = opcua("asyncua.ua")
log = logging.getLogger(__name__)
MOST_WAITING, MOST_WAITING_OF_ADDRESS = 32, 16  # connections without a session
MOST_SESSIONS = 32
AT_ONCE = 2  # connections that are taken in between two requests
SESSION_S = 5.0  # within which a connection has a session
SESSION_TIMEOUT_S = 60.0  # a session that asks for nothing
STUCK_S = 10.0  # a client that does not read what it asked for
LOOK_S = 0.5
FORGET_S = 1.0  # what was used is forgotten with this time constant
NEWCOMER_S = 0.02  # counts as used by who has just come: those who are there come first
COMMANDS_COUNT = 0.25
HANDSHAKE = 4  # greeting, channel, session, its activation
LARGEST_CHUNK, SMALLEST_CHUNK = 65535, 8192  # as OPC UA has them
LARGEST_REQUEST = 8192  # but for writing
MOST_WRITTEN = 256  # nodes in one request
QUEUED = 8  # requests of one connection that are read ahead
BUFFERED = 1 << 20  # bytes of answers that wait to be sent
MOST_SUBSCRIPTIONS, MOST_ITEMS = 2, 50  # of a session
FASTEST_MS, SLOWEST_MS = 250.0, 60_000.0  # of a subscription
#: What may be asked for without a session, and within one; asyncua could do more.
OPENING = ("GetEndpoints", "FindServers", "CreateSession", "ActivateSession", "CloseSession", "CloseSecureChannel")
SERVICES = (
    "Read", "Write", "Browse", "TranslateBrowsePathsToNodeIds", "RegisterNodes", "UnregisterNodes",
    "CreateSubscription", "ModifySubscription", "DeleteSubscriptions", "SetPublishingMode", "Publish", "Republish",
    "CreateMonitoredItems", "ModifyMonitoredItems", "DeleteMonitoredItems", "SetMonitoringMode",
)  # fmt: skip


class Client:
    """One session, as the rig's server sees it.

    Attributes
    ----------
    values : dict
        Name of a node -> value that this client has written, or that was written for it alone.
    beat_at : float or None
        When its heartbeat last counted up.
    dismissed : str
        Why it may not command any more.
    identity : int
        Of its last command.
    """

    def __init__(self, session: Any) -> None:  # noqa: ANN401 - asyncua's
        self._session, self.began = session, time.monotonic()
        self.values: dict[str, Any] = {}
        self.beat_at: float | None = None
        self.dismissed = ""
        self.identity = 0

    def __str__(self) -> str:
        """Say who it is."""
        user, place = getattr(self._session.user, "name", None), self._session.name
        address = ":".join(str(part) for part in place[:2]) if isinstance(place, tuple) else str(place)
        return f"{user} at {address}" if user else f"the client at {address}"


class Served(Protocol):
    """What is behind the front."""

    def name_of(self, node_id: Any) -> str | None:  # noqa: ANN401 - asyncua's node id
        """Name a node that each client has for itself; None for any other."""
        ...

    def read(self, client: Client, name: str, value: Any) -> Any:  # noqa: ANN401 - asyncua's value
        """Give what a client reads of such a node, which has this value for others."""
        ...

    async def written(self, client: Client, name: str, value: Any) -> Any:  # noqa: ANN401 - asyncua's value and status
        """Take what a client has written."""
        ...

    def left(self, client: Client) -> None:
        """Take note that a session has ended."""
        ...

    def commands(self, client: Client) -> bool:
        """Tell whether it is the one that commands."""
        ...


class Front:
    """Connections of a server, served in turn.

    Parameters
    ----------
    server : asyncua.Server
        With its nodes, not started.
    served : Served
    protection : Protection
    largest_write : int
        Bytes of a request to write.
    """

    def __init__(self, server: Any, served: Served, protection: Protection, largest_write: int) -> None:  # noqa: ANN401
        self.server, self.served, self.protection = server, served, protection
        self.largest_write = largest_write
        self.connections: dict[Connection, None] = {}  # in the order in which they came
        self.login = asyncio.Lock()  # one password is looked at at a time
        self._wake = asyncio.Event()
        self._listening: asyncio.Server | None = None
        self._tasks: set[asyncio.Task[Any]] = set()

    async def start(self, host: str, port: int) -> int:
        """Listen; return the port."""
        internal = self.server.iserver
        internal.max_session_timeout_ms = 1e3 * SESSION_TIMEOUT_S
        internal.max_monitored_item_queue_size = 100
        internal.max_unacked_messages_per_subscription = 100
        internal.max_subscriptions = MOST_SESSIONS * MOST_SUBSCRIPTIONS
        internal.create_session = lambda name, **_: Session(self, name)
        await self.server._setup_server_nodes()
        await internal.start()
        loop = asyncio.get_running_loop()
        self._listening = await loop.create_server(lambda: Connection(self), host, port, backlog=AT_ONCE)
        for listening in self._listening.sockets:  # asyncio takes so many between two requests; the system keeps more
            listening._sock.listen(MOST_WAITING)  # type: ignore[attr-defined] - asyncio's guard around a socket
        for work in (self._serve(), self._look()):
            self.background(work)
        return self._listening.sockets[0].getsockname()[1]

    async def stop(self) -> None:
        """Hang up."""
        if self._listening is not None:
            self._listening.close()
        for connection in list(self.connections):
            connection.drop()
        for task in list(self._tasks):
            task.cancel()
        await self.server.iserver.stop()

    def background(self, work: Any) -> None:  # noqa: ANN401 - a coroutine
        """Do it beside all else."""
        task = asyncio.create_task(work)
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)

    def come(self, new: Connection) -> None:
        """Take a connection in; where there are too many without a session, another one goes."""
        waiting = [c for c in self.connections if not c.session]
        if len([c for c in waiting if c.address == new.address]) >= MOST_WAITING_OF_ADDRESS:
            _drop_one(c for c in waiting if c.address == new.address)
        elif len(waiting) >= MOST_WAITING:
            _drop_one(waiting)
        self.connections[new] = None

    def activated(self, new: Connection) -> None:
        """Take note of a session; where there are too many, another one goes, never the one that commands."""
        others = [
            c for c in self.connections if c.session and c is not new and not self.served.commands(c.session.client)
        ]
        if len(others) >= MOST_SESSIONS:
            _drop_one(others)

    def wake(self) -> None:
        """Say that there is something to do."""
        self._wake.set()

    async def _serve(self) -> None:
        """Serve one request after the other: of who has used least."""
        while True:
            ready = [c for c in self.connections if c.queue and not c.waits]
            if not ready:
                self._wake.clear()
                await self._wake.wait()
                continue
            now = time.monotonic()
            await min(ready, key=lambda c: self._claim(c, now)).serve()
            await asyncio.sleep(0)  # what has come meanwhile is read, clocks go on

    def _claim(self, connection: Connection, now: float) -> float:
        """Seconds used; those of who commands count less, for its heartbeat must not wait for others."""
        session = connection.session
        return connection.used(now) * (COMMANDS_COUNT if session and self.served.commands(session.client) else 1.0)

    async def _look(self) -> None:
        """Hang up on who has no session in time, and on who does not read."""
        while True:
            await asyncio.sleep(LOOK_S)
            now = time.monotonic()
            for connection in list(self.connections):
                if connection.session:
                    connection.since = now
                if now - connection.since > SESSION_S or now - (connection.stuck_at or now) > STUCK_S:
                    connection.drop()


def _drop_one(connections: Iterable[Connection]) -> None:
    """Hang up on the one of the address that has most that has come least far, and of those on the oldest."""
    those = list(connections)
    address, _ = Counter(c.address for c in those).most_common(1)[0]
    min((c for c in those if c.address == address), key=lambda c: c.steps).drop()


class Connection(asyncio.Protocol):
    """One connection: cuts what comes into chunks, and lets them be served in turn."""

    def __init__(self, front: Front) -> None:
        self.front = front
        self.address = ""
        self.queue: deque[bytes] = deque()
        self.since = time.monotonic()  # without a session
        self.steps = 0  # of the handshake, that were good
        self.stuck_at: float | None = None
        self._data = bytearray()
        self._size = 0  # of the request of which chunks have come
        self._busy = self._paused = False
        self._used, self._used_at = NEWCOMER_S, self.since
        self._transport: Any = None
        self._processor: Any = None

    @property
    def session(self) -> Any:  # noqa: ANN401 - a session of ours
        """Its session, where it is activated."""
        session = self._processor and self._processor.session
        return session if session is not None and session.is_activated() else None

    @property
    def waits(self) -> bool:
        """Whether nothing of it can be served now."""
        return self._busy or self.stuck_at is not None

    def used(self, now: float) -> float:
        """Seconds of the server that it has used of late."""
        return self._used * math.exp((self._used_at - now) / FORGET_S)

    def connection_made(self, transport: Any) -> None:  # noqa: ANN401
        """Begin."""
        self._transport = transport
        transport.set_write_buffer_limits(BUFFERED)
        self.address = str((transport.get_extra_info("peername") or ("",))[0])
        self.front.come(self)

    def connection_lost(self, exc: Exception | None) -> None:
        """End."""
        self.front.connections.pop(self, None)
        self.queue.clear()
        if self._processor is not None:
            self.front.background(self._processor.close())

    def drop(self) -> None:
        """Hang up now, whatever is still to be sent."""
        self.front.connections.pop(self, None)
        self.queue.clear()
        self._transport.abort()

    def data_received(self, data: bytes) -> None:
        """Cut chunks; what is none ends the connection."""
        self._data += data
        at = 0
        while len(self._data) - at >= 8:
            size = int.from_bytes(self._data[at + 4 : at + 8], "little")
            kind = bytes(self._data[at : at + 3])
            if kind not in (b"HEL", b"OPN", b"MSG", b"CLO") or not 8 < size <= LARGEST_CHUNK:
                self.drop()
                return
            if len(self._data) - at < size:
                break
            self.queue.append(bytes(self._data[at : at + size]))
            at += size
        del self._data[:at]
        if len(self.queue) >= QUEUED and not self._paused:
            self._paused = True
            self._transport.pause_reading()
        self.front.wake()

    def pause_writing(self) -> None:
        """Take note that the client does not read."""
        self.stuck_at = time.monotonic()

    def resume_writing(self) -> None:
        """Take note that it does again."""
        self.stuck_at = None
        self.front.wake()

    async def serve(self) -> None:
        """Serve the next chunk; an error in it ends the connection."""
        chunk = self.queue.popleft()
        if self._paused and len(self.queue) < QUEUED // 2:
            self._paused = False
            self._transport.resume_reading()
        began = time.monotonic()
        if self._processor is None:
            self._processor = Processor(self, self._transport)
        try:
            self._size = self._size + len(chunk) if chunk[:3] == b"MSG" else 0
            good = self._size <= self.front.largest_write and await self._process(chunk)
            if chunk[3:4] != b"C":  # another chunk of the same request follows
                self._size = 0
        except Exception as error:  # whatever a library raises about bytes that are no request
            log.debug("a request that is none: %s", error)
            good = False
        now = time.monotonic()
        self._used, self._used_at = self.used(now) + now - began, now
        self.steps = min(self.steps + 1, HANDSHAKE)
        if not good:
            self._transport.close()

    async def _process(self, chunk: bytes) -> bool:
        data = Buffer(chunk)
        return bool(await self._processor.process(header_from_binary(data), data))

    def beside(self, work: Callable[[], Awaitable[bool]]) -> None:
        """Do what waits for something else beside all else, and nothing more of this connection until then."""
        self._busy = True

        async def do() -> None:
            try:
                if not await work():
                    self._transport.close()
            except Exception as error:
                log.debug("a login that is none: %s", error)
                self._transport.close()
            finally:
                self._busy = False
                self.front.wake()

        self.front.background(do())


SERVICE: dict[Any, str] = {
    ua.NodeId(getattr(ua.ObjectIds, f"{name}Request_Encoding_DefaultBinary")): name for name in (*OPENING, *SERVICES)
}
CODES = ua.StatusCodes


class Limits(TransportLimits):
    """What both sides take; who takes less than OPC UA asks for would have every answer cut into crumbs."""

    def create_acknowledge_and_set_limits(self, msg: Any) -> Any:  # noqa: ANN401
        """Answer a greeting."""
        if msg.ReceiveBufferSize < SMALLEST_CHUNK:
            raise ua.UaStatusCodeError(CODES.BadConnectionRejected)
        return super().create_acknowledge_and_set_limits(msg)


class Processor(UaProcessor):
    """Answers the requests of a connection: those that a rig needs, within bounds, one session."""

    def __init__(self, connection: Connection, transport: Any) -> None:  # noqa: ANN401
        super().__init__(connection.front.server.iserver, transport, Limits())
        self.connection, self.front = connection, connection.front
        self.set_policies(self.front.server._policies)

    async def _process_message(self, typeid: Any, requesthdr: Any, seqhdr: Any, body: Any) -> bool:  # noqa: ANN401
        service = SERVICE.get(typeid)
        if service is None:
            raise ServiceError(CODES.BadServiceUnsupported)
        if not self._connection.is_open():
            return False
        if service not in ("GetEndpoints", "FindServers", "CloseSecureChannel"):
            encrypted = not isinstance(self._connection.security_policy, SecurityPolicyNone)
            if self.front.protection.certificate is not None and not encrypted:
                raise ServiceError(CODES.BadSecurityModeInsufficient)
            if (self.session is None) != (service == "CreateSession"):
                raise ServiceError(CODES.BadSessionIdInvalid)
        if service == "Write":
            if int.from_bytes(body.copy(4).read(4), "little") > MOST_WRITTEN:
                raise ServiceError(CODES.BadTooManyOperations)
        elif service in SERVICES and len(body) > LARGEST_REQUEST:
            raise ServiceError(CODES.BadRequestTooLarge)
        if service == "ActivateSession":
            self.connection.beside(lambda: self._log_in(typeid, requesthdr, seqhdr, body))
            return True
        return bool(await super()._process_message(typeid, requesthdr, seqhdr, body))

    async def _log_in(self, typeid: Any, requesthdr: Any, seqhdr: Any, body: Any) -> bool:  # noqa: ANN401
        """Hash the password, which takes its time, in a thread; hang up on who may not come in."""
        try:
            token = struct_from_binary(ua.ActivateSessionParameters, body.copy()).UserIdentityToken
            if isinstance(token, ua.UserNameIdentityToken):
                user, password = self.iserver.decrypt_user_token(self.session, token)
                async with self.front.login:
                    await asyncio.to_thread(self.front.protection.hash_ahead, user, password)
            good = bool(await super()._process_message(typeid, requesthdr, seqhdr, body))
        except Exception as error:  # whatever a library raises about what somebody has sent
            response = ua.ServiceFault()
            code = getattr(error, "code", CODES.BadIdentityTokenInvalid)
            response.ResponseHeader.ServiceResult = ua.StatusCode(code)
            self.send_response(requesthdr.RequestHandle, seqhdr, response)
            return False
        self.front.activated(self.connection)
        return good

    def _should_close_session_on_transport_loss(self) -> bool:
        return True


class Session(InternalSession):
    """A session has its own commands and answers, and touches no subscription of another one."""

    def __init__(self, front: Front, name: Any) -> None:  # noqa: ANN401
        internal = front.server.iserver
        super().__init__(internal, internal.aspace, internal.subscription_service, name, external=True)
        self.served = front.served
        self.client = Client(self)

    def _mine(self, *ids: int) -> list[Any]:
        """Give its subscriptions, or those of these ids, which must be its own."""
        known = self.subscription_service.subscriptions
        mine = {i: sub for i, sub in known.items() if sub.session_id == self.session_id}
        if any(i not in mine for i in ids):
            raise ServiceError(CODES.BadSubscriptionIdInvalid)
        return list(mine.values())

    def _name_of(self, asked: Any) -> str | None:  # noqa: ANN401
        return self.served.name_of(asked.NodeId) if asked.AttributeId == ua.AttributeIds.Value else None

    async def read(self, params: Any) -> list[Any]:  # noqa: ANN401
        """Read: of the nodes that each client has for itself, its own."""
        results = self.iserver.attribute_service.read(params)
        names = [self._name_of(asked) for asked in params.NodesToRead]
        both = zip(names, results, strict=True)
        return [self.served.read(self.client, name, result) if name else result for name, result in both]

    async def write(self, params: Any) -> list[Any]:  # noqa: ANN401
        """Write what a client of a rig is to write, and nothing else."""
        results = []
        for asked in params.NodesToWrite:
            name, refused = self._name_of(asked), ua.StatusCode(CODES.BadUserAccessDenied)
            results.append(await self.served.written(self.client, name, asked.Value) if name else refused)
        return results

    async def close_session(self, delete_subs: bool = True) -> None:
        """End."""
        gone = self.state is SessionState.Closed
        await super().close_session(delete_subs=True)
        if not gone:
            self.served.left(self.client)

    async def create_subscription(self, params: Any, callback: Any, request_callback: Any = None) -> Any:  # noqa: ANN401
        """Subscribe, not too fast, not too often."""
        if len(self._mine()) >= MOST_SUBSCRIPTIONS:
            raise ServiceError(CODES.BadTooManySubscriptions)
        asked = params.RequestedPublishingInterval
        params.RequestedPublishingInterval = min(max(asked, FASTEST_MS), SLOWEST_MS) if math.isfinite(asked) else 1e3
        return await super().create_subscription(params, callback, request_callback)

    async def create_monitored_items(self, params: Any) -> list[Any]:  # noqa: ANN401
        """Watch nodes, not too many."""
        watched = sum(len(sub.monitored_item_srv._monitored_items) for sub in self._mine(params.SubscriptionId))
        if watched + len(params.ItemsToCreate) > MOST_ITEMS:
            raise ServiceError(CODES.BadTooManyMonitoredItems)
        return await super().create_monitored_items(params)

    async def modify_monitored_items(self, params: Any) -> list[Any]:  # noqa: ANN401
        """Change what is watched: nothing of it can be changed here."""
        self._mine(params.SubscriptionId)
        raise ServiceError(CODES.BadServiceUnsupported)

    async def delete_monitored_items(self, params: Any) -> list[Any]:  # noqa: ANN401
        """Watch less."""
        self._mine(params.SubscriptionId)
        return await super().delete_monitored_items(params)

    async def set_monitoring_mode(self, params: Any) -> list[Any]:  # noqa: ANN401
        """Watch or not."""
        self._mine(params.SubscriptionId)
        return await super().set_monitoring_mode(params)

    async def set_publishing_mode(self, params: Any) -> list[Any]:  # noqa: ANN401
        """Publish or not."""
        self._mine(*params.SubscriptionIds)
        return await super().set_publishing_mode(params)

    async def delete_subscriptions(self, ids: list[int]) -> list[Any]:
        """Subscribe no more."""
        self._mine(*ids)
        return await super().delete_subscriptions(ids)

    def modify_subscription(self, params: Any) -> Any:  # noqa: ANN401
        """Change a subscription."""
        self._mine(params.SubscriptionId)
        return super().modify_subscription(params)

    def republish(self, params: Any) -> Any:  # noqa: ANN401
        """Send again what was sent."""
        self._mine(params.SubscriptionId)
        return super().republish(params)

    def publish(self, acks: Any = None) -> Any:  # noqa: ANN401
        """Ask for what is new."""
        known = self.subscription_service.subscriptions
        self._mine(*(ack.SubscriptionId for ack in acks or () if ack.SubscriptionId in known))
        return super().publish(acks)
