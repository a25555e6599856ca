"""``campaign.log``: events with their times, in words."""

from __future__ import annotations

import contextlib
import threading
from typing import TYPE_CHECKING

from pneudrive.campaign.storage.lock import now
from pneudrive.errors import CommandError
from pneudrive.files.writing import open_to_append

if TYPE_CHECKING:
    from pathlib import Path


class Journal:
    """A log of lines, each with date and time. A failure of the log never ends a campaign.

    Parameters
    ----------
    path : Path
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self._lock = threading.Lock()

    def write(self, text: str) -> None:
        """Append a line; if the disk is full, the line is lost."""
        line = " | ".join(part for part in text.splitlines() if part.strip())
        with self._lock, contextlib.suppress(OSError, CommandError), open_to_append(self._path) as file:
            file.write(f"{now()} {line}\n")
