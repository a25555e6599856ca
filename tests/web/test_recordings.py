"""A recording of others: opened as it is, a layout proposed and accepted, and then its strokes."""

from __future__ import annotations

import re
import shutil
import traceback
from pathlib import Path

import numpy as np
import polars as pl
import pytest

import pneudrive as pn
from pneudrive.cli.main import run as run_command
from pneudrive.signals.load import load_recordings
from pneudrive.signals.motion import find_strokes
from pneudrive.web.measured import recordings
from waiting import until
from web.client import get, post, run_line
from web.conftest import Served
from web.frames import unpack

MEASURED = Path(__file__).parents[2] / "data" / "measurements" / "zillen-2021-pneumatic-piston"


def window(served: Served, given: dict) -> bytes:
    """Ask for a view of a recording as it is now, or as it was with a key."""
    now = {} if "key" in given else {"key": read(served, given["path"])["key"]}
    with served.client.websocket_connect("/api/live", **served.socket) as socket:
        socket.send_json({"what": "window", "number": 1, **now, **given})
        return socket.receive_bytes()


def read(served: Served, name: str) -> dict:
    return until(lambda: None if "share" in (found := get(served, "/api/recording", path=name)) else found)


def rows_of(first: int, last: int) -> str:
    return "".join(f"{k},{k}\n" for k in range(first, last))


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
    gap = np.where(np.arange(len(recording)) == 7, np.nan, recording.position_m)  # one sample is missing
    assert len(find_strokes(recording.name, recording.time_s, gap)) == len(expected)

    query = {"path": name, "from": 0.0, "to": found["span"][1], "pixels": 500, "columns": labels["force"]}
    view = window(served, query)
    head, arrays = unpack(view)
    assert head["samples"] >= len(recording)
    assert np.nanmax(arrays[labels["force"]]) >= np.nanmax(np.abs(recording.force_n)) * 0.5
    assert len(view) < 64_000


@pytest.mark.parametrize("times", [[3.0], [0.0, 0.0, 0.0], [1.7e9]])
def test_a_recording_of_one_time_has_a_view(served: Served, times: list[float]) -> None:
    pl.DataFrame({"time_s": times, "force_N": [7.0] * len(times)}).write_parquet(served.folder / "one.parquet")
    found = read(served, "one.parquet")
    first, last = found["span"]
    assert first < times[0] < last
    query = {"path": "one.parquet", "from": first, "to": last, "pixels": 500, "columns": "force_N"}
    head, arrays = unpack(window(served, query))
    assert head["samples"] == len(times)
    assert list(arrays["force_N"]) == [7.0] * len(times)


def test_a_recording_whose_name_misses_the_pattern_of_its_layout_is_shown_with_a_word(served: Served) -> None:
    shutil.copy(MEASURED / "friction" / "O-ring_1bar.csv.xz", served.folder / "odd.csv.xz")
    shutil.copy(MEASURED / "layout.toml", served.folder)
    found = read(served, "odd.csv.xz")
    assert len(found["channels"]) > 4
    assert "labels.pattern" in found["notes"][0]
    assert "correct the pattern" in found["notes"][0]


def test_a_layout_above_the_folder_is_told_of_and_not_read(served: Served) -> None:
    pl.DataFrame({"time_s": np.arange(50.0), "force_N": np.ones(50)}).write_csv(served.folder / "log.csv")
    pn.save(pn.simulate(pn.Drive.load("catalogue:reference"), "0.3", "20 ms"), served.folder / "run.parquet")
    assert read(served, "log.csv")["notes"] == []
    (served.folder.parent / "layout.toml").write_text("nonsense =")
    found = read(served, "log.csv")
    (note,) = found["notes"]
    assert found["layout"] is None
    assert "the folder above has a layout.toml" in note
    assert read(served, "run.parquet")["notes"] == []  # it needs none


@pytest.mark.parametrize("name", ["../layout.toml", "axis.toml", "layout.parquet/../../x.csv"])
def test_what_is_no_recording_is_said(served: Served, name: str) -> None:
    assert get(served, "/api/recording", 400, path=name)["problems"]


@pytest.mark.parametrize("begun", [None, "", "time_s,fo"])
def test_a_file_that_cannot_be_read_yet_can_be_once_it_is_whole(served: Served, begun: str | None) -> None:
    place = served.folder / "few.csv"
    if begun is not None:
        place.write_text(begun)
    (problem,) = read(served, "few.csv")["problems"]
    assert problem["what"] in ("there is no such file", "the file is empty", "no table of numbers was found")
    place.write_text("time_s,force_n\n" + rows_of(0, 50))
    assert read(served, "few.csv")["samples"] == 50


def test_a_view_out_of_bounds_is_refused(served: Served) -> None:
    (served.folder / "few.csv").write_text("time_s,force_n\n" + "".join(f"{0.1 * k:.1f},{k}\n" for k in range(50)))
    read(served, "few.csv")
    for wrong in ({"from": "nan"}, {"to": -1}, {"pixels": 0}, {"pixels": 5000}, {"from": "x"}, {"to": []}):
        query = {"path": "few.csv", "from": 0, "to": 1, "pixels": 100, "columns": "force_n"} | wrong
        assert unpack(window(served, query))[0]["problems"]
    assert unpack(window(served, query | {"path": 3, "key": 3}))[0]["problems"]


def test_two_recordings_aligned_and_measured(served: Served) -> None:
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
    asked |= {"beside": "rig/late.csv"}
    answered = post(served, "/api/measure", asked)
    row = answered["rows"][0]
    assert row["values"] == [early.position[600], early.position[700]]
    assert row["difference"] == early.position[700] - early.position[600]
    assert row["slope"] == pytest.approx(float(early.velocity[600:701].mean()), rel=1e-2)
    assert len(answered["rows"]) == 5
    there = next(one for one in answered["rows"][3:] if one["label"] == "position")
    assert there["recording"] == "rig/late.csv"
    assert there["values"] == pytest.approx(row["values"], abs=1e-5)  # in the unit and towards the end of the first
    assert there["time_s"] == pytest.approx([0.6, 0.7], abs=1e-3)
    for wrong in ({"at": [0.6]}, {"columns": 3}):
        post(served, "/api/measure", asked | wrong, 400)


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


RIG = """
[geometry]
kind = "rodless"
bore = "32 mm"
[chamber_a]
open_to_ambient = true
[chamber_b]
pressure = "3 bar gauge"
"""
TO_AND_FRO = {"time": (time_s := np.arange(0.0, 6.0, 5e-3)), "way": 50.0 - 40.0 * np.cos(np.pi * time_s)}
TO_AND_FRO["force"] = 120.0 + 20.0 * np.sign(np.sin(np.pi * time_s)) + np.random.default_rng(8).normal(0.0, 0.2, 1200)


def rig_file(path: Path) -> None:
    """Write a logger's text: decimal comma, points in thousands, a preamble, samples and a column that do not count."""
    times = [f"{1e3 * one:.1f}".replace(".", ",") for one in TO_AND_FRO["time"]]
    columns = (TO_AND_FRO["way"] / 2.5 - 2.0, -100.0 * TO_AND_FRO["force"], np.arange(1200.0))
    form = [[f"{one:,.3f}".translate(str.maketrans(",.", ".,")) for one in values] for values in columns]
    form[2][::2] = ["ok"] * 600
    rows = [f"1,5;0;{1 + k}.000;9;" for k in range(3)] + [";".join(row) + ";" for row in zip(times, *form, strict=True)]
    path.write_text("Rig 7; run 3\nZeit;Weg;Kraft;Zahl;\n" + "\n".join(rows) + "\n")


IN_SI = """
format = "parquet"
[columns]
time = { column = "time_s", unit = "s" }
position = { column = "x", unit = "m" }
force = { column = 2, unit = "N" }
"""


def in_si(path: Path) -> None:
    table = {"time_s": TO_AND_FRO["time"], "x": 1e-3 * TO_AND_FRO["way"], "f": TO_AND_FRO["force"]}
    pl.DataFrame(table).write_parquet(path)


LOGGED = """
delimiter = "semicolon"
decimal = ","
thousands = "."
skip_lines = 1
skip_samples = 3
header = true
[columns]
time = { column = "Zeit", unit = "ms" }
position = { column = "Weg", unit = "cm", scale = 25.0, offset = 50.0 }
force = { column = "Kraft", unit = "kN", positive = "-x", scale = 1e-5 }
"""


def test_a_layout_is_applied_to_what_is_shown(served: Served, monkeypatch: pytest.MonkeyPatch) -> None:
    """Its form, scale, offset, sign, calibration, units for this file, and lines and samples that it skips."""
    curve = '[force_calibration]\nreference = ["0 N", "110 N", "200 N"]\nshown = ["2 N", "115 N", "203 N"]\n'
    rig_file(served.folder / "run.csv")
    other = '[[for]]\nmatch = "run*"\ncolumns.position = {column = "Weg", unit = "mm", scale = 2.5, offset = 5.0}\n'
    (served.folder / "layout.toml").write_text(LOGGED + RIG + curve + other)
    truth = load_recordings([served.folder / "run.csv"])[0]
    shown = read(served, "run.csv")
    assert shown["samples"] == len(truth) == 1200
    channels = {one["label"].partition(" (")[0]: one for one in shown["channels"]}
    assert {name: one["unit"] for name, one in channels.items()} == {"position": "mm", "force": "kN", "Zahl": ""}
    names = [channels[one]["column"] for one in ("position", "force", "Zahl")]
    query = {"path": "run.csv", "from": -1.0, "to": 9.0, "columns": "\n".join(names)}
    _, drawn = unpack(window(served, query | {"pixels": 2000}))
    assert np.allclose(drawn["time"], truth.time_s, atol=1e-6)
    assert np.allclose(drawn["Weg"], 1e3 * truth.position_m, atol=1e-5)
    assert np.allclose(drawn["Kraft"], 1e-3 * truth.force_n, atol=1e-7)
    assert np.array_equal(np.isnan(drawn["Zahl"]), np.arange(1200) % 2 == 0)
    head, drawn = unpack(window(served, query | {"pixels": 3}))  # of blocks: the sign swaps lowest and highest
    assert not head["raw"]
    assert (drawn["Kraft"].min(), drawn["Kraft"].max()) == pytest.approx(
        (1e-3 * truth.force_n.min(), 1e-3 * truth.force_n.max())
    )

    asked = {"path": "run.csv", "at": [1.0, 2.5], "columns": names[:2], "beside": "", "shift": 0.0}
    rows = post(served, "/api/measure", asked)["rows"]
    assert rows[0]["values"] == pytest.approx([1e3 * truth.position_m[200], 1e3 * truth.position_m[500]])
    assert rows[1]["values"] == pytest.approx([1e-3 * truth.force_n[200], 1e-3 * truth.force_n[500]])

    (served.folder / "si").mkdir()
    same = {"time_s": truth.time_s, "x": truth.position_m, "f": truth.force_n}
    pl.DataFrame(same).write_parquet(served.folder / "si" / "same.parquet")
    (served.folder / "si" / "layout.toml").write_text(IN_SI + RIG)
    read(served, "si/same.parquet")
    _, drawn = unpack(window(served, query | {"pixels": 2000, "beside": "si/same.parquet", "shift": 0.0}))
    assert np.allclose(drawn["beside/Weg"], drawn["Weg"], atol=1e-5)
    assert np.allclose(drawn["beside/Kraft"], drawn["Kraft"], atol=1e-7)


def test_a_layout_that_does_not_fit_is_said_and_the_file_is_shown(served: Served) -> None:
    in_si(served.folder / "run.parquet")
    rig_file(served.folder / "run.csv")
    (served.folder / "layout.toml").write_text(IN_SI.replace('"x"', '"Strecke"') + RIG)
    found = read(served, "run.parquet")
    assert "the layout does not fit this file: there is no column 'Strecke'" in found["notes"][0]
    assert [one["column"] for one in found["channels"]] == ["x", "f"]
    assert "there is no column 'Strecke'" in get(served, "/api/strokes", 400, path="run.parquet")["problems"][0]["what"]
    (served.folder / "layout.toml").write_text(LOGGED.replace('"Weg"', '"Strecke"') + RIG)
    told = read(served, "run.csv")["problems"]  # without a layout nobody can read it
    assert "there is no column 'Strecke'" in told[0]["what"]


def test_the_file_states_the_unit_of_its_time(served: Served) -> None:
    rows = "".join(f"{10 * k};{k};{k}\n" for k in range(100))
    (served.folder / "logged.csv").write_text("time;way;t\nms;mm;mm\n" + rows)
    (served.folder / "thick.csv").write_text("t;way;force\nmm;mm;N\n" + rows)
    found = read(served, "logged.csv")
    assert (found["span"], found["time"]) == ([0.0, 0.99], True)
    found = read(served, "thick.csv")  # a thickness is no time
    assert (found["span"], found["time"]) == ([0.0, 99.0], False)
    assert {one["column"]: one["unit"] for one in found["channels"]} == {"t": "mm", "way": "mm", "force": "N"}


def test_a_view_is_one_of_the_file_as_it_is_shown_or_says_that_there_is_none(served: Served, cache: Path) -> None:
    """The page got views of a file that went on growing always of another one than it knew, and drew none of them."""
    place, query = (
        served.folder / "log.csv",
        {"path": "log.csv", "from": 0, "to": 99, "pixels": 500, "columns": "level"},
    )
    place.write_text("time,level\n" + rows_of(0, 10))
    keys = [read(served, "log.csv")["key"]]
    for tens in range(1, 5):
        with place.open("a") as file:
            file.write(rows_of(10 * tens, 10 * tens + 10))
        head, arrays = unpack(window(served, query | {"key": keys[-1]}))
        assert (head["key"], list(arrays["level"])) == (keys[-1], list(range(10 * tens)))
        keys.append(read(served, "log.csv")["key"])
    assert len(set(keys)) == 5
    assert [unpack(window(served, query | {"key": one}))[0]["key"] for one in keys] == [None] * 3 + keys[3:]
    assert {one.name for one in cache.iterdir()} == {one.partition("-")[0] for one in keys[3:]}

    for level in (1.0, 2.0):  # read where it lies: as it was before it cannot be read any more
        pl.DataFrame({"time": [0.0, 1.0], "level": [level, level]}).write_parquet(served.folder / "run.parquet")
        keys.append(read(served, "run.parquet")["key"])
    query |= {"path": "run.parquet"}
    assert unpack(window(served, query | {"key": keys[-2]})) == (
        {"number": 1, "path": "run.parquet", "key": None},
        {},
    )
    assert list(unpack(window(served, query))[1]["level"]) == [2.0, 2.0]


def test_what_comes_into_a_file_while_it_is_read_is_read_the_next_time(
    served: Served, monkeypatch: pytest.MonkeyPatch
) -> None:
    place, opened = served.folder / "log.csv", recordings._opened
    place.write_text("time,level\n" + rows_of(0, 10))

    def written_meanwhile(*given: object) -> object:
        found = opened(*given)
        monkeypatch.undo()
        place.write_text("time,level\n" + rows_of(0, 30))
        return found

    monkeypatch.setattr(recordings, "_opened", written_meanwhile)
    assert [read(served, "log.csv")["samples"] for _ in range(2)] == [10, 30]


def test_a_reading_that_fails_in_a_way_nobody_foresaw_ends(
    served: Served, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    (served.folder / "log.csv").write_text("time,level\n" + rows_of(0, 10))
    monkeypatch.setattr("pneudrive.web.messages.print_exception", traceback.print_exception)
    for fault, told in (
        (OSError(28, "No space left"), "cannot be read: No space left"),
        (KeyError("x"), "a fault of pneudrive"),
    ):
        (served.folder / "log.csv").touch()

        def failing(*_: object, fault: Exception = fault) -> object:
            raise fault

        monkeypatch.setattr(recordings, "_opened", failing)
        assert told[:20] in read(served, "log.csv")["problems"][0]["what"]
    assert "KeyError: 'x'" in capfd.readouterr().err


@pytest.mark.parametrize("kind", ["dates", "texts", "nanoseconds"])
def test_dates_of_a_parquet_file_are_seconds(served: Served, kind: str) -> None:
    day = np.datetime64("2026-03-01T08:00:00", "ns") + (1e9 * TO_AND_FRO["time"]).round().astype("timedelta64[ns]")
    times = {"dates": day.astype("datetime64[ms]"), "texts": day.astype(str), "nanoseconds": day}[kind]
    table = {"time_s": times, "x": 1e-3 * TO_AND_FRO["way"], "f": TO_AND_FRO["force"]}
    pl.DataFrame(table).write_parquet(served.folder / "run.parquet")
    skips = "skip_samples = 5\n" + IN_SI.replace('unit = "s"', 'unit = "date-time"')
    (served.folder / "layout.toml").write_text(skips + RIG)
    found = read(served, "run.parquet")
    assert (found["time"], found["notes"], found["samples"]) == (True, [], 1195)
    assert found["span"] == [0.025, 5.995]
    truth = load_recordings([served.folder / "run.parquet"])[0]
    query = {"path": "run.parquet", "from": 1.0, "to": 2.0, "pixels": 2000, "columns": "x"}
    _, drawn = unpack(window(served, query))
    rows = slice(194, 397)  # one sample beyond each end
    assert np.allclose(drawn["time"], truth.time_s[rows], atol=1e-7)
    assert np.allclose(drawn["x"], truth.position_m[rows])
    assert get(served, "/api/strokes", path="run.parquet")["strokes"][-1]["to"] == pytest.approx(6.0, abs=0.1)


@pytest.mark.parametrize("fault", [TO_AND_FRO["time"][300] - 0.2, np.nan])
def test_times_that_fall_within_a_block_are_said(served: Served, fault: float) -> None:
    times = TO_AND_FRO["time"].copy()
    times[300] = fault
    table = {"time_s": times, "x": 1e-3 * TO_AND_FRO["way"], "f": TO_AND_FRO["force"]}
    for name in ("run", "same", "other"):
        pl.DataFrame(table).write_parquet(served.folder / f"{name}.parquet")
        table["time_s"] = times if name == "run" else TO_AND_FRO["time"]
    (served.folder / "layout.toml").write_text(IN_SI + RIG)
    found = read(served, "run.parquet")
    assert (found["time"], found["span"]) == (False, [0.0, 1199.0])
    said = "the time decreases at sample 300: sample numbers replace it"
    assert found["notes"] == [said]
    asked = {"path": "run.parquet", "at": [400.0, 500.0], "columns": ["x"], "beside": "", "shift": 0}
    row = post(served, "/api/measure", asked)["rows"][0]
    assert row["values"] == list(table["x"][[400, 500]])
    shown = get(served, "/api/strokes", path="run.parquet")
    assert (shown["strokes"], shown["faults"]) == ([], {})
    assert "sample numbers only" in shown["note"]

    (served.folder / "deep" / "er").mkdir(parents=True)
    pl.DataFrame(table | {"time": times}).drop("time_s").write_csv(served.folder / "deep" / "er" / "run.csv")
    read(served, "other.parquet")
    for name in ("run.parquet", "deep/er/run.csv"):
        read(served, name)
        query = {"path": name, "from": 0, "to": 9, "pixels": 99, "columns": "x", "beside": "other.parquet"}
        head, _ = unpack(window(served, query | {"shift": 0.0}))
        assert f"{Path(name).name} only counts samples, but other.parquet has times" in head["problems"][0]["what"]


def test_a_recording_too_long_for_strokes_says_so(served: Served, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("pneudrive.web.measured.recordings.MOST_SAMPLES_OF_STROKES", 1199)
    in_si(served.folder / "run.parquet")
    read(served, "run.parquet")
    assert get(served, "/api/strokes", path="run.parquet") == {"strokes": [], "faults": {}}  # nobody says what moves
    (served.folder / "layout.toml").write_text(IN_SI + RIG)
    read(served, "run.parquet")
    found = get(served, "/api/strokes", path="run.parquet")
    assert (found["strokes"], found["faults"]) == ([], {})
    assert "1,200 samples, and the limit is 1,199" in found["note"]
    monkeypatch.chdir(served.folder)
    commands = re.findall(r"pneudrive .*?(?= finds)", found["note"])
    assert [run_line(one) for one in commands] == [0]


def test_a_layout_that_cannot_be_read_is_not_written(served: Served) -> None:
    rig_file(served.folder / "run.csv")
    answered = served.client.put("/api/file?path=layout.toml", json={"text": "nonsense ="}, headers=served.headers)
    assert answered.status_code == 400
    assert answered.json()["problems"][0]["file"] == "layout.toml"
    assert not (served.folder / "layout.toml").exists()
    answered = served.client.put("/api/file?path=layout.toml", json={"text": LOGGED + RIG}, headers=served.headers)
    assert answered.status_code == 200, answered.text
    assert read(served, "run.csv")["layout"] == "rig"
