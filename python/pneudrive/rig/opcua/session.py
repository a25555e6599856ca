"""What a connection to a served rig speaks: the services that a rig needs, within bounds, one session of its own."""

from __future__ import annotations

import functools
import math
import time
from typing import Any, Protocol

from asyncua.common.utils import ServiceError
from asyncua.server.internal_session import InternalSession, SessionState

from pneudrive.rig.opcua.access import opcua
from pneudrive.rig.opcua.requests import CODES

ua: Any = opcua("asyncua.ua")
MOST_SUBSCRIPTIONS, MOST_ITEMS = 2, 50  # of a session
MOST_KINDS = 256  # of references, that are kept
FASTEST_MS, SLOWEST_MS = 250.0, 60_000.0  # of a subscription


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


def know_types(internal: Any) -> None:  # noqa: ANN401 - asyncua's internal server
    """Let it look the kinds of references up once: for each reference again, a browse would take a hundred times."""
    view = internal.view_service
    below = view._get_sub_ref
    view._get_sub_ref = functools.lru_cache(MOST_KINDS)(lambda kind: frozenset(below(kind)))


class ServedSession(InternalSession):
    """A session has its own commands and answers, and touches no subscription of another one."""

    def __init__(self, internal: Any, served: Served, name: Any) -> None:  # noqa: ANN401
        super().__init__(internal, internal.aspace, internal.subscription_service, name, external=True)
        self.served = served
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
