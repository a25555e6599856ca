"""The built page over ASGI, by the standard library only. It answers while other modules are imported."""

from __future__ import annotations

import asyncio
from mimetypes import guess_type
from pathlib import PurePosixPath
from typing import TYPE_CHECKING

from pneudrive.web.guard import READING

if TYPE_CHECKING:
    from collections.abc import Mapping
    from concurrent.futures import Future

    from pneudrive.web.guard import App, Guard, Receive, Scope, Send

#: Files with a hash of what is in them in their name, which a browser may keep: they hold no data.
HASHED, KEPT = "/assets/", [(b"cache-control", b"max-age=31536000, immutable")]
TYPES = {
    ".js": "text/javascript; charset=utf-8",
    ".css": "text/css; charset=utf-8",
    ".html": "text/html; charset=utf-8",
    ".svg": "image/svg+xml",
}


class BuiltPage:
    """ASGI application of the files of the page.

    Parameters
    ----------
    files : mapping
        Bytes by path, from `pneudrive.web.workspace.built_page`.

    Attributes
    ----------
    answers : dict
        Headers and body by path, including `"/"`. No other path is requested.
    """

    def __init__(self, files: Mapping[str, bytes]) -> None:
        self.answers = {name: (_headers(name, data), data) for name, data in files.items()}
        self.answers["/"] = self.answers["/index.html"]

    async def __call__(self, scope: Scope, _receive: Receive, send: Send) -> None:
        """Answer with a file."""
        headers, data = self.answers[scope["path"]]
        await send({"type": "http.response.start", "status": 200, "headers": headers})
        await send({"type": "http.response.body", "body": data})


class Opening:
    """ASGI application that serves only the page until the full application is ready and replaces it.

    Parameters
    ----------
    guard : Guard
        Around the page.
    page : BuiltPage
    whole : Future
        Future of the application that answers everything, behind its own guard.
    """

    def __init__(self, guard: Guard, page: BuiltPage, whole: Future[App]) -> None:
        self.guard, self.page, self.whole = guard, page, whole
        whole.set_running_or_notify_cancel()  # a browser that leaves while waiting does not cancel the start

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer requests of the page itself immediately, and others when the full application is ready."""
        is_page = scope["type"] == "http" and scope["method"] in READING and scope["path"] in self.page.answers
        if self.whole.done():
            app = self.whole.result()
        else:
            app = self.guard if is_page else await asyncio.wrap_future(self.whole)
        await app(scope, receive, send)


def _headers(name: str, data: bytes) -> list[tuple[bytes, bytes]]:
    kind = TYPES.get(PurePosixPath(name).suffix) or guess_type(name)[0] or "application/octet-stream"
    own = [(b"content-type", kind.encode()), (b"content-length", str(len(data)).encode())]
    return [*own, *(KEPT if name.startswith(HASHED) else [])]
