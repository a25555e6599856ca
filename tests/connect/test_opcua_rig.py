"""A rig behind OPC UA is the same rig: same samples to the bit, same faults, whatever nodes, units and types it has."""

from __future__ import annotations

import re
import sys
import threading
import time
from importlib import import_module
from pathlib import Path

import numpy as np
import pytest

from pneudrive.errors import ConnectionLostError, RigError
from pneudrive.rig import Changeable, Envelope, Hold, Identity, Move, Reproducible, Rig, Samples, Sampling, load_rig
from pneudrive.rig.interface import CHANNELS
from pneudrive.rig.opcua.access import OpcUaFile
from pneudrive.rig.opcua.client import open_rig
from pneudrive.rig.opcua.nodes import DEFAULT_MAP, load_map
from pneudrive.rig.opcua.server import RigServer

STEPS = [Move(0.2, 0.3), Hold(0.4), Move(0.25, 0.3), Hold(0.1, released=True), Move(0.02, 0.2)]


@pytest.fixture(scope="module")
def served():
    with RigServer(load_rig("default", seed=3), load_map(), port=0) as server:
        yield server


def run_cycle(rig, key: str = "1", steps=STEPS, sampling: Sampling | None = None) -> Samples:
    rig.begin_cycle(key)
    rig.home()
    rig.set_pressure(1.5e5, 1.3e5)
    return Samples.join(list(rig.acquire(steps, sampling or Sampling())))


def assert_same(a: Samples, b: Samples) -> None:
    for name in (*CHANNELS, "step"):
        assert np.array_equal(getattr(a, name), getattr(b, name)), name


def test_same_rig_to_the_bit(served):
    direct, rig = load_rig("default", seed=3), load_rig(served.url)
    assert isinstance(rig, Rig)
    assert isinstance(rig, Reproducible)
    assert isinstance(rig, Changeable)
    assert (rig.identity(), rig.limits(), rig.levels()) == (direct.identity(), direct.limits(), direct.levels())
    memory = rig.memory()
    direct.restore(memory)
    for key in ("1", "2"):
        there, here = run_cycle(rig, key), run_cycle(direct, key)
        assert len(there) > 5 * load_map().handshake.chunk
        assert_same(there, here)
        assert (rig.memory(), rig.state()) == (direct.memory(), direct.state())
    rig.restore(memory)
    direct.restore(memory)
    assert_same(run_cycle(rig), run_cycle(direct))
    rig.close()


def test_a_ring_that_is_always_full_loses_nothing(tmp_path):
    path = tmp_path / "nodes.toml"
    path.write_text(DEFAULT_MAP.read_text().replace("slots = 8", "slots = 2").replace("chunk = 1000", "chunk = 37"))
    with RigServer(load_rig("default", seed=3), load_map(path), port=0) as server:
        rig = open_rig(OpcUaFile(url=server.url, map=str(path)))
        assert_same(run_cycle(rig, steps=STEPS[:2]), run_cycle(load_rig("default", seed=3), steps=STEPS[:2]))
        rig.close()


PLC_RIG = (Path(__file__).parents[1] / "data" / "opcua_rig_plc_rig.toml").read_text("utf-8")


def plc_map() -> str:
    """Write the default map as a small PLC has it: own ids, REAL and INT, daily units, a force that points back."""
    text = re.sub(r'"s=([\w.{}]+)"', r'"ns=4;s=GVL.\1"', DEFAULT_MAP.read_text())
    text = re.sub(r"(?s)\[(rig|simulation|sampling)\].*?(?=\n\[|\Z)", "", text).replace(
        'namespace = "urn:pneudrive:rig"', ""
    )
    lines = []
    table = ""
    for line in text.splitlines():
        table = line.strip("[] ") if line.startswith("[") else table
        key, _, rest = line.partition(" = ")
        node = rest.partition('"')[2].partition('"')[0]
        units = {"position": "mm", "speed": "mm/s", "pressure_a": "bar gauge", "pressure_b": "bar gauge", "force": "kN"}
        if "ns=4" not in line:
            lines.append(line)
        elif key == "temperature":
            lines.append('temperature = { constant = "21 degC" }')
        elif key == "supply_pressure":
            lines.append('supply_pressure = { constant = "7 bar abs" }')
        elif key == "weight":
            continue
        elif key in units:
            sign = ', positive = "-x"' if key == "force" else ""
            lines.append(f'{key} = {{ node = "{node}", unit = "{units[key]}", type = "Float"{sign} }}')
        elif key in ("kind", "verb") or (table, key) == ("samples", "step"):
            lines.append(f'{key} = {{ node = "{node}", type = "Int16" }}')
        else:
            lines.append(f'{key} = "{node}"')
    return "\n".join(lines)


def test_a_small_plc(tmp_path):
    (tmp_path / "plc.toml").write_text(plc_map())
    with RigServer(load_rig("default", seed=3), load_map(tmp_path / "plc.toml"), port=0) as server:
        (tmp_path / "bench.toml").write_text(PLC_RIG.format(url=server.url))
        rig = load_rig(tmp_path / "bench.toml")
        assert not isinstance(rig, Reproducible)
        assert rig.identity() == Identity(
            name="Bench 3",
            area_a_m2=pytest.approx(np.pi / 4 * 0.025**2),
            area_b_m2=pytest.approx(np.pi / 4 * 0.025**2),
            ambient_pressure_pa=101300.0,
            mass_beyond_sensor_kg=0.8,
            accuracy={"force_n": 0.1, "pressure_a_pa": 400.0, "bore_m": 1e-5},
            limits={"force_n": (-200.0, 200.0), "pressure_a_pa": (101300.0, 501300.0)},
            chambers="separate",
        )
        assert isinstance(rig.limits(), Envelope)
        assert rig.limits().pressure_pa == (101300.0, 401300.0)
        rig.home()
        rig.set_pressure(1.5e5, 1.3e5)
        direct = load_rig("default", seed=3)
        direct.home()
        direct.set_pressure(1.5e5, 1.3e5)
        there, here = (Samples.join(list(r.acquire(STEPS, Sampling()))) for r in (rig, direct))
        assert there.step.tolist() == here.step.tolist()
        assert there.position_m == pytest.approx(here.position_m, abs=1.1e-6)  # 32-bit targets, encoder of 1 um
        for name in ("force_n", "pressure_a_pa"):
            step = direct.identity().resolution[name]
            assert getattr(there, name) == pytest.approx(getattr(here, name), rel=1e-7, abs=1.01 * step)
        assert set(there.temperature_k) == {294.15}
        assert rig.state().pressure_a_pa == pytest.approx(direct.state().pressure_a_pa, rel=1e-6)
        rig.close()


def test_faults_of_the_rig_come_through(served):
    rig = load_rig(served.url)
    with pytest.raises(RigError, match=r"(?s)'move' failed.*Rule"):
        rig.move(5.0, 0.1)
    with pytest.raises(RigError, match="'set pressure' failed"):
        rig.set_pressure(1e9, 1e5)
    with pytest.raises(RigError, match=r"(?s)300 steps.*at most 256"):
        list(rig.acquire([Move(0.1, 0.1), Move(0.2, 0.1)] * 150, Sampling()))
    rig.home()  # and nothing of it stays
    rig.close()


def test_closing_an_acquisition_brings_the_axis_to_rest():
    with RigServer(load_rig("default", pace=1.0), load_map(), port=0) as server:
        rig = load_rig(server.url)
        parts = rig.acquire([Move(0.29, 0.02)], Sampling())
        next(parts)
        parts.close()
        at = rig.state()
        assert not at.moving
        time.sleep(0.3)
        assert rig.state().position_m == at.position_m < 0.1
        rig.set_pressure(1.2e5, 1.2e5)  # it takes commands again
        parts = rig.acquire([Move(0.29, 0.02)], Sampling())
        next(parts)
        threading.Timer(0.3, rig.stop).start()  # from another thread, as on Ctrl-C
        with pytest.raises(RigError, match="another command of this program ended this command"):
            for _ in parts:
                pass
        rig.home()
        parts = rig.acquire([Move(0.29, 0.02)], Sampling())
        next(parts)
        link = rig._link
        link._loop.loop.call_soon_threadsafe(link._client.disconnect_socket)  # a cable that was pulled, and put back
        with pytest.raises(ConnectionLostError, match=r"(?s)during the acquisition and was restored.*Repeat the cycle"):
            for _ in parts:
                pass
        assert not rig.state().moving
        rig.home()
        time.sleep(0.3)
        assert rig.state().pressure_a_pa == pytest.approx(rig.identity().ambient_pressure_pa, abs=1000.0)
        rig.close()


def test_no_server_and_a_map_that_does_not_fit(served, tmp_path):
    with pytest.raises(RigError, match=r"(?s)cannot be reached.*rig serve"):
        load_rig("opc.tcp://127.0.0.1:1")
    text = DEFAULT_MAP.read_text()
    mistakes = [
        (
            text.replace('"s=Answer.Done"', '"s=Answer.Dnoe"'),
            r"node answer.done \(.*Dnoe\) cannot be used: BadNodeIdUnknown",
        ),
        (text.replace("urn:pneudrive:rig", "urn:other"), "no namespace urn:other"),
        (text.replace("done =", "finished ="), r"(?s)answer.finished is not a known key.*nodes.toml:\d+.*Known: done"),
        (text.replace('done = "s=', 'done = "'), "is not a node id"),
        (text.replace("Samples.{slot}.Time", "Samples.Time"), "only ids of nodes in the ring contain"),
        (text.replace('"s=State.Force"', '{ node = "s=State.Force", unit = "mm" }'), "state.force: .*is a length"),
        (text.replace('"s=State.Force"', '{ constant = "1 N" }'), "cannot be a constant"),
        (text.replace('heartbeat = "1 s"', 'heartbeat = "1"'), "handshake.heartbeat: .*no unit"),
        (text.replace("schema = 1", "schema = 2"), "schema = 2 is not known"),
        (re.sub(r'done = "s=.*\n', "", text), "answer.done is missing"),
    ]
    for wrong, words in mistakes:
        assert wrong != text
        (tmp_path / "nodes.toml").write_text(wrong)
        with pytest.raises(RigError, match=words):
            open_rig(OpcUaFile(url=served.url, map=str(tmp_path / "nodes.toml")))


def test_the_rig_file_of_the_guide_is_one(tmp_path):
    guide = (Path(__file__).parents[2] / "docs" / "guide" / "opc-ua.md").read_text()
    text = re.findall(r"(?s)```toml\n(.*?)```", guide)[0]
    (tmp_path / "rig.toml").write_text(text, encoding="utf-8")
    file = OpcUaFile.load(tmp_path / "rig.toml")
    identity, limits = file.described()
    assert identity is not None
    assert limits is not None
    assert (identity.resolution, limits.supply_pressure_pa) == ({"force_n": pytest.approx(0.006)}, 5e5)
    assert limits.pressure_pa == pytest.approx((101300.0, 251300.0))
    assert file.password_env == "PNEUDRIVE_RIG_PASSWORD"


def test_without_the_library_the_extra_is_named(monkeypatch):
    monkeypatch.setattr("importlib.util.find_spec", lambda _: None)
    for name in [name for name in sys.modules if name.startswith("pneudrive.rig.opcua")]:
        monkeypatch.delitem(sys.modules, name)
    for use in (lambda: load_rig("opc.tcp://127.0.0.1:1"), lambda: import_module("pneudrive.rig.opcua.server")):
        with pytest.raises(RigError, match=r"(?s)needs the optional library asyncua.*pneudrive\[rig\]"):
            use()
