"""Bounds of requests to a served rig, checked in their bytes before they are decoded.

A request is served without interruption, so its size in bytes and nodes and its types of values bound the waiting time
of others. Most values that OPC UA can pack into a few bytes would take a hundred times as long as those of a rig.
"""

from __future__ import annotations

from typing import Any

from asyncua.common.utils import ServiceError
from asyncua.ua.ua_binary import nodeid_from_binary

from pneudrive.rig.opcua.access import opcua

ua: Any = opcua("asyncua.ua")
CODES = ua.StatusCodes
#: Services allowed without a session, and within one; asyncua has more.
OPENING = ("GetEndpoints", "FindServers", "CreateSession", "ActivateSession", "CloseSession", "CloseSecureChannel")
#: Largest number of entries, such as nodes, in the list of a request.
SERVICES = {
    "Read": 128, "Write": 256, "Browse": 8, "TranslateBrowsePathsToNodeIds": 16,
    "RegisterNodes": 256, "UnregisterNodes": 256,
    "CreateSubscription": 0, "ModifySubscription": 0, "DeleteSubscriptions": 16, "SetPublishingMode": 16,
    "Publish": 64, "Republish": 0,
    "CreateMonitoredItems": 64, "ModifyMonitoredItems": 64, "DeleteMonitoredItems": 64, "SetMonitoringMode": 64,
}  # fmt: skip
#: Bytes before that list.
BEFORE_LIST = {
    "Read": 12, "Write": 0, "RegisterNodes": 0, "UnregisterNodes": 0, "TranslateBrowsePathsToNodeIds": 0,
    "DeleteSubscriptions": 0, "SetPublishingMode": 1, "Publish": 0, "CreateMonitoredItems": 8,
    "ModifyMonitoredItems": 8, "DeleteMonitoredItems": 4, "SetMonitoringMode": 8,
}  # fmt: skip
LARGEST_REQUEST = 8192  # bytes, except for writing
SERVICE: dict[Any, str] = {
    ua.NodeId(getattr(ua.ObjectIds, f"{name}Request_Encoding_DefaultBinary")): name for name in (*OPENING, *SERVICES)
}
#: Bytes of the values that clients write; None: a text, preceded by its length.
WRITTEN: dict[int, int | None] = {1: 1, 2: 1, 3: 1, 4: 2, 5: 2, 6: 4, 7: 4, 8: 8, 9: 8, 10: 4, 11: 8, 12: None}
ARRAY, DIMENSIONS = 0x80, 0x40


def check_header(body: Any) -> None:  # noqa: ANN401 - asyncua's buffer
    """Skip the type and the header of a request, with checks.

    Raises
    ------
    ServiceError
        The request has an additional header, which may hold anything; no client of a rig uses one.
    """
    body = body.copy()
    nodeid_from_binary(body)
    nodeid_from_binary(body)  # token of the session
    body.skip(8 + 4 + 4)
    _skip_text(body)
    body.skip(4)
    nodeid_from_binary(body)
    if body.read(1) != b"\0":
        raise ServiceError(CODES.BadRequestTooLarge)


def service_of(kind: Any, body: Any) -> str:  # noqa: ANN401 - asyncua's type and buffer
    """Return the service of a request, if it is supported and within its bounds.

    Parameters
    ----------
    kind : asyncua.ua.NodeId
        Type of the request.
    body : asyncua.common.utils.Buffer
        Bytes after the header; unchanged.

    Raises
    ------
    ServiceError
        The service is not supported, or beyond its bounds.
    """
    service = SERVICE.get(kind)
    if service is None:
        raise ServiceError(CODES.BadServiceUnsupported)
    if service != "Write" and len(body) > LARGEST_REQUEST:
        raise ServiceError(CODES.BadRequestTooLarge)
    body = body.copy()
    if service == "Browse":
        nodeid_from_binary(body)  # a view
        body.skip(8 + 4 + 4)
    elif service in BEFORE_LIST:
        body.skip(BEFORE_LIST[service])
    else:
        return service
    count = max(_integer(body), 0)
    if count > SERVICES[service]:
        raise ServiceError(CODES.BadTooManyOperations)
    if service == "Write":
        for _ in range(count):
            _skip_written(body)
    return service


def _skip_written(body: Any) -> None:  # noqa: ANN401
    """Skip a node and its value to write, if the value is of a type of a rig."""
    nodeid_from_binary(body)
    body.skip(4)
    _skip_text(body)
    mask = body.read(1)[0]
    if mask & 0x01:
        encoding = body.read(1)[0]
        if encoding & DIMENSIONS or encoding & ~ARRAY not in WRITTEN:
            raise ServiceError(CODES.BadTypeMismatch)
        count, size = max(_integer(body), 0) if encoding & ARRAY else 1, WRITTEN[encoding & ~ARRAY]
        if size is not None:
            body.skip(count * size)
        elif count > 1:
            raise ServiceError(CODES.BadTypeMismatch)
        elif count:
            _skip_text(body)
    # status, times and their fractions
    body.skip(sum(size for bit, size in ((0x02, 4), (0x04, 8), (0x08, 8), (0x10, 2), (0x20, 2)) if mask & bit))


def _integer(body: Any) -> int:  # noqa: ANN401
    return int.from_bytes(body.read(4), "little", signed=True)


def _skip_text(body: Any) -> None:  # noqa: ANN401
    body.skip(max(_integer(body), 0))
