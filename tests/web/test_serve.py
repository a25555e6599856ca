"""The address comes before what serves it is imported, and only where the page can be served."""

from __future__ import annotations

import asyncio
import shutil
import socket
import subprocess
import sys
from collections import namedtuple
from collections.abc import AsyncIterator
from concurrent.futures import Future
from pathlib import Path
from urllib.parse import urlsplit
from urllib.request import url2pathname

import httpx
import pytest
import uvicorn
from starlette.requests import ClientDisconnect
from starlette.responses import PlainTextResponse

from pneudrive.cli.main import run
from pneudrive.errors import CommandError
from pneudrive.web import drop
from pneudrive.web import serve as served
from pneudrive.web.serve import MOST_BODY, Guard, Site
from pneudrive.web.workspace import Workspace, built_page
from waiting import until
from web.conftest import Served

#: Gives the modules that are loaded when the address is there, then answers its first request.
LOOKING = """
import sys, threading, urllib.request, os
from pathlib import Path
from pneudrive.web.serve import serve

def opened(address):
    print(*sorted({name.partition(".")[0] for name in sys.modules}), flush=True)
    def ask():
        print(urllib.request.urlopen(address.partition("#")[0]).status, flush=True)
        os._exit(0)
    threading.Thread(target=ask).start()

serve(Path(sys.argv[1]), 0, opened)
"""


def test_the_address_waits_for_no_library_and_its_first_request_is_answered(tmp_path: Path) -> None:
    words = [sys.executable, "-c", LOOKING, str(tmp_path)]
    done = subprocess.run(words, capture_output=True, text=True, timeout=60, check=True)
    loaded, status = done.stdout.splitlines()
    assert not {"numpy", "pydantic", "starlette", "uvicorn", "asyncio", "polars", "xarray"} & set(loaded.split())
    assert status == "200"


def test_the_first_list_of_files_waits_for_no_library_of_results() -> None:
    code = "import sys, pneudrive.web.app; print(*sys.modules)"
    loaded = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60, check=True)
    assert not {"scipy.stats", "scipy.signal", "polars", "xarray", "matplotlib"} & set(loaded.stdout.split())


def test_no_address_is_given_where_nothing_can_be_served(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(CommandError, match="the page is not built"):
        built_page(tmp_path)
    with pytest.raises(CommandError, match="is not a folder"):
        served.serve(tmp_path / "none", 0, pytest.fail)
    monkeypatch.setattr(served, "_LIBRARIES", ("starlette", "no_such_library"))
    with pytest.raises(CommandError, match="the page needs no_such_library"):
        served.serve(tmp_path, 0, pytest.fail)


def test_an_answer_in_two_pieces_does_not_wait_for_the_first_to_be_acknowledged(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    async def accepted(listening: socket.socket) -> int:
        made = asyncio.get_running_loop().create_future()
        server = await asyncio.start_server(lambda _, out: made.set_result(out), sock=listening)
        async with server:
            _, ours = await asyncio.open_connection(*listening.getsockname())
            theirs = await made
            found = theirs.get_extra_info("socket").getsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY)
            for one in (ours, theirs):
                one.close()
                await one.wait_closed()
        return found

    sends_at_once = []
    monkeypatch.setattr(uvicorn.Server, "run", lambda _, sockets: sends_at_once.append(asyncio.run(accepted(*sockets))))
    monkeypatch.setattr(served, "warm_up", lambda: None)
    served.serve(tmp_path, 0, lambda _: None)
    assert sends_at_once == [1]


def test_the_page_is_answered_while_what_answers_the_rest_is_imported() -> None:
    whole: Future = Future()
    site = Site({"/index.html": b"page", "/assets/a.js": b"1"}, whole)
    transport = httpx.ASGITransport(Guard(site, 1, "token", {*site.answers, "/api/studies", "/api/jobs"}))

    async def asked() -> None:
        async with httpx.AsyncClient(transport=transport, base_url="http://localhost:1") as client:
            page = await client.get("/")
            assert (page.text, page.headers["content-type"]) == ("page", "text/html; charset=utf-8")
            assert "default-src 'none'" in page.headers["content-security-policy"]
            assert (await client.get("/assets/a.js")).headers["cache-control"] == "max-age=31536000, immutable"
            assert (await client.get("/", headers={"host": "elsewhere:1"})).status_code == 421
            gone, waiting = (asyncio.create_task(client.get(path)) for path in ("/api/studies", "/api/jobs"))
            await asyncio.sleep(0.01)
            gone.cancel()
            await asyncio.sleep(0.01)
            assert gone.cancelled()
            assert not waiting.done()
            whole.set_result(PlainTextResponse("whole"))
            assert (await waiting).text == "whole"
            assert (await client.get("/")).headers["cache-control"] == "no-store"

    asyncio.run(asked())


def test_what_cannot_be_made_ends_the_server(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("pneudrive.web.app.make_app", lambda *_, **__: pytest.fail("made"))
    with pytest.raises(pytest.fail.Exception, match="made"):
        served.serve(tmp_path, 0, lambda _: None)


def test_the_token_is_no_argument_of_the_browser(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Every account of a computer reads the arguments of all processes; the file there is the user's alone."""
    opened, seen = "http://127.0.0.1:8123/#token=secret", []

    def browse(address: str) -> None:
        path = Path(url2pathname(urlsplit(address).path))
        seen.append((address, path, path.stat().st_mode & 0o077, path.read_text()))

    monkeypatch.setattr("webbrowser.open", browse)
    monkeypatch.setattr(served, "serve", lambda folder, port, tell, **_: [tell(opened), until(lambda: bool(seen))])
    assert run(["web", str(tmp_path)]) == 0
    ((address, path, of_others, text),) = seen
    assert "secret" not in address
    assert f'content="0;url={opened}"' in text
    assert not of_others
    assert not path.exists()  # it goes with the server


# --- A file that is dropped onto the page: whole or not at all, of any length, never over one that is there.


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
    assert "already exists" in put(served, "run.csv", b"other", 400)["problems"][0]["what"]
    assert "already exists" in put(served, "axis.toml", b"other", 400)["problems"][0]["what"]
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
    with pytest.raises(CommandError, match="arrived incomplete"):
        asyncio.run(drop.take(workspace, "x.csv", 5000, short()))

    async def meanwhile() -> AsyncIterator[bytes]:
        yield b"1"
        (served.folder / "x.csv").write_bytes(b"theirs")

    with pytest.raises(CommandError, match="already exists"):
        asyncio.run(drop.take(workspace, "x.csv", None, meanwhile()))
    assert (served.folder / "x.csv").read_bytes() == b"theirs"
    usage = namedtuple("usage", "free")
    monkeypatch.setattr(shutil, "disk_usage", lambda _: usage(free=drop.RESERVE + 10))
    assert "too little free space" in put(served, "y.csv", b"1" * 11, 400)["problems"][0]["what"]
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
