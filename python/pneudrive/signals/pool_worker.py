"""A process of the pool: work comes on stdin, the result goes to stdout."""

from __future__ import annotations

import pickle
import sys

from pneudrive.batching import many_objects
from pneudrive.errors import PneudriveError
from pneudrive.signals.pool import EXIT_INTERRUPTED


def main() -> None:
    """Read (function, arguments); write the returned list or the error."""
    with many_objects():
        work, task = pickle.load(sys.stdin.buffer)
    try:
        result: object = work(*task)
    except PneudriveError as error:
        result = error
    except KeyboardInterrupt:
        sys.exit(EXIT_INTERRUPTED)
    pickle.dump(result, sys.stdout.buffer)
