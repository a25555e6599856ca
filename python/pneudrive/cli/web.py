"""``pneudrive web``: the page of a folder, in the browser of this machine."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer


def web(
    folder: Annotated[Path, typer.Argument(help="Folder of drives, circuits and recordings.")] = Path(),
    port: Annotated[int, typer.Option(help="Port of this machine; 0 takes a free one.", min=0, max=65535)] = 0,
    control: Annotated[
        bool,
        typer.Option("--control", help="Let the page pause, stop, resume and abort campaigns too."),
    ] = False,
    bind: Annotated[
        str, typer.Option(help="Address or name of this machine to listen on; another than this needs the next three.")
    ] = "127.0.0.1",
    certificate: Annotated[Path | None, typer.Option(help="Certificate of this server (PEM): https.")] = None,
    key: Annotated[Path | None, typer.Option(help="Private key of the certificate.")] = None,
    user_file: Annotated[
        Path | None, typer.Option(help="File of users that may log in; made by `pneudrive rig user`.")
    ] = None,
    unprotected: Annotated[
        bool, typer.Option("--unprotected", help="Allow another address without them: who listens can use the page.")
    ] = False,
    browser: Annotated[bool, typer.Option(help="Open the page in the browser.")] = True,
) -> None:
    """Show a folder in the browser: circuits, sliders on running simulations, recordings. For this machine alone.

    From another one, use ssh -L; or give an address with certificate, key and users.
    """
    import sys
    import threading
    import webbrowser

    from pneudrive.web.reach import WebReach
    from pneudrive.web.serve import serve

    reach = WebReach.of(bind, certificate, key, user_file, unprotected=unprotected)
    opens = "The users of the file log in there." if reach.users else "The address opens the page for whoever knows it."

    def opened(address: str) -> None:
        typer.echo(f"{address}\n{opens} Ctrl-C ends the server.")
        sys.stdout.flush()
        if browser:
            threading.Thread(target=webbrowser.open, args=(address,), daemon=True).start()

    serve(folder, port, opened, control=control, reach=reach)
