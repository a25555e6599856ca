"""``campaign.log``: what happened when, in words."""

from __future__ import annotations

import contextlib
import logging
import sys
import threading
from typing import TYPE_CHECKING, Any, TextIO

from pneudrive.campaign.lock import now

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

#: Thread on which bluesky prints.
ENGINE_THREAD = "bluesky-run-engine"
#: What bluesky raises within a plan that somebody ends.
ENDED_ON_PURPOSE = ("RequestAbort", "RequestStop", "PlanHalt", "CancelledError")


class Journal:
    """Appends lines, each with date and time; never the reason why a campaign ends.

    Parameters
    ----------
    path : Path
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self._lock = threading.Lock()

    def write(self, text: str) -> None:
        """Append a line; on a full disk it is lost."""
        line = " | ".join(part for part in text.splitlines() if part.strip())
        with self._lock, contextlib.suppress(OSError), self._path.open("a", encoding="utf-8") as file:
            file.write(f"{now()} {line}\n")

    @contextlib.contextmanager
    def engine_output(self) -> Iterator[None]:
        """Bring what bluesky prints and logs into the journal: on the terminal the campaign speaks for itself."""
        logger = logging.getLogger("bluesky")
        handler = _Handler(self)
        kept = logger.propagate
        logger.addHandler(handler)
        logger.propagate = False
        out = _Output(sys.stdout, self)
        try:
            with contextlib.redirect_stdout(out):  # type: ignore[type-var]
                yield
        finally:
            logger.removeHandler(handler)
            logger.propagate = kept


class _Handler(logging.Handler):
    def __init__(self, journal: Journal) -> None:
        super().__init__(logging.WARNING)
        self._journal = journal

    def emit(self, record: logging.LogRecord) -> None:
        if record.exc_info and record.exc_info[0] is not None and record.exc_info[0].__name__ in ENDED_ON_PURPOSE:
            return
        self._journal.write(f"bluesky: {self.format(record)}")


class _Output:
    """Standard output, but for the thread of bluesky."""

    def __init__(self, out: TextIO, journal: Journal) -> None:
        self._out, self._journal = out, journal

    def write(self, text: str) -> int:
        if threading.current_thread().name != ENGINE_THREAD:
            return self._out.write(text)
        if text.strip():
            self._journal.write(f"bluesky: {text}")
        return len(text)

    def __getattr__(self, name: str) -> Any:  # noqa: ANN401 - whatever a stream has
        return getattr(self._out, name)
