"""Output folders of the commands."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pneudrive.errors import CommandError

if TYPE_CHECKING:
    from pathlib import Path


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
