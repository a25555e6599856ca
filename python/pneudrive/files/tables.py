"""Columns of a binary file, through one kept process that may crash instead of this one.

A Parquet file that carries a seal which holds (`pneudrive.files.seal`: campaigns, maps and trajectories of ours) has
the bytes that polars wrote, and is read here. Everything else is read in `reader_process`. Measured on two cores: the
first file costs the start of a process and the import of its library (0.2 to 0.6 s), each further one 0.3 ms and the
copy of its columns into memory that both processes see.
"""

from __future__ import annotations

import atexit
import json
import mmap
import os
import socket
import subprocess
import threading
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from pneudrive.errors import RecordingError
from pneudrive.files import child, formats, seal
from pneudrive.files.bounds import VARIABLE, bound
from pneudrive.files.content import check_file, unreadable

if TYPE_CHECKING:
    from collections.abc import Iterable

    from numpy.typing import NDArray

    from pneudrive.errors import PneudriveError
    from pneudrive.files.formats import Opened

#: Format of the layout file -> what people call it.
FORMATS = {form: name for form, (name, _) in formats.OPENERS.items()}
ALIGNED = 64  # bytes: where the arrays of an answer begin
BYTES_PER_SECOND = 1e7
ALARM = -14  # status of a process that its alarm ended


@dataclass(frozen=True)
class Table:
    """A file of columns.

    Attributes
    ----------
    path : Path
    form : str
        Key of `FORMATS`.
    metadata : dict
        Texts that the file carries.
    own : Opened or None
        What reads it in this process: a Parquet file of ours whose seal holds.
    kind : type of PneudriveError
        What is raised.
    told : tuple of str
        Names of the columns, as the reader process told them.
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
            First row and the one behind the last; None: all.
        dates : frozenset of str
            Columns for which dates are wanted: texts or NumPy's ``datetime64``, where the file says so.

        Returns
        -------
        dict
            Name -> array: numbers, dates, or texts (object), as the file holds them.

        Raises
        ------
        RecordingError
            The file is damaged, or was changed meanwhile.
        """
        names = list(dict.fromkeys(wanted))
        if self.own is not None:
            return self.own.get(names, dates, rows)
        request = {"ask": "columns", "form": self.form, "wanted": names, "rows": rows, "dates": sorted(dates)}
        told, memory = _reader.ask(self.path, request, self.kind)
        columns = told["columns"]
        return {name: _column(columns[name], told["places"], memory) for name in names if name in columns}

    def count(self) -> int | None:
        """Give the number of rows; None where channels may differ in length.

        Raises
        ------
        RecordingError
            As `get`.
        """
        if self.own is not None:
            return self.own.count()
        return _reader.ask(self.path, {"ask": "count", "form": self.form}, self.kind)[0]["count"]


def open_table(path: Path, form: str, kind: type[PneudriveError] = RecordingError) -> Table:
    """Open a file of columns.

    Parameters
    ----------
    path : Path
    form : str
        Key of `FORMATS`.
    kind : type of PneudriveError
        What to raise.

    Raises
    ------
    RecordingError
        There is no such file, it is damaged, too large, not of this format, or its library is not there.
    """
    check_file(path, kind)
    if form == "parquet":
        try:
            wrong, own = seal.look(path)
        except OSError as error:
            raise unreadable(path, error, kind) from None
        if wrong:
            raise kind(wrong, where=str(path))
        if own:
            opened = formats.open_parquet(path)
            return Table(path, form, opened.metadata, opened, kind)
    told, _ = _reader.ask(path, {"ask": "names", "form": form}, kind)
    return Table(path, form, told["metadata"], None, kind, tuple(told["names"]))


def _column(told: dict[str, Any], places: list[int], memory: memoryview) -> NDArray[Any]:
    shape = tuple(told["shape"])
    if "texts" in told:
        return np.array(told["texts"], dtype=object).reshape(shape)
    dtype = np.dtype(told["dtype"])
    count = int(np.prod(shape, dtype=np.int64))
    if not count:
        return np.zeros(shape, dtype)
    return np.frombuffer(memory, dtype, count, places[told["array"]]).reshape(shape)


class _Reader:
    """The kept process, one request at a time."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._process: subprocess.Popen[bytes] | None = None
        self._connection: socket.socket | None = None
        self._owner = 0

    def ask(self, path: Path, request: dict[str, Any], kind: type[PneudriveError]) -> tuple[dict[str, Any], memoryview]:
        """Send a request and map the answer.

        Raises
        ------
        PneudriveError
            Of `kind`: what the library said, or that it crashed, or took too long.
        """
        size = check_file(path, kind)
        request = {**request, "path": str(Path.cwd() / path), "seconds": _seconds(size)}
        with self._lock:
            try:
                answer = self._exchange(json.dumps(request).encode() + b"\n")
            except BaseException:  # Ctrl-C too: what comes later would be the answer to this
                self.stop()
                raise
            status = None if answer is not None else self._ended()
        if answer is None:
            raise _crashed(path, request, status, kind)
        told, memory = answer
        if "error" in told:
            raise kind(**told["error"], where=str(path))
        return told, memory

    def _exchange(self, line: bytes) -> tuple[dict[str, Any], memoryview] | None:
        if self._connection is None or self._owner != os.getpid():
            self._start()
        assert self._connection is not None
        try:
            self._connection.sendall(line)
            mark, descriptors, _, _ = socket.recv_fds(self._connection, 1, 1)
        except (BrokenPipeError, ConnectionResetError):
            return None
        if not mark:
            return None
        try:
            memory = memoryview(mmap.mmap(descriptors[0], 0, access=mmap.ACCESS_COPY))
        finally:
            os.close(descriptors[0])
        length = int.from_bytes(memory[:8], "little")
        head = 8 + length + (-(8 + length) % ALIGNED)
        return json.loads(bytes(memory[8 : 8 + length])), memory[head:]

    def _start(self) -> None:
        ours, theirs = socket.socketpair()
        with theirs:
            number = theirs.fileno()
            self._process = subprocess.Popen(
                child.command("pneudrive.files.reader_process", str(number)),
                pass_fds=(number,),
                stdin=subprocess.DEVNULL,
                stdout=subprocess.DEVNULL,
                stderr=subprocess.DEVNULL,  # a panic and HDF5 print their troubles before they raise them
                env={**os.environ, "HDF5_USE_FILE_LOCKING": "FALSE"},  # a file that was read can be written again
            )
        self._connection, self._owner = ours, os.getpid()

    def _ended(self) -> int:
        """Give the status of the process that has gone."""
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


def _seconds(size: int) -> int:
    return int(bound("reader_seconds") + size / BYTES_PER_SECOND)


def _crashed(path: Path, request: dict[str, Any], status: int | None, kind: type[PneudriveError]) -> PneudriveError:
    name = FORMATS[request["form"]]
    if status == ALARM:
        return kind(
            f"the file was not read as {name} within {request['seconds']} s",
            where=str(path),
            rule="a sound file is read in less (reader_seconds)",
            remedy=f'Where it is sound, allow more: {VARIABLE}="reader_seconds=600".',
        )
    return kind(
        f"the file is damaged: the library that reads {name} crashed on it",
        where=str(path),
        value=f"status {status}",
        remedy="Export it again, or take it from its first source.",
    )


_reader = _Reader()
atexit.register(_reader.stop)
