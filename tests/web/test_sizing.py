"""Sizing from the page: a task and its problems, candidates as their folder has them; command and Python agree."""

from __future__ import annotations

import json
from contextlib import closing
from pathlib import Path

import pytest

import pneudrive as pn
from pneudrive.cli.main import run as run_command
from pneudrive.errors import CommandError
from pneudrive.figures import plain_data
from pneudrive.sizing.result import SizingFolder, SizingResult
from pneudrive.sizing.task import SizingTask
from pneudrive.web.drive.sizing import FIRST
from waiting import until
from web.client import get, post, run_line, run_python
from web.conftest import Served
from web.test_friction import finished

TASK = (Path(__file__).parents[1] / "data" / "sizing_task.toml").read_text("utf-8")
ASKED = {"kind": "size", "task": "push.toml", "name": "push", "draws": 16}


def test_page_command_and_python_find_the_same(served: Served, monkeypatch: pytest.MonkeyPatch) -> None:
    (served.folder / "push.toml").write_text(TASK)
    copied = post(served, "/api/work", ASKED)
    monkeypatch.chdir(served.folder)
    Path("results").mkdir()
    assert run_line(copied["command"]) == 0
    names = run_python(copied["python"])
    found: SizingResult = names["found"]
    found.save("by-python")
    assert Path("results/push/ranking.csv").read_bytes() == Path("by-python/ranking.csv").read_bytes()

    listed = {one["path"]: one["kind"] for one in get(served, "/api/studies")["files"]}
    assert listed["push.toml"] == "task"
    assert listed["results/push"] == "sizing"
    shown = get(served, "/api/sizing", path="results/push")
    assert shown["task"] == "push.toml"
    assert shown["view"] == served_view(found)
    assert [one["state"] for one in shown["view"]["findings"]][:1] == ["open"]
    assert "side load" in shown["view"]["findings"][0]["text"]
    assert shown["view"]["title"].startswith("Not ready to order: ")
    assert [row[3] for row in shown["sheet"]["tables"][0]["rows"]] == [
        name for name in found.ranked[0].parts.values() if name != "none"
    ]
    assert [one["name"] for one in shown["candidates"]][: len(found.ranked)] == [one.name for one in found.ranked]
    candidates = {one["name"]: one for one in shown["candidates"]}
    assert candidates.keys() == {one.name for one in found.simulated}
    for place, one in enumerate(found.ranked):
        mine = candidates[one.name]
        assert mine["place"] == place
        assert (mine["air"], mine["energy"], mine["time_out"]) == (one.air_litres_anr, one.energy, one.time_out)
        assert (mine["met"], mine["binding"]) == (one.met, one.binding)
        limits = {each["name"]: each for each in mine["limits"]}
        assert limits["time out"]["interval"][1] == mine["time_out"]  # 1 % of the samples pass it
        low, high = limits["air of a cycle"]["interval"]
        assert low < mine["air"] < high
        ratio = limits["load ratio"]
        assert 0.0 < ratio["interval"][0] < ratio["value"] < ratio["limit"]
        assert ratio["value"] == pytest.approx(1e2 * mine["load_ratio"])
        assert pn.Circuit.load(mine["file"]).to_toml() == found.circuit(place).to_toml()
    missed = next(one for one in shown["candidates"] if one["misses"])
    energy = {one["name"]: one for one in missed["limits"]}["energy out"]
    assert energy["value"] > energy["limit"] == 0.26
    assert energy["margin"] == pytest.approx(1.0 - energy["value"] / 0.26, abs=1e-9)
    assert energy["interval"][0] < energy["interval"][1] == energy["value"]
    assert not missed["file"]
    lines = Path("results/push/choices.jsonl")  # as an earlier version wrote it
    drives = map(json.loads, lines.read_text().splitlines())
    old = ({key: value for key, value in drive.items() if key != "intervals"} for drive in drives)
    lines.write_text("".join(json.dumps(drive) + "\n" for drive in old))
    assert all(one["load_ratio"] is None for one in get(served, "/api/sizing", path="results/push")["candidates"])

    (served.folder / "push.toml").write_text(TASK.replace("2 kg", "3 kg"))
    assert get(served, "/api/sizing", path="results/push")["task"] == ""


def served_view(found: SizingResult) -> dict:
    """Return the view of a result as JSON has it."""
    return json.loads(json.dumps(plain_data(found.view().data())))


def test_a_search_that_is_ended_goes_on_where_it_was(served: Served) -> None:
    (served.folder / "push.toml").write_text(TASK)
    few = ASKED | {"draws": 8}
    post(served, "/api/jobs", few)
    lines = served.folder / "results" / "push" / "choices.jsonl"
    until(lines.is_file)
    number = served.jobs[0].number
    post(served, "/api/cancel", {"number": number})
    assert finished(served)["state"] == "cancelled"
    kept = lines.read_text()
    shown = get(served, "/api/sizing", path="results/push")
    assert not shown["done"]
    assert len(shown["candidates"]) <= len(kept.splitlines())
    post(served, "/api/jobs", few | {"resume": "results/push"})
    assert finished(served)["state"] == "done"
    assert lines.read_text().startswith(kept)
    assert get(served, "/api/sizing", path="results/push")["done"]


def test_a_search_of_another_process_is_seen_and_not_begun_again(
    served: Served, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The process of a search outlives its server: the next server knows no job of it."""
    (served.folder / "push.toml").write_text(TASK)
    folder = served.folder / "results" / "push"
    task = SizingTask.load(served.folder / "push.toml")
    with closing(SizingFolder(folder, task, (16, 64))):
        assert get(served, "/api/sizing", path="results/push")["searched"]
        refused = post(served, "/api/jobs", ASKED | {"resume": "results/push"}, 400)
        assert "a process searches in results/push already" in refused["problems"][0]["what"]
        monkeypatch.chdir(served.folder)
        assert run_command(["size", "push.toml", "--samples", "16", "--out", "results/push"]) != 0
        with pytest.raises(CommandError, match="another process runs a sizing in"):
            SizingFolder(folder, task, (16, 64))
    assert not get(served, "/api/sizing", path="results/push")["searched"]
    with closing(SizingFolder(folder, task, (16, 64))):
        pass


def test_a_task_says_what_it_holds_and_what_is_wrong_with_it(served: Served) -> None:
    first = FIRST.read_text()
    found = post(served, "/api/task", {"text": first})
    assert found["problems"] == []
    values = {one["key"]: one for one in found["values"]}
    assert values["mass"] | {"origin": ""} == {"key": "mass", "text": "8 kg", "kind": "given", "origin": ""}
    assert values["spread.friction"]["kind"] == "default"
    assert values["spread.friction"]["text"] == "0.7 .. 1.5"
    weight = found["follows"][0]
    assert weight["value"] == pytest.approx(8.0 * 9.80665 * 0.5)
    imperial = first.replace('"8 kg"', '"6 lb"').replace('"6 bar gauge"', '"87 psi gauge"')
    values = {one["key"]: one["text"] for one in post(served, "/api/task", {"text": imperial})["values"]}
    assert values["mass"] == "2.72155422 kg"
    assert values["supply.pressure"] == "5.998438845 bar gauge"
    assert post(served, "/api/task", {})["text"] == first
    wrong = first.replace('"8 kg"', '"8 bar"').replace("ckd-*", "cdk-*")
    problems = post(served, "/api/task", {"text": wrong})["problems"]
    assert problems[0]["line"] == 3
    assert post(served, "/api/task", {"text": "mass = "})["problems"]


@pytest.mark.parametrize(
    "change",
    [
        {"task": "missing.toml"},
        {"task": "../push.toml"},
        {"task": 3},
        {"name": "a/b"},
        {"name": "push.toml"},
        {"most": 0},
        {"draws": True},
        {"draws": 1e9},
        {"resume": "results/none"},
        {"resume": "../x"},
        {"kind": "run"},
        {"kind": ["size"]},
    ],
)
def test_a_wrong_request_starts_nothing(served: Served, change: dict) -> None:
    (served.folder / "push.toml").write_text(TASK)
    assert post(served, "/api/jobs", ASKED | change, 400)["problems"]
    assert not served.jobs


def test_a_folder_that_holds_no_sizing_is_answered_in_words(served: Served) -> None:
    (served.folder / "x").mkdir()
    begun = served.client.get("/api/sizing", params={"path": "x"}, headers=served.headers)
    assert begun.json() == {"waits": True}  # a search makes the folder first
    (served.folder / "x" / "notes.txt").write_text("of another kind")
    answered = served.client.get("/api/sizing", params={"path": "x"}, headers=served.headers)
    assert answered.status_code == 400
    assert "holds no sizing" in answered.json()["problems"][0]["what"]
    for damaged in ([1], {"task": {"mass": "8 kg"}}):
        (served.folder / "x" / "sizing.json").write_text(json.dumps(damaged))
        answered = served.client.get("/api/sizing", params={"path": "x"}, headers=served.headers)
        assert "damaged" in answered.json()["problems"][0]["what"]
