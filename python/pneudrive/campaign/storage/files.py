"""Whole files, the lock and the log of a campaign folder."""

from __future__ import annotations

import contextlib
import errno
import getpass
import json
import os
import socket
import threading
from dataclasses import asdict, dataclass
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pneudrive.errors import CampaignError, CommandError
from pneudrive.files.content import read_json
from pneudrive.files.writing import is_held, open_to_append, take

if TYPE_CHECKING:
    from collections.abc import Iterator
    from types import TracebackType


#: Ending of a file while it is written. A process that is killed leaves at most one; nobody reads it.
PART = ".part"
#: Errors of file systems that cannot flush a folder; they store names by themselves.
NO_SUCH_THING = (errno.EINVAL, errno.ENOTSUP, errno.EBADF)

REMEDIES = {
    errno.ENOSPC: "Free some space, then run `pneudrive campaign resume` on the folder: finished cycles are kept.",
    errno.EDQUOT: "The quota is used up. Free some space, then resume: finished cycles are kept.",
    errno.EROFS: "The file system is read-only. Name a writable folder.",
    errno.EACCES: "Get write permission there, or name another folder.",
    errno.ENOENT: "The parent folder does not exist. Name a folder that can be created.",
    errno.ENOTDIR: "A file is in the way. Name another folder.",
    errno.EEXIST: "A file is in the way. Name another folder.",
    errno.EPERM: "Get write permission there, or name another folder.",
}


@contextlib.contextmanager
def clear_errors(what: str, path: Path) -> Iterator[None]:
    """Turn errors of the operating system into one clear message.

    Raises
    ------
    CampaignError
    """
    try:
        yield
    except OSError as error:
        reason = error.strerror or str(error)
        remedy = REMEDIES.get(error.errno or 0, "Check the disk, then resume: finished cycles are kept.")
        raise CampaignError(what, where=str(path), value=reason, remedy=remedy) from error


def write_whole(path: Path, data: bytes, *, flush: bool = True) -> None:
    """Write a file: to a temporary name, flushed to the disk, renamed; the folder is flushed too.

    Readers find the old file or the new one, even if the process is killed at any moment.

    Parameters
    ----------
    path : Path
    data : bytes
    flush : bool
        Whether the file must survive a power cut.

    Raises
    ------
    CampaignError
        If it cannot be written: disk full, read-only, no permission. No new file exists then.
    """
    temporary = path.with_name(path.name + PART)
    with clear_errors("a file of the campaign cannot be written", path):
        try:
            with temporary.open("wb") as file:
                file.write(data)
                file.flush()
                if flush:
                    os.fsync(file.fileno())
            temporary.replace(path)
        except OSError:
            with contextlib.suppress(OSError):
                temporary.unlink()
            raise
        if flush:
            flush_folder(path.parent)


def make_folder(path: Path) -> None:
    """Create a folder and its parents so that they survive a power cut.

    Raises
    ------
    CampaignError
        If it cannot be created.
    """
    with clear_errors("a folder of the campaign cannot be created", path):
        missing = [p for p in (path, *path.parents) if not p.exists()]
        path.mkdir(parents=True, exist_ok=True)
        for made in missing:
            flush_folder(made.parent)


def no_links(folder: Path) -> None:
    """Refuse a folder that contains links, pipes or devices, because writing to them would change other files or block.

    Raises
    ------
    CampaignError
        If there is one, up to one folder deep.
    """
    own = _entries(folder)
    deeper = (inner for one in own if one.is_dir(follow_symlinks=False) for inner in _entries(one))
    for entry in (*own, *deeper):
        if not (entry.is_file(follow_symlinks=False) or entry.is_dir(follow_symlinks=False)):
            raise CampaignError(
                "a campaign folder must contain ordinary files only",
                where=entry.path,
                value=f"a link to {Path(entry.path).readlink()}" if entry.is_symlink() else "a pipe or a device",
                rule="a link could redirect writing to another place",
                remedy="Replace the link by the file. The whole folder may be a link.",
            )


def _entries(folder: str | Path | os.DirEntry[str]) -> list[os.DirEntry[str]]:
    try:
        with os.scandir(folder) as found:
            return list(found)
    except OSError:
        return []


def flush_folder(path: Path) -> None:
    """Flush a folder's list of names to the disk, if the file system supports it."""
    try:
        descriptor = os.open(path, os.O_RDONLY)
        try:
            os.fsync(descriptor)
        finally:
            os.close(descriptor)
    except OSError as error:
        if error.errno not in NO_SUCH_THING:
            raise


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
