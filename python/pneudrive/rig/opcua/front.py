"""Front of a served rig: few connections, served in fair turns.

asyncua reads and writes OPC UA; this module decides which connection is served next. Turns alternate between
connections with a session and new ones, so that neither group blocks the other. Among those with a session, the one
that has used least processor time is next; among new ones, the one that has waited longest, unless it has used much.
So a request to stop waits for at most two other requests. A connection without a session is closed after seconds; if
there are too many, the longest idle one of the address with most connections is closed. A session ends with its
connection: it cannot move to another one.
"""

from __future__ import annotations

import asyncio
import logging
import math
import time
from collections import Counter, deque
from typing import TYPE_CHECKING, Any

from asyncua.common.connection import TransportLimits
from asyncua.common.utils import Buffer, ServiceError
from asyncua.crypto.security_policies import SecurityPolicyNone
from asyncua.server.uaprocessor import UaProcessor
from asyncua.ua.ua_binary import header_from_binary, struct_from_binary

from pneudrive.rig.opcua.access import opcua
from pneudrive.rig.opcua.requests import CODES, LARGEST_REQUEST, check_header, service_of
from pneudrive.rig.opcua.session import ServedSession, know_types

if TYPE_CHECKING:
    from collections.abc import Awaitable, Callable

    from pneudrive.rig.opcua.access import Protection
    from pneudrive.rig.opcua.session import Served

log = logging.getLogger(__name__)
ua: Any = opcua("asyncua.ua")
SMALLEST_CHUNK = 8192  # value of OPC UA
MOST_WAITING, MOST_AT_DOOR = 64, 128  # connections without a session, and those not yet accepted
MOST_ASKED = 8  # connections without a session and with pending requests, above which none is accepted
IDLE_S, AT_DOOR_S = 0.05, 0.001
MOST_SESSIONS, MOST_SUBSCRIPTIONS = 64, 64
SESSION_S = 5.0  # s; time for a connection to get a session
SESSION_TIMEOUT_S = 60.0  # s; time limit of a session without requests
STUCK_S = 10.0  # s; time limit of a client that does not read its answers
LOOK_S = 0.5
FORGET_S = 1.0  # s; time constant with which used processor time decays
NEW_S = 1.0  # s; a connection counts as new for this time
USED_S = 0.01  # s; processor time up to which new connections are served in order of arrival
COMMANDS_COUNT = 0.25
LARGEST_CHUNK = 65535  # value of OPC UA
LARGEST_OPENING = 2 * LARGEST_REQUEST  # bytes of a request without a session: certificates
QUEUED = 8  # requests of one connection read ahead
BUFFERED = 1 << 20  # bytes of unsent answers


class Front:
    """Connections of a server, served in turn.

    Parameters
    ----------
    server : asyncua.Server
        Server with its nodes, not started.
    served : Served
    protection : Protection
    largest_write : int
        Largest request to write, bytes.
    """

    def __init__(self, server: Any, served: Served, protection: Protection, largest_write: int) -> None:  # noqa: ANN401
        self.server, self.served, self.protection = server, served, protection
        self.largest_write = largest_write
        self.connections: dict[Connection, None] = {}  # in order of arrival
        self.login = asyncio.Lock()  # one password is checked at a time
        self._wake = asyncio.Event()
        self._listening: asyncio.Server | None = None
        self._tasks: set[asyncio.Task[Any]] = set()

    async def start(self, host: str, port: int) -> int:
        """Start to listen; return the port."""
        internal = self.server.iserver
        internal.max_session_timeout_ms = 1e3 * SESSION_TIMEOUT_S
        internal.max_monitored_item_queue_size = 100
        internal.max_unacked_messages_per_subscription = 100
        internal.max_subscriptions = MOST_SUBSCRIPTIONS
        internal.create_session = lambda name, **_: ServedSession(internal, self.served, name)
        await self.server._setup_server_nodes()
        know_types(internal)
        await internal.start()
        loop = asyncio.get_running_loop()
        self._listening = await loop.create_server(lambda: Connection(self), host, port, start_serving=False)
        sockets = [one._sock for one in self._listening.sockets]  # type: ignore[attr-defined] - asyncio's guard
        for one in sockets:
            one.listen(MOST_AT_DOOR)
        for work in (self._serve(), self._look(), *(self._take_in(one) for one in sockets)):
            self.background(work)
        return sockets[0].getsockname()[1]

    async def stop(self) -> None:
        """Close all connections."""
        if self._listening is not None:
            self._listening.close()
        for connection in list(self.connections):
            connection.drop()
        for task in list(self._tasks):
            task.cancel()
        await self.server.iserver.stop()

    def background(self, work: Any) -> None:  # noqa: ANN401 - a coroutine
        """Run a coroutine in the background."""
        task = asyncio.create_task(work)
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)

    async def _take_in(self, listening: Any) -> None:  # noqa: ANN401 - a socket
        """Accept connections, not faster than they are served; the others wait in the queue of the socket."""
        loop = asyncio.get_running_loop()
        while True:
            while not self._has_room():
                await asyncio.sleep(AT_DOOR_S)
            try:
                new, _ = await loop.sock_accept(listening)
                await loop.connect_accepted_socket(lambda: Connection(self), new)
            except OSError as error:  # the client is gone, or there are no file handles
                log.debug("invalid connection: %s", error)
                await asyncio.sleep(AT_DOOR_S)

    def _has_room(self) -> bool:
        """Return whether there is room for a new connection, or an idle one that can be closed."""
        comers, now = [c for c in self.connections if not c.session], time.monotonic()
        asked = sum(bool(c.queue) and not c.waits for c in comers)
        idle = len(comers) < MOST_WAITING or max(c.idle_s(now) for c in comers) >= IDLE_S
        return asked < MOST_ASKED and idle

    def come(self, new: Connection) -> None:
        """Accept a connection; if too many have no session, close the longest idle one."""
        waiting, now = [c for c in self.connections if not c.session], time.monotonic()
        if len(waiting) >= MOST_WAITING:
            _drop_one(waiting, lambda c: -c.idle_s(now))
        self.connections[new] = None

    def activated(self, new: Connection) -> None:
        """Register a session; if there are too many, close another one, but never the commander.

        The new session stays, so that it can stop the axis. Of the others, the one that has used most processor
        time, or came last, is closed: quiet observers may stay.
        """
        others = [
            c for c in self.connections if c.session and c is not new and not self.served.commands(c.session.client)
        ]
        if len(others) >= MOST_SESSIONS:
            now = time.monotonic()
            there = [c for c in others if not c.is_new(now)]
            _drop_one(there or others, lambda c: (-(c.used(now) // USED_S), -c.began) if there else c.began)

    def wake(self) -> None:
        """Signal that there is work to do."""
        self._wake.set()

    async def _serve(self) -> None:
        """Serve one request after the other, alternately of connections with a session and new ones."""
        newcomers = False
        while True:
            ready = [c for c in self.connections if c.queue and not c.waits]
            if not ready:
                self._wake.clear()
                await self._wake.wait()
                continue
            now = time.monotonic()
            newcomers = not newcomers
            those = [c for c in ready if c.is_new(now) is newcomers] or ready
            await min(those, key=lambda c: self._claim(c, now)).serve()
            await asyncio.sleep(0)  # let the loop read new data and run its timers

    def _claim(self, connection: Connection, now: float) -> float:
        """Return the seconds used; those of the commander count less, as its heartbeat must not wait."""
        session, used = connection.session, connection.used(now)
        if connection.is_new(now):
            return used // USED_S
        return used * (COMMANDS_COUNT if session and self.served.commands(session.client) else 1.0)

    async def _look(self) -> None:
        """Close connections without a session in time, and those that do not read."""
        while True:
            await asyncio.sleep(LOOK_S)
            now = time.monotonic()
            for connection in list(self.connections):
                if connection.session:
                    connection.since = now
                if now - connection.since > SESSION_S or now - (connection.stuck_at or now) > STUCK_S:
                    connection.drop()


def _drop_one(those: list[Connection], last: Callable[[Connection], Any]) -> None:
    """Close one connection of the address with most connections: the first in this order."""
    address, _ = Counter(c.address for c in those).most_common(1)[0]
    min((c for c in those if c.address == address), key=last).drop()


class Connection(asyncio.Protocol):
    """One connection: cuts received data into chunks, which are served in turn."""

    def __init__(self, front: Front) -> None:
        self.front = front
        self.address = ""
        self.queue: deque[bytes] = deque()
        self.began = self.since = time.monotonic()  # time since which it has no session
        self.stuck_at: float | None = None
        self._data = bytearray()
        self._size = 0  # of the request whose chunks are arriving
        self._busy = self._paused = False
        self._used, self._used_at = 0.0, self.began
        self._idle_since = self.began
        self._transport: Any = None
        self._processor: Any = None

    @property
    def session(self) -> Any:  # noqa: ANN401 - a ServedSession
        """Activated session of the connection, or None."""
        session = self._processor and self._processor.session
        return session if session is not None and session.is_activated() else None

    @property
    def waits(self) -> bool:
        """Whether the connection has nothing to serve now."""
        return self._busy or self.stuck_at is not None

    def used(self, now: float) -> float:
        """Processor time used recently, s."""
        return self._used * math.exp((self._used_at - now) / FORGET_S)

    def is_new(self, now: float) -> bool:
        """Whether the connection counts as new."""
        return now - self.began < NEW_S or self.session is None

    def idle_s(self, now: float) -> float:
        """Time since its last request, s."""
        return 0.0 if self.queue or self._busy else now - self._idle_since

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
        """Close the connection now, without sending the rest."""
        self.front.connections.pop(self, None)
        self.queue.clear()
        self._transport.abort()

    def data_received(self, data: bytes) -> None:
        """Cut chunks; invalid data close the connection."""
        self._data += data
        self._idle_since = time.monotonic()
        at = 0
        while len(self._data) - at >= 8:
            size = int.from_bytes(self._data[at + 4 : at + 8], "little")
            kind = bytes(self._data[at : at + 3])
            largest = LARGEST_CHUNK if kind == b"MSG" else LARGEST_OPENING
            if kind not in (b"HEL", b"OPN", b"MSG", b"CLO") or not 8 < size <= largest:
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
        """Register that the client does not read."""
        self.stuck_at = time.monotonic()

    def resume_writing(self) -> None:
        """Register that the client reads again."""
        self.stuck_at = None
        self.front.wake()

    async def serve(self) -> None:
        """Serve the next chunk; an error in it closes the connection."""
        chunk = self.queue.popleft()
        if self._paused and len(self.queue) < QUEUED // 2:
            self._paused = False
            self._transport.resume_reading()
        began = time.thread_time()  # processor time, as waiting for others does not count
        if self._processor is None:
            self._processor = Processor(self, self._transport)
        try:
            self._size = self._size + len(chunk) if chunk[:3] == b"MSG" else 0
            largest = self.front.largest_write if self.session else LARGEST_OPENING
            good = self._size <= largest and await self._process(chunk)
            if chunk[3:4] != b"C":  # more chunks of the same request follow
                self._size = 0
        except Exception as error:  # any exception of a library for bytes that are not a request
            log.debug("invalid request: %s", error)
            good = False
        now = time.monotonic()
        self._used, self._used_at = self.used(now) + time.thread_time() - began, now
        self._idle_since = now
        if not good:
            self._transport.close()

    async def _process(self, chunk: bytes) -> bool:
        data = Buffer(chunk)
        return bool(await self._processor.process(header_from_binary(data), data))

    def beside(self, work: Callable[[], Awaitable[bool]]) -> None:
        """Run a waiting coroutine in the background, and serve this connection no further until it ends."""
        self._busy = True

        async def do() -> None:
            try:
                if not await work():
                    self._transport.close()
            except Exception as error:
                log.debug("invalid login: %s", error)
                self._transport.close()
            finally:
                self._busy = False
                self.front.wake()

        self.front.background(do())


class ServerLimits(TransportLimits):
    """Limits of messages; a client with buffers below the minimum of OPC UA is rejected: its chunks would be tiny."""

    def create_acknowledge_and_set_limits(self, msg: Any) -> Any:  # noqa: ANN401
        """Answer the hello message of a client."""
        if msg.ReceiveBufferSize < SMALLEST_CHUNK:
            raise ua.UaStatusCodeError(CODES.BadConnectionRejected)
        return super().create_acknowledge_and_set_limits(msg)


class Processor(UaProcessor):
    """Processor of the requests of a connection: services that a rig needs, within bounds, one session."""

    def __init__(self, connection: Connection, transport: Any) -> None:  # noqa: ANN401
        super().__init__(connection.front.server.iserver, transport, ServerLimits())
        self.connection, self.front = connection, connection.front
        self.set_policies(self.front.server._policies)

    def open_secure_channel(self, algohdr: Any, seqhdr: Any, body: Any) -> None:  # noqa: ANN401
        """Open or renew the channel."""
        check_header(body)
        super().open_secure_channel(algohdr, seqhdr, body)

    async def process_message(self, seqhdr: Any, body: Any) -> bool:  # noqa: ANN401
        """Answer a request."""
        check_header(body)
        return bool(await super().process_message(seqhdr, body))

    async def _process_message(self, typeid: Any, requesthdr: Any, seqhdr: Any, body: Any) -> bool:  # noqa: ANN401
        service = service_of(typeid, body)
        if not self._connection.is_open():
            return False
        if service not in ("GetEndpoints", "FindServers", "CloseSecureChannel"):
            encrypted = not isinstance(self._connection.security_policy, SecurityPolicyNone)
            if self.front.protection.certificate is not None and not encrypted:
                raise ServiceError(CODES.BadSecurityModeInsufficient)
            if (self.session is None) != (service == "CreateSession"):
                raise ServiceError(CODES.BadSessionIdInvalid)
        if service == "ActivateSession":
            self.connection.beside(lambda: self._log_in(typeid, requesthdr, seqhdr, body))
            return True
        return bool(await super()._process_message(typeid, requesthdr, seqhdr, body))

    async def _log_in(self, typeid: Any, requesthdr: Any, seqhdr: Any, body: Any) -> bool:  # noqa: ANN401
        """Hash the password, which takes time, in a thread; close the connection after a rejected login."""
        try:
            token = struct_from_binary(ua.ActivateSessionParameters, body.copy()).UserIdentityToken
            if isinstance(token, ua.UserNameIdentityToken):
                user, password = self.iserver.decrypt_user_token(self.session, token)
                async with self.front.login:
                    await asyncio.to_thread(self.front.protection.hash_ahead, user, password)
            good = bool(await super()._process_message(typeid, requesthdr, seqhdr, body))
        except Exception as error:  # any exception of a library for received data
            response = ua.ServiceFault()
            code = getattr(error, "code", CODES.BadIdentityTokenInvalid)
            response.ResponseHeader.ServiceResult = ua.StatusCode(code)
            self.send_response(requesthdr.RequestHandle, seqhdr, response)
            return False
        self.front.activated(self.connection)
        return good

    def _should_close_session_on_transport_loss(self) -> bool:
        return True
