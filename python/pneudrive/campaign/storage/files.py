"""Files that are written completely or not at all."""

from __future__ import annotations

import contextlib
import errno
import os
from pathlib import Path
from typing import TYPE_CHECKING

from pneudrive.errors import CampaignError

if TYPE_CHECKING:
    from collections.abc import Iterator

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
