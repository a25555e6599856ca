"""Lock of a campaign folder: one process works in the folder, and writes its present action into the lock file."""

from __future__ import annotations

import contextlib
import getpass
import json
import os
import socket
from dataclasses import asdict, dataclass
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pneudrive.campaign.storage.files import clear_errors, no_links
from pneudrive.errors import CampaignError
from pneudrive.files.content import read_json
from pneudrive.files.lock import is_held, take

if TYPE_CHECKING:
    from types import TracebackType

NAME = "campaign.lock"
#: States of a process that holds the lock.
STATES = ("starting", "running", "pausing", "paused", "waiting", "operator", "stopping")


def now() -> str:
    """Return the date and time of the computer, ISO 8601 with zone."""
    return datetime.now().astimezone().isoformat(timespec="seconds")


@dataclass(frozen=True)
class Holder:
    """Process that works in a folder, and its present action.

    Attributes
    ----------
    pid, host, user : int, str, str
    since : str
        When it began, ISO 8601.
    state : str
        One of `STATES`.
    text : str
        Reason for waiting, in words.
    cycle : str
        Key of the cycle that runs.
    """

    pid: int
    host: str
    user: str
    since: str
    state: str = "starting"
    text: str = ""
    cycle: str = ""

    def __str__(self) -> str:
        """Return a description in words."""
        what = f"{self.state}: {self.text}" if self.text else self.state
        return f"process {self.pid} of {self.user} on {self.host} since {self.since}, {what}"


class FolderLock:
    """The lock of a campaign folder: a lock of the kernel (`flock`), which ends with the process.

    Parameters
    ----------
    folder : Path
        Must exist.

    Raises
    ------
    CampaignError
        If another process holds it, or the folder holds links.
    """

    def __init__(self, folder: Path) -> None:
        path = folder / NAME
        no_links(folder)
        with clear_errors("the campaign folder cannot be locked", path):
            self._file: int | None = os.open(path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o666)
        try:
            taken = take(self._file)
        except OSError as error:
            os.close(self._file)
            raise CampaignError(
                "the campaign folder cannot be locked",
                where=str(path),
                value=error.strerror,
                rule="two processes must not write to one campaign",
                remedy="Use a folder on a file system that supports locks.",
            ) from error
        if not taken:
            os.close(self._file)
            raise CampaignError(
                "another process works in this campaign folder",
                where=str(folder),
                value=str(_read(path) or "a process without a name"),
                remedy=f"Wait for it, or end it: pneudrive campaign abort {folder}",
            )
        self._holder = Holder(os.getpid(), socket.gethostname(), user(), now())
        self.tell()

    def tell(self, **what: str) -> None:
        """Write the ``state``, ``text`` and ``cycle`` of this process for other processes."""
        self._holder = Holder(**{**asdict(self._holder), **what})
        if self._file is None:
            return
        text = json.dumps(asdict(self._holder)).encode()
        with contextlib.suppress(OSError):  # a full disk must not end the campaign here: readers wait
            os.pwrite(self._file, text, 0)
            os.ftruncate(self._file, len(text))

    def release(self) -> None:
        """Release the folder."""
        if self._file is not None:
            with contextlib.suppress(OSError):
                os.ftruncate(self._file, 0)
            os.close(self._file)
            self._file = None

    def __enter__(self) -> FolderLock:
        return self

    def __exit__(self, kind: type | None, error: BaseException | None, trace: TracebackType | None) -> None:
        self.release()


def holder(folder: Path) -> Holder | None:
    """Return the process that works in a folder, or None. The lock does not change."""
    path = folder / NAME
    return (_read(path) or Holder(0, "?", "?", "?")) if is_held(path) else None


def _read(path: Path) -> Holder | None:
    try:
        given: dict[str, Any] = read_json(path, CampaignError)
        return Holder(**given)
    except (CampaignError, TypeError):
        return None


def user() -> str:
    """Return the user name of this process."""
    try:
        return getpass.getuser()
    except (OSError, KeyError):  # no such user: in a container
        return str(os.getuid())
