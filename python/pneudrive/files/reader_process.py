"""Process in which libraries written in C read files.

`pneudrive.files.tables` starts it, and sends requests over a pipe. A damaged file can affect only this process. An
exception is returned as answer. After a crash, a timeout or exhausted memory, the client starts another process.
"""

from __future__ import annotations

import resource
import signal
import sys
import warnings
from contextlib import suppress
from functools import lru_cache
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

import numpy as np

from pneudrive.errors import PneudriveError, RecordingError
from pneudrive.files.formats import LONGEST_REASON, OPENERS, Opened, plain


@lru_cache(maxsize=1)
def _opened(form: str, path: str, _state: tuple[int, int, int]) -> Opened:
    """Open a file. The last one stays open, because a request for columns usually follows a request for names."""
    return OPENERS[form][1](Path(path))


def answer(request: dict[str, Any]) -> Any:  # noqa: ANN401 - of each request its own
    """Answer a request for a file. An exception of a library is returned as answer."""
    form, path = request["form"], request["path"]
    try:
        about = Path(path).stat()
        opened = _opened(form, path, (about.st_mtime_ns, about.st_size, about.st_ino))
        if request["wanted"] is None:
            return opened.names, opened.metadata
        found = opened.get(request["wanted"], request["dates"])
        _opened.cache_clear()
        return {name: plain(np.asarray(values)) for name, values in found.items()}
    except PneudriveError as error:
        return error
    except BaseException as error:  # libraries raise any exception
        if isinstance(error, (KeyboardInterrupt, SystemExit)):
            raise
        reason = (str(error).strip() or type(error).__name__).splitlines()[0]
        if isinstance(error, (KeyError, IndexError, AttributeError, TypeError)):
            reason = f"{type(error).__name__}: {reason}"
        _opened.cache_clear()
        return RecordingError(f"the file cannot be read as {OPENERS[form][0]}", value=reason[:LONGEST_REASON])


def main() -> None:
    """Answer requests until the other side closes the pipe."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # only the client handles Ctrl-C
    warnings.simplefilter("ignore")
    connection, most = Connection(int(sys.argv[1])), int(sys.argv[2])
    _, hard = resource.getrlimit(resource.RLIMIT_DATA)
    resource.setrlimit(resource.RLIMIT_DATA, (most if hard < 0 else min(most, hard), hard))
    with suppress(EOFError, OSError):
        while True:
            request = connection.recv()
            signal.alarm(request["seconds"])  # the default handler ends the process, even inside a library
            connection.send(answer(request))
            signal.alarm(0)
