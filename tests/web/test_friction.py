"""Work on recordings from the page: the map of the command line, byte for byte, and what the page draws of it."""

from __future__ import annotations

import shlex
import shutil
from pathlib import Path

import numpy as np
import pytest

import pneudrive as pn
from pneudrive.characterise import write_map
from pneudrive.cli.main import run as run_command
from pneudrive.identify.static.result import FrictionFit
from waiting import until
from web.client import get, post, run_line, run_python
from web.conftest import Served
from web.test_recordings import MEASURED

NAMES = ["O-ring_1bar.csv.xz", "O-ring_5bar.csv.xz"]


@pytest.fixture
def measured(served: Served) -> Served:
    for name in NAMES:
        shutil.copy(MEASURED / "friction" / name, served.folder)
    shutil.copy(MEASURED / "layout.toml", served.folder)
    return served


def finished(served: Served) -> dict:
    until(lambda: get(served, "/api/jobs")["jobs"][0]["state"] != "running")
    return get(served, "/api/jobs")["jobs"][0]


def test_command_and_python_give_the_same_map(measured: Served, monkeypatch: pytest.MonkeyPatch) -> None:
    copied = post(measured, "/api/work", {"recordings": NAMES[:1], "name": "o-ring"})
    monkeypatch.chdir(measured.folder)
    monkeypatch.setattr(
        "pneudrive.report.write_report", lambda *_: "report.html", raising=False
    )  # its figures take long
    Path("results").mkdir()
    assert run_line(copied["command"]) == 0
    names = run_python(copied["python"])
    write_map(names["curves"], "by-python.csv")
    assert Path("results/o-ring/map.csv").read_bytes() == Path("by-python.csv").read_bytes()
    again = post(measured, "/api/jobs", {"recordings": NAMES[:1], "name": "o-ring"}, 400)
    assert "results/o-ring already exists" in again["problems"][0]["what"]


def test_a_map_and_its_fit_are_shown_as_they_are(measured: Served) -> None:
    folder = measured.folder / "results" / "o-rings"
    folder.mkdir(parents=True)
    table = pn.characterise([measured.folder / name for name in NAMES])
    write_map(table, folder / "map.parquet")
    fit = pn.fit_friction(table)
    fit.to_toml(folder / "fit.toml")

    found = get(measured, "/api/map", path="results/o-rings/map.parquet")
    points = [point for group in found["groups"] for point in group["points"]]
    assert sorted(one["y"] for one in points) == sorted(table["friction_n"].to_numpy())
    assert len(found["groups"]) == 2  # two pressures in chamber b
    assert found["recordings"] == {"O-ring_1bar": NAMES[0], "O-ring_5bar": NAMES[1]}
    for group in found["groups"]:
        curve = group["curve"]
        predicted = fit.predict(np.array(curve["x"]), *group["gauges"])
        assert np.allclose(curve["y"], predicted.friction_n, rtol=1e-12)
        assert np.all(np.array(curve["low"]) <= curve["y"])
        assert np.all(np.array(curve["high"]) >= curve["y"])

    assert found["seals"] == {"O-ring": "results/o-rings/fit.toml"}
    (over,) = get(measured, "/api/slice", path="results/o-rings/map.parquet", speed="all")["groups"]
    assert len(over["points"]) == len(points)  # of every speed
    gauge, speed = np.array(over["curve"]["x"]), np.full(len(over["curve"]["x"]), over["speed"])
    assert np.allclose(over["curve"]["y"], fit.predict(speed, 0.0, gauge).friction_n, rtol=1e-3)

    shown = get(measured, "/api/view", path="results/o-rings/fit.toml")
    values = {one["key"]: one for one in shown["rows"]}
    assert values["coulomb"]["value"] == fit.values["coulomb"]
    assert values["breakaway"]["value"] is None
    assert any("breakaway" in one for one in (*shown["notes"], *(one["text"] for one in shown["findings"])))
    assert [tuple(row) for row in shown["table"]] == fit.view().table()[1]  # as in a terminal
    (folder / "fit.toml").unlink()
    assert "no fit.toml" in get(measured, "/api/map", path="results/o-rings/map.parquet")["fit"]


@pytest.mark.parametrize(("law", "pressure"), [("stribeck lorentzian", "none"), ("coulomb", "linear")])
def test_a_map_is_fitted_again_by_command_and_by_python(
    measured: Served, law: str, pressure: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = measured.folder / "results" / "o-rings"
    folder.mkdir(parents=True)
    write_map(pn.characterise([measured.folder / name for name in NAMES]), folder / "map.parquet")
    asked = {"kind": "fit", "map": "results/o-rings/map.parquet", "law": law, "pressure": pressure, "name": "second"}
    copied = post(measured, "/api/work", asked)
    monkeypatch.chdir(measured.folder)
    assert run_line(copied["command"]) == 0
    names = run_python(copied["python"])
    fit = FrictionFit.from_toml(folder / "second.toml")
    assert fit.values.keys() == names["fit"].values.keys()
    assert np.array_equal([*fit.values.values()], [*names["fit"].values.values()], equal_nan=True)
    assert fit.intervals == names["fit"].intervals
    shown = get(measured, "/api/map", path=asked["map"], fit="results/o-rings/second.toml")
    assert shown["fits"] == ["results/o-rings/second.toml"]
    given = {"path": asked["map"], "fit": "results/o-rings/third.toml"}  # its curve is not that of another fit
    refused = measured.client.get("/api/map", params=given, headers=measured.headers)
    assert (refused.status_code, "no fit results/o-rings/third.toml" in refused.text) == (400, True)
    for group in shown["groups"]:
        predicted = fit.predict(np.array(group["curve"]["x"]), *group["gauges"])
        assert np.array_equal(group["curve"]["y"], predicted.friction_n)
    for wrong in ({"law": "x"}, {"pressure": 3}, {"name": "../x"}, {"map": "../map.csv"}, {"map": "map.csv"}):
        assert post(measured, "/api/jobs", asked | wrong, 400)["problems"]


def test_a_job_is_cancelled_as_by_ctrl_c(measured: Served) -> None:
    job = post(measured, "/api/jobs", {"recordings": NAMES, "name": "late"})
    assert job["state"] == "running"
    post(measured, "/api/cancel", {"number": job["number"]})
    assert finished(measured)["state"] == "cancelled"


def test_what_is_cancelled_leaves_nothing_and_keeps_its_name(measured: Served, monkeypatch: pytest.MonkeyPatch) -> None:
    def ended(*_: object) -> str:
        assert Path("results/two/map.parquet").is_file()
        raise KeyboardInterrupt

    monkeypatch.chdir(measured.folder)
    monkeypatch.setattr("pneudrive.report.write_report", ended, raising=False)
    Path("results").mkdir()
    asked = {"recordings": NAMES[:1], "name": "two"}
    words = shlex.split(post(measured, "/api/work", asked)["command"].splitlines()[-1])[1:]
    assert run_command(words) != 0
    assert not Path("results/two").exists()
    Path("results/two").mkdir()  # of the user: it stays
    Path("results/two/notes.txt").write_text("mine")
    assert run_command(words) != 0
    assert Path("results/two/notes.txt").read_text() == "mine"


@pytest.mark.parametrize(
    "work",
    [
        {"recordings": [], "name": "x"},
        {"recordings": ["../secret.csv"], "name": "x"},
        {"recordings": ["axis.toml"], "name": "x"},
        {"recordings": ["missing.csv"], "name": "x"},
        {"recordings": NAMES, "name": "a/b"},
        {"recordings": NAMES, "name": "..."},
        {"recordings": "axis.csv", "name": "x"},
        {},
    ],
)
def test_work_outside_is_refused(measured: Served, work: dict) -> None:
    assert post(measured, "/api/jobs", work, 400)["problems"]
    assert not (measured.folder / "results").exists()


def test_a_recording_without_a_layout_is_not_characterised(served: Served) -> None:
    (served.folder.parent / "layout.toml").write_text((MEASURED / "layout.toml").read_text())
    shutil.copy(MEASURED / "friction" / NAMES[0], served.folder)
    refused = post(served, "/api/jobs", {"recordings": NAMES[:1], "name": "x"}, 400)
    assert "no layout in the workspace" in refused["problems"][0]["what"]
