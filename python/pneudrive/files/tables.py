"""Columns of binary files, with one clear message for each kind of damage.

Parquet is read in this process. A valid checksum (`pneudrive.files.seal`) shows that a file is unchanged since
pneudrive wrote it. Formats with libraries in C are read by a child process (`pneudrive.files.formats`), so that a crash
does not end this process. The start of the child takes 0.2 to 0.6 s.
"""

from __future__ import annotations

import atexit
import contextlib
import os
import subprocess
import threading
from functools import cached_property
from itertools import pairwise
from multiprocessing import Pipe
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

from pneudrive.batching import child_command, in_advance
from pneudrive.errors import ErrorKind, PneudriveError, RecordingError
from pneudrive.files import formats, seal
from pneudrive.files.bounds import VARIABLE, bound
from pneudrive.files.content import check_file, check_unpacked, most_unpacked, unreadable

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Sequence
    from multiprocessing.connection import Connection

    import polars as pl
    from numpy.typing import NDArray

    Columns = dict[str, NDArray[Any]]

Found = TypeVar("Found")
Text = tuple[str | None, bool]
Rows = tuple[int, int]
#: Format in the layout file -> its name in messages.
FORMATS = {"parquet": "Parquet"} | {form: name for form, (name, _) in formats.OPENERS.items()}
MOST_PLACES = 100  # largest length of lists that become columns
OF_FILE = "the file of this row"  # name of an added column
READERS = 2  # threads that read many files
MOST_FILES, MOST_BYTES = 100, 1 << 24  # largest number of files in one batch, and of their bytes
BYTES_PER_SECOND = 1e7
ALARM = -14  # exit status of a process ended by its alarm


class Table:
    """Parquet file whose columns are read only on request.

    Attributes
    ----------
    path : Path
    kind : type of PneudriveError
        Class of the errors.
    is_sealed : bool
        Whether the file has a valid checksum.
    metadata : dict
        Texts in the file's metadata.
    """

    def __init__(self, path: Path, kind: ErrorKind) -> None:
        import polars as pl

        self.path, self.kind, self.is_sealed = path, kind, _is_sealed(path, kind)
        with clear_errors(path, kind):
            self.metadata: dict[str, str] = pl.read_parquet_metadata(path)
        if not self.is_sealed:
            assert self.names  # read from the footer, which may be damaged

    @cached_property
    def _scan(self) -> pl.LazyFrame:
        import polars as pl

        table = pl.scan_parquet(self.path)
        # Each column of short lists is split into columns ``name[0]``, ``name[1]``, ...
        schema = table.collect_schema()
        inner = {name: kind.inner for name, kind in schema.items() if isinstance(kind, pl.List | pl.Array)}
        lists = [name for name, kind in inner.items() if pl.Series(dtype=kind).dtype.is_numeric()]
        if not lists:
            return table
        short = table.with_columns(pl.col(name).cast(pl.List(inner[name])) for name in lists)
        longest = pl.col(lists).list.len().max()
        widths = short.head(1).select(longest).collect().row(0, named=True)
        return short.with_columns(
            pl.col(name).list.get(at, null_on_oob=True).alias(f"{name}[{at}]")
            for name in lists
            for at in range(min(widths[name] or 0, MOST_PLACES))
        ).drop(lists)

    @cached_property
    def names(self) -> list[str]:
        """Names of the columns."""
        with clear_errors(self.path, self.kind):
            return self._scan.collect_schema().names()

    def count(self) -> int:
        """Return the number of rows.

        Raises
        ------
        RecordingError
            As for `get`.
        """
        import polars as pl

        with clear_errors(self.path, self.kind):
            return int(self._scan.select(pl.len()).collect().item())

    def get(self, wanted: Iterable[str], rows: Rows | None = None, dates: frozenset[str] = frozenset()) -> Columns:
        """Read columns.

        Parameters
        ----------
        wanted : iterable of str
            Some of `names`; each is read once.
        rows : (int, int), optional
            First row and the row after the last, only for Parquet; None: all.
        dates : frozenset of str
            Columns that are read as dates (texts or NumPy's ``datetime64``) if the file has dates.

        Returns
        -------
        dict
            Name -> array of numbers, dates, or texts (object).

        Raises
        ------
        RecordingError
            The file is damaged, or was changed since it was opened.
        """
        import polars as pl

        with clear_errors(self.path, self.kind):
            table, size = self._scan.select(list(dict.fromkeys(wanted))), self.path.stat().st_size
            # A long constant column is a small file: rows beyond the bounds are not read.
            schema = table.collect_schema()
            width = sum(8 if kind.is_numeric() or kind.is_temporal() else 16 for kind in schema.dtypes())
            most = int(most_unpacked(size) / max(width, 1)) + 1
            first, end = rows or (0, most)
            frame = table.slice(first, min(end - first, most)).collect()
            check_unpacked(frame.height * width, size, RecordingError)
            texts = [int(column.str.len_bytes().sum()) for column in frame.iter_columns() if column.dtype == pl.String]
            check_unpacked(sum(texts), size, RecordingError)  # the file may hold a text only once for all rows
            return {column.name: formats.plain(column.to_numpy()) for column in frame.iter_columns()}


class LibraryTable(Table):
    """File of another format, read by the reader process. It has no row count: channels may differ in length."""

    def __init__(self, path: Path, form: str, kind: ErrorKind) -> None:
        self.path, self.kind, self.is_sealed, self._form = path, kind, False, form
        self.names, self.metadata = _reader.ask(path, kind, {"form": form, "wanted": None})

    def get(self, wanted: Iterable[str], rows: Rows | None = None, dates: frozenset[str] = frozenset()) -> Columns:
        """Read whole columns, see `Table.get`."""
        assert rows is None, "only Parquet is read in parts"
        wanted = list(dict.fromkeys(wanted))
        found = _reader.ask(self.path, self.kind, {"form": self._form, "wanted": wanted, "dates": dates})
        return {name: found[name] for name in wanted if name in found}


@contextlib.contextmanager
def clear_errors(path: Path, kind: ErrorKind) -> Iterator[None]:
    """Convert errors and panics of polars about a Parquet file to errors of `kind`."""
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
    """Open a binary file with columns.

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
    return Table(path, kind) if form == "parquet" else LibraryTable(path, form, kind)


def read_alike(paths: Sequence[Path], wanted: Sequence[str]) -> list[Columns] | None:
    """Read columns of many Parquet files by one query, because a query takes longer than reading a small file.

    Return None if a column or a value is missing in a file. A missing value would turn the integers of all files into
    floats.
    """
    import polars as pl

    try:
        frame = pl.scan_parquet(list(paths), include_file_paths=OF_FILE).select(*wanted, OF_FILE).collect()
    except (OSError, pl.exceptions.PolarsError, pl.exceptions.PanicException):  # the columns differ, or are damaged
        return None
    if any(frame[name].null_count() for name in wanted):
        return None
    stretches = frame[OF_FILE].rle().struct.unnest()
    rows = dict(zip(stretches["value"], stretches["len"], strict=True))  # a file without rows does not appear
    columns = {name: frame[name].to_numpy() for name in wanted}
    ends = np.cumsum([0, *(rows.get(str(path), 0) for path in paths)]).tolist()
    return [{name: column[begin:end] for name, column in columns.items()} for begin, end in pairwise(ends)]


def read_texts(paths: Iterable[Path], key: str, kind: ErrorKind) -> Iterator[Text | PneudriveError]:
    """Read one text from the metadata of each of many Parquet files.

    Parameters
    ----------
    paths : iterable of Path
    key : str
        Key of the text in the metadata.
    kind : type of PneudriveError

    Yields
    ------
    (str or None, bool) or PneudriveError
        Text, and whether the file has a valid checksum; one entry per file, in order. The errors are those of
        `open_table`, as `kind`.
    """

    def text(path: Path) -> Text:
        table = open_table(path, "parquet", kind)
        return table.metadata.get(key), table.is_sealed

    return in_advance(lambda path: _found(text, path, kind), paths, READERS)


def read_columns(paths: Iterable[Path], wanted: Sequence[str], kind: ErrorKind) -> Iterator[Columns | PneudriveError]:
    """Read columns of many Parquet files. Columns that are missing in a file are left out. See `read_texts`."""

    def columns(path: Path) -> Columns:
        table = open_table(path, "parquet", kind)
        return table.get(name for name in wanted if name in table.names)

    def batch(some: list[Path]) -> Sequence[Columns | PneudriveError]:
        looked = [_found(lambda path: _is_sealed(path, kind), path, kind) for path in some]
        alike = read_alike(some, wanted) if all(one is True for one in looked) else None
        return alike or [_found(columns, path, kind) for path in some]

    for found in in_advance(batch, _batches(paths), READERS, ahead=1):
        yield from found


def _found(read: Callable[[Path], Found], path: Path, kind: ErrorKind) -> Found | PneudriveError:
    """Read a file, and return the result or the error."""
    try:
        return read(path)
    except kind as error:
        return error


def _batches(paths: Iterable[Path]) -> Iterator[list[Path]]:
    """Divide files into batches of limited number and size."""
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
                    about = {"name": name, "seconds": seconds, "variable": VARIABLE}
                    raise kind.of("files.too-slow", where=str(path), **about) from None
                raise kind.of("files.crashed", where=str(path), name=name, status=status) from None
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
                child_command(formats.__name__, str(number), str(int(bound("reader_bytes")))),
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
