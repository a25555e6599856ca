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
    browser: Annotated[bool, typer.Option(help="Open the page in the browser.")] = True,
) -> None:
    """Show a folder in the browser: circuits, sliders on running simulations, recordings. For this machine alone."""
    import sys
    import threading
    import webbrowser

    from pneudrive.web.serve import serve

    def opened(address: str) -> None:
        typer.echo(f"{address}\nThe address opens the page for whoever knows it. Ctrl-C ends the server.")
        sys.stdout.flush()
        if browser:
            threading.Thread(target=webbrowser.open, args=(address,), daemon=True).start()

    serve(folder, port, opened, control=control)
