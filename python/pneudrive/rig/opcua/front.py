"""The front of a served rig: few connections, everyone has a turn, those who are there and those who come.

asyncua reads and writes OPC UA; here stands whom it serves, and when. Turns go to those who have a session and to those
who are about to get one alternately, so that neither keeps the other out. Of those who have one, who has used the
server least comes next; of those who come, who has been waiting longest, unless it has used much. So a request to stop
waits for two other requests at most, whatever others send. Who has no session is gone after seconds; where there are
too many, the one goes that has been idle for longest, of the address that has most. A session ends with its connection:
it cannot be taken over on another one.
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
SMALLEST_CHUNK = 8192  # as OPC UA has it
MOST_WAITING, MOST_AT_DOOR = 64, 128  # connections without a session, and those that are not yet taken in
MOST_ASKED = 8  # connections without a session whose requests are still to be served: then nobody is taken in
IDLE_S, AT_DOOR_S = 0.05, 0.001
MOST_SESSIONS, MOST_SUBSCRIPTIONS = 64, 64
SESSION_S = 5.0  # within which a connection has a session
SESSION_TIMEOUT_S = 60.0  # a session that asks for nothing
STUCK_S = 10.0  # a client that does not read what it asked for
LOOK_S = 0.5
FORGET_S = 1.0  # what was used is forgotten with this time constant
NEW_S = 1.0  # a connection counts as one that comes for so long
USED_S = 0.01  # who has just come is served first come, first served, until it has used this
COMMANDS_COUNT = 0.25
LARGEST_CHUNK = 65535  # as OPC UA has it
LARGEST_OPENING = 2 * LARGEST_REQUEST  # bytes of a request without a session: certificates
QUEUED = 8  # requests of one connection that are read ahead
BUFFERED = 1 << 20  # bytes of answers that wait to be sent


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

    async def _take_in(self, listening: Any) -> None:  # noqa: ANN401 - a socket
        """Take connections in, no faster than they are served; the others wait at the door, in their order."""
        loop = asyncio.get_running_loop()
        while True:
            while not self._has_room():
                await asyncio.sleep(AT_DOOR_S)
            try:
                new, _ = await loop.sock_accept(listening)
                await loop.connect_accepted_socket(lambda: Connection(self), new)
            except OSError as error:  # it has gone again, or there are no handles
                log.debug("a connection that is none: %s", error)
                await asyncio.sleep(AT_DOOR_S)

    def _has_room(self) -> bool:
        """Whether there is room for one that comes, or one that has been idle for long enough to go."""
        comers, now = [c for c in self.connections if not c.session], time.monotonic()
        asked = sum(bool(c.queue) and not c.waits for c in comers)
        idle = len(comers) < MOST_WAITING or max(c.idle_s(now) for c in comers) >= IDLE_S
        return asked < MOST_ASKED and idle

    def come(self, new: Connection) -> None:
        """Take a connection in; where there are too many without a session, the one goes that was idle for longest."""
        waiting, now = [c for c in self.connections if not c.session], time.monotonic()
        if len(waiting) >= MOST_WAITING:
            _drop_one(waiting, lambda c: -c.idle_s(now))
        self.connections[new] = None

    def activated(self, new: Connection) -> None:
        """Take note of a session; where there are too many, another one goes, never the one that commands.

        One that has just come stays, so that it can stop the axis; of the others, the one that has used most, or came
        last: who looks on quietly since long before may stay.
        """
        others = [
            c for c in self.connections if c.session and c is not new and not self.served.commands(c.session.client)
        ]
        if len(others) >= MOST_SESSIONS:
            now = time.monotonic()
            there = [c for c in others if not c.is_new(now)]
            _drop_one(there or others, lambda c: (-(c.used(now) // USED_S), -c.began) if there else c.began)

    def wake(self) -> None:
        """Say that there is something to do."""
        self._wake.set()

    async def _serve(self) -> None:
        """Serve one request after the other, of those who are there and of those who come alternately."""
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
            await asyncio.sleep(0)  # what has come meanwhile is read, clocks go on

    def _claim(self, connection: Connection, now: float) -> float:
        """Seconds used; those of who commands count less, for its heartbeat must not wait for others."""
        session, used = connection.session, connection.used(now)
        if connection.is_new(now):
            return used // USED_S
        return used * (COMMANDS_COUNT if session and self.served.commands(session.client) else 1.0)

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


def _drop_one(those: list[Connection], last: Callable[[Connection], Any]) -> None:
    """Hang up on one of the address that has most: the one that comes first in this order."""
    address, _ = Counter(c.address for c in those).most_common(1)[0]
    min((c for c in those if c.address == address), key=last).drop()


class Connection(asyncio.Protocol):
    """One connection: cuts what comes into chunks, and lets them be served in turn."""

    def __init__(self, front: Front) -> None:
        self.front = front
        self.address = ""
        self.queue: deque[bytes] = deque()
        self.began = self.since = time.monotonic()  # since when it has no session
        self.stuck_at: float | None = None
        self._data = bytearray()
        self._size = 0  # of the request of which chunks have come
        self._busy = self._paused = False
        self._used, self._used_at = 0.0, self.began
        self._idle_since = self.began
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
        """Seconds of the processor that it has used of late."""
        return self._used * math.exp((self._used_at - now) / FORGET_S)

    def is_new(self, now: float) -> bool:
        """Whether it is one of those who come."""
        return now - self.began < NEW_S or self.session is None

    def idle_s(self, now: float) -> float:
        """How long it has been its turn to say something, s."""
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
        """Hang up now, whatever is still to be sent."""
        self.front.connections.pop(self, None)
        self.queue.clear()
        self._transport.abort()

    def data_received(self, data: bytes) -> None:
        """Cut chunks; what is none ends the connection."""
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
        began = time.thread_time()  # not the clock: what waits for others is not its own
        if self._processor is None:
            self._processor = Processor(self, self._transport)
        try:
            self._size = self._size + len(chunk) if chunk[:3] == b"MSG" else 0
            largest = self.front.largest_write if self.session else LARGEST_OPENING
            good = self._size <= largest and await self._process(chunk)
            if chunk[3:4] != b"C":  # another chunk of the same request follows
                self._size = 0
        except Exception as error:  # whatever a library raises about bytes that are no request
            log.debug("a request that is none: %s", error)
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


class ServerLimits(TransportLimits):
    """What both sides take; who takes less than OPC UA asks for would have every answer cut into crumbs."""

    def create_acknowledge_and_set_limits(self, msg: Any) -> Any:  # noqa: ANN401
        """Answer a greeting."""
        if msg.ReceiveBufferSize < SMALLEST_CHUNK:
            raise ua.UaStatusCodeError(CODES.BadConnectionRejected)
        return super().create_acknowledge_and_set_limits(msg)


class Processor(UaProcessor):
    """Answers the requests of a connection: those that a rig needs, within bounds, one session."""

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
