"""Running the server: one port of this machine, its address printed, the browser opened."""

from __future__ import annotations

import socket
import warnings
from typing import TYPE_CHECKING

from pneudrive.errors import CommandError, PneudriveError, PneudriveWarning

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

HOST = "127.0.0.1"
MOST_MESSAGE = 1 << 16  # bytes of a message of the socket
_NEEDED = 'pip install "pneudrive[web]"'


def serve(folder: Path, port: int, opened: Callable[[str], object], *, control: bool = False) -> None:
    """Serve a folder until Ctrl-C.

    Parameters
    ----------
    folder : Path
        Workspace.
    port : int
        Port; 0 takes a free one.
    opened : callable
        Called with the address when the server listens.
    control : bool
        Whether the page may send requests to campaigns.

    Raises
    ------
    CommandError
        The folder is not one, the port is taken, the page is not built, or the libraries of the page are missing.
    """
    try:
        import uvicorn

        from pneudrive.web.app import make_app
    except ImportError as error:
        raise CommandError(f"the page needs {error.name}", remedy=_NEEDED) from None
    from pneudrive.web.guard import address, new_token
    from pneudrive.web.workspace import Workspace

    workspace = Workspace.at(folder)
    with socket.socket(socket.AF_INET, socket.SOCK_STREAM) as listening:
        listening.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            listening.bind((HOST, port))
        except (OSError, OverflowError) as error:
            raise CommandError(f"port {port} cannot be used: {error}", remedy="Choose another one: --port.") from None
        port, token = listening.getsockname()[1], new_token()
        app = make_app(workspace, port, token, control=control)
        warnings.simplefilter("ignore", PneudriveWarning)  # the page shows the warnings of a run
        settings = uvicorn.Config(
            app,
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
        listening.listen(128)
        opened(address(port, token))
        server.run(sockets=[listening])


def warm_up() -> None:
    """Simulate once, so that the first run of the page does not wait for imports."""
    from pneudrive.web.asked_run import AskedRun
    from pneudrive.web.workspace import Workspace

    asked = {"path": "catalogue:reference", "command": "1", "duration": "10 ms"}
    try:
        AskedRun.of(asked).run(Workspace.at(_here()))
    except PneudriveError:
        return


def _here() -> Path:
    from pathlib import Path

    return Path(__file__).parent
