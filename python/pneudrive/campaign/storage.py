"""Files that are there whole or not at all, and that tell when they are damaged."""

from __future__ import annotations

import contextlib
import errno
import hashlib
import os
from pathlib import Path
from typing import TYPE_CHECKING

from pneudrive.errors import CampaignError

if TYPE_CHECKING:
    from collections.abc import Iterator

#: Ending of a file that is being written. A process that dies leaves at most one; it is never read.
PART = ".part"
#: Key of the Parquet metadata under which a file carries the SHA-256 of its own bytes.
SEAL = "pneudrive-seal"
BLANK = "0" * 64
PARQUET = b"PAR1"
#: What file systems answer that cannot flush a folder: the names get there by themselves.
NO_SUCH_THING = (errno.EINVAL, errno.ENOTSUP, errno.EBADF)

REMEDIES = {
    errno.ENOSPC: "Free some space, then run `pneudrive campaign resume` on the folder: what is finished is kept.",
    errno.EDQUOT: "The quota is used up. Free some space, then resume: what is finished is kept.",
    errno.EROFS: "The file system is read-only. Name a folder that can be written to.",
    errno.EACCES: "Give yourself the right to write there, or name another folder.",
    errno.ENOENT: "Its place is not there, or was taken away. Name a folder that can be made.",
    errno.ENOTDIR: "A file is in the way. Name another folder.",
    errno.EEXIST: "A file is in the way. Name another folder.",
    errno.EPERM: "Give yourself the right to write there, or name another folder.",
}


@contextlib.contextmanager
def clear_errors(what: str, path: Path) -> Iterator[None]:
    """Turn what the operating system refuses into one clear message.

    Raises
    ------
    CampaignError
    """
    try:
        yield
    except OSError as error:
        reason = error.strerror or str(error)
        remedy = REMEDIES.get(error.errno or 0, "Look at the disk; then resume: what is finished is kept.")
        raise CampaignError(what, where=str(path), value=reason, remedy=remedy) from error


def write_whole(path: Path, data: bytes, *, flush: bool = True) -> None:
    """Write a file: to a temporary name, flushed to the disk, renamed; the folder is flushed too.

    A reader, or a process that follows one that was killed at any moment, finds the old file or the new one.

    Parameters
    ----------
    path : Path
    data : bytes
    flush : bool
        Whether the file must outlive a power cut.

    Raises
    ------
    CampaignError
        If it cannot be written: disk full, read-only, no right. Then no new file is there.
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
    """Make a folder that outlives a power cut, with those above it.

    Raises
    ------
    CampaignError
        If it cannot be made.
    """
    with clear_errors("a folder of the campaign cannot be made", path):
        missing = [p for p in (path, *path.parents) if not p.exists()]
        path.mkdir(parents=True, exist_ok=True)
        for made in missing:
            flush_folder(made.parent)


def no_links(folder: Path) -> None:
    """Refuse a folder that holds links, pipes or devices: who writes into it would write, or wait, elsewhere.

    Raises
    ------
    CampaignError
        One is there, up to one folder deep.
    """
    own = _entries(folder)
    deeper = (inner for one in own if one.is_dir(follow_symlinks=False) for inner in _entries(one))
    for entry in (*own, *deeper):
        if not (entry.is_file(follow_symlinks=False) or entry.is_dir(follow_symlinks=False)):
            raise CampaignError(
                "a campaign folder holds its own files, and this is none",
                where=entry.path,
                value=f"a link to {Path(entry.path).readlink()}" if entry.is_symlink() else "a pipe or a device",
                rule="a folder does not decide what is written elsewhere",
                remedy="Put the file itself there. The whole folder may be a link.",
            )


def _entries(folder: str | Path | os.DirEntry[str]) -> list[os.DirEntry[str]]:
    try:
        with os.scandir(folder) as found:
            return list(found)
    except OSError:
        return []


def flush_folder(path: Path) -> None:
    """Flush a folder's list of names to the disk, where the file system knows how."""
    try:
        descriptor = os.open(path, os.O_RDONLY)
        try:
            os.fsync(descriptor)
        finally:
            os.close(descriptor)
    except OSError as error:
        if error.errno not in NO_SUCH_THING:
            raise


def sealed(parquet: bytes) -> bytes:
    """Fill in the seal of a Parquet file that was written with ``{SEAL: BLANK}`` in its metadata."""
    at = _seal_at(parquet)
    assert at is not None, "the file was written without a blank seal"
    return parquet[:at] + hashlib.sha256(parquet).hexdigest().encode() + parquet[at + len(BLANK) :]


def damage(parquet: bytes) -> str | None:
    """Say what is wrong with the bytes of a Parquet file, before anything tries to make sense of them.

    Returns
    -------
    str or None
        None where nothing is wrong, as far as can be told: without a seal only the ends of the file are looked at.
    """
    if not parquet:
        return "the file is empty"
    if parquet[:4] != PARQUET or len(parquet) < 12:
        return "this is not a Parquet file"
    footer = int.from_bytes(parquet[-8:-4], "little")
    if parquet[-4:] != PARQUET or footer > len(parquet) - 12:
        return "the file is cut off: its end is missing"
    at = _seal_at(parquet)
    if at is None:
        return "the file is damaged: its seal cannot be read" if has_seal(parquet) else None
    total = hashlib.sha256(memoryview(parquet)[:at])
    total.update(BLANK.encode())
    total.update(memoryview(parquet)[at + len(BLANK) :])
    if total.hexdigest().encode() != parquet[at : at + len(BLANK)]:
        return "the file is damaged: its bytes do not have the SHA-256 that they had when it was written"
    return None


def has_seal(parquet: bytes) -> bool:
    """Tell whether the file was written with a seal; others may be sound too."""
    return SEAL.encode() in parquet


def _seal_at(parquet: bytes) -> int | None:
    """Find the 64 characters of the seal in the footer: the key, then type and length of the text (compact Thrift)."""
    mark = SEAL.encode() + b"\x18" + bytes([len(BLANK)])
    at = parquet.rfind(mark)
    return None if at < 0 or at + len(mark) + len(BLANK) > len(parquet) else at + len(mark)
