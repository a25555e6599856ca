"""Routes of the server. Every route answers with JSON or with a frame of `messages`.

Modules that are not needed for the first curves are imported at their first use. `BEHIND` lists these modules, so that
they can be loaded in advance.
"""

from __future__ import annotations

import asyncio
import json
import platform
import re
from collections.abc import Mapping
from mimetypes import guess_type
from typing import Any

from starlette.applications import Starlette
from starlette.requests import ClientDisconnect, Request
from starlette.responses import JSONResponse, Response
from starlette.routing import Route, WebSocketRoute
from starlette.websockets import WebSocket

from pneudrive import __version__
from pneudrive.arrays import Keyed, Plain
from pneudrive.batching import processors
from pneudrive.errors import CommandError, PneudriveError, package_table
from pneudrive.figures import plain_data
from pneudrive.report.page import FIGURES, POLICY, REPORT
from pneudrive.web.drop import take
from pneudrive.web.jobs import READY, JobRequest, PageJobs
from pneudrive.web.live import live
from pneudrive.web.messages import answer_of, page_error, problems_of, table_of
from pneudrive.web.workspace import DROP, MOST_FILES, REPORTS, ChangedError, Workspace, fingerprint, new_token

#: Permissions of a report in a browser: only to be viewed and saved.
SANDBOX = f"{POLICY}; frame-ancestors 'none'; sandbox allow-same-origin allow-downloads"
_PICTURE = re.compile(rf"{FIGURES}/[\w.+-]+\.(?:png|svg)")
BUILD_FILE, FRAME = "/build.json", "application/octet-stream"
#: Method and address -> function that answers such requests, see `answer_of`.
ANSWERS: dict[str, str] = {
    route: f"{module}:{function}"
    for module, routes in package_table(__file__, "routes.toml").items()
    for route, function in routes.items()
}
#: Modules that are imported at their first use.
BEHIND = tuple(dict.fromkeys(f"pneudrive.web.{name.partition(':')[0]}" for name in ANSWERS.values()))


def make_app(workspace: Workspace, page: Mapping[str, bytes], *, control: bool = False) -> Starlette:
    """Return the application of the routes, without its guard.

    Parameters
    ----------
    workspace : Workspace
    page : mapping
        Files of the page, from `pneudrive.web.workspace.built_page`.
    control : bool
        Whether the page may send requests to campaigns.
    """
    build = json.loads(page.get(BUILD_FILE, b"{}")).get("build", "")
    threads = asyncio.Semaphore(processors())
    known = {"workspace": workspace, "control": control, "build": build}

    async def socket(websocket: WebSocket) -> None:
        await live(websocket, workspace, threads)

    async def drop(request: Request) -> Response:
        """Accept a file that was dropped onto the page."""
        length = request.headers.get("content-length")
        name, size = request.query_params.get("path", ""), int(length) if length is not None else None
        try:
            return JSONResponse({"size": await take(workspace, name, size, request.stream())})
        except ClientDisconnect:  # the tab was closed: nothing is stored, and the answer is not read
            return Response(status_code=400)
        except PneudriveError as error:
            return _problems(error)

    async def report(request: Request) -> Response:
        """Answer with the report of a folder, or with a picture of it."""
        try:
            data, kind = await asyncio.to_thread(read_report, workspace, **request.path_params)
        except PneudriveError as error:
            return _problems(error, 404)
        return Response(data, media_type=kind, headers={"content-security-policy": SANDBOX})

    routes: list[Any] = [
        *(_route(name, function, known) for name, function in ANSWERS.items()),
        Route(DROP, drop, methods=["PUT"]),
        Route(f"{REPORTS}{{secret}}/{{name:path}}", report),
        WebSocketRoute("/api/live", socket),
    ]
    return Starlette(routes=routes)


def _route(name: str, function: str, known: Keyed) -> Route:
    """Return the route of one entry of `ANSWERS`. The function runs in a thread, and its errors become answers."""
    method, path = name.split()

    async def endpoint(request: Request) -> Response:
        query = {**request.query_params, "if_match": request.headers.get("if-match", "").strip('"')}
        body = await request.body()
        try:
            table = query if method == "GET" else {**query, **table_of(body)}
            answer = await asyncio.to_thread(answer_of, function, table, known, has_defaults=method == "GET")
            if isinstance(answer, JobRequest):
                answer = await asyncio.to_thread(known["workspace"].state(PageJobs).start, answer)
            if isinstance(answer, bytes):
                return Response(answer, media_type=FRAME)
            try:
                return JSONResponse({} if answer is None else answer)
            except (TypeError, ValueError):  # arrays and records become plain data, infinite values and NaN null
                return JSONResponse(plain_data(answer))
        except ChangedError as changed:
            there = {"text": changed.text, "sha256": fingerprint(changed.text)}
            return JSONResponse({"problems": problems_of(CommandError(str(changed))), **there}, status_code=412)
        except (KeyboardInterrupt, SystemExit, asyncio.CancelledError):
            raise
        except BaseException as error:  # also an unexpected one; the core's panics are no `Exception`
            return _problems(page_error(error, query.get("path", "")))

    return Route(path, endpoint, methods=[method])


def _problems(error: PneudriveError, status: int = 400) -> JSONResponse:
    return JSONResponse({"problems": problems_of(error)}, status_code=status)


def studies(workspace: Workspace, control: bool, build: str, state: str) -> Plain:
    """List the files of the workspace and the drives of the catalogue. An unchanged folder is not listed again."""
    from pneudrive.describe.files.catalogue import PREFIX, entries

    files, left_out = workspace.listed()
    new = f"{hash((build, left_out, *files)):x}"  # of this server: another one lists anew
    if new == state:
        return {"state": state}
    return {
        "state": new,
        "folder": workspace.root.name or str(workspace.root),
        "version": __version__,
        "platform": f"{platform.system()} {platform.machine()}",
        "build": build,
        "protocols": READY,
        "control": control,
        "left_out": left_out,
        "is_cut": len(files) == MOST_FILES,
        "files": [vars(file) for file in files],
        "catalogue": [
            {"path": f"{PREFIX}{name}", "title": entry.title} for name, entry in entries().items() if entry.is_drive
        ],
    }


def read_report(workspace: Workspace, secret: str, name: str) -> tuple[bytes, str]:
    """Return a report, or a picture of a report, with its media type. A report never runs code.

    Raises
    ------
    CommandError
        The secret is not valid, or the file is neither a report nor a picture.
    """
    if secret in workspace.reports and (name == REPORT or _PICTURE.fullmatch(name)):
        path = workspace.folder(f"{workspace.reports[secret]}/{name}")
        if path.is_file():
            return path.read_bytes(), guess_type(name)[0] or ""
    raise CommandError("there is no such report", remedy="Open it from the page again.")


def report_address(workspace: Workspace, path: str) -> dict[str, str]:
    """Return the address of the report in a folder; empty if the folder has no report.

    A tab that a link opens has no token. The address itself therefore contains a secret, which is as long as a token.
    The secret is valid for one folder until the server stops.
    """
    if not (workspace.folder(path) / REPORT).is_file():
        return {"address": ""}
    secret = next((known for known, folder in workspace.reports.items() if folder == path), None) or new_token()
    workspace.reports[secret] = path
    return {"address": f"{REPORTS}{secret}/{REPORT}"}
