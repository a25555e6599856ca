"""Running the server: one port of this machine, a printed address, and the browser."""

from __future__ import annotations

import json
import socket
import sys
import threading
import warnings
from contextlib import suppress
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING

from pneudrive.errors import CommandError, PneudriveWarning
from pneudrive.web.guard import NAMES, Guard, Site, address, new_token
from pneudrive.web.workspace import Workspace, built_page, cache_folder, forget_unused

if TYPE_CHECKING:
    from collections.abc import Callable
    from concurrent.futures import Future

    from pneudrive.web.guard import App


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
