"""Safe writing into folders that other people may have made: links are never followed."""

from __future__ import annotations

import errno
import os
from typing import TYPE_CHECKING, TextIO

from pneudrive.errors import CommandError

if TYPE_CHECKING:
    from pathlib import Path

#: Flag of `os.open` that refuses a link; Windows has none, and makes links for administrators alone.
NO_FOLLOW = getattr(os, "O_NOFOLLOW", 0)
_RULE, _REMEDY = "a link could point to another of your files", "Remove the link."


def open_to_append(path: Path) -> TextIO:
    """Open a text file to append lines; it is created if it does not exist.

    Raises
    ------
    CommandError
        The file is a link.
    OSError
        The file cannot be opened for another reason.
    """
    flags = os.O_WRONLY | os.O_APPEND | os.O_CREAT | getattr(os, "O_CLOEXEC", 0) | NO_FOLLOW
    try:
        return os.fdopen(os.open(path, flags, 0o666), "a", encoding="utf-8", newline="")
    except OSError as error:
        if error.errno not in (errno.ELOOP, errno.EMLINK):
            raise
        raise CommandError(f"{path} is a link", rule=_RULE, remedy=_REMEDY) from None


def make_subfolder(path: Path) -> None:
    """Create a folder of a result, unless it exists.

    Raises
    ------
    CommandError
        The folder is a link, or cannot be created.
    """
    try:
        path.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        remedy = "Name another folder."
        raise CommandError(f"the folder {path} cannot be created", value=error.strerror, remedy=remedy) from None
    if path.is_symlink():
        raise CommandError(f"the folder {path} is a link", rule=_RULE, remedy=_REMEDY)
