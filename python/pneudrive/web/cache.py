"""Cache of the page, in the user's own cache folder. A folder of another user could contain forged data."""

from __future__ import annotations

import atexit
import os
import shutil
import sys
import tempfile
import time
from functools import cache
from pathlib import Path

#: A recording that was not opened for so long is removed from the cache, s.
LONGEST_UNUSED_S = 30 * 86400.0


def cache_folder() -> Path:
    """Return the folder of converted recordings, which only this user can open. The first call makes it.

    Without a writable home folder, `log_folder` is returned.
    """
    folder = _user_cache() / "pneudrive" / "page"
    try:
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        if not folder.is_symlink() and _is_ours(folder) and os.access(folder, os.W_OK):
            folder.chmod(0o700)
            return folder.resolve()
    except OSError:
        pass
    return log_folder()


def forget_unused(folder: Path, now_s: float | None = None) -> None:
    """Remove files that were not opened during `LONGEST_UNUSED_S`."""
    oldest = (time.time() if now_s is None else now_s) - LONGEST_UNUSED_S
    for entry in os.scandir(folder):
        if entry.is_dir(follow_symlinks=False) and entry.stat(follow_symlinks=False).st_mtime < oldest:
            shutil.rmtree(entry.path, ignore_errors=True)


@cache
def log_folder() -> Path:
    """Return a new folder for logs of jobs that only this user can open. It is removed when Python ends."""
    folder = tempfile.mkdtemp(prefix="pneudrive-")
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    return Path(folder).resolve()


def _is_ours(folder: Path) -> bool:
    return not hasattr(os, "getuid") or folder.stat().st_uid == os.getuid()


def _user_cache() -> Path:
    """Return the cache folder of this user, whose files can be made again."""
    if sys.platform == "darwin":
        return Path.home() / "Library" / "Caches"
    named = os.environ.get("LOCALAPPDATA" if sys.platform == "win32" else "XDG_CACHE_HOME", "")
    return Path(named) if Path(named).is_absolute() else Path.home() / ".cache"
