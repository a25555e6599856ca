"""Safe writing into folders that may come from other people. Symbolic links are never followed."""

from __future__ import annotations

import errno
import os
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TextIO

from pneudrive.errors import CommandError

#: Flag of `os.open` that refuses a symbolic link; 0 on Windows, where only administrators create links.
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


def make_result_folder(path: Path) -> None:
    """Create a folder named by the user, with its parents, unless it exists.

    Raises
    ------
    CommandError
        The folder cannot be created.
    """
    try:
        path.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        remedy = "Name another folder."
        raise CommandError(f"the folder {path} cannot be created", value=error.strerror, remedy=remedy) from None


def make_subfolder(path: Path) -> None:
    """Create a folder inside a result folder, unless it exists.

    Raises
    ------
    CommandError
        The folder is a link, or cannot be created.
    """
    make_result_folder(path)
    if path.is_symlink():
        raise CommandError(f"the folder {path} is a link", rule=_RULE, remedy=_REMEDY)


# --- Locks of folders: held by the kernel (`flock`) while a process works there, and freed when that process ends.

TRIES, TRY_AGAIN_S = 5, 0.05
_THREADS = threading.Lock()


def take(file: int) -> bool:
    """Try a few times to lock an open file, because `is_held` locks it for a moment. Return whether it is locked.

    Raises
    ------
    OSError
        The file system has no locks.
    """
    import fcntl

    for _ in range(TRIES):
        with suppress(BlockingIOError, PermissionError):  # EAGAIN, and EACCES of network file systems
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            return True
        time.sleep(TRY_AGAIN_S)
    return False


def is_held(path: Path) -> bool:
    """Return whether a process holds the lock of a file. The state of the lock does not change."""
    import fcntl

    try:
        file = os.open(path, os.O_RDONLY | os.O_CLOEXEC | os.O_NONBLOCK)  # does not block for any kind of file
    except OSError:
        return False
    try:
        fcntl.flock(file, fcntl.LOCK_SH | fcntl.LOCK_NB)
    except OSError as error:
        return isinstance(error, BlockingIOError | PermissionError)
    else:
        return False
    finally:
        os.close(file)


@contextmanager
def alone_in(folder: Path) -> Iterator[None]:
    """Let one thread of one process at a time work in a folder.

    If the system has no folder locks, only threads of this process are excluded.

    The lock should be held only briefly: a second process waits until it is released.
    """
    with _THREADS:
        file = None
        with suppress(OSError, ImportError):  # Windows opens no folders and has no `flock`
            import fcntl

            file = os.open(folder, os.O_RDONLY | os.O_CLOEXEC)
            fcntl.flock(file, fcntl.LOCK_EX)
        try:
            yield
        finally:
            if file is not None:
                os.close(file)
