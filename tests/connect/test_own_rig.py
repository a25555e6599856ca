"""A laboratory's own Python as a rig: loaded because it is named, checked before it moves, served as any rig."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

from campaign.fake_rig import QUICK, protocol
from pneudrive.campaign.folder import Campaign
from pneudrive.campaign.run import DONE, resume_campaign, run_campaign
from pneudrive.cli.main import run
from pneudrive.errors import RigError
from pneudrive.rig import Hold, Move, Reproducible, Rig, Samples, Sampling, load_rig
from pneudrive.rig.opcua_nodes import load_map
from pneudrive.rig.opcua_server import RigServer

EXAMPLE = Path(__file__).parents[2] / "examples" / "own_rig.py"
PROTOCOL = """
name = "Two speeds"
[speed]
list = ["100 mm/s", "300 mm/s"]
settled_time = "0 s"
"""


def test_a_campaign_on_the_example(tmp_path):
    (tmp_path / "two.toml").write_text(PROTOCOL)
    arguments = ["campaign", "run", str(tmp_path / "two.toml"), "--rig", f"{EXAMPLE}:make_rig"]
    assert run([*arguments, "--into", str(tmp_path / "there")]) == 0
    files = list(Campaign.open(tmp_path / "there").cycles())
    assert [file.head.cycle.speed_m_s for file in files] == pytest.approx([0.1, 0.3])
    assert all(not file.head.flags for file in files)
    assert Campaign.open(tmp_path / "there").identity.name == "Bench 3"


def test_the_example_behind_opc_ua():
    rig = load_rig(f"{EXAMPLE}:make_rig")
    with RigServer(rig, load_map(), port=0) as server:
        there = load_rig(server.url)
        assert isinstance(there, Rig)
        assert not isinstance(there, Reproducible)
        assert (there.identity(), there.limits()) == (rig.identity(), rig.limits())
        there.set_pressure(1.5e5, 1.5e5)
        there.home()
        steps = [Move(0.2, 0.3), Hold(1.0), Move(0.1, 0.3)]
        samples = Samples.join(list(there.acquire(steps, Sampling())))
        assert samples.position_m.max() == pytest.approx(0.2)
        assert samples.position_m[-1] == pytest.approx(0.1)
        assert list(dict.fromkeys(samples.step.tolist())) == [0, 1, 2]
        with pytest.raises(RigError, match="one regulator for both chambers"):
            there.set_pressure(1.2e5, 1.5e5)
        there.stop()
        assert there.state().pressure_a_pa == pytest.approx(rig.identity().ambient_pressure_pa)
        there.close()


MISTAKES = [
    ("", "make_rig", r"no function or class of that name(?s:.*)Known: "),
    ("def make_rig(): pass", "make_rg", "Did you mean 'make_rig'"),
    ("def make_rig():\n    return 1 / 0", "make_rig", r"ZeroDivisionError: division by zero\.   .*own.py:2"),
    ("import no_such_driver", "make_rig", r"No module named 'no_such_driver'\.   .*own.py:1"),
    ("def make_rig(:", "make_rig", r"SyntaxError.*own.py:1"),
    ("class Bench:\n    def home(self): ...", "Bench", "it lacks identity, limits, state, set_pressure, move"),
]


@pytest.mark.parametrize(("code", "name", "words"), MISTAKES)
def test_code_that_is_no_rig_is_one_message(tmp_path, code, name, words):
    (tmp_path / "own.py").write_text(code)
    with pytest.raises(RigError, match=words):
        load_rig(f"{tmp_path / 'own.py'}:{name}")
    with pytest.raises(RigError, match="there is no file"):
        load_rig(f"{tmp_path / 'other.py'}:{name}")


def test_nothing_runs_that_is_not_named(tmp_path, monkeypatch):
    (tmp_path / "own.py").write_text("raise SystemExit('it ran')")
    monkeypatch.chdir(tmp_path)
    for source in ("own.py", "own", str(tmp_path)):
        with pytest.raises(RigError):
            load_rig(source)


BENCH = """
from campaign.fake_rig import FakeRig

closed = []

class Bench(FakeRig):
    def close(self):
        closed.append(self)
"""


def test_a_rig_is_found_again_from_another_folder_and_its_connection_closed(tmp_path, monkeypatch):
    (tmp_path / "bench.py").write_text(BENCH)
    monkeypatch.chdir(tmp_path)
    assert run_campaign(protocol(), "bench.py:Bench", "c", options=QUICK).ended == DONE
    assert len(sys.modules["bench"].closed) == 1
    monkeypatch.chdir(tmp_path / "c")
    assert resume_campaign(tmp_path / "c", options=QUICK).ended == DONE
