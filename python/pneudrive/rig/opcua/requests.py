"""What a request to a served rig may hold: asked of its bytes, before anything is made of them.

A request is served in one go, so that its size in bytes, in nodes and in kinds of values bounds how long any other one
waits. Of what OPC UA can pack into a few bytes, most would take a hundred times as long as what a rig is written.
"""

from __future__ import annotations

from typing import Any

from asyncua.common.utils import ServiceError
from asyncua.ua.ua_binary import nodeid_from_binary

from pneudrive.rig.opcua.access import opcua

ua: Any = opcua("asyncua.ua")
CODES = ua.StatusCodes
#: What may be asked for without a session, and within one; asyncua could do more.
OPENING = ("GetEndpoints", "FindServers", "CreateSession", "ActivateSession", "CloseSession", "CloseSecureChannel")
#: How many nodes, or whatever else its list holds, a request may name.
SERVICES = {
    "Read": 128, "Write": 256, "Browse": 8, "TranslateBrowsePathsToNodeIds": 16,
    "RegisterNodes": 256, "UnregisterNodes": 256,
    "CreateSubscription": 0, "ModifySubscription": 0, "DeleteSubscriptions": 16, "SetPublishingMode": 16,
    "Publish": 64, "Republish": 0,
    "CreateMonitoredItems": 64, "ModifyMonitoredItems": 64, "DeleteMonitoredItems": 64, "SetMonitoringMode": 64,
}  # fmt: skip
#: Bytes that stand before that list.
BEFORE_LIST = {
    "Read": 12, "Write": 0, "RegisterNodes": 0, "UnregisterNodes": 0, "TranslateBrowsePathsToNodeIds": 0,
    "DeleteSubscriptions": 0, "SetPublishingMode": 1, "Publish": 0, "CreateMonitoredItems": 8,
    "ModifyMonitoredItems": 8, "DeleteMonitoredItems": 4, "SetMonitoringMode": 8,
}  # fmt: skip
LARGEST_REQUEST = 8192  # bytes, but for writing
SERVICE: dict[Any, str] = {
    ua.NodeId(getattr(ua.ObjectIds, f"{name}Request_Encoding_DefaultBinary")): name for name in (*OPENING, *SERVICES)
}
#: Bytes of the values that a rig is written; None: a text, with its length before it.
WRITTEN: dict[int, int | None] = {1: 1, 2: 1, 3: 1, 4: 2, 5: 2, 6: 4, 7: 4, 8: 8, 9: 8, 10: 4, 11: 8, 12: None}
ARRAY, DIMENSIONS = 0x80, 0x40


def check_header(body: Any) -> None:  # noqa: ANN401 - asyncua's buffer
    """Go over the type and the header of a request.

    Raises
    ------
    ServiceError
        It has an additional header, which may hold anything; no client of a rig has one.
    """
    body = body.copy()
    nodeid_from_binary(body)
    nodeid_from_binary(body)  # of the session
    body.skip(8 + 4 + 4)
    _skip_text(body)
    body.skip(4)
    nodeid_from_binary(body)
    if body.read(1) != b"\0":
        raise ServiceError(CODES.BadRequestTooLarge)


def service_of(kind: Any, body: Any) -> str:  # noqa: ANN401 - asyncua's type and buffer
    """Name the service that a request asks for, where it is one of ours and no larger than it may be.

    Parameters
    ----------
    kind : asyncua.ua.NodeId
        Of the request.
    body : asyncua.common.utils.Buffer
        After its header; it is left as it is.

    Raises
    ------
    ServiceError
        It is not.
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
    """Go over a node and the value that it is to have, where that is of a type that a rig has."""
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
