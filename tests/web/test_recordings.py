"""A recording of others: opened as it is, a layout proposed and accepted, and then its strokes."""

from __future__ import annotations

import shutil
import time
from pathlib import Path

import numpy as np
import pytest

import pneudrive as pn
from pneudrive.cli.main import run as run_command
from pneudrive.signals.load import load_recordings
from pneudrive.signals.motion import find_strokes
from pneudrive.web.messages import unpack
from web.conftest import Served

MEASURED = Path(__file__).parents[2] / "data" / "measurements" / "zillen-2021-pneumatic-piston"


def get(served: Served, address: str, status: int = 200, **given: object) -> dict:
    answered = served.client.get(address, params=given, headers=served.headers)
    assert answered.status_code == status, answered.text
    return answered.json()


def read(served: Served, name: str) -> dict:
    for _ in range(100):
        found = get(served, "/api/recording", path=name)
        if "channels" in found:
            return found
        time.sleep(0.05)
    raise AssertionError(found)


def test_a_measured_file_its_layout_and_its_strokes(served: Served) -> None:
    name = "O-ring_1bar.csv.xz"
    shutil.copy(MEASURED / "friction" / name, served.folder)
    found = read(served, name)
    assert found["layout"] is None
    assert len(found["channels"]) > 4

    proposed = get(served, "/api/propose", path=name)
    out = served.folder / "by-command.toml"
    assert run_command(["layout", str(served.folder / name), "--out", str(out)]) == 0
    assert proposed["text"] == out.read_text()
    assert {"position", "force"} <= {one["role"] for one in proposed["guesses"]}
    assert all(one["why"] for one in proposed["guesses"])

    shutil.copy(MEASURED / "layout.toml", served.folder)
    found = read(served, name)
    assert found["layout"] == "rig"
    labels = {one["label"].partition(" (")[0]: one["column"] for one in found["channels"]}
    assert {"position", "force", "pressure b"} <= labels.keys()
    assert {one["unit"] for one in found["channels"]} >= {"mm", "N", "bar gauge"}
    strokes = get(served, "/api/strokes", path=name)["strokes"]
    recording = load_recordings([served.folder / name])[0]
    expected = find_strokes(recording.name, recording.time_s, recording.position_m)
    assert [one["speed"] for one in strokes] == [one.speed_m_s for one in expected]
    assert {one["direction"] for one in strokes} == {1, -1}

    query = {"path": name, "from": 0.0, "to": found["span"][1], "pixels": 500, "columns": labels["force"]}
    view = served.client.get("/api/window", params=query, headers=served.headers)
    head, arrays = unpack(view.content)
    assert head["samples"] >= len(recording)
    assert np.nanmax(arrays[labels["force"]]) >= np.nanmax(np.abs(recording.force_n)) * 0.5
    assert len(view.content) < 64_000


def test_a_simulated_run_is_a_recording(served: Served) -> None:
    run = pn.simulate(pn.Drive.load("catalogue:reference"), "0 s: 0.2, 2 s: -0.2, 4 s: 0.2", "6 s")
    pn.save(run, served.folder / "run.parquet")
    found = read(served, "run.parquet")
    assert found["time"]
    units = {one["column"]: one["unit"] for one in found["channels"]}
    assert units["position_m"] == "m"
    assert len(get(served, "/api/strokes", path="run.parquet")["strokes"]) >= 2


@pytest.mark.parametrize("name", ["../layout.toml", "missing.csv", "axis.toml", "layout.parquet/../../x.csv"])
def test_what_is_no_recording_is_said(served: Served, name: str) -> None:
    assert get(served, "/api/recording", 400, path=name)["problems"]


def test_a_view_out_of_bounds_is_refused(served: Served) -> None:
    (served.folder / "few.csv").write_text("time_s,force_n\n" + "".join(f"{0.1 * k:.1f},{k}\n" for k in range(50)))
    read(served, "few.csv")
    for wrong in ({"from": "nan"}, {"to": "-1"}, {"pixels": "0"}, {"pixels": "5000"}, {"from": "x"}):
        query = {"path": "few.csv", "from": "0", "to": "1", "pixels": "100", "columns": "force_n"} | wrong
        assert get(served, "/api/window", 400, **query)["problems"]


def test_a_layout_outside_the_workspace_is_not_read(served: Served) -> None:
    (served.folder.parent / "layout.toml").write_text("[columns]\nsecret = 1\n")
    (served.folder / "few.csv").write_text("time_s,force_n\n" + "".join(f"{0.1 * k:.1f},{k}\n" for k in range(50)))
    assert read(served, "few.csv")["layout"] is None
