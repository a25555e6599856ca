"""A campaign over OPC UA is the direct one, to the bit; a server that is killed costs at most the running cycle."""

from __future__ import annotations

import multiprocessing
import os
import re
import signal
import socket
import subprocess
import sys
import threading
import time
from pathlib import Path

import numpy as np
import pytest

from connect import served_child
from pneudrive.campaign.run import run_campaign
from pneudrive.campaign.storage.folder import Campaign
from pneudrive.errors import ConnectionLostError
from pneudrive.rig import load_rig
from pneudrive.rig.opcua.access import make_certificate
from pneudrive.rig.opcua.nodes import load_map
from pneudrive.rig.opcua.server import RigServer

PROTOCOL = Path(__file__).parents[1] / "data" / "opcua_quick_look.toml"  # quick-look with fewer samples
KILLS = 2
BENCH = (Path(__file__).parents[1] / "data" / "opcua_tls_rig.toml").read_text("utf-8")
PACE = 60.0  # a cycle takes a tenth of a second or more, so that a kill comes in the middle of it


@pytest.fixture(scope="module")
def direct(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("campaigns") / "direct"
    run_campaign(PROTOCOL, "default", folder)
    return folder


def assert_same_campaign(one: Path, other: Path) -> list[int]:
    """Hold every file of both against each other, but for when and how often it was begun; give the attempts."""
    here, there = (list(Campaign.open(folder).cycles()) for folder in (one, other))
    assert [file.name for file in here] == [file.name for file in there]
    for a, b in zip(here, there, strict=True):
        assert a.head.sha256 == b.head.sha256, a.name  # every bit of every sample
        for what in ("cycle", "began_s", "flags", "memory"):
            assert getattr(a.head, what) == getattr(b.head, what), (a.name, what)
    assert Campaign.open(one).identity == Campaign.open(other).identity
    return [file.head.attempts for file in there]


def test_a_campaign_over_a_connection_is_the_direct_one(direct, tmp_path):
    seed = Campaign.open(direct).about["seed"]
    with RigServer(load_rig("default", seed=seed), load_map(), port=0) as server:
        run_campaign(PROTOCOL, server.url, tmp_path / "there")
    assert set(assert_same_campaign(direct, tmp_path / "there")) == {1}


class Server:
    """`pneudrive rig serve` over TLS in a process of its own, killed and started again.

    A process that has imported everything forks it, so that it is there again fast.
    """

    def __init__(self, seed: int, folder: Path) -> None:
        with socket.socket() as free:
            free.bind(("127.0.0.1", 0))
            self.port = free.getsockname()[1]
        self.options = ["default", "--port", str(self.port), "--speed", str(PACE), "--seed", str(seed)]
        for name in ("server", "client"):
            make_certificate(folder, name)
        files = {"--certificate": "server.pem", "--trust": "client.pem"}
        self.options += [text for option, name in files.items() for text in (option, str(folder / name))]
        self.rig = folder / "bench.toml"
        self.rig.write_text(BENCH.format(port=self.port))
        self.context = multiprocessing.get_context("forkserver")
        self.context.set_forkserver_preload(["connect.served_child"])
        self.kills, self.over = 0, threading.Event()
        self.start()

    def start(self) -> None:
        here, there = self.context.Pipe(duplex=False)
        self.process = self.context.Process(target=served_child.serve, args=(self.options, there))
        self.process.start()
        there.close()
        with os.fdopen(os.dup(here.fileno())) as printed:
            assert "opc.tcp" in printed.readline()
        self.printed = here  # open as long as the process prints

    def kill(self) -> None:
        self.process.kill()
        self.process.join()
        self.printed.close()

    def keep_killing(self, folder: Path, rng: np.random.Generator) -> None:
        """Kill it in the middle of one cycle after the other."""
        cycles = folder / "cycles"
        while self.kills < KILLS and not self.over.is_set():
            finished = len(list(cycles.glob("*.parquet"))) if cycles.is_dir() else 0
            if finished > self.kills:
                time.sleep(rng.uniform(0.0, 0.1))
                self.kill()
                self.kills += 1
                self.start()
            time.sleep(0.002)


def test_a_server_that_is_killed_costs_at_most_the_running_cycle(direct, tmp_path):
    server = Server(Campaign.open(direct).about["seed"], tmp_path)
    killer = threading.Thread(target=server.keep_killing, args=(tmp_path / "there", np.random.default_rng(5)))
    killer.start()
    try:
        run_campaign(PROTOCOL, str(server.rig), tmp_path / "there")
    finally:
        server.over.set()
        killer.join()
        server.kill()
    assert server.kills == KILLS
    attempts = assert_same_campaign(direct, tmp_path / "there")
    assert sum(attempts) - len(attempts) <= KILLS


# --- A client that stops talking leaves the axis at rest, without pressure, within the heartbeat time; nodes say so.

HEARTBEAT_S = load_map().handshake.heartbeat_s
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
    with RigServer(rig, load_map(), port=0) as server:
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
            ConnectionLostError, match=r"(?s)during 'move' and was restored.*stopped the axis.*without pressure"
        ):
            rig.move(0.1, 0.1)
        assert rig.state().pressure_a_pa == pytest.approx(rig.identity().ambient_pressure_pa, abs=SENSOR_PA)
        rig.move(0.1, 0.1)  # and that was all
        assert rig.state().fault is None
        rig.close()
