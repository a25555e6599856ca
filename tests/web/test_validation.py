"""A drive against recordings from the page: as command and Python find it, and runs of a changed drive beside it."""

from __future__ import annotations

import json
import signal
import time
from pathlib import Path

import numpy as np
import polars as pl
import pytest

import pneudrive as pn
from oracle.drive_records import drive, record
from pneudrive.identify.dynamic.result import DriveFit
from pneudrive.web.live import answer
from pneudrive.web.workspace import Workspace
from web.client import get, post, run_line, run_python
from web.conftest import Served
from web.frames import unpack

WRITTEN = "results/friday/validation.toml"
ASKED = {"kind": "validate", "drive": "axis.toml", "recordings": ["friday.parquet"], "name": "friday"}
LONG_S = 15.0
BEGIN_S = 512.0  # of the clock of the logger
TRUE_C = "1.6 dm3/(s bar)"


@pytest.fixture(scope="module")
def bench(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("bench")
    (folder / "axis.toml").write_text(drive().to_toml())
    own = record(drive(valve__conductance=TRUE_C), 3, duration_s=2.0)
    pl.DataFrame({**own.columns, "time_s": own.time_s + BEGIN_S}).write_parquet(folder / "friday.parquet")
    return folder


@pytest.fixture
def validated(served: Served, bench: Path) -> Served:
    for path in bench.iterdir():
        (served.folder / path.name).write_bytes(path.read_bytes())
    folder = served.folder / "results" / "friday"
    folder.mkdir(parents=True)
    kept = bench.parent / "kept"
    if not kept.is_dir():
        kept.mkdir()
        pn.validate(pn.Drive.load(bench / "axis.toml"), bench / "friday.parquet").write(kept)
    for path in kept.iterdir():
        (folder / path.name).write_bytes(path.read_bytes())
    return served


def asked_frame(served: Served, **given: object) -> tuple[dict, dict]:
    asked = {"what": "validation", "number": 3, "path": WRITTEN, "record": 0, "span": [0.0, 9.0], "pixels": 4000}
    return unpack(answer(Workspace.at(served.folder), json.dumps(asked | given)))


def test_page_command_and_python_find_the_same(served: Served, bench: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for path in bench.iterdir():
        (served.folder / path.name).write_bytes(path.read_bytes())
    copied = post(served, "/api/work", ASKED)
    monkeypatch.chdir(served.folder)
    monkeypatch.setattr("pneudrive.report.validation.write_validation_report", lambda *_: "report.html")  # takes long
    Path("results").mkdir()
    assert run_line(copied["command"]) == 0
    names = run_python(copied["python"])
    found = names["found"]
    Path("results/by-python").mkdir()  # paths of inputs are relative to the folder
    for path in found.write("results/by-python"):
        assert path.read_bytes() == Path("results/friday", path.name).read_bytes()

    shown = get(served, "/api/validation", path=WRITTEN)
    assert (shown["drive"], shown["editable"]) == ("axis.toml", True)
    (cause,) = shown["diagnosis"]["culprit"]
    assert cause["text"] == found.diagnosis().culprits[0].text
    assert cause["amount"] < -0.15  # the valve passes less than the model
    assert cause["free"] == ["valve.conductance"]
    (one,) = shown["record"]
    assert (one["file"], one["start_s"], one["span"][0]) == ("friday.parquet", BEGIN_S, 0.0)
    assert one["position_m"]["free"]["fit_percent"] == found.records[0].channels["position_m"].free.fit_percent
    _, drawn = asked_frame(served)
    for channel in ("position_m", "pressure_a_pa", "pressure_b_pa"):
        measured, free = getattr(found.records[0].signals, channel), found.records[0].free[channel]
        assert np.array_equal(drawn[f"{channel}.measured"], measured)
        assert np.array_equal(drawn[f"{channel}.free"], free)
        assert np.array_equal(drawn[f"{channel}.free.residual"], measured - free)


def test_a_running_validation_is_cancelled(served: Served, bench: Path) -> None:
    """Ctrl-C reaches it while it simulates, also from a server that a script has started in the background.

    A folder that is there holds whole files, and no report.
    """
    for path in bench.iterdir():
        (served.folder / path.name).write_bytes(path.read_bytes())
    long = record(drive(), 5, duration_s=LONG_S)
    pl.DataFrame(long.columns).write_parquet(served.folder / "long.parquet")
    handler = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        job = post(served, "/api/jobs", ASKED | {"recordings": ["long.parquet"]})
    finally:
        signal.signal(signal.SIGINT, handler)
    (running,) = served.jobs
    while b"done" not in running.log.read_bytes():  # it is past its imports
        assert running.process.poll() is None
        time.sleep(0.02)
    time.sleep(0.1)  # and its first call of the core, in which NumPy is looked up
    post(served, "/api/cancel", {"number": job["number"]})
    assert running.process.wait(30.0) == 130
    assert get(served, "/api/jobs")["jobs"][0]["state"] == "cancelled"
    assert not (served.folder / "results" / "friday" / "report.html").exists()


def test_a_changed_drive_runs_beside_the_record_with_the_bits_of_a_validation(validated: Served) -> None:
    given = pn.Drive.load(validated.folder / "axis.toml")
    same = f"{given.valve.conductance_m3_s_pa!r} m3/(s Pa)"
    head, drawn = asked_frame(validated, drive="axis.toml", changes={"valve.conductance": same})
    assert head["number"] == 3
    assert np.array_equal(drawn["position_m.changed"], drawn["position_m.free"])
    head, drawn = asked_frame(validated, drive="axis.toml", changes={"valve.conductance": TRUE_C})
    found = pn.validate(given.replace({"valve.conductance": TRUE_C}), validated.folder / "friday.parquet")
    assert head["fit"]["position_m"] == found.records[0].channels["position_m"].free.fit_percent > 97.0
    assert np.array_equal(drawn["pressure_a_pa.changed"], found.records[0].free["pressure_a_pa"])
    narrow = asked_frame(validated, span=[0.5, 0.6], pixels=20)[1]
    assert len(narrow["time_s"]) <= 4 * 20
    assert narrow["time_s"][0] == pytest.approx(0.5, abs=2e-3)


@pytest.mark.parametrize(
    "change",
    [
        {"record": 1},
        {"record": "0"},
        {"span": [0.0]},
        {"pixels": 1e9},
        {"path": "axis.toml"},
        {"path": "../x.toml"},
        {"changes": {"friction.coulomb": "3 bar"}, "drive": "axis.toml"},
        {"changes": {"friction.coulomb": [1]}, "drive": "axis.toml"},
        {"changes": {"friction.coulomb": "30 N"}, "drive": "../axis.toml"},
        {"changes": {"friction.law": "file:../secret.toml"}, "drive": "axis.toml"},
    ],
)
def test_what_is_no_view_of_a_validation_is_answered_in_words(validated: Served, change: dict) -> None:
    (validated.folder.parent / "secret.toml").write_text("secret = 1\n")
    head, arrays = asked_frame(validated, **change)
    assert head["problems"][0]["what"]
    assert "secret = 1" not in json.dumps(head)
    assert not arrays


def test_recordings_without_a_needed_channel_are_not_offered(validated: Served) -> None:
    """A recording of a friction rig has no command: it was offered, and the command failed."""
    rig = "time,position,force,pressure\n" + "\n".join(f"{0.1 * k},{0.01 * k},{k},3" for k in range(200))
    layout = """[columns]
time = { column = "time", unit = "s" }
position = { column = "position", unit = "m" }
force = { column = "force", unit = "N" }
pressure_a = { column = "pressure", unit = "bar gauge" }
[geometry]
bore = "25 mm"
[chamber_b]
open_to_ambient = true
"""
    (validated.folder / "rig").mkdir()
    (validated.folder / "rig/slow.csv").write_text(rig)
    (validated.folder / "rig/layout.toml").write_text(layout)
    offered = {}
    for kind, form in get(validated, "/api/forms").items():
        for field in form["fields"]:
            if field["kind"] == "recordings":
                offered[kind] = [path for path, _ in field["choices"]]
    assert "friday.parquet" in offered["validate"] == offered["identify"]
    assert "rig/slow.csv" not in offered["validate"]
    assert "rig/slow.csv" in offered["characterise"]
    refused = post(validated, "/api/jobs", ASKED | {"recordings": ["rig/slow.csv"]}, 400)
    assert refused["problems"][0]["what"] == "rig/slow.csv does not have the channels command, pressure_b"


def test_a_job_writes_into_folders_of_the_workspace_alone(validated: Served) -> None:
    outside = validated.folder.parent / "outside"
    outside.mkdir()
    (validated.folder / "linked").symlink_to(outside)
    identify = ASKED | {"kind": "identify", "free": "valve.conductance"}
    for out, told in (("linked/fit.toml", "not a file of this workspace"), ("axis.toml/fit.toml", "cannot be made")):
        refused = post(validated, "/api/jobs", identify | {"out": out}, 400)
        assert told in refused["problems"][0]["what"]
    (validated.folder / "results").rename(validated.folder / "old")
    (validated.folder / "results").symlink_to(outside)
    post(validated, "/api/jobs", ASKED, 400)
    assert validated.jobs == []
    assert not list(outside.iterdir())


def test_a_suspect_is_identified_applied_and_traced(validated: Served, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(validated.folder)
    fit = "results/friday/fit.toml"
    given = {**ASKED, "kind": "identify", "free": "valve.conductance", "out": fit}
    copied = post(validated, "/api/work", given)
    assert run_line(copied["command"]) == 0
    names = run_python(copied["python"])
    found = DriveFit.from_toml(fit)
    assert found.values == names["fit"].values
    assert found.intervals == names["fit"].intervals
    copied = post(validated, "/api/work", {"kind": "apply", "drive": "axis.toml", "fit": fit, "out": "after.toml"})
    assert run_line(copied["command"]) == 0
    exec(copied["python"], names)
    assert names["after"].to_toml() == Path("after.toml").read_text()

    compared = post(validated, "/api/compare", {"before": "axis.toml", "after": "after.toml"})
    (value,) = compared["values"]
    origin = pn.Drive.load("after.toml").provenance["valve.conductance"]
    assert (value["interval_before"], value["interval_after"]) == ("", " … ".join(origin.interval))
    assert any(line.startswith("-conductance") for line in compared["lines"])

    Path("results/after").mkdir()
    pn.validate(pn.Drive.load("after.toml"), "friday.parquet").write("results/after")
    shown = get(validated, "/api/validation", path="results/after/validation.toml")
    origin = {one["key"]: one for one in shown["values"]}["valve.conductance"]
    assert origin["kind"] == "identified"
    assert origin["fit"] == fit
    assert origin["source"] == [{"name": "friday", "file": "friday.parquet"}]
    Path("after.toml").unlink()
    Path(fit).unlink()
    shown = get(validated, "/api/validation", path="results/after/validation.toml")
    assert (shown["drive"], shown["editable"]) == ("", False)
    assert [one["key"] for one in shown["values"]] == ["valve.conductance"]


@pytest.mark.parametrize(
    "change",
    [
        {"drive": "missing.toml"},
        {"drive": "../axis.toml"},
        {"drive": "catalogue:nothing"},
        {"drive": 3},
        {"recordings": []},
        {"recordings": ["axis.toml"]},
        {"recordings": [3]},
        {"recordings": ["bare.csv"]},
        {"name": "a/b"},
        {"kind": "identify", "out": "results/fit.toml", "free": " , "},
        {"kind": "identify", "out": "results/fit.csv", "free": "friction.coulomb"},
        {"kind": "identify", "out": "../fit.toml", "free": "friction.coulomb"},
        {"kind": "apply", "out": "after.toml", "fit": "missing.toml"},
    ],
)
def test_a_wrong_request_starts_nothing(validated: Served, change: dict) -> None:
    (validated.folder / "bare.csv").write_text("t,x\n0,1\n1,2\n")
    assert post(validated, "/api/jobs", ASKED | change, 400)["problems"]
    assert not validated.jobs
