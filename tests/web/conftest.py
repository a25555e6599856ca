"""A small workspace, and clients of its server in process."""

from __future__ import annotations
import __future__

import sys
import warnings
from collections.abc import Iterator
from concurrent.futures import Future
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from types import ModuleType

import httpx
import pytest
from pydantic import TypeAdapter

with warnings.catch_warnings():
    warnings.simplefilter("ignore")  # it would rather have another client than httpx
    from starlette.testclient import TestClient

from pneudrive import web
from pneudrive.web.app import make_app
from pneudrive.web.jobs import PageJob, PageJobs
from pneudrive.web.serve import Guard, Site, guarded
from pneudrive.web.workspace import Workspace, built_page

#: Door -> form of its answer in `answers.pyi`.
FORMS = {
    "GET /api/studies": "Studies", "GET /api/file": "TextFile", "GET /api/lineage": "Lineage",
    "GET /api/stale": "Stale", "POST /api/check": "Checked", "POST /api/parts": "Parts", "GET /api/view": "SentView",
    "GET /api/forms": "dict[str, Form]", "POST /api/work": "Copied", "POST /api/jobs": "Job", "GET /api/jobs": "Jobs",
    "POST /api/campaigns": "Job", "POST /api/comparisons": "Job", "GET /api/kinds": "Kinds",
    "POST /api/drawing": "CircuitDrawing", "POST /api/copy": "Copied", "GET /api/recording": "OpenedRecording",
    "GET /api/strokes": "Strokes", "POST /api/measure": "MeasuredRows", "GET /api/propose": "Proposal",
    "GET /api/validation": "Validation", "POST /api/compare": "Compared", "GET /api/sizing": "Sizing",
    "GET /api/map": "FrictionMap", "GET /api/slice": "Slice", "GET /api/behind": "BehindFit",
    "GET /api/next": "NextPoints", "POST /api/plan": "Plan", "GET /api/campaign": "Campaign",
    "GET /api/control": "Choices", "GET /api/comparison": "Card", "GET /api/fmu": "Fmu",
}  # fmt: skip
#: Answers to a known state and to a search that has just begun have one key.
SHORT = ({"state"}, {"waits"})


@cache
def form_of(name: str) -> TypeAdapter:
    """Return the form of an answer, from the declarations that the types of the page are written from."""
    module = sys.modules.get("answers") or ModuleType("answers")
    if "answers" not in sys.modules:
        sys.modules["answers"] = module
        path = Path(web.__file__).with_name("answers.pyi")
        flags = __future__.annotations.compiler_flag
        exec(compile(path.read_text(), path, "exec", flags), vars(module))
        vars(module).update(Shape=dict, PistonShapes=dict)  # their types are known to type checkers only
    return TypeAdapter(eval(name, vars(module)))


def hold_to_form(response: httpx.Response) -> None:
    """Hold an answer to its form: the page relies on it."""
    name = FORMS.get(f"{response.request.method} {response.request.url.path}")
    response.read()
    if name and response.status_code == 200 and set(answer := response.json()) not in SHORT:
        form_of(name).validate_python(answer)


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
    workspace: Workspace
    app: Guard
    client: TestClient

    @property
    def jobs(self) -> list[PageJob]:
        """The jobs that were started."""
        return self.workspace.state(PageJobs).all

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


def app_of(workspace: Workspace, built: Path, **options: bool) -> Guard:
    """Return the application of a workspace as `serve` makes it."""
    routes, page = Future(), built_page(built)
    site = Site(page, routes)
    routes.set_result(make_app(workspace, page, **options))
    return guarded(workspace, site, PORT, TOKEN)


@pytest.fixture
def served(tmp_path: Path) -> Iterator[Served]:
    folder, built = tmp_path / "studies", tmp_path / "built"
    folder.mkdir()
    built.mkdir()
    (folder / "axis.toml").write_text(DRIVE)
    (built / "index.html").write_text("<!doctype html><title>page</title>")
    (built / "build.json").write_text('{"build": "abc"}')
    workspace = Workspace.at(folder)
    app = app_of(workspace, built)
    made = Served(folder, workspace, app, TestClient(app, base_url=f"http://127.0.0.1:{PORT}"))
    made.client.headers.clear()
    made.client.event_hooks = {"response": [hold_to_form]}
    yield made
    for job in made.jobs:
        job.process.kill()
        job.process.wait()
