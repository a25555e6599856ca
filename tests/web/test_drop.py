"""A file that is dropped onto the page: whole or not at all, of any length, never over one that is there."""

from __future__ import annotations

import asyncio
import shutil
from collections import namedtuple
from collections.abc import AsyncIterator

import pytest
from starlette.requests import ClientDisconnect

from pneudrive.errors import CommandError
from pneudrive.web import drop
from pneudrive.web.guard import MOST_BODY
from pneudrive.web.workspace import Workspace
from web.conftest import Served


def put(served: Served, name: str, content: bytes, status: int = 200) -> dict:
    answer = served.client.put("/api/drop", params={"path": name}, content=content, headers=served.headers)
    assert answer.status_code == status
    return answer.json()


def left_over(served: Served) -> list[str]:
    return [one.name for one in served.folder.glob(".*")]


def test_a_file_longer_than_any_request_arrives_whole_and_only_once(served: Served) -> None:
    content = bytes(range(256)) * (MOST_BODY // 64)
    assert put(served, "run.csv", content) == {"size": 4 * MOST_BODY}
    assert (served.folder / "run.csv").read_bytes() == content
    assert "is there already" in put(served, "run.csv", b"other", 400)["problems"][0]["what"]
    assert "is there already" in put(served, "axis.toml", b"other", 400)["problems"][0]["what"]
    assert (served.folder / "run.csv").read_bytes() == content
    assert left_over(served) == []


@pytest.mark.parametrize("name", ["../x.csv", "a/x.csv", "x.py", "/x.csv", ".x.csv", "x.csv\0", "", "results/x.csv"])
def test_a_name_that_leads_elsewhere_is_refused(served: Served, name: str) -> None:
    (served.folder / "results").mkdir()
    before = sorted(served.folder.parent.rglob("*"))
    assert put(served, name, b"1", 400)["problems"]
    assert sorted(served.folder.parent.rglob("*")) == before


@pytest.mark.parametrize("missing", ["authorization", "origin"])
def test_no_other_page_drops_a_file(served: Served, missing: str) -> None:
    headers = {key: value for key, value in served.headers.items() if key != missing}
    answer = served.client.put("/api/drop", params={"path": "x.csv"}, content=b"1", headers=headers)
    assert answer.status_code in (401, 403)
    assert served.client.post("/api/drop", content=b"1" * (MOST_BODY + 1), headers=served.headers).status_code == 413
    assert not (served.folder / "x.csv").exists()


def test_what_does_not_arrive_whole_or_does_not_fit_leaves_nothing(
    served: Served, monkeypatch: pytest.MonkeyPatch
) -> None:
    workspace = Workspace.at(served.folder)

    async def torn() -> AsyncIterator[bytes]:
        yield b"1" * 1000
        raise ClientDisconnect

    async def short() -> AsyncIterator[bytes]:
        yield b"1" * 1000

    with pytest.raises(ClientDisconnect):
        asyncio.run(drop.take(workspace, "x.csv", 5000, torn()))
    with pytest.raises(CommandError, match="did not arrive whole"):
        asyncio.run(drop.take(workspace, "x.csv", 5000, short()))

    async def meanwhile() -> AsyncIterator[bytes]:
        yield b"1"
        (served.folder / "x.csv").write_bytes(b"theirs")

    with pytest.raises(CommandError, match="is there already"):
        asyncio.run(drop.take(workspace, "x.csv", None, meanwhile()))
    assert (served.folder / "x.csv").read_bytes() == b"theirs"
    usage = namedtuple("usage", "free")
    monkeypatch.setattr(shutil, "disk_usage", lambda _: usage(free=drop.RESERVE + 10))
    assert "too little room" in put(served, "y.csv", b"1" * 11, 400)["problems"][0]["what"]
    assert put(served, "z.csv", b"1" * 10)["size"] == 10
    assert left_over(served) == []


@pytest.mark.parametrize("to", ["../x.toml", "other.toml", "axis.csv", "none/x.toml", ".x.toml", "/x.toml"])
def test_no_name_leads_out_of_the_folder_or_over_a_file(served: Served, to: str) -> None:
    (served.folder / "other.toml").write_text("name = 'theirs'\n")
    before = {path: path.read_bytes() for path in served.folder.parent.rglob("*.toml")}
    answer = served.client.post("/api/rename", json={"path": "axis.toml", "to": to}, headers=served.headers)
    assert answer.status_code == 400
    assert {path: path.read_bytes() for path in served.folder.parent.rglob("*.toml")} == before


def test_a_file_gets_another_name_whole(served: Served) -> None:
    text = (served.folder / "axis.toml").read_bytes()
    asked = {"path": "axis.toml", "to": "mine.toml"}
    assert served.client.post("/api/rename", json=asked, headers=served.headers).status_code == 200
    assert (served.folder / "mine.toml").read_bytes() == text
    assert not (served.folder / "axis.toml").exists()


def test_example_recordings_are_copied_once_and_never_over_a_file(served: Served) -> None:
    (served.folder / "example").mkdir()
    (served.folder / "example" / "layout.toml").write_text("# mine")
    for _ in range(2):
        found = served.client.post("/api/example", json={}, headers=served.headers).json()
    assert (served.folder / found["path"]).is_file()
    assert (served.folder / "example" / "layout.toml").read_text() == "# mine"
    assert len(list((served.folder / "example").iterdir())) == 3


def test_a_recording_of_another_rig_gets_a_folder_with_its_own_layout(served: Served) -> None:
    raw = b"time,way\n0,1\n"
    (served.folder / "other.csv").write_bytes(raw)
    (served.folder / "layout.toml").write_text("# theirs\n")
    text = 'kind = "fixed-volume"\n[columns]\ntime = { column = 0, unit = "s" }\n'
    text += 'pressure = { column = 1, unit = "bar gauge" }\n'

    def asked(path: str, text: str, code: int = 200) -> dict:
        answer = served.client.post("/api/own-layout", json={"path": path, "text": text}, headers=served.headers)
        assert answer.status_code == code
        return answer.json()

    asked("other.csv", "[columns]\nspeeed = 1\n", 400)
    asked("../other.csv", text, 400)
    assert (served.folder / "other.csv").read_bytes() == raw
    assert asked("other.csv", text)["path"] == "other/other.csv"
    assert (served.folder / "other" / "other.csv").read_bytes() == raw
    assert (served.folder / "other" / "layout.toml").read_text() == text
    assert not (served.folder / "other.csv").exists()
    assert (served.folder / "layout.toml").read_text() == "# theirs\n"
