"""Session of the client of a served rig: it reads all nodes and writes those of commands. Nothing else is served."""

from __future__ import annotations

from typing import Any

from asyncua.common.connection import TransportLimits
from asyncua.common.utils import ServiceError
from asyncua.server.internal_session import InternalSession

from pneudrive.rig.opcua.access import ua

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
