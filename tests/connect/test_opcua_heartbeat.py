"""A client that stops talking leaves the axis at rest, without pressure, within the heartbeat time; nodes say so."""

from __future__ import annotations

import re
import signal
import subprocess
import sys
import time

import pytest

from pneudrive.errors import ConnectionLostError
from pneudrive.rig import load_rig
from pneudrive.rig.opcua.nodes import load_map
from pneudrive.rig.opcua.server import RigServer

HEARTBEAT_S = 1.0
SENSOR_PA = 1000.0  # error of the rig's pressure transducer
CLIENT = """
import sys
from pneudrive.rig import Move, Sampling, load_rig
rig = load_rig(sys.argv[1])
rig.set_pressure(1.5e5, 1.5e5)
if sys.argv[2] == "acquire":
    for part in rig.acquire([Move(0.29, 0.02)], Sampling()):
        print(part.position_m[-1], flush=True)
else:
    print("moving", flush=True)
    rig.move(0.29, 0.02)
"""


@pytest.mark.parametrize(("how", "verb"), [("SIGSTOP", "acquire"), ("SIGKILL", "move")])
def test_the_axis_stops(how, verb):
    rig = load_rig("default", pace=1.0)
    with RigServer(rig, load_map(), port=0, heartbeat_s=HEARTBEAT_S) as server:
        client = subprocess.Popen([sys.executable, "-c", CLIENT, server.url, verb], stdout=subprocess.PIPE, text=True)
        try:
            client.stdout.readline()  # type: ignore[union-attr]
            begun = rig.state().position_m
            time.sleep(0.6)
            assert rig.state().position_m > begun
            assert rig.state().pressure_a_pa == pytest.approx(1.5e5, abs=SENSOR_PA)
            client.send_signal(getattr(signal, how))
            silent = time.monotonic()
            motion, last = silent, rig.state().position_m
            while time.monotonic() < silent + 1.5 * HEARTBEAT_S:
                time.sleep(0.002)
                if (now := rig.state().position_m) != last:
                    motion, last = time.monotonic(), now
            assert 0.0 < motion - silent < HEARTBEAT_S
            assert last < 0.1
            state = rig.state()
            assert not state.moving
            assert state.pressure_a_pa == pytest.approx(rig.identity().ambient_pressure_pa, abs=SENSOR_PA)
            words = "no heartbeat of the client for 0.75 s" if how == "SIGSTOP" else "connection of .* ended"
            assert re.search(f"{words}.*the server stopped the axis and released the pressure", server.fault)
        finally:
            client.send_signal(signal.SIGKILL)
            client.wait()
            client.stdout.close()  # type: ignore[union-attr]


def test_no_command_without_a_heartbeat():
    import asyncio

    from asyncua import Client, ua

    async def command(url: str) -> str:
        async with Client(url) as client:
            index = await client.get_namespace_index("urn:pneudrive:rig")
            verb, identity = (client.get_node(f"ns={index};s=Command.{name}") for name in ("Verb", "Id"))
            await verb.write_value(1, ua.VariantType.Int32)
            await identity.write_value(7, ua.VariantType.UInt32)
            assert await client.get_node(f"ns={index};s=Answer.Done").read_value() == 7
            with pytest.raises(ua.UaStatusCodeError):  # only what the client is to write can be written
                await client.get_node(f"ns={index};s=State.Position").write_value(0.1)
            return await client.get_node(f"ns={index};s=Answer.Fault").read_value()

    with RigServer(load_rig("default"), load_map(), port=0) as server:
        assert "no heartbeat" in asyncio.run(command(server.url))


def test_a_client_that_was_asleep_is_told_so():
    with RigServer(load_rig("default"), load_map(), port=0) as server:
        rig = load_rig(server.url)
        rig.set_pressure(1.5e5, 1.5e5)
        rig._link._loop.loop.call_soon_threadsafe(time.sleep, 1.2 * HEARTBEAT_S)  # as a laptop whose lid was shut
        time.sleep(HEARTBEAT_S)
        with pytest.raises(
            ConnectionLostError, match=r"(?s)during 'move' and is back.*stopped the axis.*without pressure"
        ):
            rig.move(0.1, 0.1)
        assert rig.state().pressure_a_pa == pytest.approx(rig.identity().ambient_pressure_pa, abs=SENSOR_PA)
        rig.move(0.1, 0.1)  # and that was all
        assert rig.state().fault is None
        rig.close()
