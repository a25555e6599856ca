"""What `test_opcua_campaign` kills: a process that serves a rig."""

from __future__ import annotations

import os
import sys
from typing import TYPE_CHECKING

from pneudrive.cli.main import run
from pneudrive.rig import load_rig
from pneudrive.rig.opcua import server as _server  # imported here, once, by the server that forks the children

if TYPE_CHECKING:
    from multiprocessing.connection import Connection

assert _server
load_rig("default").identity()


def serve(options: list[str], printed: Connection) -> None:
    """Run the command; what it prints goes into a pipe."""
    os.dup2(printed.fileno(), 1)
    sys.stdout = os.fdopen(1, "w")
    sys.exit(run(["rig", "serve", *options]))
