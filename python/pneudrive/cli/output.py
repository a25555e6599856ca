"""What commands write to: folders, and the terminal."""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING

from pneudrive.errors import CommandError

if TYPE_CHECKING:
    from pathlib import Path

    from rich.console import Console

#: Columns of a table that goes to a file.
WIDTH = 160


def writable_folder(out: Path) -> Path:
    """Make an output folder before any work is done.

    Raises
    ------
    CommandError
        It cannot be made or written to.
    """
    try:
        out.mkdir(parents=True, exist_ok=True)
        probe = out / ".pneudrive-probe"
        probe.touch()
        probe.unlink()
    except OSError as error:
        raise CommandError(f"--out {out}: the folder cannot be written to", value=error.strerror) from None
    return out


def console() -> Console:
    """Make a console that shows texts as they are: names of recordings and seals may hold brackets."""
    from rich.console import Console

    return Console(width=None if sys.stdout.isatty() else WIDTH, highlight=False, markup=False)
