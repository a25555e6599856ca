"""A recording of others: opened as it is, a layout proposed and accepted, and then its strokes."""

from __future__ import annotations

import shlex
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


def window(served: Served, given: dict) -> bytes:
    with served.client.websocket_connect("/api/live", **served.socket) as socket:
        socket.send_json({"what": "window", "number": 1, **given})
        return socket.receive_bytes()


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
    view = window(served, query)
    head, arrays = unpack(view)
    assert head["samples"] >= len(recording)
    assert np.nanmax(arrays[labels["force"]]) >= np.nanmax(np.abs(recording.force_n)) * 0.5
    assert len(view) < 64_000


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
    for wrong in ({"from": "nan"}, {"to": -1}, {"pixels": 0}, {"pixels": 5000}, {"from": "x"}, {"to": []}, {"path": 3}):
        query = {"path": "few.csv", "from": 0, "to": 1, "pixels": 100, "columns": "force_n"} | wrong
        assert unpack(window(served, query))[0]["problems"]


def test_a_layout_outside_the_workspace_is_not_read(served: Served) -> None:
    (served.folder.parent / "layout.toml").write_text("[columns]\nsecret = 1\n")
    (served.folder / "few.csv").write_text("time_s,force_n\n" + "".join(f"{0.1 * k:.1f},{k}\n" for k in range(50)))
    assert read(served, "few.csv")["layout"] is None


def test_two_recordings_aligned_and_measured(served: Served, monkeypatch: pytest.MonkeyPatch) -> None:
    """The second file is in mm and bar gauge, its axis is mounted the other way round, and its stroke begins later."""
    drive = pn.Drive.load("catalogue:reference")
    start = {"position": "5 mm"}
    early = pn.simulate(drive, "0 s: 0, 0.5 s: 0.2, 3 s: -0.2", "5 s", initial=start)
    late = pn.simulate(drive, "0 s: 0, 1.25 s: 0.2, 3.75 s: -0.2", "5 s", initial=start)
    pn.save(early, served.folder / "early.parquet")
    (served.folder / "rig").mkdir()
    columns = np.column_stack(
        [late.time, -1e3 * late.position, late.friction_force, (late.pressure_a - 101325.0) * 1e-5, late.pressure_b]
    )
    np.savetxt(served.folder / "rig" / "late.csv", columns, "%.17g", ",", header="t,way,force,pa,pb", comments="")
    (served.folder / "rig" / "layout.toml").write_text(
        'delimiter = "comma"\nheader = true\n[columns]\ntime = {column = "t", unit = "s"}\n'
        'position = {column = "way", unit = "mm", positive = "-x"}\n'
        'force = {column = "force", unit = "N"}\npressure_a = {column = "pa", unit = "bar gauge"}\n'
        'pressure_b = {column = "pb", unit = "Pa abs"}\n[geometry]\nkind = "rodless"\nbore = "32 mm"\n'
    )
    read(served, "early.parquet")
    read(served, "rig/late.csv")
    begins = [get(served, "/api/strokes", path=one)["strokes"][0]["from"] for one in ("early.parquet", "rig/late.csv")]
    shift = begins[0] - begins[1]
    assert shift == pytest.approx(-0.75, abs=2e-3)

    names = ["position_m", "pressure_a_pa", "velocity_m_s"]
    query = {"path": "early.parquet", "from": 0.4, "to": 1.2, "pixels": 2000, "columns": "\n".join(names)}
    _, drawn = unpack(window(served, {**query, "beside": "rig/late.csv", "shift": shift}))
    assert drawn.keys() == {"time", *names, "beside/time", "beside/position_m", "beside/pressure_a_pa"}
    for column, variable in (("position_m", early.position), ("pressure_a_pa", early.pressure_a)):
        beside = np.interp(drawn["time"], drawn["beside/time"], drawn[f"beside/{column}"])
        assert np.abs(beside - drawn[column]).max() < 1e-2 * np.ptp(variable.to_numpy())
        assert np.ptp(drawn[column]) > 0.1 * np.ptp(variable.to_numpy())

    asked = {"path": "early.parquet", "at": [0.6, 0.7], "columns": names, "shift": shift}
    asked |= {"beside": "rig/late.csv", "strokes": [1, 1]}
    answered = served.client.post("/api/measure", json=asked, headers=served.headers).json()
    row = answered["rows"][0]
    assert row["values"] == [early.position[600], early.position[700]]
    assert row["difference"] == early.position[700] - early.position[600]
    assert row["slope"] == pytest.approx(float(early.velocity[600:701].mean()), rel=1e-2)
    monkeypatch.chdir(served.folder)
    copied: dict = {}
    exec(answered["python"], copied)
    found = {(one.recording, one.label): one for one in copied["found"].channels}
    assert copied["found"].shift_s == shift
    for one in answered["rows"]:
        own = found[Path(one["recording"]).name, one["label"]]
        told = (one["time_s"], one["values"], one["difference"], one["slope"])
        assert told == (list(own.time_s), list(own.values), own.difference, own.slope)
    assert len(answered["rows"]) == 5
    assert run_command(shlex.split(answered["command"])[1:]) == 0
    assert post_measure(served, asked | {"at": [0.6]}) == post_measure(served, asked | {"columns": 3}) == 400


def post_measure(served: Served, asked: dict) -> int:
    return served.client.post("/api/measure", json=asked, headers=served.headers).status_code


def test_faults_are_placed_where_they_are(served: Served) -> None:
    rng = np.random.default_rng(3)
    time = np.arange(4000) * 1e-3
    force = 20.0 * np.sign(np.cos(2 * np.pi * 0.5 * time)) + rng.normal(0.0, 0.3, len(time))
    force[1500] = 90.0
    force = np.minimum(force, 20.5)
    force[2600:2610] = np.nan
    position = 50.0 * np.sin(2 * np.pi * 0.5 * time)
    rows = np.column_stack([time, position, force])[np.r_[0:3200, 3300:4000]]
    np.savetxt(served.folder / "rig.csv", rows, "%.6f", ",", header="t,x,f", comments="")
    (served.folder / "layout.toml").write_text(
        'delimiter = "comma"\nheader = true\n[columns]\ntime = {column = "t", unit = "s"}\n'
        'position = {column = "x", unit = "mm"}\n'
        'force = {column = "f", unit = "N", range = "-500 N .. 20.5 N"}\n[geometry]\nkind = "rodless"\n'
        'bore = "32 mm"\n[chamber_a]\nopen_to_ambient = true\n[chamber_b]\nopen_to_ambient = true\n'
    )
    read(served, "rig.csv")
    faults = get(served, "/api/strokes", path="rig.csv")["faults"]
    assert faults["non_finite"] == {"count": 10, "places": [[2.6, 2.609]]}
    assert faults["gap"]["places"] == [[2.599, 2.61], [3.199, 3.3]]
    hit = np.flatnonzero(rows[:, 2] == 20.5)
    assert faults["saturated"]["count"] == len(hit) > 5
    inside = [any(low - 1e-6 < at < high + 1e-6 for low, high in faults["saturated"]["places"]) for at in rows[hit, 0]]
    assert all(inside)
    assert sum(high - low for low, high in faults["saturated"]["places"]) < 0.1  # and nowhere else


def test_strokes_and_faults_of_a_drive_whose_force_nobody_measures(served: Served) -> None:
    run = pn.simulate(pn.Drive.load("catalogue:reference"), "0 s: 0.6, 0.8 s: -0.6", "1.6 s")
    channels = [run.position, run.pressure_a, run.pressure_b]
    noise = np.random.default_rng(5).normal(0.0, 1.0, (run.sizes["time"], 3)) * [1e-6, 50.0, 50.0]
    columns = np.column_stack([run.time, run.command, *channels])
    columns[:, 2:] += noise
    columns[900:960, 3] = columns[900, 3]
    columns[300:310, 4] = np.nan
    np.savetxt(served.folder / "drive.csv", columns, "%.9g", ",", header="t,u,x,a,b", comments="")
    pressures = "".join(f'pressure_{one} = {{column = "{one}", unit = "Pa abs"}}\n' for one in "ab")
    (served.folder / "layout.toml").write_text(
        'delimiter = "comma"\nheader = true\n[columns]\ntime = {column = "t", unit = "s"}\n'
        'command = {column = "u"}\nposition = {column = "x", unit = "m"}\n' + pressures
    )
    assert read(served, "drive.csv")["layout"] == "drive"
    found = get(served, "/api/strokes", path="drive.csv")
    time_s, position = columns[:, 0], columns[:, 2]
    moved = np.ptp(position)
    assert [one["direction"] for one in found["strokes"]] == [1, -1]
    out = found["strokes"][0]
    assert out["from"] < time_s[np.argmax(position > 0.1 * moved + position[0])] < out["to"] < 0.85
    assert found["faults"]["non_finite"] == {"count": 10, "places": [[time_s[300], time_s[309]]]}
    [[begin, end]] = found["faults"]["stuck"]["places"]
    assert (begin, end) == pytest.approx((time_s[900], time_s[959]), abs=2e-3)


def test_what_has_its_clock_set_back_is_measured_by_samples(tmp_path: Path) -> None:
    time_s = np.r_[0.0:2.0:1e-3, 1.5:3.0:1e-3]
    position = np.linspace(0.0, 90.0, len(time_s))
    table = np.column_stack([time_s, 0.0 * position, position, 300.0 + position, 300.0 - position])
    np.savetxt(tmp_path / "drive.csv", table, "%.6f", ",", header="t,u,x,a,b", comments="")
    pressures = "".join(f'pressure_{one} = {{column = "{one}", unit = "kPa abs"}}\n' for one in "ab")
    (tmp_path / "layout.toml").write_text(
        'delimiter = "comma"\nheader = true\n[columns]\ntime = {column = "t", unit = "s"}\n'
        'command = {column = "u"}\nposition = {column = "x", unit = "mm"}\n' + pressures
    )
    found = pn.measure(tmp_path / "drive.csv", "100", "2500")
    by = {one.label: one for one in found.channels}
    assert by["position (x)"].difference == pytest.approx(position[2500] - position[100], abs=1e-5)
    assert found.faults == {}
    assert "time runs backwards" in found.unknown
    assert "time runs backwards" in repr(found)
