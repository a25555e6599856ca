"""Routes of the server: files, descriptions, runs. Every route answers with JSON or with a frame of `messages`.

Modules that the first curves do not need are imported where they are used. `BEHIND` lists these modules, so that they
can be loaded ahead.
"""

from __future__ import annotations

import asyncio
import json
import os
import platform
from functools import cached_property
from importlib import import_module
from pathlib import Path
from posixpath import basename
from typing import TYPE_CHECKING, Any

from starlette.applications import Starlette
from starlette.requests import ClientDisconnect
from starlette.responses import JSONResponse, Response
from starlette.routing import Route, WebSocketRoute

from pneudrive import __version__
from pneudrive.errors import CommandError, PneudriveError
from pneudrive.web.drive import description
from pneudrive.web.drop import take
from pneudrive.web.guard import DROP, REPORTS, Guard
from pneudrive.web.jobs import READY, JobRequest, PageJobs, campaign_job
from pneudrive.web.live import live
from pneudrive.web.messages import fault_of, pack, plain, problems_of
from pneudrive.web.pages import BuiltPage
from pneudrive.web.reports import SANDBOX, OpenReports
from pneudrive.web.requests import WRONG_REQUEST, ViewRequest
from pneudrive.web.results import SHOWN
from pneudrive.web.workspace import (
    BUILT,
    MOST_FILES,
    TABLES,
    ChangedError,
    Workspace,
    built_page,
)

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from starlette.requests import Request as Asked
    from starlette.websockets import WebSocket

    from pneudrive.web.measured.campaigns import WatchedCampaign
    from pneudrive.web.measured.recordings import Recordings

PLATFORM = f"{platform.system()} {platform.machine()}"
BUILD_FILE, FRAME = "build.json", "application/octet-stream"
#: Requests that need nothing but the workspace: method and address, the function that answers, and the texts that it
#: takes from the request. Without texts, it takes the table in the body of a POST.
ANSWERS: dict[str, tuple[str, ...]] = {
    "/api/lineage": ("GET", "lineage:shown_lineage", "path"),
    "/api/stale": ("GET", "lineage:stale_results"),
    "/api/headlines": ("GET", "headlines:headlines"),
    "/api/rename": ("POST", "drop:rename", "path", "to"),
    "/api/own-layout": ("POST", "drop:with_own_layout", "path", "text"),
    "/api/example": ("POST", "drop:add_example"),
    "/api/check": ("POST", "drive.description:checked", "path", "text"),
    "/api/edit": ("POST", "drive.description:edited_as_asked"),
    "/api/result": ("GET", "results:shown_result", "path"),
    "/api/forms": ("GET", "signatures:forms"),
    "/api/kinds": ("GET", "drive.structure:kinds"),
    "/api/structure": ("POST", "drive.structure:restructured"),
    "/api/drawing": ("POST", "drive.description:drawing", "path", "text"),
    "/api/copy": ("POST", "drive.beside:copied"),
    "/api/propose": ("GET", "measured.recordings:proposed", "path"),
    "/api/validation": ("GET", "measured.validation:shown_validation", "path"),
    "/api/compare": ("POST", "measured.validation:compared", "before", "after"),
    "/api/task": ("POST", "drive.sizing:checked_or_first"),
    "/api/sizing": ("GET", "drive.sizing:shown_sizing", "path"),
    "/api/map": ("GET", "measured.friction:shown_map", "path", "fit"),
    "/api/slice": ("GET", "measured.friction:map_slice", "path", "fit", "speed"),
    "/api/map-difference": ("GET", "measured.friction:map_difference", "path", "fit", "other"),
    "/api/fit": ("GET", "measured.fits:shown_fit", "path"),
    "/api/behind": ("GET", "measured.fits:behind_fit", "path"),
    "/api/next": ("GET", "measured.fits:next_points", "path", "points"),
    "/api/plan": ("POST", "measured.campaigns:planned"),
    "/api/control": ("GET", "drive.control:choices", "path"),
    "/api/comparison": ("GET", "drive.control:shown_card", "path", "measure"),
    "/api/tracks": ("GET", "drive.control:shown_tracks", "path", "reference", "pixels"),
    "/api/fmu": ("GET", "drive.handover:shown_fmu", "path"),
}
#: Modules that are imported at their first use.
BEHIND = tuple(
    f"pneudrive.web.{name}"
    for name in (
        "measured.recordings",
        "drive.control",
        "measured.friction",
        "measured.validation",
        "measured.campaigns",
        "drive.sizing",
        "drive.handover",
        "lineage",
    )
)


def make_app(
    workspace: Workspace,
    port: int,
    token: str,
    built: Path = BUILT,
    *,
    control: bool = False,
) -> Guard:
    """Return the application behind its guard.

    Parameters
    ----------
    workspace : Workspace
    port : int
        Port of the server.
    token : str
        Secret of this run, from `pneudrive.web.guard.new_token`.
    built : Path
        Folder of the built page.
    control : bool
        Whether the page may send requests to campaigns.

    Raises
    ------
    CommandError
        The page is not built.
    """
    page = built_page(built)
    files = BuiltPage(page)
    build = json.loads(page.get(f"/{BUILD_FILE}", b"{}")).get("build", "")
    reports: dict[str, str] = {}
    views = _Views(workspace, build, OpenReports(workspace, reports), control=control)
    threads = asyncio.Semaphore(os.cpu_count() or 1)

    async def socket(websocket: WebSocket) -> None:
        await live(websocket, workspace, threads, views.window)

    routes: list[Any] = [
        Route("/api/studies", _answered(views.studies)),
        Route("/api/file", _answered(views.read)),
        Route("/api/file", _answered(views.write), methods=["PUT"]),
        Route("/api/recording", _answered(views.recording)),
        Route("/api/spectrum", _answered(views.spectrum)),
        Route("/api/strokes", _answered(views.strokes)),
        Route("/api/measure", _answered(views.measure), methods=["POST"]),
        Route("/api/work", _answered(views.work), methods=["POST"]),
        Route("/api/jobs", _answered(views.jobs)),
        Route("/api/jobs", _answered(views.start), methods=["POST"]),
        Route("/api/cancel", _answered(views.cancel), methods=["POST"]),
        Route("/api/campaign", _answered(views.campaign)),
        Route("/api/campaign", _answered(views.ask), methods=["POST"]),
        Route("/api/cycle", _answered(views.cycle)),
        Route(DROP, views.drop, methods=["PUT"]),
        Route("/api/report", _answered(views.report)),
        Route(f"{REPORTS}{{secret}}/{{name:path}}", views.open_report),
        Route("/api/comparisons", _answered(views.compare), methods=["POST"]),
        Route("/api/campaigns", _answered(views.begin), methods=["POST"]),
        *(_tabled(workspace, path, *one) for path, one in ANSWERS.items()),
        WebSocketRoute("/api/live", socket),
        *(Route(path, files, methods=["GET"]) for path in files.answers),
    ]
    app = Starlette(routes=routes)
    app.state.jobs = views.running
    return Guard(app, port, token, frozenset(files.answers), reports)


def _tabled(workspace: Workspace, path: str, method: str, name: str, *texts: str) -> Route:
    """Return the route of a line of `ANSWERS`."""
    module, _, function = name.partition(":")

    def view(given: Mapping[str, str], body: bytes) -> Any:  # noqa: ANN401 - plain data, or a frame
        table = _table(body, *texts) if method == "POST" else given
        wanted = [table.get(one, "") for one in texts]
        if method == "POST" and not texts:
            wanted = [table]
        return getattr(import_module(f"pneudrive.web.{module}"), function)(workspace, *wanted) or {}

    return Route(path, _answered(view), methods=[method])


def _answered(view: Callable[[Mapping[str, str], bytes], Any]) -> Callable[[Asked], Any]:
    """Return the endpoint of a view, which runs in a thread. Errors of pneudrive become error answers."""

    async def endpoint(asked: Asked) -> Response:
        given = {**asked.query_params, "if-match": asked.headers.get("if-match", "")}
        body = await asked.body()
        try:
            found = await asyncio.to_thread(view, given, body)
            return Response(found, media_type=FRAME) if isinstance(found, bytes) else _json(found)
        except ChangedError as changed:
            there = {"text": changed.text, "sha256": changed.version}
            return JSONResponse({"problems": [{"what": str(changed)}], **there}, status_code=412)
        except PneudriveError as error:
            return JSONResponse({"problems": problems_of(error)}, status_code=400)
        except (KeyboardInterrupt, SystemExit, asyncio.CancelledError):
            raise
        except BaseException as fault:  # unexpected, or a damaged file; the core's panics are no `Exception`
            error = fault_of(fault, given.get("path", ""))
            return JSONResponse({"problems": problems_of(error)}, status_code=400)

    return endpoint


def _json(found: Any) -> JSONResponse:  # noqa: ANN401 - plain data
    """Return an answer. Infinite values and NaN, which a file may contain, become null."""
    try:
        return JSONResponse(found)
    except ValueError:
        return JSONResponse(plain(found))


class _Views:
    """Handler of each address, called with its parameters and its body."""

    def __init__(self, workspace: Workspace, build: str, reports: OpenReports, *, control: bool) -> None:
        self.workspace, self.build, self.reports, self.control = workspace, build, reports, control
        self.campaigns: dict[Path, WatchedCampaign] = {}
        self.running = PageJobs(workspace)

    @cached_property
    def recordings(self) -> Recordings:
        """Recordings that are open."""
        from pneudrive.web.measured.recordings import Recordings

        return Recordings(self.workspace)

    def studies(self, _given: Mapping[str, str], _body: bytes) -> dict[str, Any]:
        """List the workspace and the drives of the catalogue."""
        from pneudrive.describe.files.catalogue import PREFIX, entries

        drives = [{"path": f"{PREFIX}{name}", "title": one.title} for name, one in entries().items() if one.is_drive]
        files, left_out = self.workspace.listed()
        folder = self.workspace.root
        about: dict[str, Any] = {
            "folder": folder.name or str(folder),
            "version": __version__,
            "platform": PLATFORM,
            "build": self.build,
        }
        about |= {
            "shown": list(SHOWN),
            "protocols": READY,
            "control": self.control,
            "left_out": left_out,
            "is_cut": len(files) == MOST_FILES,
        }
        return {**about, "files": [vars(one) for one in files], "catalogue": drives}

    def read(self, given: Mapping[str, str], _body: bytes) -> dict[str, Any]:
        """Return the text of a file, and on request its check as a description."""
        path = given.get("path", "")
        text, sha256 = description.text_at(self.workspace, path)
        about = {"checked": description.checked(self.workspace, path, text)} if "checked" in given else {}
        return {"text": text, "sha256": sha256, **about}

    def write(self, given: Mapping[str, str], body: bytes) -> dict[str, Any]:
        """Write a file that has not changed since the page read it."""
        known = given["if-match"].strip('"') or None
        asked = _table(body, "text")
        path = given.get("path", "")
        if basename(path) == "layout.toml":  # an unreadable recording must not hide the others
            from pneudrive.signals.layout import Layout

            Layout.loads(asked["text"], "layout.toml")
        return {"sha256": self.workspace.write(path, asked["text"], known)}

    def recording(self, given: Mapping[str, str], _body: bytes) -> dict[str, Any]:
        """Open a recording, or report the progress of its reading or its errors: the file may be half written."""
        from pneudrive.web.measured.recordings import layout_above, layout_in, needs_none

        name = given.get("path", "")
        path = self.workspace.path(name, TABLES)
        try:
            reading = self.recordings.opened(name)
            if reading.goes_on:
                return {"share": reading.share}
            found, layout = reading.need(name), layout_in(self.workspace, path)
        except PneudriveError as error:
            return {"problems": problems_of(error)}
        return {
            "key": found.key,
            "channels": [{"column": one.column, "label": one.label, "unit": one.unit} for one in found.channels],
            "span": found.span,
            "samples": found.pyramid.count,
            "time": found.time is not None,
            "layout": "own names" if needs_none(path) else None if layout is None else layout.kind,
            "notes": found.notes if layout else found.notes + layout_above(self.workspace, path),
        }

    def window(self, given: Mapping[str, Any]) -> bytes:
        """Return a view of a recording with the requested key as a frame, or None if the recording has another key.

        A view of the changed recording would have times and channels that do not match those in the page.
        """
        name, key = str(given.get("path", "")), str(given.get("key", ""))
        head: dict[str, Any] = {"number": given.get("number"), "path": given.get("path"), "key": None}
        if (found := self.recordings.version(name, key)) is None:
            return pack(head, {})
        asked = ViewRequest.of(given)
        columns, span, pixels = asked.columns_in(found), asked.span, asked.pixels
        view = found.window(span, pixels, columns)
        if self.recordings.version(name, key) is None:  # the file was replaced during the reading
            return pack(head, {})
        head |= {"key": found.key, "from": span[0], "to": span[1]}
        head |= {"missing": view.missing, "samples": view.samples, "raw": view.raw}
        arrays = {"time": view.time_s, **view.channels}
        if other := given.get("beside"):
            arrays |= self.recordings.beside(found, str(other), span, asked.shift, pixels, columns)
        return pack(head, arrays, drawn=True)

    def spectrum(self, given: Mapping[str, str], _body: bytes) -> bytes:
        """Return the spectra of channels within a view as a frame."""
        found = self.recordings.need(given.get("path", ""))
        asked = ViewRequest.of(given)
        span = asked.span
        spectra = {name: found.spectrum(span, name) for name in asked.columns_in(found)}
        arrays = {
            f"{axis}/{name}": one[axis == "density"] for name, one in spectra.items() for axis in ("hz", "density")
        }
        return pack({"from": span[0], "to": span[1]}, arrays)

    def strokes(self, given: Mapping[str, str], _body: bytes) -> dict[str, Any]:
        """Return the strokes of a recording, and its faults."""
        return self.recordings.motion(given.get("path", ""))

    def measure(self, _given: Mapping[str, str], body: bytes) -> dict[str, Any]:
        """Measure a recording at two times."""
        from pneudrive.web.measured.measuring import MeasureRequest

        return MeasureRequest.of(_table(body, "path")).answer(self.recordings)

    def _job(self, body: bytes) -> JobRequest:
        from pneudrive.web.signatures import job_of

        return job_of(_table(body), self.workspace)

    def report(self, given: Mapping[str, str], _body: bytes) -> dict[str, Any]:
        """Return the address of a folder's report."""
        return {"address": self.reports.address(given.get("path", ""))}

    async def drop(self, asked: Asked) -> Response:
        """Accept a file that was dropped onto the page."""
        length = asked.headers.get("content-length")
        said = int(length) if length is not None else None
        try:
            size = await take(self.workspace, asked.query_params.get("path", ""), said, asked.stream())
        except ClientDisconnect:  # the tab was closed: nothing is stored, and the answer is not read
            return Response(status_code=400)
        except PneudriveError as error:
            return JSONResponse({"problems": problems_of(error)}, status_code=400)
        return JSONResponse({"size": size})

    async def open_report(self, asked: Asked) -> Response:
        """Answer with the report of a folder, or with a picture of it."""
        try:
            data, kind = await asyncio.to_thread(self.reports.read, **asked.path_params)
        except PneudriveError as error:
            return JSONResponse({"problems": problems_of(error)}, status_code=404)
        return Response(data, media_type=kind, headers={"content-security-policy": SANDBOX})

    def work(self, _given: Mapping[str, str], body: bytes) -> dict[str, Any]:
        """Return a job as lines of a shell and as Python."""
        asked = self._job(body)
        return {"command": asked.command, "python": asked.python}

    def jobs(self, _given: Mapping[str, str], _body: bytes) -> dict[str, Any]:
        """Return the jobs of this server."""
        return {"jobs": self.running.about()}

    def start(self, _given: Mapping[str, str], body: bytes) -> dict[str, Any]:
        """Start a job."""
        return self.running.start(self._job(body)).about()

    def cancel(self, _given: Mapping[str, str], body: bytes) -> dict[str, Any]:
        """Cancel a job, like Ctrl-C."""
        self.running.cancel(_table(body).get("number"))
        return self.jobs(_given, body)

    def _watched(self, name: str) -> WatchedCampaign:
        from pneudrive.web.measured.campaigns import WatchedCampaign

        folder = self.workspace.folder(name)
        return self.campaigns.setdefault(folder, WatchedCampaign(folder))

    def campaign(self, given: Mapping[str, str], _body: bytes) -> dict[str, Any]:
        """Return the state of a campaign."""
        return self._watched(given.get("path", "")).about()

    def cycle(self, given: Mapping[str, str], _body: bytes) -> bytes:
        """Return the running cycle of a campaign as a frame."""
        return self._watched(given.get("path", "")).live()

    def ask(self, _given: Mapping[str, str], body: bytes) -> dict[str, Any]:
        """Send a request to a campaign."""
        asked = _table(body, "path")
        self._watched(asked["path"]).ask(asked.get("word"), control=self.control)
        return {}

    def compare(self, _given: Mapping[str, str], body: bytes) -> dict[str, Any]:
        """Run a benchmark of controllers, or continue one."""
        from pneudrive.web.drive import control

        return self.running.start(control.comparison_job(_table(body), self.workspace)).about()

    def begin(self, _given: Mapping[str, str], body: bytes) -> dict[str, Any]:
        """Run a campaign on the simulated rig, or resume one."""
        return self.running.start(campaign_job(_table(body), self.workspace)).about()


def _table(body: bytes, *texts: str) -> dict[str, Any]:
    """Read a JSON body that is a table with these texts."""
    try:
        table = json.loads(body)
        json.dumps(table, ensure_ascii=False).encode()  # half of a surrogate pair is not text
    except (ValueError, RecursionError):
        table = None
    if not isinstance(table, dict) or not all(isinstance(table.get(key), str) for key in texts):
        raise CommandError(WRONG_REQUEST, remedy="Reload the page.")
    return table
