"""``pneudrive campaign run``, ``resume``, ``status``, ``pause``, ``abort``: what users type and what they get."""

from __future__ import annotations

import io
import json
import os
import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest

from campaign.fake_rig import PROTOCOL, FakeRig, contents, protocol
from pneudrive.campaign.planning.plan import lay_out
from pneudrive.campaign.storage.control import holder
from pneudrive.cli.main import run

TESTS = Path(__file__).parents[1]


@pytest.fixture
def folder(tmp_path):
    return tmp_path / "c"


@pytest.fixture
def asked(tmp_path):
    path = tmp_path / "small.toml"
    path.write_text(PROTOCOL.format(more="", repeats=1), encoding="utf-8")
    return str(path)


def test_run_and_status(folder, asked, capsys, printed):
    lines = printed(["campaign", "run", asked, "--out", folder, "--operator", "anna", "--label", "seal=B"]).splitlines()
    assert lines[0].startswith("Small campaign: 10 cycles, ")
    assert any(line.startswith("1/10 b1/warm-up") for line in lines)
    assert lines[-1] == f"10 cycles in {folder}"
    about = json.loads((folder / "campaign.json").read_text())
    assert (about["operator"], about["labels"], about["synthetic"], about["seed"]) == ("anna", {"seal": "B"}, True, 3)
    assert run(["campaign", "status", str(folder)]) == 0
    assert capsys.readouterr().out.splitlines() == [
        "Small campaign (synthetic), rig Default simulated rig",
        "10 of 10 planned cycles; done",
        "no process runs this campaign",
    ]
    sorted((folder / "cycles").iterdir())[4].write_bytes(b"PAR1")
    run(["campaign", "status", str(folder)])
    lines = capsys.readouterr().out.splitlines()
    assert lines[1].startswith("9 of 10 planned cycles; ")
    assert lines[2].startswith("problem: cycles/00005-b1_sweep_v50_a0_b0_r1.parquet: this is not a Parquet file")
    assert "put aside" in printed(["campaign", "resume", folder])
    assert len(contents(folder)) == 10


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["run", "nothing.toml", "--out", "c"], "nothing.toml"),
        (["run", "quick-look", "--out", "c", "--rig", "nothing"], "'nothing' is not a rig"),
        (["run", "quick-look", "--out", "c", "--label", "seal"], '--label "seal" is not key = value'),
        (["run", "quick-look", "--out", "c", "--timeout", "long"], "--timeout: "),
        (["resume", "c"], "this is not a campaign folder"),
        (["status", "c"], "this is not a campaign folder"),
        (["pause", "c"], "no process works in this campaign folder"),
        (["abort", "c"], "no process works in this campaign folder"),
    ],
)
def test_what_cannot_be_done_is_one_clear_message(tmp_path, monkeypatch, refusal, arguments, said):
    monkeypatch.chdir(tmp_path)
    refusal(["campaign", *arguments], said)
    assert not (tmp_path / "c").exists()


def test_a_fault_while_running_is_status_1_and_says_how_to_go_on(folder, asked, capsys, monkeypatch):
    monkeypatch.setattr(FakeRig, "set_pressure", lambda self, a, b: (_ for _ in ()).throw(OSError("valve stuck")))
    assert run(["campaign", "run", asked, "--out", str(folder), "--rig", "campaign.fake_rig:FakeRig"]) == 1
    error = capsys.readouterr().err
    assert "the custom code of the rig failed: OSError: valve stuck" in error
    assert f"pneudrive campaign resume {folder}" in error


def test_pause_resume_and_abort_by_the_command_line(folder, asked, capsys, printed, refusal):
    """One process runs in real time, this one talks to it."""
    process = subprocess.Popen(
        [sys.executable, "-m", "pneudrive", "campaign", "run", asked, "--out", str(folder), "--speed", "20"],
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        text=True,
        env={**os.environ, "PYTHONPATH": os.pathsep.join([str(TESTS), *sys.path])},
    )
    deadline = time.monotonic() + 60.0
    while (at := holder(folder)) is None or at.state != "running":
        assert time.monotonic() < deadline
        time.sleep(0.05)
    assert "paus" in printed(["campaign", "pause", "--now", folder])
    while holder(folder).state != "paused":
        assert time.monotonic() < deadline
        time.sleep(0.05)
    refusal(["campaign", "run", asked, "--out", folder], "another process works in this campaign folder")
    run(["campaign", "status", str(folder)])
    assert f"run by process {process.pid}" in capsys.readouterr().out
    assert "The campaign continues" in printed(["campaign", "resume", folder, "--operator", "eve"])
    assert "The campaign has ended" in printed(["campaign", "abort", folder])
    out, _ = process.communicate(timeout=60.0)
    assert process.returncode == 130
    assert "Resume: pneudrive campaign resume" in out


def test_the_live_picture_shows_what_runs():
    from rich.console import Console

    from pneudrive.campaign.running.live import TerminalDisplay

    out = io.StringIO()
    screen = TerminalDisplay(Console(file=out, force_terminal=True, width=100, height=30, color_system=None))
    rig, asked = FakeRig(), protocol()
    plan = lay_out(asked.model_copy(update={"name": "seal [/dry]"}), rig.identity(), rig.limits())
    screen.began(plan, [])
    cycle = plan.cycles[2]
    screen.cycle(cycle)
    for part in rig.acquire(cycle.steps, cycle.sampling):
        screen.part(part)
    for speed in (2e-3, 0.2):
        screen.finished(next(c for c in plan.cycles if c.speed_m_s == speed), {"stuck": 3})
    threading.Event().wait(0.3)
    screen.say("the supply pressure is low")
    screen.ended()
    shown = out.getvalue()
    assert "b1/sweep/v2/a0/b0/r1, " in shown
    assert "seal [/dry]" in shown
    assert f"2/{len(plan.cycles)}" in shown
    assert "the supply pressure is low" in shown
    assert "stuck 3" in shown
