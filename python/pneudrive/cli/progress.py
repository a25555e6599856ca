"""Progress of long commands on the terminal."""

from __future__ import annotations

import json
import os
import sys
import time

from pneudrive.progress import Watch

FIRST_S = 1.0  # s; shorter work shows nothing
LINE_EVERY_S = 10.0  # s; between lines if stderr is a file
#: Environment variable; where it is "json", each report is a line {"done": ..., "total": ..., "task": ...} on stderr.
FORM, JSON = "PNEUDRIVE_PROGRESS", "json"


class _Line:
    """Progress line on stderr, overwritten in place; in a file, a line every ten seconds."""

    def __init__(self) -> None:
        self.began = self.written = time.monotonic()
        self.width = 0

    def __call__(self, done: float, total: float, task: str) -> None:
        """Write the progress."""
        now = time.monotonic()
        if now - self.began < FIRST_S:
            return
        share = f"{done:g} of {total:g}" if total else f"{done:g}"
        text = f"{task}: {share}"
        if sys.stderr.isatty():
            sys.stderr.write("\r" + text.ljust(self.width))
            self.width = len(text)
            if done >= total > 0:
                sys.stderr.write("\r" + " " * self.width + "\r")
                self.width = 0
        elif now - self.written >= LINE_EVERY_S:
            self.written = now
            sys.stderr.write(text + "\n")
        sys.stderr.flush()


def _as_json(done: float, total: float, task: str) -> None:
    sys.stderr.write(json.dumps({"done": done, "total": total, "task": task}) + "\n")
    sys.stderr.flush()


def on_terminal() -> Watch:
    """Return the watch of a command, which shows progress on stderr after the first second."""
    return Watch(_as_json if os.environ.get(FORM) == JSON else _Line())
