"""A small workspace, and clients of its server in process."""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import pytest

with warnings.catch_warnings():
    warnings.simplefilter("ignore")  # it would rather have another client than httpx
    from starlette.testclient import TestClient

from pneudrive.web.app import make_app
from pneudrive.web.guard import Guard
from pneudrive.web.jobs import PageJob
from pneudrive.web.workspace import Workspace

PORT = 8123
TOKEN = "t" * 32
DRIVE = """\
drive = "catalogue:reference"   # made up
name = "my axis"

[friction]
coulomb = "28 N"   # measured

[load]
mass = "1.5 kg"
"""


@dataclass
class Served:
    """A served folder: its application, and a client that has the token and is the page."""

    folder: Path
    app: Guard
    client: TestClient

    @property
    def jobs(self) -> list[PageJob]:
        """The jobs that were started."""
        return self.app.app.state.jobs.all

    @property
    def socket(self) -> dict[str, object]:
        """What opens the socket as the page does."""
        return {"subprotocols": ["pneudrive", f"token.{TOKEN}"], "headers": self.headers}

    @property
    def headers(self) -> dict[str, str]:
        """What a browser sends for the page."""
        own = f"127.0.0.1:{PORT}"
        return {
            "host": own,
            "origin": f"http://{own}",
            "sec-fetch-site": "same-origin",
            "authorization": f"Bearer {TOKEN}",
        }


@pytest.fixture(autouse=True)
def no_faults(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let a fault that nobody foresaw fail a test: to the page it is an answer."""
    monkeypatch.setattr("pneudrive.web.messages.print_exception", lambda fault: pytest.fail(f"a fault: {fault!r}"))


@pytest.fixture(autouse=True)
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Give each test a cache of its own."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    return tmp_path / "cache" / "pneudrive" / "page"


@pytest.fixture
def served(tmp_path: Path) -> Iterator[Served]:
    folder, built = tmp_path / "studies", tmp_path / "built"
    folder.mkdir()
    built.mkdir()
    (folder / "axis.toml").write_text(DRIVE)
    (built / "index.html").write_text("<!doctype html><title>page</title>")
    (built / "build.json").write_text('{"build": "abc"}')
    app = make_app(Workspace.at(folder), PORT, TOKEN, built)
    made = Served(folder, app, TestClient(app, base_url=f"http://127.0.0.1:{PORT}"))
    made.client.headers.clear()
    yield made
    for job in made.jobs:
        job.process.kill()
        job.process.wait()
