"""A laboratory's own Python as a rig: loaded because it is named, checked before it moves, served as any rig."""

from __future__ import annotations

import json
import py_compile
import shutil
import sys
import time
from contextlib import nullcontext
from dataclasses import replace
from hashlib import sha256
from importlib.util import cache_from_source
from pathlib import Path

import numpy as np
import polars as pl
import pytest

from campaign.fake_rig import QUICK, protocol
from pneudrive.campaign.run import DONE, run_campaign
from pneudrive.campaign.storage.folder import Campaign
from pneudrive.characteristics import characterise
from pneudrive.cli.main import run
from pneudrive.errors import RigError
from pneudrive.rig import Changeable, Hold, Move, Reproducible, Rig, Samples, Sampling, load_rig

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
    assert run([*arguments, "--out", str(tmp_path / "there")]) == 0
    files = list(Campaign.open(tmp_path / "there").cycles())
    assert [file.head.cycle.speed_m_s for file in files] == pytest.approx([0.1, 0.3])
    assert all(not file.head.flags for file in files)
    assert Campaign.open(tmp_path / "there").identity.name == "Bench 3"


MISTAKES = [
    ("", "make_rig", r"no function or class of this name(?s:.*)Known: "),
    ("def make_rig(): pass", "make_rg", "Did you mean 'make_rig'"),
    ("def make_rig():\n    return 1 / 0", "make_rig", r"ZeroDivisionError: division by zero\.   .*own.py:2"),
    ("import no_such_driver", "make_rig", r"No module named 'no_such_driver'\.   .*own.py:1"),
    ("def make_rig(:", "make_rig", r"SyntaxError.*own.py:1"),
    ("class Bench:\n    def home(self): ...", "Bench", "missing methods: identity, limits, state, set_pressure, move"),
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


def test_a_folder_never_decides_what_is_imported(tmp_path, monkeypatch, capsys, refusal):
    """Own code runs because the command of this run names it, or the hash of its file; all else only reads data."""
    (tmp_path / "bench.py").write_text(BENCH)
    monkeypatch.chdir(tmp_path)
    assert run_campaign(protocol(), "bench.py:Bench", "c", options=QUICK).ended == DONE
    assert len(sys.modules["bench"].closed) == 1  # its connection
    about = json.loads((tmp_path / "c" / "campaign.json").read_text())
    code = sha256((tmp_path / "bench.py").read_bytes()).hexdigest()
    assert about["rig_sha256"] == code
    monkeypatch.chdir(tmp_path / "c")

    def resume(*arguments: str, rig: str | None = None, made_with: str = code) -> str:
        (tmp_path / "c" / "campaign.json").write_text(json.dumps({**about, "rig": rig, "rig_sha256": made_with}))
        last.unlink(missing_ok=True)  # so that there is something to do
        status, error = run(["campaign", "resume", str(tmp_path / "c"), *arguments]), capsys.readouterr().err
        assert (status, last.exists()) in ((0, True), (2, False)), error
        return error

    last = max((tmp_path / "c" / "cycles").glob("*.parquet"))
    own = f"{tmp_path / 'bench.py'}:Bench"
    assert resume("--rig", own, rig="os:abort") == ""
    (tmp_path / "evil.py").write_text("raise SystemExit('it ran')")
    (tmp_path / "evil.toml").write_text('kind = "opc-ua"\nurl = "opc.tcp://127.0.0.1:1"\nreconnect = "0 s"')
    evil = f"{tmp_path / 'evil.py'}:make"
    for rig in (own, evil, "os:abort", "evil:make"):
        assert "only the user decides which code runs" in resume(rig=rig)
    for rig in ("opc.tcp://127.0.0.1:1", str(tmp_path / "evil.toml")):
        assert "which axis moves" in resume(rig=rig)
    assert resume("--allow-code", code.upper(), rig=own) == ""
    assert "not the allowed code" in resume("--allow-code", "0" * 64, rig=own)
    evil_code = sha256((tmp_path / "evil.py").read_bytes()).hexdigest()
    assert "not the allowed code" in resume("--allow-code", code, rig=evil, made_with=evil_code)
    assert "differs from the allowed code" in resume("--allow-code", code, rig=evil)
    # a compiled copy beside the file is of whoever made it, and modules beside it have no hash
    cache = tmp_path / "__pycache__"
    cache.mkdir()
    py_compile.compile(str(tmp_path / "evil.py"), cfile=cache_from_source(str(tmp_path / "bench.py")))
    assert resume("--allow-code", code, rig=own) == ""
    with_neighbour = BENCH + "import neighbour_of_bench\n"
    (tmp_path / "bench.py").write_text(with_neighbour)
    (tmp_path / "neighbour_of_bench.py").write_text("raise SystemExit('it ran')")
    monkeypatch.setattr(sys, "path", [path for path in sys.path if path != str(tmp_path)])
    code = sha256(with_neighbour.encode()).hexdigest()
    (tmp_path / "c" / "campaign.json").write_text(json.dumps({**about, "rig": own, "rig_sha256": code}))
    refusal(["campaign", "resume", tmp_path / "c", "--allow-code", code], "No module named 'neighbour_of_bench'")


# --- A campaign folder plays back as a rig: the same campaign to the bit, and nothing made up.


@pytest.fixture(scope="module")
def recorded(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("campaigns") / "recorded"
    run_campaign("quick-look", "default", folder)
    return folder


def test_a_campaign_again(recorded, tmp_path):
    rig = load_rig(recorded)
    assert isinstance(rig, Rig)
    assert isinstance(rig, Reproducible)
    assert isinstance(rig, Changeable)
    again = run_campaign("quick-look", str(recorded), tmp_path / "again").campaign
    original = Campaign.open(recorded)
    assert (again.identity, again.synthetic) == (original.identity, True)
    for a, b in zip(original.cycles(), again.cycles(), strict=True):
        assert (a.name, a.head.sha256, a.head.flags) == (b.name, b.head.sha256, b.head.flags)
        assert a.head.began_s == b.head.began_s
    assert characterise(tmp_path / "again").identical(characterise(recorded))


def test_real_time_and_stop(recorded):
    file = next(file for file in Campaign.open(recorded).cycles() if file.head.cycle.kind == "sweep")
    cycle, samples = file.head.cycle, file.samples()
    rig = load_rig(recorded, pace=20.0)
    rig.set_pressure(cycle.pressure_a_pa, cycle.pressure_b_pa)
    began = time.monotonic()
    played = Samples.join(list(rig.acquire(cycle.steps, cycle.sampling)))
    assert time.monotonic() - began == pytest.approx(samples.time_s[-1] / 20.0, rel=0.2, abs=0.3)
    assert np.array_equal(played.force_n, samples.force_n)
    assert rig.state().position_m == samples.position_m[-1]
    parts = rig.acquire(cycle.steps, cycle.sampling)
    next(parts)
    rig.stop()
    with pytest.raises(RigError, match="stopped"):
        next(parts)
    assert not rig.state().moving


def test_what_was_not_recorded_is_refused(recorded):
    rig = load_rig(recorded)
    cycle = next(file.head.cycle for file in Campaign.open(recorded).cycles() if file.head.cycle.kind == "sweep")
    rig.begin_cycle(cycle.key)
    rig.set_pressure(3e5, 3e5)
    with pytest.raises(
        RigError, match=r"(?s)no recording matches the cycle.*3 and 3 bar abs.*nearest: .*within 20 mbar"
    ):
        rig.acquire(cycle.steps, Sampling())
    rig.set_pressure(cycle.pressure_a_pa, cycle.pressure_b_pa)
    out, *rest = cycle.steps
    for steps in (
        [Move(out.to_m, 1.2 * out.speed_m_s), *rest],
        [out],
        [out, Hold(1.0), *rest],
        [Move(0.1, out.speed_m_s), *rest],
    ):
        with pytest.raises(RigError, match="no recording matches"):
            rig.acquire(steps, Sampling())
    assert len(Samples.join(list(rig.acquire(cycle.steps, Sampling())))) > 1000


def test_a_campaign_that_somebody_else_wrote(recorded, tmp_path):
    """Without an envelope, the rig file states the limits. Without steps, speed and stop are compared."""
    shutil.copytree(recorded, tmp_path / "plain")
    (tmp_path / "plain" / "campaign.json").write_text("{}")
    with pytest.raises(RigError, match=r"(?s)limits of the rig\..*plain/campaign.json.*\[limits\] in the rig file"):
        load_rig(tmp_path / "plain")
    limits = 'position = "5 mm .. 295 mm", speed = "1 m/s", force = "150 N", temperature = "15 degC .. 30 degC"'
    limits += ', acceleration = "5 m/s2", jerk = "200 m/s3", pressure = "0 bar gauge .. 1.5 bar gauge"'
    (tmp_path / "plain.toml").write_text(f'kind = "replay"\nfolder = "plain"\nlimits = {{ {limits} }}')
    for path in (tmp_path / "plain" / "cycles").iterdir():
        head = json.loads(pl.read_parquet_metadata(path)["pneudrive"])
        del head["cycle"]["steps"]
        pl.read_parquet(path).write_parquet(path, metadata={"pneudrive": json.dumps(head)})
    rig = load_rig(tmp_path / "plain.toml")
    file = next(file for file in Campaign.open(recorded).cycles() if file.cycle.kind == "sweep")
    rig.set_pressure(file.cycle.pressure_a_pa, file.cycle.pressure_b_pa)
    played = Samples.join(list(rig.acquire(file.cycle.steps, file.cycle.sampling)))
    assert np.array_equal(played.force_n, file.samples().force_n)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ('folder = "nowhere"', "nowhere is not a campaign folder"),
        ('folder = "x"\nlayout = "layout.toml"', "layout is not a known key"),
        ("", "folder is missing"),
        ('folder = "x"\nspeed_tolerance = "5"', r"speed_tolerance: '5' is not a percentage"),
        ('folder = "x"\ntolerance = "5 %"', "tolerance is not a known key"),
    ],
)
def test_rig_files_that_are_wrong(tmp_path, text, words):
    (tmp_path / "bench.toml").write_text(f'kind = "replay"\n{text}')
    with pytest.raises(RigError, match=words):
        load_rig(tmp_path / "bench.toml")


def test_a_folder_that_is_not_a_campaign(tmp_path):
    with pytest.raises(RigError, match=r"(?s)is not a campaign folder.*pneudrive characterise"):
        load_rig(tmp_path)


def test_a_rig_file_allows_other_speeds(recorded, tmp_path):
    cycle = next(file.head.cycle for file in Campaign.open(recorded).cycles() if file.head.cycle.kind == "sweep")
    steps = [replace(step, speed_m_s=1.2 * step.speed_m_s) for step in cycle.steps if isinstance(step, Move)]
    for tolerance, fits in (("5 %", False), ("40 %", True)):
        (tmp_path / "bench.toml").write_text(
            f'kind = "replay"\nfolder = "{recorded}"\nspeed_tolerance = "{tolerance}"\n'
        )
        rig = load_rig(tmp_path / "bench.toml")
        rig.set_pressure(cycle.pressure_a_pa, cycle.pressure_b_pa)
        with nullcontext() if fits else pytest.raises(RigError, match="no recording matches"):
            assert list(rig.acquire(steps, Sampling()))
