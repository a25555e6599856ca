"""Columns of binary files, with one clear message for each kind of damage.

Parquet is read in this process. A valid checksum (`pneudrive.files.seal`) shows that a file is unchanged since
pneudrive wrote it. Formats with libraries in C are read by a child process (`pneudrive.files.reader_process`), so that
a crash does not end this process. The start of the child takes 0.2 to 0.6 s.
"""

from __future__ import annotations

import atexit
import contextlib
import os
import subprocess
import threading
from dataclasses import dataclass
from functools import cached_property, partial
from multiprocessing import Pipe
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from pneudrive.batching import in_advance
from pneudrive.errors import ErrorKind, PneudriveError, RecordingError
from pneudrive.files import child, formats, seal
from pneudrive.files.bounds import VARIABLE, bound
from pneudrive.files.content import check_file, unreadable

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Sequence
    from multiprocessing.connection import Connection

    from numpy.typing import NDArray

    Columns = dict[str, NDArray[Any]]

Found = TypeVar("Found")
Text = tuple[str | None, bool]
#: Format in the layout file -> its name in messages.
FORMATS = {form: name for form, (name, _) in formats.OPENERS.items()}
READERS = 2  # threads that read many files
MOST_FILES, MOST_BYTES = 100, 1 << 24  # largest number of files in one batch, and of their bytes
BYTES_PER_SECOND = 1e7
ALARM = -14  # exit status of a process ended by its alarm


@dataclass(frozen=True)
class Table:
    """File of columns.

    Attributes
    ----------
    path : Path
    opened : formats.Opened
        The file, opened here or in the reader process.
    is_sealed : bool
        Whether it is a Parquet file with a valid checksum.
    kind : type of PneudriveError
        Class of the errors.
    """

    path: Path
    opened: formats.Opened
    is_sealed: bool
    kind: ErrorKind

    @property
    def metadata(self) -> dict[str, str]:
        """Texts in the file's metadata."""
        return self.opened.metadata

    @cached_property
    def names(self) -> list[str]:
        """Names of the columns."""
        with clear_errors(self.path, self.kind):
            return self.opened.names()

    def get(
        self,
        wanted: Iterable[str],
        rows: formats.Rows | None = None,
        dates: frozenset[str] = frozenset(),
    ) -> Columns:
        """Read columns.

        Parameters
        ----------
        wanted : iterable of str
            Some of `names`; each is read once.
        rows : (int, int), optional
            First row and the row after the last; None: all.
        dates : frozenset of str
            Columns to read as dates: texts or NumPy's ``datetime64``, if the file has them.

        Returns
        -------
        dict
            Name -> array of numbers, dates, or texts (object).

        Raises
        ------
        RecordingError
            The file is damaged, or was changed since it was opened.
        """
        with clear_errors(self.path, self.kind):
            return self.opened.get(list(dict.fromkeys(wanted)), dates, rows)

    def count(self) -> int | None:
        """Return the number of rows; None if channels may differ in length.

        Raises
        ------
        RecordingError
            As for `get`.
        """
        with clear_errors(self.path, self.kind):
            return self.opened.count()


@contextlib.contextmanager
def clear_errors(path: Path, kind: ErrorKind) -> Iterator[None]:
    """Raise errors of polars about a Parquet file as errors of `kind`. Panics of polars are not ordinary exceptions."""
    import polars as pl

    try:
        yield
    except PneudriveError as error:
        error.where = str(path)
        raise error.turned(kind) from None
    except OSError as error:
        raise unreadable(path, error, kind) from None
    except (pl.exceptions.PolarsError, pl.exceptions.PanicException, ValueError) as error:
        reason = (str(error).strip() or type(error).__name__).splitlines()[0]
        what = "the file cannot be read as Parquet; it is damaged, or was changed after it was opened"
        raise kind(what, where=str(path), value=reason[: formats.LONGEST_REASON]) from None


def open_table(path: Path, form: str, kind: ErrorKind = RecordingError) -> Table:
    """Open a file of columns.

    Parameters
    ----------
    path : Path
    form : str
        Key of `FORMATS`.
    kind : type of PneudriveError
        Class of the errors.

    Raises
    ------
    RecordingError
        The file does not exist, is damaged, too large or not of this format, or its library is not installed.
    """
    if form == "parquet":
        is_sealed = _is_sealed(path, kind)
        with clear_errors(path, kind):
            table = Table(path, formats.open_parquet(path), is_sealed, kind)
        if not is_sealed:
            assert table.names  # read from the footer, which may be damaged
        return table
    ask = partial(_reader.ask, path, kind)
    names, metadata = ask({"ask": "names", "form": form})

    def get(wanted: list[str], dates: frozenset[str], rows: formats.Rows | None) -> Columns:
        columns = ask({"ask": "columns", "form": form, "wanted": wanted, "rows": rows, "dates": dates})
        return {name: columns[name] for name in wanted if name in columns}

    opened = formats.Opened(lambda: names, get, lambda: ask({"ask": "count", "form": form}), metadata)
    return Table(path, opened, False, kind)


def read_texts(paths: Iterable[Path], key: str, kind: ErrorKind) -> Iterator[Text | PneudriveError]:
    """Read one text of the metadata of many Parquet files.

    Parameters
    ----------
    paths : iterable of Path
    key : str
        Key of the text in the metadata.
    kind : type of PneudriveError

    Yields
    ------
    (str or None, bool) or PneudriveError
        Text, and whether the file has a valid checksum; one entry per file, in order. Errors, of `kind`, are those of
        `open_table`.
    """

    def text(path: Path) -> Text:
        table = open_table(path, "parquet", kind)
        return table.metadata.get(key), table.is_sealed

    return in_advance(lambda path: _found(text, path, kind), paths, READERS)


def read_columns(paths: Iterable[Path], wanted: Sequence[str], kind: ErrorKind) -> Iterator[Columns | PneudriveError]:
    """Read columns of many Parquet files. Columns missing in a file are left out. See `read_texts`."""

    def columns(path: Path) -> Columns:
        table = open_table(path, "parquet", kind)
        return table.get(name for name in wanted if name in table.names)

    def batch(some: list[Path]) -> Sequence[Columns | PneudriveError]:
        looked = [_found(lambda path: _is_sealed(path, kind), path, kind) for path in some]
        alike = formats.read_alike(some, wanted) if all(one is True for one in looked) else None
        return alike or [_found(columns, path, kind) for path in some]

    for found in in_advance(batch, _batches(paths), READERS, ahead=1):
        yield from found


def _found(read: Callable[[Path], Found], path: Path, kind: ErrorKind) -> Found | PneudriveError:
    """Return the result of reading a file, or its error."""
    try:
        return read(path)
    except kind as error:
        return error


def _batches(paths: Iterable[Path]) -> Iterator[list[Path]]:
    """Divide files into batches, limited in number and bytes."""
    batch, size = list[Path](), 0
    for path in paths:
        batch.append(path)
        size += path.stat().st_size if path.is_file() else 0
        if len(batch) == MOST_FILES or size > MOST_BYTES:
            yield batch
            batch, size = [], 0
    if batch:
        yield batch


def _is_sealed(path: Path, kind: ErrorKind) -> bool:
    """Check a Parquet file; return whether it has a valid checksum.

    Raises
    ------
    PneudriveError
        An error of `kind`: the file does not exist, is damaged, too large, or not a Parquet file.
    """
    size = check_file(path, kind)
    try:
        damage, is_sealed = seal.look(path, size)
    except OSError as error:
        raise unreadable(path, error, kind) from None
    if damage:
        raise kind(damage, where=str(path))
    return is_sealed


class _Reader:
    """Client of the persistent reader process, for one request at a time."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._process: subprocess.Popen[bytes] | None = None
        self._connection: Connection | None = None
        self._owner = 0

    def ask(self, path: Path, kind: ErrorKind, request: dict[str, Any]) -> Any:  # noqa: ANN401 - of each request its own
        """Send a request for a file, and return the answer.

        Raises
        ------
        PneudriveError
            An error of `kind`: the library reported an error, crashed, or took too long.
        """
        seconds = int(bound("reader_seconds") + check_file(path, kind) / BYTES_PER_SECOND)
        with self._lock:
            try:
                if self._connection is None or self._owner != os.getpid():
                    self._start()
                assert self._connection is not None
                self._connection.send({**request, "path": str(Path.cwd() / path), "seconds": seconds})
                answer = self._connection.recv()
            except (EOFError, OSError):
                status = 0 if self._process is None else self._process.wait()
                self.stop()
                name = FORMATS[request["form"]]
                if status == ALARM:
                    raise kind(
                        f"the file was not read as {name} within {seconds} s",
                        where=str(path),
                        rule="reading an intact file takes less time (bound reader_seconds)",
                        remedy=f'If the file is intact, allow more time: {VARIABLE}="reader_seconds=600".',
                    ) from None
                raise kind(
                    f"the file is damaged: the library that reads {name} crashed on it",
                    where=str(path),
                    value=f"status {status}",
                    remedy="Export the file again, or get another copy of it.",
                ) from None
            except BaseException:  # Ctrl-C too: a late answer would be taken for that of the next request
                self.stop()
                raise
        if isinstance(answer, PneudriveError):
            answer.where = str(path)
            raise answer.turned(kind)
        return answer

    def _start(self) -> None:
        ours, theirs = Pipe()
        with theirs:
            number = theirs.fileno()
            self._process = subprocess.Popen(
                child.command("pneudrive.files.reader_process", str(number), str(int(bound("reader_bytes")))),
                pass_fds=(number,),
                stdin=subprocess.DEVNULL,
                stdout=subprocess.DEVNULL,
                stderr=subprocess.DEVNULL,  # Rust panics and HDF5 print errors before they raise them
                env={**os.environ, "HDF5_USE_FILE_LOCKING": "FALSE"},  # close the file, so that it can be written again
            )
        self._connection, self._owner = ours, os.getpid()  # pyright: ignore[reportAttributeAccessIssue] - not on Windows

    def stop(self) -> None:
        """End the process; the next request starts another one."""
        process, connection = self._process, self._connection
        self._process = self._connection = None
        if connection is not None:
            connection.close()
        if process is not None and self._owner == os.getpid():
            process.kill()
            process.wait()


_reader = _Reader()
atexit.register(_reader.stop)
