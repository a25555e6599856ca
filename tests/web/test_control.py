"""Laws on the page: a run, its command and its Python give the same bits; the score card says what the files say."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import polars as pl
import pytest

import pneudrive as pn
from pneudrive.control.mismatch import ready_mismatches
from pneudrive.control.scores import written
from pneudrive.control.setup import ready_setups
from pneudrive.errors import Cancelled, CommandError, PneudriveWarning
from pneudrive.web.live import answer
from pneudrive.web.workspace import Workspace
from waiting import until
from web.client import post, run_python
from web.conftest import DRIVE, Served
from web.frames import unpack
from web.test_friction import finished

STEP = "250 mm; 0.1 s: 280 mm in 0.2 s"
SLOW = "sine 60 mm 0.5 Hz around 250 mm"
ASKED = {
    "what": "control",
    "path": "axis.toml",
    "law": "pid",
    "gains": {"gain": "4 1/m", "friction_share": 0.25},
    "reference": STEP,
    "setup": "cheap",
    "mismatch": "mass+30",
    "seed": 7,
    "duration": "0.6 s",
}
COLUMNS = {
    "position_m": "position",
    "pressure_a_pa": "pressure_a",
    "command": "command",
    "disturbance_n": "disturbance",
}


def asked(served: Served, **changes: object) -> tuple[dict, dict]:
    return unpack(answer(Workspace.at(served.folder), json.dumps(ASKED | {"number": 3} | changes)))


def shell(served: Served, lines: str) -> None:
    """Run lines of a shell in the folder; `pneudrive` is the one of this package."""
    tool = served.folder.parent / "bin" / "pneudrive"
    tool.parent.mkdir(exist_ok=True)
    tool.write_text(f'#!/bin/sh\nexec "{sys.executable}" -m pneudrive "$@"\n')
    tool.chmod(0o755)
    environment = {**os.environ, "PATH": f"{tool.parent}:{os.environ['PATH']}"}
    subprocess.run(["sh", "-ec", lines], cwd=served.folder, env=environment, check=True, capture_output=True)


def test_run_command_and_python_give_the_same_bits(served: Served, monkeypatch: pytest.MonkeyPatch) -> None:
    (served.folder / "axis-pid.toml").write_text("mine")
    with served.client.websocket_connect("/api/live", **served.socket) as socket:
        socket.send_text(json.dumps(ASKED | {"number": 3}))
        head, drawn = unpack(socket.receive_bytes())
    assert head["number"] == 3, head
    assert "problems" not in head, head
    assert {one["key"]: one["number"] for one in head["gains"] if one["rule"] == "given"} == {
        "gain": 4.0,
        "friction_share": 0.25,
    }
    ends = {one["key"]: (one["low"], one["high"]) for one in head["gains"]}  # from a quarter to four times the value
    assert (ends["gain"], ends["friction_share"]) == (pytest.approx((1.0, 16.0)), pytest.approx((0.0625, 1.0)))
    assert head["view"]["tables"][0]["rows"] == [["moving_mass", "1.3"]]
    monkeypatch.chdir(served.folder)
    names = run_python(head["python"])
    shell(served, head["command"])
    assert (served.folder / "axis-pid.toml").read_text() == "mine"
    table = pl.read_parquet("axis-control.parquet")
    run = names["run"]
    for column, name in COLUMNS.items():
        assert np.array_equal(drawn[column], run[name].to_numpy()), name
        assert np.array_equal(drawn[column], table[column].to_numpy()), name
    assert np.array_equal(drawn["error_m"], (run.reference - run.position).to_numpy())
    assert head["max_error_m"] == run.attrs["score"]["max_error_m"]
    head, other = asked(served, mismatch="")  # what is true counts
    assert not np.array_equal(other["position_m"], drawn["position_m"])


def test_what_a_terminal_warns_of_is_told(served: Served, monkeypatch: pytest.MonkeyPatch) -> None:
    """A deviation without a number is one all the same."""
    head, _ = asked(served, mismatch="load-step")
    assert not [table for table in head["view"]["tables"] if "True drive" in table["caption"]]
    assert head["mismatch"] == ["load-step", "A force of 20 N from 6.2 s to 13.3 s; assumed."]
    monkeypatch.chdir(served.folder)
    with pytest.warns(PneudriveWarning) as told:
        run_python(head["python"])
    assert head["warnings"] == [str(one.message) for one in told]
    assert "the entry at 6.2 s has no effect" in head["warnings"][0]


def test_a_controller_file_is_run_too(served: Served, monkeypatch: pytest.MonkeyPatch) -> None:
    drive = pn.Drive.load(served.folder / "axis.toml")
    pn.control.tune(drive, "inversion").save(served.folder / "MINE.TOML")
    head, drawn = asked(served, law="MINE.TOML", gains={}, setup="real", mismatch="")
    monkeypatch.chdir(served.folder)
    names = run_python(head["python"])
    assert np.array_equal(drawn["position_m"], names["run"].position.to_numpy())
    assert head["law"] == "inversion"
    for key, name, ready in (("setup", "real", ready_setups()), ("mismatch", "mass+30", ready_mismatches())):
        (served.folder / "own-copy.toml").write_text(ready[name].read_text("utf-8"))  # in a file, the same numbers
        both = [asked(served, **{key: one})[1]["position_m"] for one in (name, "own-copy.toml")]
        assert np.array_equal(*both), key


@pytest.mark.parametrize(
    "changes",
    [
        {"law": "../evil.toml", "gains": {}},
        {"law": "evil.py:Law", "gains": {}},
        {"law": "own.toml", "gains": {}},
        {"law": "led.toml", "gains": {}},
        {"reference": "../record.csv"},
        {"reference": "/etc/hostname.gcode:X"},
        {"setup": "../evil.toml"},
        {"mismatch": "/tmp/evil.toml"},
        {"path": "../evil.toml"},
        {"gains": {"gain": [1]}},
        {"gains": {"gain": "4 bar"}},
        {"seed": True},
        {"duration": "1e9 s"},
        {"duration": "900 s", "law": "nmpc", "gains": {}, "reference": SLOW},
    ],
)
def test_what_is_no_run_is_answered_in_words(served: Served, changes: dict, monkeypatch: pytest.MonkeyPatch) -> None:
    (served.folder.parent / "evil.toml").write_text(DRIVE)
    (served.folder / "evil.py").write_text("raise SystemExit('it ran')\n")
    (served.folder / "own.toml").write_text('law = "evil.py:Law"\n')
    (served.folder / "led.toml").write_text('law = "pid"\ndrive = "../evil.toml"\n')
    monkeypatch.setattr("pneudrive.web.drive.control.MOST_SECONDS", 0.05)
    head, arrays = asked(served, **changes)
    assert head["problems"][0]["what"]
    assert not arrays


def card_of(served: Served, measure: str = "max_error_m") -> dict:
    given = {"path": "results/laws", "measure": measure}
    answered = served.client.get("/api/comparison", params=given, headers=served.headers)
    assert answered.status_code == 200, answered.text
    return answered.json()


def test_a_comparison_is_run_cancelled_resumed_and_shown(served: Served, monkeypatch: pytest.MonkeyPatch) -> None:
    begun = {"drive": "axis.toml", "laws": ["inversion", "pid"], "references": [STEP, SLOW], "count": 3, "name": "laws"}
    post(served, "/api/comparisons", begun | {"mismatch": "mass+30"})
    runs = served.folder / "results" / "laws" / "runs"
    until(lambda: list(runs.glob("[!.]*.parquet")))
    number = served.jobs[0].number
    post(served, "/api/cancel", {"number": number})
    job = finished(served)
    assert job["state"] == "cancelled"
    assert 0 <= job["progress"]["done"] < job["progress"]["total"] == 12
    before = {path: path.stat().st_mtime_ns for path in runs.glob("[!.]*.parquet")}
    assert 0 < len(before) < 12
    card = card_of(served)
    assert not card["finished"]
    assert card["total"] == 12
    so_far = {(one["law"], one["reference"], one["seed"]): one["value"] for one in card["each"]}
    assert len(so_far) == card["done"] <= len(before) <= len(so_far) + 2  # two that were being told

    post(served, "/api/comparisons", {"resume": "results/laws"})
    job = finished(served)
    assert job["state"] == "done", job["tail"]
    assert job["progress"] == {"done": 12, "total": 12, "task": "runs"}
    assert "{" not in job["tail"]
    assert {path: path.stat().st_mtime_ns for path in before} == before  # none was run again
    listed = served.client.get("/api/studies", headers=served.headers).json()["files"]
    assert {"results/laws": "comparison"}.items() <= {one["path"]: one["kind"] for one in listed}.items()
    assert not [one for one in listed if "runs/" in one["path"]]

    card = card_of(served)
    assert card["finished"]
    each = {(one["law"], one["reference"], one["seed"]): one["value"] for one in card["each"]}
    assert len(each) == 12
    assert so_far.items() <= each.items()
    assert not (served.folder / "results" / "laws" / "so-far.jsonl").exists()
    assert card["command"].startswith("pneudrive control benchmark axis.toml --laws inversion,pid")
    monkeypatch.chdir(served.folder)
    names = run_python(card["python"])
    made = names["card"]
    for cell in card["cells"]:
        assert cell["value"] == made.middle(cell["law"], cell["reference"], "max_error_m")
    table = pl.read_csv("results/laws/score.csv")
    assert sorted(one["value"] for one in card["each"]) == sorted(table["max_error_m"])
    best = {cell["reference"]: cell["law"] for cell in card["cells"] if cell["best"]}
    assert best[SLOW] == "inversion" == made.best(SLOW)
    true, told, _ = card["told"]["tables"]
    assert true["rows"] == [["moving_mass", "1.3", "1.3"]]
    gain = next(row for row in told["rows"] if row[:2] == ["pid", "gain"])
    assert gain[2] == made.about["laws"]["pid"]["gains"][0]["written"]
    settled = card_of(served, "settling_100_um_s")  # a sine has no settling: no text, and no number
    assert {cell["text"] for cell in settled["cells"] if cell["reference"] == SLOW} == {""}
    never = {cell["law"]: cell for cell in settled["cells"] if cell["reference"] == STEP}
    assert never["pid"]["text"] == written("settling_100_um_s", made.middle("pid", STEP, "settling_100_um_s"))

    (served.folder / "axis.toml").unlink()  # the card is shown all the same, without its command
    later = card_of(served)
    assert later["cells"] == card["cells"]
    assert later["command"] == ""
    assert "read_comparison" in later["python"]

    given = {"path": "results/laws", "reference": SLOW, "pixels": "4000"}
    frame = served.client.get("/api/tracks", params=given, headers=served.headers)
    head, arrays = unpack(frame.content)
    assert head["laws"] == ["inversion", "pid"]
    track = made.of("pid", SLOW)[0].columns("position_m", "reference_m")
    assert arrays["pid/position_m"].max() == track["position_m"].max()
    assert arrays["pid/error_m"].min() == (track["reference_m"] - track["position_m"]).min()


def test_another_comparison_in_the_folder_takes_the_scores_with_it(tmp_path: Path) -> None:
    drive = pn.Drive.load("catalogue:reference")
    pn.control.benchmark(drive, ["inversion"], [STEP], seeds=1, out=tmp_path)
    first = pn.control.read_comparison(tmp_path)
    assert [run.law for run in first.runs] == ["inversion"]
    assert first.runs[0].columns("position_m")["position_m"][0] == pytest.approx(0.25, abs=1e-9)
    flag = type("Flag", (), {"is_set": lambda self: True})()
    with pytest.raises(Cancelled):
        pn.control.benchmark(drive, ["pid"], [STEP], seeds=1, out=tmp_path, cancel=flag)
    second = pn.control.read_comparison(tmp_path)
    assert not second.is_finished
    assert {run.law for run in second.runs} <= {"pid"}  # none of the first
    about = json.loads((tmp_path / "comparison.json").read_text())
    for damaged in ({"drive": 3}, {key: value for key, value in about.items() if key != "laws"}):
        (tmp_path / "comparison.json").write_text(json.dumps(damaged))
        with pytest.raises(CommandError, match="damaged"):
            pn.control.read_comparison(tmp_path)
    with pytest.raises(CommandError, match="not a comparison"):
        pn.control.read_comparison(tmp_path / "runs")


def test_two_names_of_one_reference_keep_their_runs(tmp_path: Path) -> None:
    made = pn.control.benchmark(
        pn.Drive.load("catalogue:reference"), ["inversion"], {"a": STEP, "b": STEP}, seeds=2, out=tmp_path
    )
    read = pn.control.read_comparison(tmp_path)
    assert [(run.reference, run.seed) for run in read.runs] == [("a", 1), ("a", 2), ("b", 1), ("b", 2)]
    for along in "ab":
        assert read.middle("inversion", along, "max_error_m") == made.middle("inversion", along, "max_error_m") > 0.0


@pytest.mark.parametrize(
    "changes",
    [
        {"laws": []},
        {"laws": ["evil.py:Law"]},
        {"laws": ["../evil.toml"]},
        {"laws": ["pid,evil.py:Law"]},
        {"references": ["../x.csv"]},
        {"references": [3]},
        {"name": "../out"},
        {"count": 0},
        {"spread": "/etc/x.toml"},
        {"setup": "--out"},
        {"resume": "axis.toml"},
        {"resume": "../laws"},
    ],
)
def test_what_is_no_comparison_is_refused(served: Served, changes: dict) -> None:
    begun = {"drive": "axis.toml", "laws": ["inversion"], "references": [STEP], "count": 1, "name": "laws"}
    refused = post(served, "/api/comparisons", begun | changes, 400)
    assert refused["problems"][0]["what"]
    assert served.jobs == []


def test_choices_are_those_of_the_drive(served: Served) -> None:
    answered = served.client.get("/api/control", params={"path": "axis.toml"}, headers=served.headers).json()
    assert {"pid", "nmpc"} <= set(answered["laws"])
    usual = pn.control.standard(pn.Drive.load(served.folder / "axis.toml"))
    assert {one["name"]: one["text"] for one in answered["references"]} == {k: v.text for k, v in usual.items()}
    assert {one["name"] for one in answered["references"] if not one["usable"]} == {"R4"}
