"""Whose turn it is at a served rig, and what a request may hold: order and bytes, no times."""

from __future__ import annotations

import asyncio

import pytest
from asyncua import ua
from asyncua.common.utils import Buffer, ServiceError
from asyncua.ua.ua_binary import struct_to_binary

from connect.hostile import dense_values
from pneudrive.rig.opcua.front import IDLE_S, MOST_ASKED, MOST_SESSIONS, MOST_WAITING, NEW_S, Connection, Front
from pneudrive.rig.opcua.requests import check_header, service_of

CHUNK = b"MSGF\x20\0\0\0" + b"\0" * 24


class Transport:
    """Takes note that it was hung up on."""

    gone = False

    def __init__(self, address: str) -> None:
        self.address = address

    def get_extra_info(self, _):
        return (self.address, 1)

    def set_write_buffer_limits(self, _): ...

    def abort(self):
        self.gone = True

    pause_reading = resume_reading = close = lambda self: None


class Someone(Connection):
    """A connection of a given age and use whose requests are nothing but a name in the order."""

    def __init__(self, front: Front, name: str, age_s: float, used_s: float = 0.0, session: bool = True) -> None:
        super().__init__(front)
        self.name, self._session = name, session
        self.began -= age_s
        self._used, self._processor = used_s, self
        self.connection_made(Transport("10.0.0.1"))

    session = property(lambda self: self._session and self)  # type: ignore[assignment]
    client = property(lambda self: self)
    order: list[str] = []  # noqa: RUF012 - of all

    async def _process(self, chunk: bytes) -> bool:
        self.order.append(self.name)
        return True


class Rig:
    """What is behind the front: the one of this name commands."""

    def __init__(self, commander: str = "") -> None:
        self.commander = commander

    def commands(self, client) -> bool:
        return client.name == self.commander


def front(commander: str = "") -> Front:
    Someone.order = []
    return Front(None, Rig(commander), None, 1 << 16)  # type: ignore[arg-type]


def test_a_stop_waits_for_two_others_at_most_and_comers_have_every_second_turn():
    async def run() -> None:
        here = front()
        floods = [Someone(here, f"flood {i}", 10.0, used_s=0.05) for i in range(20)]
        comers = [Someone(here, f"comer {i}", 0.1, session=False) for i in range(20)]
        viewer = Someone(here, "viewer", 100.0, used_s=0.02)
        serving = asyncio.create_task(here._serve())
        for one in floods + comers:
            one.data_received(CHUNK * 8)
        await asyncio.sleep(0)
        for _ in range(10):  # ask, and ask again when answered
            asked = len(Someone.order)
            viewer.data_received(CHUNK)
            for _ in range(9):
                await asyncio.sleep(0)
            assert "viewer" in Someone.order[asked : asked + 3]
        for _ in range(60):
            await asyncio.sleep(0)
        serving.cancel()

    asyncio.run(run())
    kinds = [name.split()[0] for name in Someone.order if name != "viewer"]
    assert abs(kinds.count("comer") - kinds.count("flood")) <= 12
    first = [name for name in Someone.order if name.startswith("comer")]
    assert first[:8] == ["comer 0"] * 8  # who came first gets through first


def test_who_is_idle_goes_first_and_nobody_is_taken_in_before():
    here = front()
    idle = [Someone(here, f"idle {i}", 2.0, session=False) for i in range(MOST_WAITING)]
    assert not here._has_room()
    for one in idle[3:5]:
        one._idle_since -= 2.0 * IDLE_S
    idle[4].data_received(CHUNK)
    assert here._has_room()
    new = Someone(here, "new", 0.0, session=False)
    assert [one.name for one in idle if one._transport.gone] == ["idle 3"]
    assert not here._has_room()
    for one in [new, *idle[-MOST_ASKED:]]:
        one.data_received(CHUNK)
    idle[0]._idle_since -= 1.0
    assert not here._has_room()  # those who are in come first


def test_sessions_too_many_cost_neither_who_commands_nor_who_looks_on_nor_who_has_just_come():
    here = front("commander")
    commander, viewer = Someone(here, "commander", 500.0, used_s=1.0), Someone(here, "viewer", 400.0)
    idle = [Someone(here, f"idle {i}", 300.0 - i) for i in range(MOST_SESSIONS - 3)]
    loud, late = Someone(here, "loud", 350.0, used_s=0.5), Someone(here, "late", 0.5 * NEW_S)
    for expected in (loud, idle[-1], idle[-2]):
        here.activated(Someone(here, "one more", 0.0))
        assert expected._transport.gone
    assert not any(one._transport.gone for one in (commander, viewer, late))


def body_of(request) -> tuple[ua.NodeId, Buffer]:
    """Cut a request as it travels into its type and what follows its header."""
    whole = request.to_binary() if hasattr(request, "to_binary") else struct_to_binary(request)
    check_header(Buffer(whole))
    kind = ua.NodeId(int.from_bytes(whole[2:4], "little"))
    return kind, Buffer(whole[4 + len(struct_to_binary(request.RequestHeader)) :])


@pytest.mark.parametrize("request_", dense_values(70_000, 900))
def test_values_that_no_rig_has_are_refused_by_their_first_bytes(request_):
    kind, body = body_of(request_)
    with pytest.raises(ServiceError):
        service_of(kind, body)


def test_requests_name_few_nodes():
    def reads(count: int) -> ua.ReadRequest:
        request = ua.ReadRequest()
        request.Parameters.NodesToRead = [
            ua.ReadValueId(NodeId=ua.NodeId(2259), AttributeId=ua.AttributeIds.Value)
        ] * count
        return request

    def browses(count: int) -> ua.BrowseRequest:
        request = ua.BrowseRequest()
        request.Parameters.NodesToBrowse = [ua.BrowseDescription(NodeId=ua.NodeId(84))] * count
        return request

    def writes(count: int, value: ua.Variant) -> ua.WriteRequest:
        request = ua.WriteRequest()
        written = ua.WriteValue(NodeId=ua.NodeId("Rig.Text", 2), AttributeId=ua.AttributeIds.Value)
        written.Value = ua.DataValue(value)
        request.Parameters.NodesToWrite = [written] * count
        return request

    text, row = ua.Variant("x" * 100), ua.Variant([0.5] * 256, ua.VariantType.Double)
    for good, name in (
        (reads(128), "Read"),
        (browses(8), "Browse"),
        (writes(256, text), "Write"),
        (writes(9, row), "Write"),
    ):
        assert service_of(*body_of(good)) == name
    for bad in (
        reads(129),
        browses(9),
        writes(257, text),
        ua.CallRequest(),
        ua.HistoryReadRequest(),
        ua.AddNodesRequest(),
    ):
        with pytest.raises(ServiceError):
            service_of(*body_of(bad))
    header = ua.ReadRequest()
    header.RequestHeader.AdditionalHeader = ua.Argument(Name="x")
    with pytest.raises(ServiceError):
        check_header(Buffer(struct_to_binary(header)))
