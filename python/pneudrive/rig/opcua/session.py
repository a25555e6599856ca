"""OPC UA services of a connection to a served rig, in one session."""

from __future__ import annotations

import functools
import math
import time
from typing import Any, Protocol

from asyncua.common.utils import ServiceError
from asyncua.server.internal_session import InternalSession, SessionState

from pneudrive.rig.opcua.access import opcua

ua: Any = opcua("asyncua.ua")
CODES = ua.StatusCodes
MOST_SUBSCRIPTIONS, MOST_ITEMS = 2, 50  # of a session
MOST_KINDS = 256  # kept references
FASTEST_MS, SLOWEST_MS = 250.0, 60_000.0  # of a subscription


class Client:
    """Session of a client on the rig's server.

    Attributes
    ----------
    values : dict
        Name of a node -> value written by this client, or only for it.
    beat_at : float or None
        Time of the last increment of the client's heartbeat.
    dismissed : str
        Why the client may no longer command.
    identity : int
        Id of its last command.
    """

    def __init__(self, session: Any) -> None:  # noqa: ANN401 - asyncua's
        self._session, self.began = session, time.monotonic()
        self.values: dict[str, Any] = {}
        self.beat_at: float | None = None
        self.dismissed = ""
        self.identity = 0

    def __str__(self) -> str:
        """Return user and address."""
        user, place = getattr(self._session.user, "name", None), self._session.name
        address = ":".join(str(part) for part in place[:2]) if isinstance(place, tuple) else str(place)
        return f"{user} at {address}" if user else f"the client at {address}"


class Served(Protocol):
    """Protocol of the server behind the front."""

    def name_of(self, node_id: Any) -> str | None:  # noqa: ANN401 - asyncua's node id
        """Return the name of a node that has a separate value for each client; None for other nodes."""
        ...

    def read(self, client: Client, name: str, value: Any) -> Any:  # noqa: ANN401 - asyncua's value
        """Return the value of a node for one client. Value that other clients see."""
        ...

    async def written(self, client: Client, name: str, value: Any) -> Any:  # noqa: ANN401 - asyncua's value and status
        """Handle a value that a client has written."""
        ...

    def left(self, client: Client) -> None:
        """Handle the end of a session."""
        ...

    def commands(self, client: Client) -> bool:
        """Return whether a client is the commander."""
        ...


def know_types(internal: Any) -> None:  # noqa: ANN401 - asyncua's internal server
    """Cache the subtypes of references, without which a browse takes a hundred times as long."""
    view = internal.view_service
    below = view._get_sub_ref
    view._get_sub_ref = functools.lru_cache(MOST_KINDS)(lambda kind: frozenset(below(kind)))


class ServedSession(InternalSession):
    """Session with separate commands and answers, and access only to its subscriptions."""

    def __init__(self, internal: Any, served: Served, name: Any) -> None:  # noqa: ANN401
        super().__init__(internal, internal.aspace, internal.subscription_service, name, external=True)
        self.served = served
        self.client = Client(self)

    def _mine(self, *ids: int) -> list[Any]:
        """Return the subscriptions of this session, or those of the given ids."""
        known = self.subscription_service.subscriptions
        mine = {i: sub for i, sub in known.items() if sub.session_id == self.session_id}
        if any(i not in mine for i in ids):
            raise ServiceError(CODES.BadSubscriptionIdInvalid)
        return list(mine.values())

    def _name_of(self, asked: Any) -> str | None:  # noqa: ANN401
        return self.served.name_of(asked.NodeId) if asked.AttributeId == ua.AttributeIds.Value else None

    async def read(self, params: Any) -> list[Any]:  # noqa: ANN401
        """Read nodes, with the values for this client."""
        results = self.iserver.attribute_service.read(params)
        names = [self._name_of(asked) for asked in params.NodesToRead]
        both = zip(names, results, strict=True)
        return [self.served.read(self.client, name, result) if name else result for name, result in both]

    async def write(self, params: Any) -> list[Any]:  # noqa: ANN401
        """Write nodes that clients of a rig may write, and no others."""
        results = []
        for asked in params.NodesToWrite:
            name, refused = self._name_of(asked), ua.StatusCode(CODES.BadUserAccessDenied)
            results.append(await self.served.written(self.client, name, asked.Value) if name else refused)
        return results

    async def close_session(self, delete_subs: bool = True) -> None:
        """Close the session."""
        was_closed = self.state is SessionState.Closed
        await super().close_session(delete_subs=True)
        if not was_closed:
            self.served.left(self.client)

    async def create_subscription(self, params: Any, callback: Any, request_callback: Any = None) -> Any:  # noqa: ANN401
        """Create a subscription, limited in rate and number."""
        if len(self._mine()) >= MOST_SUBSCRIPTIONS:
            raise ServiceError(CODES.BadTooManySubscriptions)
        asked = params.RequestedPublishingInterval
        params.RequestedPublishingInterval = min(max(asked, FASTEST_MS), SLOWEST_MS) if math.isfinite(asked) else 1e3
        return await super().create_subscription(params, callback, request_callback)

    async def create_monitored_items(self, params: Any) -> list[Any]:  # noqa: ANN401
        """Create monitored items, limited in number."""
        watched = sum(len(sub.monitored_item_srv._monitored_items) for sub in self._mine(params.SubscriptionId))
        if watched + len(params.ItemsToCreate) > MOST_ITEMS:
            raise ServiceError(CODES.BadTooManyMonitoredItems)
        return await super().create_monitored_items(params)

    async def modify_monitored_items(self, params: Any) -> list[Any]:  # noqa: ANN401
        """Reject changes of monitored items."""
        self._mine(params.SubscriptionId)
        raise ServiceError(CODES.BadServiceUnsupported)

    async def delete_monitored_items(self, params: Any) -> list[Any]:  # noqa: ANN401
        """Delete monitored items."""
        self._mine(params.SubscriptionId)
        return await super().delete_monitored_items(params)

    async def set_monitoring_mode(self, params: Any) -> list[Any]:  # noqa: ANN401
        """Set the monitoring mode."""
        self._mine(params.SubscriptionId)
        return await super().set_monitoring_mode(params)

    async def set_publishing_mode(self, params: Any) -> list[Any]:  # noqa: ANN401
        """Set the publishing mode."""
        self._mine(*params.SubscriptionIds)
        return await super().set_publishing_mode(params)

    async def delete_subscriptions(self, ids: list[int]) -> list[Any]:
        """Delete subscriptions."""
        self._mine(*ids)
        return await super().delete_subscriptions(ids)

    def modify_subscription(self, params: Any) -> Any:  # noqa: ANN401
        """Change a subscription."""
        self._mine(params.SubscriptionId)
        return super().modify_subscription(params)

    def republish(self, params: Any) -> Any:  # noqa: ANN401
        """Send a notification again."""
        self._mine(params.SubscriptionId)
        return super().republish(params)

    def publish(self, acks: Any = None) -> Any:  # noqa: ANN401
        """Request new notifications."""
        known = self.subscription_service.subscriptions
        self._mine(*(ack.SubscriptionId for ack in acks or () if ack.SubscriptionId in known))
        return super().publish(acks)
