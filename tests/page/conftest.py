"""A browser and servers for the tests of the page. They run by `make test-page`, and are never skipped."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from urllib.parse import urlsplit

import pytest

ROOT = Path(__file__).parents[2]
PICTURES = ROOT / "out" / "page"
LOUD = ("error", "warning")
PATIENCE = 15_000  # ms; a state of the page on a busy machine
NAMES = ("chromium", "chromium-browser", "google-chrome", "chrome")
DRIVE = """\
drive = "catalogue:reference"   # made up
name = "my axis"

[friction]
coulomb = "28 N"   # measured
"""


def chromium() -> str:
    """Return the browser: the one that is named, one on the path, or that of the lock."""
    named = os.environ.get("PNEUDRIVE_CHROMIUM") or next(filter(None, map(shutil.which, NAMES)), None)
    needed = "axe" if named else "browser"  # the browser of the lock brings axe-core with it
    done = subprocess.run(
        [sys.executable, ROOT / "tools" / "page.py", needed], capture_output=True, text=True, check=True
    )
    return named or done.stdout.strip().splitlines()[-1]


@pytest.fixture(scope="package")  # its event loop would be in the way of other tests of the session
def browser() -> Iterator[object]:
    from playwright.sync_api import expect, sync_playwright

    expect.set_options(timeout=PATIENCE)

    path = chromium()
    libraries = Path(path).parent / "al2023" / "lib"
    environment = {**os.environ, **({"LD_LIBRARY_PATH": str(libraries)} if libraries.is_dir() else {})}
    with sync_playwright() as playwright:
        found = playwright.chromium.launch(
            executable_path=path, args=["--headless=shell", "--no-sandbox", "--disable-gpu"], env=environment
        )
        yield found
        found.close()


@dataclass
class Server:
    """A running `pneudrive web`."""

    folder: Path
    address: str
    process: subprocess.Popen[str]

    @property
    def port(self) -> int:
        found = urlsplit(self.address).port
        assert found
        return found

    @classmethod
    def start(cls, folder: Path, port: int = 0, *options: str) -> Server:
        words = [sys.executable, "-m", "pneudrive", "web", str(folder), "--no-browser", "--port", str(port), *options]
        process = subprocess.Popen(words, stdout=subprocess.PIPE, text=True)
        assert process.stdout
        return cls(folder, process.stdout.readline().strip(), process)

    def end(self) -> None:
        if self.process.returncode is None:
            self.process.kill()
            self.process.communicate()  # closes the pipe too


@pytest.fixture(scope="package")
def shared(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    folder = tmp_path_factory.mktemp("page") / "studies"
    folder.mkdir()
    made = Server.start(folder)
    yield made
    made.end()


@pytest.fixture
def server(shared: Server) -> Server:
    """Give a running server over a folder with one drive in it."""
    for one in shared.folder.iterdir():
        shutil.rmtree(one) if one.is_dir() else one.unlink()
    (shared.folder / "axis.toml").write_text(DRIVE)
    return shared


@pytest.fixture
def own_server(tmp_path: Path) -> Iterator[Server]:
    """Give a server that a test may kill."""
    folder = tmp_path / "studies"
    folder.mkdir()
    (folder / "axis.toml").write_text(DRIVE)
    made = Server.start(folder, 0, "--control")
    yield made
    made.end()


@dataclass
class Tab:
    """A page in the browser; what it asks for and complains of is kept."""

    page: object
    origin: str
    complaints: list[str] = field(default_factory=list)
    foreign: list[str] = field(default_factory=list)

    def picture(self, name: str) -> None:
        """Keep a picture for people to look at."""
        PICTURES.mkdir(parents=True, exist_ok=True)
        self.page.screenshot(path=PICTURES / f"{name}.png")

    def check(self) -> None:
        """Nothing was complained of, and nothing was asked of another machine."""
        assert self.complaints == []
        assert self.foreign == []


@pytest.fixture
def open_tab(browser: object) -> Iterator[object]:
    contexts: dict[str, object] = {}

    def opened(address: str, look: str = "light") -> Tab:
        """Open an address; tabs of one look share a browser profile."""
        if look not in contexts:
            contexts[look] = browser.new_context(
                locale="en-GB", viewport={"width": 1400, "height": 1000}, color_scheme=look, reduced_motion="reduce"
            )
        page = contexts[look].new_page()
        origin = address.partition("/#")[0]
        tab = Tab(page, origin)
        page.on("pageerror", lambda error: tab.complaints.append(str(error)))
        page.on("console", lambda m: tab.complaints.append(f"{m.text} {m.location['url']}") if m.type in LOUD else None)
        page.on("request", lambda r: None if r.url.startswith((origin, "data:")) else tab.foreign.append(r.url))
        page.set_default_timeout(PATIENCE)
        page.goto(address)
        return tab

    yield opened
    for context in contexts.values():
        context.close()


@pytest.fixture
def tab(server: Server, open_tab: Callable[[str], Tab]) -> Tab:
    """Open the first screen of the server."""
    return open_tab(server.address)
