"""The address comes before what serves it is imported, and only where the page can be served."""

from __future__ import annotations

import asyncio
import socket
import subprocess
import sys
import time
from collections.abc import Callable
from concurrent.futures import Future
from pathlib import Path
from urllib.parse import urlsplit
from urllib.request import url2pathname

import httpx
import pytest
import uvicorn
from starlette.responses import PlainTextResponse

from pneudrive.cli.main import run
from pneudrive.errors import CommandError
from pneudrive.web import serve as served
from pneudrive.web.guard import BuiltPage, Guard, Opening
from pneudrive.web.workspace import built_page

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
    built = BuiltPage({"/index.html": b"page", "/assets/a.js": b"1"})
    transport = httpx.ASGITransport(Opening(Guard(built, 1, "token", built.answers), built, whole))

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
            assert (await client.get("/")).text == "whole"

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
    monkeypatch.setattr(served, "serve", lambda folder, port, tell, **_: [tell(opened), wait_until(lambda: bool(seen))])
    assert run(["web", str(tmp_path)]) == 0
    ((address, path, of_others, text),) = seen
    assert "secret" not in address
    assert f'content="0;url={opened}"' in text
    assert not of_others
    assert not path.exists()  # it goes with the server


def wait_until(is_true: Callable[[], bool]) -> None:
    for _ in range(200):
        if is_true():
            return
        time.sleep(0.02)
