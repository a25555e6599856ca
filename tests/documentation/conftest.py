"""The browser of the tests of the page, for the documentation that `make docs` has built."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer

import pytest

from page.conftest import ROOT, browser, open_tab

__all__ = ["browser", "open_tab"]
BUILT = ROOT / "docs" / "_build" / "html"


class Quiet(SimpleHTTPRequestHandler):
    """A server of files that says nothing."""

    def log_message(self, *_: object) -> None:
        """Say nothing."""


@pytest.fixture(scope="session")
def site() -> Iterator[str]:
    """Give the address of the documentation, served by this machine to itself."""
    assert (BUILT / "index.html").is_file(), "make docs builds the documentation before it runs these tests"
    server = ThreadingHTTPServer(("127.0.0.1", 0), partial(Quiet, directory=str(BUILT)))
    threading.Thread(target=server.serve_forever, daemon=True).start()
    yield f"http://127.0.0.1:{server.server_port}"
    server.shutdown()
    server.server_close()
