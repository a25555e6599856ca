"""The server: one port of this machine, one user, the files of the page, and access control of every request.

The guard checks every request and every socket first. The built page is served from memory while other modules are
imported.
"""

from __future__ import annotations

import hmac
import json
import socket
import sys
import threading
import warnings
from contextlib import suppress
from dataclasses import dataclass, field
from importlib import import_module
from importlib.util import find_spec
from mimetypes import guess_type
from pathlib import Path, PurePosixPath
from typing import TYPE_CHECKING, Any

from pneudrive.errors import CommandError, PneudriveWarning
from pneudrive.web.workspace import DROP, REPORTS, Workspace, built_page, cache_folder, forget_unused, new_token

if TYPE_CHECKING:
    from collections.abc import Awaitable, Callable, Iterable, Mapping, MutableMapping
    from concurrent.futures import Future

    Scope = MutableMapping[str, Any]
    Message = MutableMapping[str, Any]
    Receive = Callable[[], Awaitable[Message]]
    Send = Callable[[Message], Awaitable[None]]
    App = Callable[[Scope, Receive, Send], Awaitable[None]]

MOST_BODY = 1 << 20  # bytes
TOO_LONG = f"the page cannot open more than {MOST_BODY} bytes: open a file of that size in an editor"
MOST_SOCKETS = 8
TOKEN_PROTOCOL = "token."
NAMES = ("127.0.0.1", "localhost", "[::1]")
READING = ("GET", "HEAD")
METHODS = (*READING, "POST", "PUT")

CONTENT_SECURITY = (
    "default-src 'none'; script-src 'self'; style-src 'self'; connect-src 'self'; img-src 'self' data:; "
    "base-uri 'none'; form-action 'none'; frame-ancestors 'none'; require-trusted-types-for 'script'; "
    "trusted-types 'none'"
)
HEADERS = [
    (b"content-security-policy", CONTENT_SECURITY.encode()),
    (b"x-content-type-options", b"nosniff"),
    (b"referrer-policy", b"no-referrer"),
    (b"cross-origin-opener-policy", b"same-origin"),
    (b"cross-origin-resource-policy", b"same-origin"),
    (b"cache-control", b"no-store"),
]


class RefusedError(Exception):
    """The request is rejected, with a status and one line of text."""

    def __init__(self, status: int, why: str) -> None:
        super().__init__(why)
        self.status, self.why = status, why


@dataclass
class Guard:
    """Pure ASGI guard around an application: forbidden requests do not reach it.

    Parameters
    ----------
    app : ASGI application
    port : int
        Port of the server, as in `Host`.
    token : str
        Secret of this run.
    open_paths : iterable of str
        Paths that need no token: the page itself, which holds no data.
    reports : iterable of str
        Secrets of reports; each is part of the address that opens one report.
    """

    app: App
    port: int
    token: str
    open_paths: Iterable[str] = ()
    reports: Iterable[str] = ()
    sockets: int = field(default=0, init=False)

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Check a request, then pass it to the application. The answer gets the security headers."""
        try:
            self.check(scope)
        except RefusedError as refused:
            await _refuse(scope, receive, send, refused)
            return
        if scope["type"] == "websocket":
            self.sockets += 1
            try:
                await self.app(scope, receive, send)
            finally:
                self.sockets -= 1
            return
        body, is_more = b"", not _is_drop(scope)
        while is_more:  # the whole body is read, up to a limit
            message = await receive()
            if message["type"] != "http.request":  # the client went
                return
            body, is_more = body + message.get("body", b""), message.get("more_body", False)
            if len(body) > MOST_BODY:
                await _refuse(scope, receive, send, RefusedError(413, TOO_LONG))
                return
        whole = iter([] if _is_drop(scope) else [{"type": "http.request", "body": body, "more_body": False}])

        async def with_body() -> Message:
            return next(whole, None) or await receive()

        async def with_headers(message: Message) -> None:
            if message["type"] == "http.response.start":
                own = list(message.get("headers", ()))
                names = {name for name, _ in own}
                message = {**message, "headers": [*own, *(one for one in HEADERS if one[0] not in names)]}
            await send(message)

        await self.app(scope, with_body, with_headers)

    def check(self, scope: Scope) -> None:
        """Raise `RefusedError` for a request that is not from this page of this user."""
        is_socket = scope["type"] == "websocket"
        method = "GET" if is_socket else scope["method"]
        if method not in METHODS:
            raise RefusedError(405, "method not allowed")
        host = _header(scope, "host")
        if host not in {f"{name}:{self.port}" for name in NAMES}:
            raise RefusedError(421, "the request names another host than this server")
        origin = _header(scope, "origin")
        if origin is not None and origin != f"http://{host}":
            raise RefusedError(403, "the request comes from another page")
        if origin is None and (is_socket or method not in READING):
            raise RefusedError(403, "the request does not state its origin")
        opens_page = (_header(scope, "sec-fetch-mode"), _header(scope, "sec-fetch-dest")) == ("navigate", "document")
        if _header(scope, "sec-fetch-site") not in (None, "same-origin", "none") and not (
            opens_page and scope["path"] == "/"  # the file that leads a browser here is another site
        ):
            raise RefusedError(403, "the request comes from another site")
        if is_socket and self.sockets >= MOST_SOCKETS:
            raise RefusedError(503, f"{MOST_SOCKETS} sockets are open")
        path, token = scope["path"], ""
        is_open = not is_socket and (path in self.open_paths or self._is_report(path))
        if is_socket:
            token = next((p for p in scope.get("subprotocols", ()) if p.startswith(TOKEN_PROTOCOL)), "")
            token = token.removeprefix(TOKEN_PROTOCOL)
        elif not is_open:
            scheme, _, token = (_header(scope, "authorization") or "").partition(" ")
            token = token if scheme == "Bearer" else ""
        if not is_open and not hmac.compare_digest(token.encode("utf-8", "replace"), self.token.encode()):
            raise RefusedError(401, "the token is missing or wrong: open the address that the server printed")
        length = _header(scope, "content-length")
        is_number = length is not None and length.isascii() and length.isdigit()
        if length is not None and not (is_number and (_is_drop(scope) or int(length) <= MOST_BODY)):
            raise RefusedError(413, TOO_LONG)

    def _is_report(self, path: str) -> bool:
        """Return whether an address contains the secret of a report."""
        given = path.removeprefix(REPORTS).partition("/")[0] if path.startswith(REPORTS) else ""
        found = [hmac.compare_digest(given.encode("utf-8", "replace"), one.encode()) for one in list(self.reports)]
        return any(found)


def _is_drop(scope: Scope) -> bool:
    return scope["type"] == "http" and scope["path"] == DROP and scope["method"] == "PUT"


def _header(scope: Scope, name: str) -> str | None:
    """Return a header that must not occur twice, or None."""
    values = [value.decode("latin-1") for key, value in scope["headers"] if key.decode("latin-1").lower() == name]
    if len(values) > 1:
        raise RefusedError(400, f"{name} is given twice")
    return values[0] if values else None


async def _refuse(scope: Scope, receive: Receive, send: Send, refused: RefusedError) -> None:
    if scope["type"] == "websocket":
        await receive()  # the request to connect
        await send({"type": "websocket.close", "code": 1008, "reason": refused.why})
        return
    text = refused.why.encode()
    headers = [(b"content-type", b"text/plain; charset=utf-8"), (b"content-length", str(len(text)).encode()), *HEADERS]
    await send({"type": "http.response.start", "status": refused.status, "headers": headers})
    await send({"type": "http.response.body", "body": text})


def address(port: int, token: str) -> str:
    """Return the address that opens the page. The token is in the fragment, which a browser never sends."""
    return f"http://{NAMES[0]}:{port}/#token={token}"


#: Prefix of files with a hash in their name, and headers by which browsers cache them. These files have no user data.
HASHED, KEPT = "/assets/", [(b"cache-control", b"max-age=31536000, immutable")]
TYPES = {
    ".js": "text/javascript; charset=utf-8",
    ".css": "text/css; charset=utf-8",
    ".html": "text/html; charset=utf-8",
    ".svg": "image/svg+xml",
}


class Site:
    """ASGI application that serves the files of the page, and passes other requests to the routes.

    Parameters
    ----------
    files : mapping
        Bytes by path, from `pneudrive.web.workspace.built_page`.
    routes : Future
        Future of the application that answers all other requests.

    Attributes
    ----------
    answers : dict
        Headers and body by path, including `"/"`.
    """

    def __init__(self, files: Mapping[str, bytes], routes: Future[App]) -> None:
        self.answers: dict[str, tuple[list[tuple[bytes, bytes]], bytes]] = {}
        for name, data in files.items():
            kind = TYPES.get(PurePosixPath(name).suffix) or guess_type(name)[0] or "application/octet-stream"
            own = [(b"content-type", kind.encode()), (b"content-length", str(len(data)).encode())]
            self.answers[name] = [*own, *(KEPT if name.startswith(HASHED) else [])], data
        self.answers["/"] = self.answers["/index.html"]
        self.routes = routes
        routes.set_running_or_notify_cancel()  # a browser that leaves while waiting does not cancel the start

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer requests of the page itself immediately, and others when the routes are ready."""
        if scope["type"] == "http" and scope["method"] in READING and scope["path"] in self.answers:
            headers, data = self.answers[scope["path"]]
            await send({"type": "http.response.start", "status": 200, "headers": headers})
            await send({"type": "http.response.body", "body": data})
            return
        from asyncio import wrap_future  # not before the address is printed

        app = await wrap_future(self.routes)
        await app(scope, receive, send)


# --- Running the server: a printed address, and the browser.

MOST_MESSAGE = 1 << 16  # largest message of the socket, bytes
SWITCH_S = 5e-4  # thread switch interval, s: with the default of 5 ms, answers would wait for importing threads
MOST_WAIT_S = 2.0  # the same until the first answer of a run
_LIBRARIES = ("starlette", "uvicorn", "websockets", "tomlkit")


def serve(
    folder: Path,
    port: int,
    opened: Callable[[str], object],
    *,
    control: bool = False,
) -> None:
    """Serve a folder until Ctrl-C.

    The address is given as soon as the port listens. Other modules are imported while the browser starts.

    Parameters
    ----------
    folder : Path
        Workspace.
    port : int
        Port. 0 selects a free port.
    opened : callable
        Called with the address when the server listens.
    control : bool
        Whether the page may send requests to campaigns.

    Raises
    ------
    CommandError
        The folder does not exist, the port is taken, the page is not built, or the libraries of the page are missing.
    """
    for name in _LIBRARIES:
        if find_spec(name) is None:
            raise CommandError(f"the page needs {name}", remedy='pip install "pneudrive[web]"')
    workspace, page = Workspace.at(folder), built_page()
    # The protocol is set explicitly. Otherwise asyncio delays small packets by 40 ms each.
    with socket.socket(socket.AF_INET, socket.SOCK_STREAM, socket.IPPROTO_TCP) as listening:
        listening.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            listening.bind((NAMES[0], port))
        except (OSError, OverflowError) as error:
            raise CommandError(f"port {port} cannot be used: {error}", remedy="Choose another one: --port.") from None
        port, token = listening.getsockname()[1], new_token()
        listening.listen(128)
        opened(address(port, token))

        from concurrent.futures import Future

        import uvicorn

        sys.setswitchinterval(SWITCH_S)
        routes: Future[App] = Future()
        warnings.simplefilter("ignore", PneudriveWarning)  # the page shows the warnings of a run
        settings = uvicorn.Config(
            guarded(workspace, Site(page, routes), port, token),
            ws="websockets-sansio",
            ws_max_size=MOST_MESSAGE,
            ws_per_message_deflate=False,
            proxy_headers=False,
            server_header=False,
            lifespan="off",
            log_level="warning",
            timeout_graceful_shutdown=1,
        )
        server = uvicorn.Server(settings)

        def make() -> None:
            try:
                from pneudrive.web.app import make_app

                routes.set_result(make_app(workspace, page, control=control))
            except BaseException as error:  # Ctrl-C ends the server below
                routes.set_exception(error)
                server.should_exit = True
            else:
                warm_up()

        threading.Thread(target=make, daemon=True).start()
        server.run(sockets=[listening])
        if routes.done():
            routes.result()


def guarded(workspace: Workspace, site: Site, port: int, token: str) -> Guard:
    """Return the guard of a site: only the page itself and the reports that it opened need no token."""
    return Guard(site, port, token, site.answers, workspace.reports)


def warm_up() -> None:
    """Simulate once, then import the modules of other views, so that the first click is answered without delay."""
    from pneudrive.web.app import BEHIND
    from pneudrive.web.live import ANSWERED, answer

    asked = {"path": "catalogue:reference", "command": "1", "duration": "10 ms"}
    answer(Workspace.at(Path(__file__).parent), json.dumps(asked))
    ANSWERED.wait(MOST_WAIT_S)
    for name in BEHIND:
        import_module(name)
    with suppress(OSError):
        forget_unused(cache_folder())
