"""Process in which libraries written in C read files: requests are JSON on a socket, answers are JSON and arrays.

`pneudrive.files.tables` starts it. An answer is the length of a JSON text, the text, and the bytes of the arrays.
Effects of a damaged file on a library end here. An exception becomes the answer. A crash, the alarm or the bound of
memory ends this process, and the client starts another one.
"""

from __future__ import annotations

import json
import signal
import socket
import sys
import warnings
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from pneudrive.errors import PneudriveError
from pneudrive.files.formats import OPENERS, check_parquet, read_parquets

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numpy.typing import NDArray

    from pneudrive.files.formats import Opened

resource = None
with suppress(ImportError):  # not on Windows
    import resource

FIELDS = ("what", "value", "rule", "remedy")
LONGEST_REASON = 200
ALIGNED = 8  # bytes; offset of the arrays of an answer


class _Files:
    """Cache of the last opened file, because a request for names is followed by a request for columns."""

    def __init__(self) -> None:
        self._key: object = None
        self._opened: Opened | None = None

    def open(self, form: str, path: str) -> Opened:
        """Open a file, or return the open one."""
        about = Path(path).stat()
        key = (form, path, about.st_mtime_ns, about.st_size, about.st_ino)
        if self._opened is None or key != self._key:
            self.close()
            self._opened, self._key = OPENERS[form][1](Path(path)), key
        return self._opened

    def close(self) -> None:
        """Close the open file."""
        opened, self._opened = self._opened, None
        if opened is not None:
            opened.close()


def answer(request: dict[str, Any], path: str, files: _Files) -> tuple[dict[str, Any], dict[str, NDArray[Any]]]:
    """Answer a request for a file; an exception of a library becomes an answer too."""
    form = request["form"]
    try:
        opened = files.open(form, path)
        if request["ask"] == "metadata":
            return {"metadata": opened.metadata}, {}
        if request["ask"] == "names":
            return {"names": opened.names(), "metadata": opened.metadata}, {}
        if request["ask"] == "count":
            return {"count": opened.count()}, {}
        rows, wanted = request["rows"], request["wanted"]
        if request["ask"] == "some columns":
            names = set(opened.names())
            wanted = [name for name in wanted if name in names]
        found = opened.get(wanted, frozenset(request["dates"]), tuple(rows) if rows else None)
        columns = {name: np.asarray(values) for name, values in found.items()}
        if not rows:
            files.close()
        return {}, columns
    except PneudriveError as error:
        return {"error": {key: getattr(error, key) for key in FIELDS}}, {}
    except BaseException as error:  # libraries raise any exception; a panic of Rust is a BaseException
        if isinstance(error, (KeyboardInterrupt, SystemExit)):
            raise
        reason = (str(error).strip() or type(error).__name__).splitlines()[0]
        if isinstance(error, (KeyError, IndexError, AttributeError, TypeError)):
            reason = f"{type(error).__name__}: {reason}"
        files.close()
        what = f"the file cannot be read as {OPENERS[form][0]}"
        return {"error": {"what": what, "value": reason[:LONGEST_REASON]}}, {}


def _alike(request: dict[str, Any]) -> list[dict[str, NDArray[Any]]] | None:
    """Read several Parquet files with one query. Return None on an error.

    If this fails, reading the files one by one shows the faulty file.
    """
    if request["ask"] != "some columns" or len(request["paths"]) < 2:
        return None
    try:
        for path in request["paths"]:
            check_parquet(Path(path), [])
        return read_parquets([Path(path) for path in request["paths"]], request["wanted"])
    except BaseException as error:  # a panic of Rust is a BaseException
        if isinstance(error, (KeyboardInterrupt, SystemExit)):
            raise
        return None


def answers(request: dict[str, Any], files: _Files) -> tuple[list[dict[str, Any]], list[NDArray[Any]]]:
    """Answer for each file; the arrays of all files are sent together, each with its offset."""
    each, arrays = [], []
    end = 0
    alike = _alike(request)
    found = [({}, one) for one in alike] if alike else (answer(request, path, files) for path in request["paths"])
    for answer_of, columns in found:
        each.append(answer_of)
        answer_of["columns"] = {}
        for name, column in columns.items():
            if column.dtype.kind in "iufbMm":
                answer_of["columns"][name] = {"dtype": column.dtype.str, "shape": column.shape, "place": end}
                arrays.append(np.ascontiguousarray(column))
                end += arrays[-1].nbytes + -arrays[-1].nbytes % ALIGNED
            else:
                texts = [None if v is None else str(v) for v in column.ravel().tolist()]
                answer_of["columns"][name] = {"texts": texts, "shape": column.shape, "dtype": str(column.dtype)}
    return each, arrays


def send(connection: socket.socket, each: list[dict[str, Any]], arrays: list[NDArray[Any]]) -> None:
    """Send the answers: lengths of text and arrays, the text, the arrays."""
    text = json.dumps({"each": each}).encode()
    padding = [bytes(-array.nbytes % ALIGNED) for array in arrays]
    sizes = (len(text), sum(array.nbytes + len(pad) for array, pad in zip(arrays, padding, strict=True)))
    connection.sendall(b"".join(size.to_bytes(8, "little") for size in sizes) + text)
    for array, pad in zip(arrays, padding, strict=True):
        connection.sendall(array.reshape(-1).view(np.uint8).data)
        connection.sendall(pad)


def limit_memory(most: int) -> None:
    """Limit the memory of this process, if the system supports it."""
    if resource is not None:
        _, hard = resource.getrlimit(resource.RLIMIT_DATA)
        resource.setrlimit(resource.RLIMIT_DATA, (most if hard < 0 else min(most, hard), hard))


def _requests(connection: socket.socket) -> Iterator[dict[str, Any]]:
    with connection.makefile("rb") as stream:
        for line in stream:
            yield json.loads(line)


def main() -> None:
    """Answer requests until the other side closes the socket."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # only the client handles Ctrl-C
    warnings.simplefilter("ignore")
    connection = socket.socket(fileno=int(sys.argv[1]))
    files = _Files()
    limit_memory(int(sys.argv[2]))
    for request in _requests(connection):
        signal.alarm(request["seconds"])  # the default handler ends the process, even inside a library
        send(connection, *answers(request, files))
        signal.alarm(0)
