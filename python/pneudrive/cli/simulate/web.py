"""``pneudrive web``: the page of a folder, in the browser of this machine."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from pneudrive.errors import CommandError


def _removed(context: typer.Context, parameter: typer.CallbackParam, value: object) -> None:
    """Raise an error that names the replacement of a removed option."""
    if value and not context.resilient_parsing:
        raise CommandError(
            f"{parameter.opts[0]} is no longer an option of pneudrive web",
            rule="the page answers only this machine",
            remedy="From another machine: ssh -L 8123:127.0.0.1:8123 HOST, and pneudrive web --port 8123 on HOST.",
        )


def web(
    folder: Annotated[Path, typer.Argument()] = Path(),
    port: Annotated[int, typer.Option(min=0, max=65535)] = 0,
    control: Annotated[bool, typer.Option("--control")] = False,
    browser: bool = True,
    bind: Annotated[str, typer.Option(hidden=True, callback=_removed)] = "",
    certificate: Annotated[str, typer.Option(hidden=True, callback=_removed)] = "",
    key: Annotated[str, typer.Option(hidden=True, callback=_removed)] = "",
    user_file: Annotated[str, typer.Option(hidden=True, callback=_removed)] = "",
    unprotected: Annotated[bool, typer.Option("--unprotected", hidden=True, callback=_removed)] = False,
) -> None:
    """Open a folder in the browser, with live simulations.

    The server answers this machine only. From another machine, use ssh -L.

    Options
    -------
    folder
        Folder of drives, circuits and recordings.
    port
        Port of this machine; 0 takes a free one.
    control
        Let the page pause, stop, resume and abort campaigns too.
    browser
        Open the page in the browser.
    """
    import sys
    import tempfile
    import threading
    import webbrowser

    from pneudrive.web.serve import serve

    with tempfile.TemporaryDirectory(prefix="pneudrive-") as private:

        def opened(address: str) -> None:
            typer.echo(f"{address}\nThe address opens the page for whoever knows it. Ctrl-C ends the server.")
            sys.stdout.flush()
            if browser:
                way = Path(private) / "open.html"
                _write_redirect(way, address)
                threading.Thread(target=webbrowser.open, args=(way.as_uri(),), daemon=True).start()

        serve(folder, port, opened, control=control)


def _write_redirect(path: Path, address: str) -> None:
    """Write a file that leads a browser to an address.

    Only the user may read it. Every account of a shared computer can read the arguments of the browser's process.
    """
    path.touch(0o600, exist_ok=False)
    text = f'<meta http-equiv="refresh" content="0;url={address}"><a href="{address}">{path.stem}</a>\n'
    path.write_text(text, encoding="utf-8")
