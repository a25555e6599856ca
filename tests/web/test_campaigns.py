"""A campaign on the simulated rig, begun by the page, killed, resumed: the bits of one that nobody disturbed."""

from __future__ import annotations

import shlex
import shutil
import time
from pathlib import Path

import numpy as np
import pytest

from pneudrive.campaign.run import run_campaign
from pneudrive.campaign.storage.folder import Campaign
from pneudrive.cli.main import run as command_line
from pneudrive.web.app import make_app
from pneudrive.web.workspace import Workspace
from web.conftest import PORT, TOKEN, Served
from web.test_friction import post
from web.test_recordings import get

NAME = "campaigns/first"
PROTOCOL = """\
schema = 1
name = "three speeds"
seed = 3
directions = "both"

[speed]
from = "100 mm/s"
to = "300 mm/s"
count = 3
settled_time = "0 s"

[pressure]
both = ["0 bar gauge"]
settling = "1 s"
"""


def until(served: Served, done: int) -> dict:
    for _ in range(300):
        answered = served.client.get("/api/campaign", params={"path": NAME}, headers=served.headers)
        if answered.status_code == 200 and answered.json()["done"] >= done:
            return answered.json()
        time.sleep(0.05)
    raise AssertionError(answered.text)


def bits(folder: Path) -> dict[str, np.ndarray]:
    return {one.head.cycle.key: one.samples().force_n for one in Campaign.open(folder).cycles()}


def test_a_campaign_is_watched_killed_and_resumed(served: Served) -> None:
    (served.folder / "speeds.toml").write_text(PROTOCOL)
    job = post(served, "/api/campaigns", {"protocol": "speeds.toml", "name": "first", "pace": 1})
    line = "pneudrive campaign run speeds.toml --rig default --out campaigns/first --yes --speed 1"
    assert job["command"].splitlines()[-1] == line
    seen = until(served, 1)
    assert seen["synthetic"]
    assert seen["state"] in ("running", "starting")
    assert seen["planned"] > seen["done"]
    process = served.jobs[0].process
    process.kill()
    process.wait()
    post(served, "/api/campaigns", {"resume": NAME})
    seen = until(served, seen["planned"])
    assert [len(group["points"]) for group in seen["groups"]] == [3]
    assert any("finished" in line for line in seen["log"])
    assert {one["kind"] for one in get(served, "/api/studies")["files"] if one["path"] == NAME} == {"campaign"}

    run_campaign(served.folder / "speeds.toml", "default", served.folder / "alone")
    expected, found = bits(served.folder / "alone"), bits(served.folder / NAME)
    assert expected.keys() == found.keys()
    assert all(np.array_equal(found[key], expected[key]) for key in expected)


def test_a_campaign_that_was_begun_anew_in_its_folder_shows_its_own_points(served: Served) -> None:
    def speeds() -> list[float]:
        groups = get(served, "/api/campaign", path=NAME)["groups"]
        return sorted(round(one["speed"], 4) for group in groups for one in group["points"])

    (served.folder / "speeds.toml").write_text(PROTOCOL)
    run_campaign(served.folder / "speeds.toml", "default", served.folder / NAME)
    assert speeds() == [0.1, 0.1732, 0.3]
    shutil.rmtree(served.folder / NAME)
    (served.folder / "speeds.toml").write_text(
        PROTOCOL.replace('from = "100', 'from = "150').replace("= 3\ns", "= 2\ns")
    )
    run_campaign(served.folder / "speeds.toml", "default", served.folder / NAME)
    for _ in range(100):
        if len(seen := speeds()) == 2:
            break
        time.sleep(0.05)
    assert seen == [0.15, 0.3]


def test_the_plan_on_the_page_is_that_of_command_and_python(served: Served, capsys: pytest.CaptureFixture) -> None:
    (served.folder / "speeds.toml").write_text(PROTOCOL)
    shown = post(served, "/api/plan", {"protocol": "quick-look"})
    assert command_line(shlex.split(shown["command"])[1:]) == 0
    assert capsys.readouterr().out == f"{shown['text']}\n"
    exec(shown["python"], {})
    assert capsys.readouterr().out == f"{shown['text']}\n"
    pressures = PROTOCOL.replace('["0 bar gauge"]', '["0 bar gauge", "29 psi gauge"]')
    (served.folder / "psi.toml").write_text(pressures)
    text = post(served, "/api/plan", {"protocol": "psi.toml"})["text"]
    assert "pressure 2 levels in both chambers, 0 bar gauge to 1.99948 bar gauge" in text
    (served.folder / "fast.toml").write_text(PROTOCOL.replace("300 mm/s", "30 m/s"))
    refused = post(served, "/api/plan", {"protocol": "fast.toml"}, 400)["problems"][0]
    assert "speed" in refused["what"] + str(refused["value"])
    assert "there is no protocol" in post(served, "/api/plan", {"protocol": 3}, 400)["problems"][0]["what"]


def test_a_server_without_control_only_watches(served: Served) -> None:
    (served.folder / "speeds.toml").write_text(PROTOCOL)
    run_campaign(served.folder / "speeds.toml", "default", served.folder / "done")
    for word in ("pause", "stop", "resume", "abort"):
        refused = post(served, "/api/campaign", {"path": "done", "word": word}, 400)
        assert "only watches" in refused["problems"][0]["what"]
    served.app = make_app(Workspace.at(served.folder), PORT, TOKEN, served.folder.parent / "built", control=True)
    served.client.app = served.app
    served.client._transport.app = served.app
    refused = post(served, "/api/campaign", {"path": "done", "word": "abort"}, 400)
    assert "no process works" in refused["problems"][0]["what"]


@pytest.mark.parametrize(
    "asked",
    [
        {"protocol": "../speeds.toml", "name": "x"},
        {"protocol": "unknown", "name": "x"},
        {"protocol": "quick-look", "name": "../x"},
        {"protocol": "quick-look", "name": "x", "pace": 0.1},
        {"protocol": "quick-look", "name": "x", "pace": "fast"},
        {"resume": "../elsewhere"},
        {"resume": "missing"},
        {},
    ],
)
def test_a_campaign_elsewhere_is_not_begun(served: Served, asked: dict) -> None:
    assert post(served, "/api/campaigns", asked, 400)["problems"]
    assert not (served.folder / "campaigns").exists()
