"""What the views answer: the page's numbers are those of Python and of the command line, to the last bit."""

from __future__ import annotations

import json
import shlex
from pathlib import Path

import numpy as np
import polars as pl
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import pneudrive as pn
from pneudrive.cli.main import run as run_command
from pneudrive.errors import CommandError
from pneudrive.web.drive.run_request import RunLimit
from pneudrive.web.live import MOST_IMPACTS, answer
from pneudrive.web.messages import pack
from pneudrive.web.workspace import Workspace
from web.client import post, run_line, run_python
from web.conftest import DRIVE, Served
from web.frames import unpack

EXAMPLES = Path(__file__).parents[2] / "examples"
LAWS = EXAMPLES / "laws"
CHANGED = {"friction.coulomb": "31 N", "valve.critical_pressure_ratio": 0.35}
ASKED = {
    "path": "axis.toml",
    "changes": CHANGED,
    "command": "0 s: 1, 0.1 s: -0.5",
    "duration": "0.2 s",
    "initial": "position = 50 mm",
}
COLUMNS = {
    "position_m": "position",
    "velocity_m_s": "velocity",
    "pressure_a_pa": "pressure_a",
    "pressure_b_pa": "pressure_b",
}


def test_page_command_and_python_give_the_same_bits(served: Served, monkeypatch: pytest.MonkeyPatch) -> None:
    copied = post(served, "/api/copy", ASKED)
    with served.client.websocket_connect("/api/live", **served.socket) as socket:
        socket.send_text(json.dumps({"number": 7} | ASKED))
        head, drawn = unpack(socket.receive_bytes())
    assert head["number"] == 7

    monkeypatch.chdir(served.folder)
    names = run_python(copied["python"])
    assert run_line(copied["command"]) == 0
    table = pl.read_parquet("axis.parquet")
    for column, name in COLUMNS.items():
        assert np.array_equal(drawn[column], names["run"][name].to_numpy())
        assert np.array_equal(drawn[column], table[column].to_numpy())
    unchanged = pn.simulate(pn.Drive.load("axis.toml"), ASKED["command"], "0.2 s", initial=ASKED["initial"])
    assert not np.array_equal(drawn["position_m"], unchanged.position.to_numpy())  # the sliders count


def test_the_newest_of_waiting_requests_is_answered(served: Served) -> None:
    with served.client.websocket_connect("/api/live", **served.socket) as socket:
        for number in range(1, 41):
            socket.send_text(json.dumps({"number": number} | ASKED | {"duration": "4 s", "command": "0 s: 1, 2 s: -1"}))
        numbers = []
        while not numbers or numbers[-1] != 40:
            numbers.append(unpack(socket.receive_bytes())[0]["number"])
    assert numbers == sorted(numbers)
    assert len(numbers) < 40


def test_a_run_too_long_for_the_page_is_refused_in_words(served: Served) -> None:
    workspace = Workspace.at(served.folder)
    head, _ = unpack(answer(workspace, json.dumps(ASKED | {"duration": "1001 s"})))
    assert "samples are too many" in head["problems"][0]["what"]
    chatter = ASKED | {"duration": "900 s", "command": ", ".join(f"{0.05 * k:g} s: {(-1) ** k}" for k in range(3000))}
    head, _ = unpack(answer(workspace, json.dumps(chatter), RunLimit(0.02)))
    assert "took longer than 0.02 s" in head["problems"][0]["what"]


@pytest.mark.parametrize(
    "command",
    [
        *("secret", "valve:secret", "valve: /etc/passwd", "/etc/hostname", "../x"),
        *("../secret.csv", "valve: ../secret.csv", "{outside}/secret.csv", "link.csv", "a/../../secret.csv", ".csv"),
    ],
)
def test_a_command_is_no_file_but_a_csv_of_the_folder(
    served: Served, command: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(served.folder)
    outside = served.folder.parent
    (outside / "secret.csv").write_text("root:x:0:0")
    (served.folder / "secret").write_text("root:x:0:0")
    (served.folder / "link.csv").symlink_to(outside / "secret.csv")
    given = ASKED | {"command": command.format(outside=outside)}
    head, _ = unpack(answer(Workspace.at(served.folder), json.dumps(given)))
    assert any(said in head["problems"][0]["what"] for said in ("is not a command", "is not a file of this workspace"))
    assert "root:x" not in json.dumps(head)


def test_a_command_from_a_file_of_the_folder(served: Served, monkeypatch: pytest.MonkeyPatch) -> None:
    (served.folder / "steps").mkdir()
    (served.folder / "steps" / "out and back.csv").write_text("time_s,command\n0,1\n0.1,-0.5\n")
    (served.folder / "pair.toml").write_text(pn.Drive.load(served.folder / "axis.toml").circuit.to_toml())
    workspace = Workspace.at(served.folder)
    monkeypatch.chdir(served.folder)
    for path, command in (("axis.toml", "steps/out and back.csv"), ("pair.toml", ["valve: steps/out and back.csv"])):
        asked = {"path": path, "command": command, "duration": "0.2 s"}
        written = asked | {"command": ["valve: 0 s: 1, 0.1 s: -0.5"] if path == "pair.toml" else ASKED["command"]}
        head, drawn = unpack(answer(workspace, json.dumps(asked)))
        _, expected = unpack(answer(workspace, json.dumps(written)))
        assert "problems" not in head, head
        assert all(np.array_equal(drawn[name], values) for name, values in expected.items())
        copied = post(served, "/api/copy", asked)
        names = run_python(copied["python"])
        assert run_line(copied["command"]) == 0
        column = "position_m" if path == "axis.toml" else "cylinder.position_m"
        assert drawn[column][-1] == names["run"][column.removesuffix("_m")][-1]
        assert drawn[column][-1] == pl.read_parquet(Path(path).with_suffix(".parquet"))[column][-1]
    (served.folder / "steps" / "out and back.csv").write_text("time_s,command\n0,1\n0.1,-5\n")
    head, _ = unpack(answer(workspace, json.dumps(asked)))
    assert "command = -5 at 0.1 s" in head["problems"][0]["what"]


@pytest.mark.parametrize(
    "changes",
    [
        {"friction.law": "file:../secret.toml"},
        {"friction": "file:secret.toml"},
        {"cylinder.bore.x": "1 mm"},
        {"provenance": "x"},
        {"": 3, ".": "x"},
        {"friction.coulomb": "28 bar"},
        {"unknown.key": 1.0},
    ],
)
def test_a_change_that_is_none_is_answered_in_words(served: Served, changes: dict) -> None:
    (served.folder.parent / "secret.toml").write_text("secret = 1\n")
    head, arrays = unpack(answer(Workspace.at(served.folder), json.dumps(ASKED | {"changes": changes})))
    assert head["problems"][0]["what"]
    assert not arrays
    assert "secret = 1" not in json.dumps(head)


def test_a_long_run_is_drawn_without_losing_an_extreme(served: Served) -> None:
    asked = ASKED | {"duration": "3 s", "rate": "10 kHz", "pixels": 300, "command": "0 s: 1, 1 s: -1"}
    head, drawn = unpack(answer(Workspace.at(served.folder), json.dumps(asked)))
    drive = pn.Drive.load(served.folder / "axis.toml").replace(CHANGED)
    run = pn.simulate(drive, asked["command"], "3 s", initial=asked["initial"], sample_rate="10 kHz")
    assert head["samples"] == 30001
    assert all(len(values) == 600 for values in drawn.values())  # at most 4 x pixels
    rows = np.searchsorted(run["time"], drawn["time_s"])
    assert np.array_equal(run["time"][rows], drawn["time_s"])
    for column, name in COLUMNS.items():
        assert np.array_equal(drawn[f"{column}/at"], run[name][rows])  # what the page says of a time is of that time
        assert drawn[column].max() == run[name].max()
        assert drawn[column].min() == run[name].min()
        assert head["ends"][column] == run[name][-1]


def test_all_problems_come_with_their_lines(served: Served) -> None:
    text = DRIVE.replace('"28 N"', '"28 bar"').replace("mass", "mas")
    found = post(served, "/api/check", {"path": "axis.toml", "text": text})["problems"]
    assert [one["line"] for one in found] == [5, 8]
    assert "Did you mean 'mass'?" in found[1]["remedy"]
    broken = post(served, "/api/check", {"path": "axis.toml", "text": "name = "})["problems"]
    assert broken[0]["line"] == 1
    assert "values" not in broken


def test_values_say_where_they_come_from(served: Served) -> None:
    found = post(served, "/api/check", {"path": "axis.toml", "text": DRIVE})
    values = {one["key"]: one for one in found["values"]}
    assert values["friction.coulomb"] | {"low": 0, "high": 0} == {
        "key": "friction.coulomb",
        "text": "28 N",
        "number": 28.0,
        "unit": "N",
        "units": ["N", "mN", "kN"],
        "component": "cylinder",
        "kind": "given",
        "origin": "",
        "low": 0,
        "high": 0,
    }
    assert values["friction.breakaway"]["kind"] == "assumed"
    assert values["load.force"]["kind"] == "default"
    assert "friction.coulomb" in found["sliders"]
    circuit = pn.Drive.load(served.folder / "axis.toml").circuit.to_toml()
    sliders = post(served, "/api/check", {"path": "axis.toml", "text": circuit})["sliders"]
    assert len(sliders) == len(set(sliders))


def test_an_edit_keeps_comments_and_order(served: Served) -> None:
    text = post(served, "/api/edit", {"text": DRIVE, "key": "friction.coulomb", "value": "31 N"})["text"]
    assert text == DRIVE.replace("28 N", "31 N")
    text = post(served, "/api/edit", {"text": text, "key": "valve.critical_pressure_ratio", "value": 0.4})["text"]
    drive = pn.Drive.load(_written(served, text))
    assert drive.valve.critical_pressure_ratio == 0.4
    assert text.startswith('drive = "catalogue:reference"   # made up\n')
    refused = post(served, "/api/edit", {"text": DRIVE, "key": "name.first", "value": "x"}, 400)
    assert "not a table" in refused["problems"][0]["what"]


SHORT = (Path(__file__).parents[1] / "data" / "short_tables.toml").read_text("utf-8")


def circuits() -> dict[str, str]:
    """Texts of circuits: those of the examples, and one with the tables of a drive."""
    files = [*EXAMPLES.glob("*.toml"), *(EXAMPLES / "axes").glob("*.toml")]
    return {"short": SHORT} | {path.stem: path.read_text() for path in files}


@pytest.mark.parametrize("name", sorted(circuits()))
def test_each_value_of_a_circuit_is_written_where_it_stands(served: Served, name: str) -> None:
    text = circuits()[name]
    path = str(served.folder / "circuit.toml")
    Path(path).write_text(text)
    circuit = pn.Circuit.load(path)
    found = post(served, "/api/check", {"path": "circuit.toml", "text": text})
    assert found["kind"] == "circuit"
    # Of long circuits some: what a value is written by is the same for all of a kind.
    for one in found["values"][:: 1 + len(found["values"]) // 40]:
        asked = {"text": text, "key": one["key"], "value": one.get("number", 0.0)}
        if one.get("unit") != "":
            others = [unit for unit in one.get("units", []) if unit != one["unit"]]
            asked |= {"value": one["text"], **({"unit": others[-1]} if others else {})}
        edited = post(served, "/api/edit", asked)["text"]
        Path(path).write_text(edited)
        assert pn.Circuit.load(path).core_json() == circuit.core_json(), (one["key"], edited)
        kept = [line for line in text.splitlines() if line not in edited.splitlines()]
        assert len(kept) <= 1, (one["key"], kept)  # comments, order and all other values


def test_a_value_of_copies_is_that_of_all_and_says_so(served: Served) -> None:
    text = (EXAMPLES / "two_cylinders.toml").read_text()
    values = post(served, "/api/check", {"path": "pair.toml", "text": text})["values"]
    copies = {one["key"]: one.get("copies") for one in values}
    assert copies["components.left.bore"] == copies["components.right.bore"] == ["left", "right"]
    assert copies["components.tank.volume"] is None
    asked = {"text": text, "key": "components.left.dead_volume_a", "value": "9 cm3"}
    edited = post(served, "/api/edit", asked)["text"]
    assert edited == text.replace('dead_volume = { a = "8 cm3"', 'dead_volume = { a = "9 cm3"')
    for wrong in ("components = 3", "[components]\nleft = 3", "[components]\nleft_and_right = 3\nleft = [4]"):
        refused = post(served, "/api/edit", asked | {"text": wrong}, 400)
        assert "is not a table" in refused["problems"][0]["what"]


def test_what_no_field_can_write_says_where_it_stands(served: Served) -> None:
    text = """\
[components.hose]
formula = "file:flow.toml"
[components.valve]
flow_table = [{ opening = -1 }, { opening = 1 }]
"""
    said = {
        "components.hose.formula.name": "components.hose.formula.name is set in flow.toml",
        "components.valve.flow_table": "components.valve.flow_table is a table of points",
    }
    for key, what in said.items():
        refused = post(served, "/api/edit", {"text": text, "key": key, "value": "x"}, 400)
        assert refused["problems"][0]["what"] == what


@pytest.mark.parametrize("name", ["pwm_axis", "axes/switching", "two_cylinders", "cushioned_axis"])
def test_the_first_command_of_a_circuit_draws_a_curve(served: Served, name: str) -> None:
    text = (EXAMPLES / f"{name}.toml").read_text()
    (served.folder / "circuit.toml").write_text(text)
    found = post(served, "/api/check", {"path": "circuit.toml", "text": text})
    lines = [f"{valve}: 0 s: 1, 1 s: {lowest}" for valve, lowest in found["valves"].items()]
    asked = {"path": "circuit.toml", "command": lines, "duration": "1.2 s", "rate": "100 Hz"}
    head, drawn = unpack(answer(Workspace.at(served.folder), json.dumps(asked)))
    assert "problems" not in head, head
    assert all(np.isfinite(values).all() for values in drawn.values())
    assert set(found["valves"].values()) == ({0} if "pwm" in name or "switching" in name else {-1})


def test_another_unit_converts_the_value(served: Served) -> None:
    asked = {"text": DRIVE, "key": "friction.coulomb", "value": "28 N", "unit": "kN"}
    assert post(served, "/api/edit", asked)["text"] == DRIVE.replace("28 N", "0.028 kN")
    asked = {"text": DRIVE, "key": "supply.pressure", "value": "6.3 bar gauge", "unit": "psi gauge"}
    text = post(served, "/api/edit", asked)["text"]
    before, after = (pn.Drive.load(_written(served, one)) for one in (DRIVE, text))
    assert after.supply.pressure.value_pa == 630_000.0 != before.supply.pressure.value_pa
    for wrong in ("m", "psi abs", "bar", ""):
        assert post(served, "/api/edit", asked | {"unit": wrong}, 400)["problems"]


LINES = """
[load]
mass = "4 kg"
[load.spring]
stiffness = "300 N/m"
rest_position = "100 mm"
[tubing]
a = { length = "1 m", diameter = "4 mm" }
b = { length = "2 m", diameter = "4 mm" }
[flow_control]
a = { conductance = "0.5 dm3/(s bar)", critical_pressure_ratio = 0.3 }
b = { conductance = "0.6 dm3/(s bar)", critical_pressure_ratio = 0.3 }
"""


@pytest.mark.parametrize("is_circuit", [False, True])
def test_every_symbol_has_its_own_values(served: Served, is_circuit: bool) -> None:
    text = DRIVE.replace('[load]\nmass = "1.5 kg"\n', "") + LINES
    if is_circuit:
        text = pn.Drive.load(_written(served, text)).circuit.to_toml()
    asked = {"path": "axis.toml", "text": text}
    drawn = {one["component"] for one in post(served, "/api/drawing", asked)["shapes"]} - {""}
    assert len(drawn) == 9
    own: dict[str, set[str]] = {}
    for one in post(served, "/api/check", asked)["values"]:
        own.setdefault(one["component"], set()).add(one["key"])
    assert drawn <= own.keys()
    if not is_circuit:
        assert own["tube_b"] >= {"tubing.b.length"}
        assert not any(key.startswith("tubing.a") for key in own["tube_b"])
        assert "load.spring.stiffness" in own["spring"]
        assert "load.mass" in own["load"]
        assert {"friction.coulomb", "cylinder.bore"} <= own["cylinder"]
        assert own[""] <= {"ambient.pressure", "ambient.temperature"}
        alone = post(served, "/api/check", {"path": "axis.toml", "text": DRIVE.split("[load]")[0]})["values"]
        assert next(one for one in alone if one["key"] == "load.mass")["component"] == "cylinder"


def _written(served: Served, text: str) -> str:
    path = served.folder / "edited.toml"
    path.write_text(text)
    return str(path)


def test_a_file_is_saved_by_whoever_knows_it(served: Served) -> None:
    known = served.client.get("/api/file", params={"path": "axis.toml"}, headers=served.headers).json()
    assert known["text"] == DRIVE
    tag = served.headers | {"if-match": f'"{known["sha256"]}"'}
    answered = served.client.put("/api/file?path=axis.toml", json={"text": DRIVE + "#\n"}, headers=tag)
    assert answered.status_code == 200
    late = served.client.put("/api/file?path=axis.toml", json={"text": "lost"}, headers=tag)
    assert late.status_code == 412
    assert late.json()["text"] == DRIVE + "#\n"
    assert (served.folder / "axis.toml").read_text() == DRIVE + "#\n"
    outside = served.client.get("/api/file", params={"path": "../axis.toml"}, headers=served.headers)
    assert outside.status_code == 400


def test_the_drawing_has_every_component_and_no_markup(served: Served) -> None:
    hostile = DRIVE.replace("my axis", "<img src=x onerror=alert(1)>")
    found = post(served, "/api/drawing", {"path": "axis.toml", "text": hostile})
    assert {"supply", "valve", "cylinder"} <= {one["component"] for one in found["shapes"]}
    assert found["words"][0] == "<img src=x onerror=alert(1)>"  # text, which the page shows as text


@pytest.mark.parametrize("kind", ["rodless", "single-rod", "through-rod"])
def test_the_piston_moves_and_the_barrel_stays(served: Served, kind: str) -> None:
    rod = "" if kind == "rodless" else '\nrod_diameter = "10 mm"'
    cylinder = f'\n[cylinder]\nkind = "{kind}"{rod}\n'
    found = post(served, "/api/drawing", {"path": "axis.toml", "text": DRIVE + cylinder})
    at = found["pistons"]["cylinder"]
    left, low, right, high = at["barrel"]
    assert left < at["piston"][0] < at["piston"][1] < right
    lines = [one["points"] for one in found["shapes"] if one["component"] == "cylinder" and one["word"] == "line"]
    corners = {tuple(point) for points in lines for point in points}
    assert {(left, low), (right, low), (left, high), (right, high)} <= corners
    moved, held = set(), set()
    for number, one in enumerate(found["shapes"]):
        if one["component"] != "cylinder":
            continue
        moves = at["moves"].get(str(number), [False] * len(one["points"]))
        for point, is_moved in zip(one["points"], moves, strict=True):
            (moved if is_moved else held).add(tuple(point))
    assert {(x, y) for x in at["piston"] for y in (low, high)} <= moved
    assert {(left, low), (right, low), (left, high), (right, high)} <= held
    assert {(x, low - 1.0) for x in (left + 1.0, left + 11.0)} <= held  # the ports
    port = (left + 3.0, high + 2.0) if kind == "rodless" else (right + 3.0, low + 2.3)
    assert (port in held) == (kind != "rodless")  # a rod ends where its load begins


@settings(max_examples=30, deadline=None)
@given(st.dictionaries(st.text(max_size=8), st.lists(st.floats(width=32), max_size=9), max_size=4), st.text(max_size=9))
def test_frames_are_read_back_and_aligned(arrays: dict[str, list[float]], said: str) -> None:
    given_arrays = {name: np.array(values, "f4" if len(values) % 2 else "f8") for name, values in arrays.items()}
    frame = pack({"said": said}, given_arrays)
    assert len(frame) % 8 == 0
    head, found = unpack(frame)
    assert head == {"said": said}
    assert found.keys() == given_arrays.keys()
    for name, values in given_arrays.items():
        assert found[name].dtype == values.dtype
        assert np.array_equal(found[name], values, equal_nan=True)


def test_a_fault_is_answered_too(served: Served, monkeypatch: pytest.MonkeyPatch) -> None:
    """Else the page would wait for an answer that never comes."""

    def faulty(*_: object) -> object:
        raise IndexError("index 0 is out of bounds")

    monkeypatch.setattr("pneudrive.web.messages.print_exception", lambda _: None)
    monkeypatch.setattr("pneudrive.web.live.ExtrasRequest.of", faulty)
    with served.client.websocket_connect("/api/live", **served.socket) as socket:
        for number in (1, 2):
            socket.send_text(f'{{"number": {number}}}')
            head, _ = unpack(socket.receive_bytes())
            assert head["number"] == number
            assert "IndexError: index 0 is out of bounds" in head["problems"][0]["what"]


def test_what_is_no_request_is_answered_in_words(served: Served) -> None:
    workspace = Workspace.at(served.folder)
    for message in (
        "",
        "[]",
        "{}",
        '{"path": 3}',
        "[" * 20000,
        '{"path": "axis.toml", "changes": {"a": [1]}}',
        "\ud800",
    ):
        head, arrays = unpack(answer(workspace, message))
        assert head["problems"]
        assert not arrays


def test_arrays_that_are_drawn_take_32_bits_and_lose_nothing_that_is_seen() -> None:
    rng = np.random.default_rng(5)
    values = {"pressure": 1e6 + 1e-3 * rng.random(2000), "time": np.linspace(1e5, 1e5 + 1e-2, 2000)}
    values["pressure"][7] = np.nan
    values["nothing"] = np.full(3, np.nan)
    frame = pack({"a": 1}, values, drawn=True)
    head, drawn = unpack(frame)
    assert head == {"a": 1}
    assert len(frame) < 4 * 4003 + 300
    assert np.isnan(drawn["pressure"][7])
    assert np.isnan(drawn["nothing"]).all()
    for name in ("pressure", "time"):
        off = np.nanmax(np.abs(drawn[name] - values[name]))
        assert off <= 2.0**-25 * np.nanmax(values[name]) - 2.0**-25 * np.nanmin(values[name]) + np.spacing(1e6)


def test_a_law_in_a_file_is_read_as_it_is_now(served: Served) -> None:
    law = served.folder / "own.toml"
    law.write_text((LAWS / "lugre.toml").read_text())
    text = DRIVE.replace(
        "[friction]",
        '[friction]\nlaw = "file:own.toml"\nbreakaway = "40 N"\nviscous = "40 N s/m"\n'
        'stribeck_velocity = "20 mm/s"\nbristle_stiffness = "1e5 N/m"\nbristle_damping = "20 N s/m"',
    )
    (served.folder / "with-law.toml").write_text(text)
    asked = json.dumps({**ASKED, "path": "with-law.toml", "changes": {}, "number": 1})
    before = unpack(answer(Workspace.at(served.folder), asked))[0]
    law.write_text(law.read_text().replace("+ viscous*v", "+ 5*viscous*v"))
    after = unpack(answer(Workspace.at(served.folder), asked))[0]
    assert after["ends"]["position_m"] != before["ends"]["position_m"]


def test_texts_and_names_that_cannot_be_are_refused_in_words(served: Served) -> None:
    half = b'{"path": "axis.toml", "text": "\\ud800"}'
    answered = served.client.post("/api/check", content=half, headers=served.headers)
    assert answered.status_code == 400
    with pytest.raises(CommandError, match="cannot be written"):
        Workspace.at(served.folder).write("é" * 200 + ".toml", "schema = 1\n", None)
    (served.folder / "-axis.toml").write_text(DRIVE)
    command = post(served, "/api/copy", {**ASKED, "path": "-axis.toml"})["command"]
    assert " ./-axis.toml " in command
    assert command.endswith("--out axis.parquet")


def test_a_list_that_is_cut_says_so(served: Served, monkeypatch: pytest.MonkeyPatch) -> None:
    assert served.client.get("/api/studies", headers=served.headers).json()["is_cut"] is False
    for module in ("app", "workspace"):
        monkeypatch.setattr(f"pneudrive.web.{module}.MOST_FILES", 1)
    assert served.client.get("/api/studies", headers=served.headers).json()["is_cut"] is True


def test_what_is_left_out_of_a_panel_and_of_the_impacts_is_counted(served: Served) -> None:
    text = (EXAMPLES / "two_cylinders.toml").read_text()
    (served.folder / "pair.toml").write_text(text)
    asked = {
        "path": "pair.toml",
        "command": ["valve_l: 0 s: 1, 1 s: -1", "valve_r: 0 s: 1, 1 s: -1"],
        "duration": "2 s",
    }
    head, _ = unpack(answer(Workspace.at(served.folder), json.dumps(asked)))
    run = pn.simulate(pn.Circuit.load(served.folder / "pair.toml"), asked["command"], "2 s")
    shown = {one["title"]: (len(one["curves"]), one["left_out"]) for one in head["panels"]}
    pressures = [name for name in run.data_vars if str(name).rpartition(".")[2] == "pressure"]
    assert shown["Pressure, absolute"] == (8, len(pressures) - 8)
    assert shown["Position"] == (2, 0)
    impacts = run.attrs["impacts"]
    assert head["more_impacts"] == max(len(impacts) - MOST_IMPACTS, 0)
    assert [one["cylinder"] for one in head["impacts"]] == [one["cylinder"] for one in impacts[:MOST_IMPACTS]]
    assert [one["cylinder"] for one in head["impacts"]][:3] == ["left", "right", "left"]


def test_a_copied_command_writes_over_no_file(served: Served, monkeypatch: pytest.MonkeyPatch) -> None:
    (served.folder / "axis.parquet").write_text("measured")
    (served.folder / "old").mkdir()
    (served.folder / "old" / "axis.toml").write_text(DRIVE.replace("28 N", "20 N"))
    beside = {"others": ["old/axis.toml"], "energy": True}
    lines = post(served, "/api/copy", {**ASKED, "changes": {}, **beside})["command"].splitlines()
    words = [shlex.split(line) for line in lines]
    outs = [one[one.index("--out") + 1] for one in words]
    assert outs == ["axis-2.parquet", "axis-3.parquet", "axis-2.parquet"]
    monkeypatch.chdir(served.folder)
    for one in words:
        assert run_command(one[1:]) == 0
    assert (served.folder / "axis.parquet").read_text() == "measured"
    own, other = (pl.read_parquet(one)["position_m"][-1] for one in outs[:2])
    assert own != other


def test_a_problem_in_a_file_that_a_text_names_says_which(served: Served) -> None:
    (served.folder / "law.toml").write_text("\n\nbroken = [\n")
    text = 'drive = "catalogue:reference"\n[friction]\nlaw = "file:law.toml"\n'
    (told,) = post(served, "/api/check", {"path": "axis.toml", "text": text})["problems"]
    assert (told["file"], told["line"]) == ("law.toml", 3)
    (told,) = post(served, "/api/check", {"path": "axis.toml", "text": DRIVE.replace("28 N", "28")})["problems"]
    assert told["file"] == "axis.toml"
