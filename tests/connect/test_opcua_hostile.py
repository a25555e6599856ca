"""Whatever other clients do, stop is answered, and the axis is at rest; one client commands, and no other moves it.

Order and delivery are asserted, no times: how long a stop takes is measured by itself.
"""

from __future__ import annotations

import contextlib
import multiprocessing
import threading
import time

import pytest

from connect import hostile
from pneudrive.errors import RigError
from pneudrive.rig import Move, Sampling, load_rig
from pneudrive.rig.opcua.nodes import load_map
from pneudrive.rig.opcua.server import RigServer

SENSOR_PA = 1000.0  # error of the rig's pressure transducer
PATIENCE_S = 60.0


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


def until(true) -> None:
    """Wait until something is true."""
    deadline = time.monotonic() + PATIENCE_S
    while not true():
        assert time.monotonic() < deadline, "it never became true"
        time.sleep(0.005)


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


BESIDE = ["silent", "garbage", "reads", "deaf"]
COMMANDING = ["writes", "second_commander", "giant_acquires"]


@pytest.mark.parametrize("name", BESIDE)
def test_stop_is_answered_beside(name, served, processes):
    bench, server = served
    commander, viewer = load_rig(server.url), load_rig(server.url)
    commander.set_pressure(1.5e5, 1.5e5)
    with attacked(processes, name, server.url):
        until(lambda: len(server._front.connections) > 5)
        thread, told = in_background(lambda: commander.move(0.29 if bench.state().position_m < 0.1 else 0.02, 0.02))
        until(lambda: bench.state().moving)
        viewer.stop()
        at_rest(bench)
        thread.join()
        late = load_rig(server.url)  # who comes while all this goes on gets in, and may stop the axis too
        late.stop()
        late.close()
    assert "stopped the axis" in told[0]
    viewer.close()
    commander.close()
    until(lambda: not server._front.connections)


@pytest.mark.parametrize("name", COMMANDING)
def test_stop_is_answered_against(name, served, processes):
    bench, server = served
    viewer = load_rig(server.url)
    with attacked(processes, name, server.url):
        for _ in range(3):
            until(lambda: server._commander is not None)
            viewer.stop()  # who commands is dismissed; it comes again, or another one
    viewer.stop()
    at_rest(bench)
    viewer.close()
    until(lambda: not server._front.connections)


def test_stop_is_answered_among_many_that_stop(served, processes):
    bench, server = served
    viewer = load_rig(server.url)
    with attacked(processes, "stops", server.url):
        until(lambda: len(server._front.connections) > 5)
        for _ in range(3):
            viewer.stop()
    at_rest(bench)
    viewer.close()
    until(lambda: not server._front.connections)


def test_one_commands_by_session():
    """Another one may read and stop, but neither move nor spoil a command nor keep a dead commander's axis moving."""
    bench = load_rig("default", pace=1.0)
    with RigServer(bench, load_map(), port=0) as server:
        anna, bert = load_rig(server.url), load_rig(server.url)
        anna.set_pressure(1.5e5, 1.5e5)
        thread, told = in_background(lambda: anna.move(0.29, 0.02))
        until(lambda: bench.state().moving)
        for work in (
            lambda: bert.move(0.1, 0.3),
            lambda: bert.set_pressure(2e5, 2e5),
            lambda: next(bert.acquire([Move(0.1, 0.3)], Sampling())),
            lambda: bert.begin_cycle("x"),
        ):
            with pytest.raises(RigError, match=r"commands this rig since .*others may observe and stop it"):
                work()
        until(lambda: bert.state().moving)  # what is served is some tenths of a second old
        assert bert.state().pressure_a_pa == pytest.approx(1.5e5, abs=SENSOR_PA)
        # its heart beats, but it is not the one that counts
        anna._link._loop.loop.call_soon_threadsafe(time.sleep, 1.2)
        until(lambda: not bench.state().moving)
        thread.join()
        assert "the connection was lost during 'move' and is back" in told[0]
        bert.move(0.03, 0.3)  # nobody commands now
        with pytest.raises(RigError, match="commands this rig since"):
            anna.move(0.1, 0.3)
        anna.stop()
        with pytest.raises(RigError, match=r"stopped the axis at .*connect again"):
            bert.move(0.1, 0.3)
        assert "stopped the axis" in bert.state().fault
        anna.move(0.04, 0.3)
        carla = load_rig(server.url)
        assert carla.state().fault is None  # what became of others is nothing to it
        for rig in (anna, bert, carla):
            rig.close()


def test_a_session_is_not_taken_over_and_a_subscription_is_ones_own():
    import asyncio

    from asyncua import Client, ua

    class Ignore:
        def datachange_notification(self, *_) -> None: ...

    async def work(url: str) -> None:
        async with Client(url) as one, Client(url) as other:
            subscription = await one.create_subscription(0, Ignore())
            assert subscription.parameters.RequestedPublishingInterval == 250  # as revised
            with pytest.raises(ua.UaStatusCodeError):
                await other.uaclient.delete_subscriptions([subscription.subscription_id])
            await one.create_subscription(100, Ignore())
            with pytest.raises(ua.uaerrors.BadTooManySubscriptions):
                await one.create_subscription(100, Ignore())
            for unknown in (other.nodes.server, other.nodes.objects):
                with pytest.raises(ua.UaStatusCodeError):
                    await unknown.call_method("0:GetMonitoredItems", 1)
            # another connection with the token of a session that lives
            thief = Client(url)
            await thief.connect_socket()
            await thief.send_hello()
            await thief.open_secure_channel()
            thief.uaclient.protocol.authentication_token = one.uaclient.protocol.authentication_token
            request = ua.ActivateSessionRequest()
            request.Parameters.UserIdentityToken = ua.AnonymousIdentityToken()
            with pytest.raises(ua.UaStatusCodeError):
                await thief.uaclient.protocol.send_request(request)
            thief.disconnect_socket()

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
