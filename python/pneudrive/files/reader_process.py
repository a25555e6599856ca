"""Process in which libraries written in C read files.

`pneudrive.files.tables` starts it, and sends requests over a pipe. A damaged file can affect only this process. An
exception is returned as answer. After a crash, a timeout or exhausted memory, the client starts another process.
"""

from __future__ import annotations

import signal
import sys
import warnings
from contextlib import suppress
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

import numpy as np

from pneudrive.errors import PneudriveError, RecordingError
from pneudrive.files.formats import LONGEST_REASON, OPENERS, Opened, plain

resource = None
with suppress(ImportError):  # not on Windows
    import resource


class _Files:
    """Cache of the last opened file, because a request for columns usually follows a request for names."""

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


def answer(request: dict[str, Any], files: _Files) -> Any:  # noqa: ANN401 - of each request its own
    """Answer a request for a file. An exception of a library is returned as answer."""
    form = request["form"]
    try:
        opened = files.open(form, request["path"])
        if request["ask"] == "names":
            return opened.names(), opened.metadata
        if request["ask"] == "count":
            return opened.count()
        found = opened.get(request["wanted"], request["dates"], request["rows"])
        columns = {name: plain(np.asarray(values)) for name, values in found.items()}
        if not request["rows"]:
            files.close()
    except PneudriveError as error:
        return error
    except BaseException as error:  # libraries raise any exception
        if isinstance(error, (KeyboardInterrupt, SystemExit)):
            raise
        reason = (str(error).strip() or type(error).__name__).splitlines()[0]
        if isinstance(error, (KeyError, IndexError, AttributeError, TypeError)):
            reason = f"{type(error).__name__}: {reason}"
        files.close()
        return RecordingError(f"the file cannot be read as {OPENERS[form][0]}", value=reason[:LONGEST_REASON])
    else:
        return columns


def limit_memory(most: int) -> None:
    """Limit the memory of this process, if the system supports it."""
    if resource is not None:
        _, hard = resource.getrlimit(resource.RLIMIT_DATA)
        resource.setrlimit(resource.RLIMIT_DATA, (most if hard < 0 else min(most, hard), hard))


def main() -> None:
    """Answer requests until the other side closes the pipe."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # only the client handles Ctrl-C
    warnings.simplefilter("ignore")
    files, connection = _Files(), Connection(int(sys.argv[1]))
    limit_memory(int(sys.argv[2]))
    with suppress(EOFError, OSError):
        while True:
            request = connection.recv()
            signal.alarm(request["seconds"])  # the default handler ends the process, even inside a library
            connection.send(answer(request, files))
            signal.alarm(0)
