"""One client is served: whatever others do, its stop is answered, and no other moves the axis.

Order and delivery are asserted, no times: how long a stop takes is measured by itself.
"""

from __future__ import annotations

import contextlib
import multiprocessing
import re
import struct
import threading
import time
from urllib.parse import urlsplit

import pytest

from connect import hostile
from pneudrive.errors import RigError
from pneudrive.rig import Move, Sampling, load_rig
from pneudrive.rig.opcua.nodes import load_map
from pneudrive.rig.opcua.server import RigServer
from waiting import until

SENSOR_PA = 1000.0  # error of the rig's pressure transducer


@pytest.fixture(scope="module")
def processes():
    """Give what starts a hostile client fast: a server that has imported everything forks it."""
    context = multiprocessing.get_context("forkserver")
    context.set_forkserver_preload(["connect.hostile"])
    return context


@pytest.fixture(scope="module")
def served():
    bench = load_rig("default", pace=1.0)
    with RigServer(bench, load_map(), port=0) as server:
        yield bench, server


@contextlib.contextmanager
def attacked(processes, name: str, url: str):
    process = processes.Process(target=hostile.run, args=(name, url), daemon=True)
    process.start()
    try:
        yield
    finally:
        process.kill()
        process.join()


def in_background(work) -> tuple[threading.Thread, list]:
    """Run work in a thread; what it raises goes into the list."""
    told: list = []

    def run() -> None:
        try:
            work()
        except RigError as error:
            told.append(str(error))

    thread = threading.Thread(target=run)
    thread.start()
    return thread, told


def at_rest(rig) -> None:
    state = rig.state()
    assert not state.moving
    assert state.pressure_a_pa == pytest.approx(rig.identity().ambient_pressure_pa, abs=SENSOR_PA)
    time.sleep(0.15)
    assert rig.state().position_m == state.position_m


@pytest.mark.parametrize("name", ["silent", "garbage", "deaf", "newcomers"])
def test_the_stop_of_the_client_is_answered_beside(name, served, processes):
    bench, server = served
    rig = load_rig(server.url)
    rig.set_pressure(1.5e5, 1.5e5)
    with attacked(processes, name, server.url):
        until(lambda: len(server._server.bserver.clients) > (5 if name in ("silent", "garbage") else 1))
        for _ in range(3):
            thread, told = in_background(lambda: rig.move(0.29 if bench.state().position_m < 0.1 else 0.02, 0.02))
            until(lambda: bench.state().moving)
            rig.stop()
            at_rest(bench)
            thread.join()
            assert "another command of this program ended" in told[0]
    rig.close()
    until(lambda: server.session is None)


def test_a_second_client_waits_for_the_end_of_the_first():
    """A client without a heartbeat gives way; one that has stopped the axis by its silence finds out."""
    bench = load_rig("default", pace=1.0)
    with RigServer(bench, load_map(), port=0) as server:
        viewer = load_rig(server.url)
        assert viewer.state().fault is None
        anna = load_rig(server.url)  # the viewer has no heartbeat
        anna.set_pressure(1.5e5, 1.5e5)
        with pytest.raises(RigError, match=r"cannot be reached: BadTooManySessions"):
            load_rig(server.url)
        thread, told = in_background(lambda: anna.move(0.29, 0.02))
        until(lambda: bench.state().moving)
        anna._link._loop.loop.call_soon_threadsafe(time.sleep, 1.2)
        until(lambda: not bench.state().moving)
        thread.join()
        assert "the connection was lost during 'move' and was restored" in told[0]
        at_rest(bench)
        anna.set_pressure(1.5e5, 1.5e5)
        anna.close()
        until(lambda: bench.state().pressure_a_pa < 1.1e5)  # the stop begins a moment after the session ends
        until(lambda: not server._stopping.locked())
        at_rest(bench)  # a client that leaves leaves no pressure
        assert re.search(r"connection of the client ended: the server stopped the axis", server.fault)
        bert = load_rig(server.url)
        assert bert.state().fault is None  # the end of others does not concern it
        bert.home()
        bert.close()


def test_a_session_is_not_taken_over_and_writes_only_commands():
    import asyncio

    from asyncua import Client, ua

    class Ignore:
        def datachange_notification(self, *_) -> None: ...

    async def work(url: str) -> None:
        async with Client(url) as client:
            with pytest.raises(ua.UaStatusCodeError):
                await client.create_subscription(100, Ignore())
            index = await client.get_namespace_index("urn:pneudrive:rig")
            for node, value in ((f"ns={index};s=State.Position", 0.1), ("i=2254", ["x"])):
                with pytest.raises(ua.UaStatusCodeError):
                    await client.get_node(node).write_value(value)
            with pytest.raises(ua.UaStatusCodeError):
                await client.nodes.objects.add_object(index, "mine")
            # another connection with the token of a session that lives
            thief = Client(url)
            await thief.connect_socket()
            await thief.send_hello()
            await thief.open_secure_channel()
            thief.uaclient.protocol.authentication_token = client.uaclient.protocol.authentication_token
            request = ua.ActivateSessionRequest()
            request.Parameters.UserIdentityToken = ua.AnonymousIdentityToken()
            with pytest.raises(ua.UaStatusCodeError):
                await thief.uaclient.protocol.send_request(request)
            thief.disconnect_socket()
            # one with tiny buffers, which the library would take for all connections
            reader, writer = await asyncio.open_connection("127.0.0.1", urlsplit(url).port)
            body = struct.pack("<IIIII", 0, 100, 100, 1, 1) + struct.pack("<i", 4) + b"opc:"
            writer.write(b"HELF" + struct.pack("<I", 8 + len(body)) + body)
            assert b"ACK" not in await asyncio.wait_for(reader.read(100), 10.0)
            writer.close()
            assert await client.get_node(f"ns={index};s=State.Position").read_value() > 0.0

    with RigServer(load_rig("default"), load_map(), port=0) as server:
        asyncio.run(work(server.url))


def test_what_a_rig_is_not_asked_for_is_refused_in_words():
    with RigServer(load_rig("default"), load_map(), port=0) as server:
        rig = load_rig(server.url)
        for work, words in (
            (lambda: list(rig.acquire([Move(0.2, 0.1)], Sampling(samples_per_stroke=2**31 - 1))), "samples"),
            (lambda: rig.hold(1e300), "a hold of"),
            (lambda: rig.move(0.2, 1e-9), "at most a day"),
            (lambda: rig.move(float("nan"), 0.1), "BadOutOfRange"),
            (lambda: rig.set_pressure(float("inf"), 1e5), "BadOutOfRange"),
            (lambda: rig.restore({"clock_s": float("nan")}), "restore"),
            (lambda: rig.restore({**rig.memory(), "commanded_m": "x"}), "not the saved state of a simulated rig"),
            (lambda: rig.begin_cycle(None), "is not an argument of begin_cycle"),
            (lambda: rig.change(["seal"]), "is not an argument of change"),
        ):
            with pytest.raises(RigError, match=words):
                work()
        rig.home()
        rig.close()
