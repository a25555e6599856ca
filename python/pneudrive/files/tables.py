"""Columns of a binary file, read by a persistent child process. If a library crashes, only that process ends.

A Parquet file with a valid checksum (`pneudrive.files.seal`: campaigns, maps and trajectories of pneudrive) is
unchanged since pneudrive wrote it, and is read in this process. All other files are read in `reader_process`. The first
file costs the start of a process and the import of its library (0.2 to 0.6 s on two cores). Each further message costs
0.3 ms and the
transfer of the columns. Many small files are therefore requested by one message.
"""

from __future__ import annotations

import atexit
import contextlib
import json
import os
import socket
import subprocess
import threading
from dataclasses import dataclass
from functools import cached_property
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from pneudrive.batching import in_advance
from pneudrive.errors import PneudriveError, RecordingError
from pneudrive.files import child, formats, seal
from pneudrive.files.bounds import VARIABLE, bound
from pneudrive.files.content import check_file, unreadable

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Sequence

    from numpy.typing import NDArray

    from pneudrive.files.formats import Opened

    Answer = tuple[dict[str, Any], memoryview]

#: Format in the layout file -> its name in messages.
FORMATS = {form: name for form, (name, _) in formats.OPENERS.items()}
#: Largest number of files, and of their bytes, in one batch.
MOST_FILES, MOST_BYTES = 100, 1 << 25
#: Files checked in one batch, and number of threads: keeps the disk and each processor busy.
LOOKED_AT, LOOKERS = 20, 4
BYTES_PER_SECOND = 1e7
ALARM = -14  # exit status of a process ended by its alarm


@dataclass(frozen=True)
class Table:
    """File of columns.

    Attributes
    ----------
    path : Path
    form : str
        Key of `FORMATS`.
    metadata : dict
        Texts in the file's metadata.
    own : Opened or None
        The file opened in this process: a Parquet file with a valid checksum.
    kind : type of PneudriveError
        Class of the errors.
    told : tuple of str
        Names of the columns from the reader process.
    """

    path: Path
    form: str
    metadata: dict[str, str]
    own: Opened | None
    kind: type[PneudriveError]
    told: tuple[str, ...] = ()

    @cached_property
    def names(self) -> list[str]:
        """Names of the columns."""
        return list(self.told) if self.own is None else self.own.names()

    def get(
        self, wanted: Iterable[str], rows: tuple[int, int] | None = None, dates: frozenset[str] = frozenset()
    ) -> dict[str, NDArray[Any]]:
        """Read columns.

        Parameters
        ----------
        wanted : iterable of str
            Some of `names`; each is read once.
        rows : (int, int), optional
            First row and one behind the last; None: all.
        dates : frozenset of str
            Columns to read as dates: texts or NumPy's ``datetime64``, if the file has them.

        Returns
        -------
        dict
            Name -> array of numbers, dates, or texts (object).

        Raises
        ------
        RecordingError
            The file is damaged, or was changed meanwhile.
        """
        names = list(dict.fromkeys(wanted))
        if self.own is not None:
            with self._named():
                return self.own.get(names, dates, rows)
        request = {"ask": "columns", "form": self.form, "wanted": names, "rows": rows, "dates": sorted(dates)}
        columns = _columns(*_reader.ask(self.path, request, self.kind))
        return {name: columns[name] for name in names if name in columns}

    def count(self) -> int | None:
        """Return the number of rows; None where channels may differ in length.

        Raises
        ------
        RecordingError
            As for `get`.
        """
        if self.own is not None:
            with self._named():
                return self.own.count()
        return _reader.ask(self.path, {"ask": "count", "form": self.form}, self.kind)[0]["count"]

    @contextlib.contextmanager
    def _named(self) -> Iterator[None]:
        """Raise an error of a file that is read here as one of `kind`."""
        import polars as pl

        try:
            yield
        except (pl.exceptions.PolarsError, pl.exceptions.PanicException, OSError) as error:
            reason = (str(error).strip() or type(error).__name__).splitlines()[0]
            what = "the file cannot be read as Parquet; it was changed after it was opened"
            raise self.kind(what, where=str(self.path), value=reason) from None


def open_table(path: Path, form: str, kind: type[PneudriveError] = RecordingError) -> Table:
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
    if form == "parquet" and _look(path, kind).own:
        opened = formats.open_parquet(path)
        return Table(path, form, opened.metadata, opened, kind)
    header, _ = _reader.ask(path, {"ask": "names", "form": form}, kind)
    return Table(path, form, header["metadata"], None, kind, tuple(header["names"]))


def read_texts(paths: Iterable[Path], key: str, kind: type[PneudriveError]) -> Iterator[Text | PneudriveError]:
    """Read one text of the metadata of many Parquet files.

    Parameters
    ----------
    paths : iterable of Path
    key : str
        Key of the text in the metadata.
    kind : type of PneudriveError

    Yields
    ------
    Text or PneudriveError
        For each file in order; an error, of `kind`, is that of `open_table`. For a file without a checksum, only its
        ends and the text are checked, if the text is found there: reading its columns checks the rest.
    """
    request = {"ask": "metadata", "form": "parquet"}

    def ask(some: list[_File]) -> tuple[list[tuple[_File, str | None]], Iterator[Answer | PneudriveError]]:
        known = [(one, seal.footer_text(one.end, key) if one.end else None) for one in some]
        return known, _ask_foreign([one for one, text in known if text is None], request, kind)

    for some, others in in_advance(ask, _batches(paths, kind), 1):
        for one, text in some:
            if one.error is not None:
                yield one.error
            elif text is not None:
                yield Text(text, one.own)
            elif one.own:
                yield Text(formats.parquet_metadata(one.path).get(key), True)
            else:
                answer = next(others)
                yield answer if isinstance(answer, PneudriveError) else Text(answer[0]["metadata"].get(key), False)


def read_columns(
    paths: Iterable[Path], wanted: Sequence[str], kind: type[PneudriveError]
) -> Iterator[dict[str, NDArray[Any]] | PneudriveError]:
    """Read columns of many Parquet files. Columns that a file lacks are left out. See `read_texts`."""
    request = {"ask": "some columns", "form": "parquet", "wanted": list(wanted), "rows": None, "dates": []}
    for some in _batches(paths, kind):
        others = _ask_foreign(some, request, kind)
        own = iter(_read_own([one.path for one in some if one.own], wanted, kind))
        for one in some:
            if one.error is not None:
                yield one.error
            elif one.foreign:
                answer = next(others)
                yield answer if isinstance(answer, PneudriveError) else _columns(*answer)
            else:
                yield next(own)


@dataclass(frozen=True)
class Text:
    """Text of a Parquet file's metadata, or None; ``sealed``: the file has a valid checksum."""

    text: str | None
    sealed: bool


@dataclass(frozen=True)
class _File:
    """Parquet file of a batch: unreadable, with a valid checksum, or foreign."""

    path: Path
    size: int
    error: PneudriveError | None = None
    own: bool = False
    end: bytes = b""

    @property
    def foreign(self) -> bool:
        return self.error is None and not self.own


def _batches(paths: Iterable[Path], kind: type[PneudriveError]) -> Iterator[list[_File]]:
    """Check files in batches, limited in number and bytes."""
    batch: list[_File] = []
    size = 0
    rest = iter(paths)
    parts = iter(lambda: list(islice(rest, LOOKED_AT)), [])
    for part in in_advance(lambda part: [_looked(path, kind) for path in part], parts, LOOKERS):
        for one in part:
            batch.append(one)
            size += one.size
            if len(batch) >= MOST_FILES or size >= MOST_BYTES:
                yield batch
                batch, size = [], 0
    if batch:
        yield batch


def _looked(path: Path, kind: type[PneudriveError]) -> _File:
    try:
        return _look(path, kind)
    except kind as error:
        return _File(path, 0, error)


def _ask_foreign(
    some: Sequence[_File], request: dict[str, Any], kind: type[PneudriveError]
) -> Iterator[Answer | PneudriveError]:
    """Request the foreign files of a batch from the reader process."""
    foreign = [one for one in some if one.foreign]
    size = sum(one.size for one in foreign)
    return iter(list(_reader.ask_each([one.path for one in foreign], size, request, kind)))


def _look(path: Path, kind: type[PneudriveError]) -> _File:
    """Check a Parquet file.

    Raises
    ------
    PneudriveError
        An error of `kind`: the file does not exist, is damaged, too large, or not a Parquet file.
    """
    size = check_file(path, kind)
    try:
        looked = seal.look(path, size)
    except OSError as error:
        raise unreadable(path, error, kind) from None
    if looked.wrong:
        raise kind(looked.wrong, where=str(path))
    return _File(path, size, None, looked.own, looked.end)


def _read_own(
    paths: Sequence[Path], wanted: Sequence[str], kind: type[PneudriveError]
) -> list[dict[str, NDArray[Any]] | PneudriveError]:
    """Read columns of files with a valid checksum; a file deleted meanwhile gives an error."""
    try:
        return list(formats.read_parquets(paths, wanted))
    except OSError as error:
        if len(paths) == 1:
            return [unreadable(paths[0], error, kind)]
        return [found for path in paths for found in _read_own([path], wanted, kind)]


def _columns(told: dict[str, Any], memory: memoryview) -> dict[str, NDArray[Any]]:
    return {name: _column(column, memory) for name, column in told["columns"].items()}


def _column(told: dict[str, Any], memory: memoryview) -> NDArray[Any]:
    shape = tuple(told["shape"])
    if "texts" in told:
        return np.array(told["texts"], dtype=object).reshape(shape)
    dtype = np.dtype(told["dtype"])
    count = int(np.prod(shape, dtype=np.int64))
    if not count:
        return np.zeros(shape, dtype)
    return np.frombuffer(memory, dtype, count, told["place"]).reshape(shape)


class _Reader:
    """Client of the persistent reader process, for one request at a time."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._process: subprocess.Popen[bytes] | None = None
        self._connection: socket.socket | None = None
        self._owner = 0

    def ask(self, path: Path, request: dict[str, Any], kind: type[PneudriveError]) -> Answer:
        """Send a request, and map the answer.

        Raises
        ------
        PneudriveError
            An error of `kind`: the library reported an error, crashed, or took too long.
        """
        (answer,) = self.ask_each([path], check_file(path, kind), request, kind)
        if isinstance(answer, PneudriveError):
            raise answer
        return answer

    def ask_each(
        self, paths: Sequence[Path], size: int, request: dict[str, Any], kind: type[PneudriveError]
    ) -> Iterator[Answer | PneudriveError]:
        """Send one request for several files, of `size` bytes in total.

        After a crash, send one request for each file.
        """
        if not paths:
            return
        seconds = _seconds(size)
        message = {**request, "paths": [str(Path.cwd() / path) for path in paths], "seconds": seconds}
        with self._lock:
            try:
                answer = self._exchange(json.dumps(message).encode() + b"\n")
            except BaseException:  # Ctrl-C too: a late answer would be taken for that of the next request
                self.stop()
                raise
            status = None if answer is not None else self._ended()
        if answer is not None:
            content, memory = answer
            for path, one in zip(paths, content["each"], strict=True):
                yield kind(**one["error"], where=str(path)) if "error" in one else (one, memory)
        elif len(paths) > 1:
            for path in paths:
                yield from self.ask_each([path], size, request, kind)
        else:
            yield _crashed(paths[0], request["form"], seconds, status, kind)

    def _exchange(self, line: bytes) -> Answer | None:
        if self._connection is None or self._owner != os.getpid():
            self._start()
        assert self._connection is not None
        try:
            self._connection.sendall(line)
            sizes = _received(self._connection, 16)
            text = _received(self._connection, int.from_bytes(sizes[:8], "little"))
            arrays = _received(self._connection, int.from_bytes(sizes[8:], "little"))
        except (BrokenPipeError, ConnectionResetError, EOFError):
            return None
        return json.loads(bytes(text)), arrays

    def _start(self) -> None:
        ours, theirs = socket.socketpair()
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
        self._connection, self._owner = ours, os.getpid()

    def _ended(self) -> int:
        """Return the exit status of the ended process."""
        process = self._process
        status = 0 if process is None else process.wait()
        self.stop()
        return status

    def stop(self) -> None:
        """End the process; the next request starts another one."""
        process, connection = self._process, self._connection
        self._process = self._connection = None
        if connection is not None:
            connection.close()
        if process is not None and self._owner == os.getpid():
            process.kill()
            process.wait()


def _received(connection: socket.socket, size: int) -> memoryview:
    """Receive a number of bytes.

    Raises
    ------
    EOFError
        The connection ended before.
    """
    data = memoryview(bytearray(size))
    place = 0
    while place < size:
        count = connection.recv_into(data[place:])
        if not count:
            raise EOFError
        place += count
    return data


def _seconds(size: int) -> int:
    return int(bound("reader_seconds") + size / BYTES_PER_SECOND)


def _crashed(path: Path, form: str, seconds: int, status: int | None, kind: type[PneudriveError]) -> PneudriveError:
    name = FORMATS[form]
    if status == ALARM:
        return kind(
            f"the file was not read as {name} within {seconds} s",
            where=str(path),
            rule="reading an intact file takes less time (bound reader_seconds)",
            remedy=f'If the file is intact, allow more time: {VARIABLE}="reader_seconds=600".',
        )
    return kind(
        f"the file is damaged: the library that reads {name} crashed on it",
        where=str(path),
        value=f"status {status}",
        remedy="Export the file again, or get another copy of it.",
    )


_reader = _Reader()
atexit.register(_reader.stop)
