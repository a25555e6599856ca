"""Front of a served rig: the server of asyncua, with few connections and one session per connection.

Each connection is served by one task, one request at a time, so that requests of all connections alternate. If all
places are taken, a new connection replaces the oldest one without a session. A connection is closed if it opens no
session within seconds, sends requests faster than they are served, or does not read its answers. A session ends with
its connection, and cannot continue on another connection.
"""

from __future__ import annotations

import asyncio
from typing import TYPE_CHECKING, Any

from asyncua.common.connection import TransportLimits
from asyncua.common.utils import ServiceError
from asyncua.crypto.security_policies import SecurityPolicyNone
from asyncua.server.binary_server_asyncio import BinaryServer, OPCUAProtocol
from asyncua.server.uaprocessor import UaProcessor
from asyncua.ua.ua_binary import struct_from_binary

from pneudrive.rig.opcua.access import opcua
from pneudrive.rig.opcua.session import CODES, ServedSession, know_types

if TYPE_CHECKING:
    from pneudrive.rig.opcua.access import Protection
    from pneudrive.rig.opcua.session import Served

ua: Any = opcua("asyncua.ua")
MOST_CONNECTIONS, MOST_SUBSCRIPTIONS = 64, 64
MOST_REQUESTS = 64  # of one connection, read ahead
SESSION_S = 5.0  # s; time for a connection to get a session
SESSION_TIMEOUT_S = 60.0  # s; time limit of a session without requests
SMALLEST_CHUNK = 8192  # bytes; value of OPC UA
LARGEST_MESSAGE = 1 << 22  # bytes of a request or an answer
UNREAD = 1 << 22  # bytes of unread answers
#: Services before there is a session, as asyncua numbers them.
_OPENING = {
    ua.NodeId(getattr(ua.ObjectIds, f"{name}Request_Encoding_DefaultBinary")): name
    for name in ("GetEndpoints", "FindServers", "CloseSecureChannel", "CreateSession", "ActivateSession")
}


class Front:
    """Connections of a server.

    Parameters
    ----------
    server : asyncua.Server
        Server with its nodes, not started.
    served : Served
    protection : Protection
    """

    def __init__(self, server: Any, served: Served, protection: Protection) -> None:  # noqa: ANN401
        self.server, self.served, self.protection = server, served, protection
        self.limits = ServerLimits(max_message_size=LARGEST_MESSAGE, max_chunk_count=LARGEST_MESSAGE // SMALLEST_CHUNK)
        self.login = asyncio.Lock()  # one password is checked at a time
        self._listening: BinaryServer | None = None
        self._tasks: set[asyncio.Task[Any]] = set()

    @property
    def connections(self) -> list[Any]:
        """Open connections, in order of arrival."""
        return [] if self._listening is None else list(self._listening.clients)

    async def start(self, host: str, port: int) -> int:
        """Start to listen; return the port."""
        internal = self.server.iserver
        internal.max_session_timeout_ms = 1e3 * SESSION_TIMEOUT_S
        internal.max_monitored_item_queue_size = 100
        internal.max_unacked_messages_per_subscription = 100
        internal.max_subscriptions = MOST_SUBSCRIPTIONS
        internal.max_pending_messages_per_connection = MOST_REQUESTS
        internal.max_pending_activation_seconds = SESSION_S
        internal.max_connections = MOST_CONNECTIONS
        internal.create_session = lambda name, **_: ServedSession(internal, self.served, name)
        await self.server._setup_server_nodes()
        know_types(internal)
        await internal.start()
        self._listening = _Listening(self, host, port)
        self._listening.set_policies(self.server._policies)
        await self._listening.start()
        return self._listening.port

    async def stop(self) -> None:
        """Close all connections."""
        for task in list(self._tasks):
            task.cancel()
        if self._listening is not None:
            await self._listening.stop()
        await self.server.iserver.stop()

    def background(self, work: Any) -> None:  # noqa: ANN401 - a coroutine
        """Run a coroutine in the background."""
        task = asyncio.create_task(work)
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)


class _Listening(BinaryServer):
    """Server of the socket, with connections of a rig."""

    def __init__(self, front: Front, host: str, port: int) -> None:
        super().__init__(front.server.iserver, host, port, front.limits)
        self.front = front

    def _make_protocol(self) -> OPCUAProtocol:
        new = Connection(self.iserver, self._policies, self.clients, self.closing_tasks, self.limits)
        new.front = self.front
        return new


class Connection(OPCUAProtocol):
    """One connection; its requests are served in order."""

    front: Front

    @property
    def session(self) -> Any:  # noqa: ANN401 - a ServedSession
        """Activated session of the connection, or None."""
        session = self.processor and self.processor.session
        return session if session is not None and session.is_activated() else None

    def connection_made(self, transport: Any) -> None:  # noqa: ANN401
        """Accept a connection; if all places are taken, close the oldest one without a session."""
        if len(self.clients) >= MOST_CONNECTIONS:
            idle = next((client for client in self.clients if not getattr(client, "session", None)), None)
            if idle is not None and idle.transport is not None:
                self.clients.remove(idle)
                idle.transport.abort()
        super().connection_made(transport)
        if self.processor is not None:
            self.processor = Processor(self, transport)

    async def _process_one_msg(self, header: Any, buf: Any) -> bool:  # noqa: ANN401
        good = await super()._process_one_msg(header, buf)
        await asyncio.sleep(0)  # the other connections have their turn
        return good

    def drop(self) -> None:
        """Close the connection now, without sending the rest."""
        if self.transport is not None:
            self.transport.abort()


class ServerLimits(TransportLimits):
    """Limits of messages.

    A client with buffers below the minimum of OPC UA is rejected, because its chunks would be tiny.
    """

    def create_acknowledge_and_set_limits(self, msg: Any) -> Any:  # noqa: ANN401
        """Answer the hello message of a client."""
        if msg.ReceiveBufferSize < SMALLEST_CHUNK:
            raise ua.UaStatusCodeError(CODES.BadConnectionRejected)
        return super().create_acknowledge_and_set_limits(msg)


class Processor(UaProcessor):
    """Processor of the requests of a connection, which has one session."""

    def __init__(self, connection: Connection, transport: Any) -> None:  # noqa: ANN401
        self.connection, self.front = connection, connection.front
        super().__init__(self.front.server.iserver, transport, self.front.limits)
        self.set_policies(self.front.server._policies)

    def send_response(self, *arguments: Any, **named: Any) -> None:  # noqa: ANN401 - those of asyncua
        """Send an answer; close the connection of a client that does not read."""
        super().send_response(*arguments, **named)
        if self._transport.get_write_buffer_size() > UNREAD:
            self.connection.drop()

    async def _process_message(self, typeid: Any, requesthdr: Any, seqhdr: Any, body: Any) -> bool:  # noqa: ANN401
        service = _OPENING.get(typeid, "")
        if not self._connection.is_open():
            return False
        if service not in ("GetEndpoints", "FindServers", "CloseSecureChannel"):
            encrypted = not isinstance(self._connection.security_policy, SecurityPolicyNone)
            if self.front.protection.certificate is not None and not encrypted:
                raise ServiceError(CODES.BadSecurityModeInsufficient)
            if (self.session is None) != (service == "CreateSession"):
                raise ServiceError(CODES.BadSessionIdInvalid)
        if service == "ActivateSession":
            return await self._log_in(typeid, requesthdr, seqhdr, body)
        return bool(await super()._process_message(typeid, requesthdr, seqhdr, body))

    async def _log_in(self, typeid: Any, requesthdr: Any, seqhdr: Any, body: Any) -> bool:  # noqa: ANN401
        """Hash the password, which takes time, in a thread; close the connection after a rejected login."""
        try:
            token = struct_from_binary(ua.ActivateSessionParameters, body.copy()).UserIdentityToken
            if isinstance(token, ua.UserNameIdentityToken):
                user, password = self.iserver.decrypt_user_token(self.session, token)
                async with self.front.login:
                    await asyncio.to_thread(self.front.protection.hash_ahead, user, password)
            return bool(await super()._process_message(typeid, requesthdr, seqhdr, body))
        except Exception as error:  # any exception of a library for received data
            response = ua.ServiceFault()
            code = getattr(error, "code", CODES.BadIdentityTokenInvalid)
            response.ResponseHeader.ServiceResult = ua.StatusCode(code)
            self.send_response(requesthdr.RequestHandle, seqhdr, response)
            return False

    def _should_close_session_on_transport_loss(self) -> bool:
        return True
