"""A process that characterises part of a campaign: work comes on stdin, the summaries go to stdout."""

from __future__ import annotations

import pickle
import sys

from pneudrive.characterise.campaign import EXIT_INTERRUPTED, work
from pneudrive.errors import PneudriveError


def main() -> None:
    """Read (sources, choice), write a list of summaries or the error that stopped it."""
    sources, choice = pickle.load(sys.stdin.buffer)
    try:
        result: object = work(sources, choice)
    except PneudriveError as error:
        result = error
    except KeyboardInterrupt:
        sys.exit(EXIT_INTERRUPTED)
    pickle.dump(result, sys.stdout.buffer)


if __name__ == "__main__":
    main()
