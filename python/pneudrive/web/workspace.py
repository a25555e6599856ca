"""The folder of the page: its accessible files, safe writing of files, and the cache of this user.

The import of this module must be fast, because the address is printed only afterwards. Modules for descriptions are
therefore imported in functions.
"""

from __future__ import annotations

import atexit
import hashlib
import os
import posixpath
import re
import secrets
import shutil
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass, field
from functools import cache, lru_cache
from itertools import count, islice
from pathlib import Path
from typing import Any, TypeVar

from pneudrive.errors import CommandError
from pneudrive.files.content import exists, kind_of_folder, kind_of_toml, read_text
from pneudrive.files.writing import alone_in
from pneudrive.simulation.trajectory import whole

State = TypeVar("State")

DESCRIPTIONS = (".toml",)
TABLES = (".csv", ".parquet", ".nc", ".h5", ".hdf5", ".tdms", ".mf4", ".mat", ".txt", ".xz", ".gz", ".bz2")
FMUS = (".fmu",)
COMMANDS = (".csv",)  # command of a valve over time
SUFFIXES = (*DESCRIPTIONS, *TABLES, *FMUS)
BUILT = Path(__file__).parent / "built"  # the page
REPORTS = "/report/"  # address of reports; the secret of one report follows
#: Address for dropped files. They may have any length, because each piece is written when it arrives.
DROP = "/api/drop"
TOKEN_BYTES = 24  # 192 bits
LONGEST = 1024  # longest name, characters
MOST_FILES = 20_000
LONGEST_UNUSED_S = 30 * 86400.0  # a recording that was not opened for so long is removed from the cache, s
#: Characters that are not allowed in file names of the page, and characters on disk that cannot be sent to the page.
_FORBIDDEN, _NO_UTF8 = re.compile(r"[\x00-\x1f\x7f\\\ud800-\udfff]"), re.compile(r"[\ud800-\udfff]")


class ChangedError(Exception):
    """The file has changed since the page read it. It is not overwritten."""

    def __init__(self, text: str) -> None:
        super().__init__("the file changed on disk")
        self.text = text


@dataclass(frozen=True)
class Listed:
    """One file of the workspace: path from its root, kind, size in bytes, and time of its last change in s."""

    path: str
    kind: str
    size: int
    changed: float


@dataclass(frozen=True)
class Workspace:
    """A folder and the names in it that the page may use."""

    root: Path
    #: Secret in the address of a report -> its folder. See `pneudrive.web.app.report_address`.
    reports: dict[str, str] = field(default_factory=dict, init=False, repr=False, compare=False)
    _states: dict[Any, Any] = field(default_factory=dict, init=False, repr=False, compare=False)
    _lock: threading.Lock = field(default_factory=threading.Lock, init=False, repr=False, compare=False)

    @classmethod
    def at(cls, folder: Path) -> Workspace:
        """Open a folder as a workspace.

        Raises
        ------
        CommandError
            The path is not a folder.
        """
        if not folder.is_dir():
            raise CommandError(f"{folder} is not a folder", remedy="Name the folder that contains your drives.")
        return cls(folder.resolve())

    def state(self, kind: Callable[[Workspace], State]) -> State:
        """Return the single object of a class for this workspace, such as its jobs. The first call makes it."""
        with self._lock:
            if kind not in self._states:
                self._states[kind] = kind(self)
        return self._states[kind]  # type: ignore[no-any-return]

    def path(self, name: str, suffixes: tuple[str, ...] = SUFFIXES) -> Path:
        """Return the path of a file from its name, which must be relative, of a known kind, and inside the folder.

        Raises
        ------
        CommandError
            The name is not valid, or leads out of the workspace.
        """
        place = self.folder(name)
        if not name.lower().endswith(suffixes):
            raise CommandError(
                f"{name} cannot be opened: the page does not know this extension", rule=", ".join(suffixes)
            )
        return place

    def folder(self, name: str) -> Path:
        """Return the path of a folder, or of a file of any kind, from its name. Links must not lead outside.

        Raises
        ------
        CommandError
            The name is not valid, or leads out of the workspace.
        """
        is_text = isinstance(name, str) and 0 < len(name) <= LONGEST and not _FORBIDDEN.search(name)
        if is_text and not any(not part or part.startswith(".") for part in name.split("/")):
            with suppress(OSError, RuntimeError, ValueError):  # a cycle of links, or a name that the system rejects
                place = (self.root / name).resolve()
                if place.is_relative_to(self.root):
                    return place
        raise CommandError.of("web.refused", name=str(name)[:80])

    def check_named(self, name: str, tables: dict[str, Any]) -> None:
        """Reject a description that names a file outside the workspace. Such names are relative to the description."""
        from pneudrive.describe.files.toml import leaves
        from pneudrive.describe.formulas import FILE_PREFIX

        for _, given in leaves(tables, is_inner=lambda value: isinstance(value, dict | list)):
            if isinstance(given, str) and given.startswith(FILE_PREFIX):
                beside = posixpath.join(posixpath.dirname(name), given.removeprefix(FILE_PREFIX).strip())
                self.path(posixpath.normpath(beside), DESCRIPTIONS)

    def files(self) -> list[Listed]:
        """Return the files that the page knows, by name."""
        return self.listed()[0]

    def listed(self) -> tuple[list[Listed], int]:
        """Return the known files by name, and the number of names that are left out because they are not UTF-8.

        Names that begin with a dot are ignored.
        """
        left_out: list[str] = []
        found = islice(self._walk(self.root, "", left_out), MOST_FILES)
        return sorted(found, key=lambda file: file.path), len(left_out)

    def _walk(self, folder: Path, before: str, left_out: list[str]) -> Iterator[Listed]:
        try:
            entries = list(os.scandir(folder))
        except OSError:
            return
        for entry in entries:
            path, is_folder = f"{before}{entry.name}", entry.is_dir(follow_symlinks=False)
            if entry.name.startswith("."):
                continue
            if _NO_UTF8.search(entry.name):
                left_out.append(entry.name)
                continue
            kind = kind_of_folder(Path(entry.path)) if is_folder else ""
            if is_folder and not kind:
                yield from self._walk(Path(entry.path), f"{path}/", left_out)
            elif kind or (entry.name.lower().endswith(SUFFIXES) and entry.is_file(follow_symlinks=False)):
                status = entry.stat()
                kind = kind or _kind(entry.path, status.st_mtime_ns, status.st_size)
                yield Listed(path, kind, status.st_size, status.st_mtime)

    def read(self, name: str) -> tuple[str, str]:
        """Return the text of a file and its version, the SHA-256 of the text."""
        text = read_text(self.path(name, DESCRIPTIONS), CommandError)
        return text, fingerprint(text)

    def write(self, name: str, text: str, known: str | None) -> str:
        """Write a file that has not changed since the page read it, and return its new version.

        Parameters
        ----------
        name, text : str
        known : str or None
            Version of the text that the page read. None for a new file.

        Raises
        ------
        ChangedError
            The file has changed.
        CommandError
            The file cannot be written.
        """
        path = self.path(name, DESCRIPTIONS)
        with alone_in(self.root):  # two writers with the same version: the second one gets an error
            there = read_text(path, CommandError) if exists(path) else None
            if known != (there if there is None else fingerprint(there)):
                raise ChangedError(there or "")
            if there is None and not path.parent.is_dir():
                raise CommandError(f"there is no folder {path.parent.name}", remedy="Make it first.")
            if "\r\n" in (there or ""):  # line ends of the file: an editor in a browser only has "\n"
                text = text.replace("\r\n", "\n").replace("\n", "\r\n")
            try:
                with whole(path) as temporary:
                    temporary.write_bytes(text.encode())
            except OSError as error:
                raise CommandError(f"{name[:80]} cannot be written", rule=error.strerror or str(error)) from None
        return fingerprint(text)


class NewNames:
    """Generator of file names for copied commands. Existing names are avoided, so that no file is overwritten."""

    def __init__(self, workspace: Workspace) -> None:
        self._root = workspace.root
        self._given: set[str] = set()

    def of(self, stem: str, suffix: str = ".parquet") -> str:
        """Return a name that begins with `stem`."""
        names = (f"{stem}{f'-{number}' if number > 1 else ''}{suffix}" for number in count(1))
        name = next(one for one in names if one not in self._given and not exists(self._root / one))
        self._given.add(name)
        return name


def built_page(built: Path = BUILT) -> dict[str, bytes]:
    """Read the built page once. A request selects one of these files by name; no path is built from the request.

    Raises
    ------
    CommandError
        The page is not built.
    """
    if not (built / "index.html").is_file():
        raise CommandError("the page is not built", where=built, remedy="Run make setup.")
    return {
        f"/{path.relative_to(built).as_posix()}": path.read_bytes()
        for path in sorted(built.rglob("*"))
        if path.is_file()
    }


def last_lines(path: Path, most_bytes: int) -> list[str]:
    """Return the last complete lines of a log; empty if it cannot be read."""
    try:
        with path.open("rb") as file:
            size = file.seek(0, os.SEEK_END)
            file.seek(max(size - most_bytes, 0))
            return file.read().decode("utf-8", "replace").splitlines()[size > most_bytes :]
    except OSError:
        return []


def new_token() -> str:
    """Return a new secret for a run of the server, or for a report."""
    return secrets.token_urlsafe(TOKEN_BYTES)


def fingerprint(text: str) -> str:
    """Return the SHA-256 of a text."""
    return hashlib.sha256(text.encode()).hexdigest()


def is_in_catalogue(name: str) -> bool:
    """Return whether a name refers to the catalogue and not to a file of the workspace."""
    from pneudrive.describe.files.catalogue import PREFIX

    return name.startswith(PREFIX)


def safe(name: str) -> str:
    """Return a name in a form that commands do not read as an option."""
    return f"./{name}" if name.startswith("-") else name


@lru_cache(maxsize=MOST_FILES)
def _kind(path: str, _changed_ns: int, _size: int) -> str:
    """Return the kind of a file. TOML files are distinguished by their tables."""
    if path.lower().endswith(FMUS):
        return "fmu"
    if path.lower().endswith(DESCRIPTIONS):
        return kind_of_toml(Path(path))
    return "friction map" if Path(path).stem.lower() == "map" else "recording"


def cache_folder() -> Path:
    """Return the folder of converted recordings, which only this user can open. The first call makes it.

    Without a writable home folder, `log_folder` is returned.
    """
    if sys.platform == "darwin":
        cache = Path.home() / "Library" / "Caches"
    else:
        named = os.environ.get("LOCALAPPDATA" if sys.platform == "win32" else "XDG_CACHE_HOME", "")
        cache = Path(named) if Path(named).is_absolute() else Path.home() / ".cache"
    folder = cache / "pneudrive" / "page"
    with suppress(OSError):
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        is_ours = not hasattr(os, "getuid") or folder.stat().st_uid == os.getuid()
        if not folder.is_symlink() and is_ours and os.access(folder, os.W_OK):
            folder.chmod(0o700)
            return folder.resolve()
    return log_folder()


def forget_unused(folder: Path) -> None:
    """Remove files that were not opened during `LONGEST_UNUSED_S`."""
    oldest = time.time() - LONGEST_UNUSED_S
    for entry in os.scandir(folder):
        if entry.is_dir(follow_symlinks=False) and entry.stat(follow_symlinks=False).st_mtime < oldest:
            shutil.rmtree(entry.path, ignore_errors=True)


@cache
def log_folder() -> Path:
    """Return a new folder for logs of jobs; only this user can open it. The folder is removed when Python ends."""
    folder = tempfile.mkdtemp(prefix="pneudrive-")
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    return Path(folder).resolve()
