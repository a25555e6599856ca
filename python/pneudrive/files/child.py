"""Start of child processes with the import path of this process, without the current folder."""

from __future__ import annotations

import json
import sys

_START = (
    "import json,signal,sys;signal.signal(signal.SIGINT,signal.default_int_handler);"
    "sys.path[:]=json.loads(sys.argv.pop(1));"
    "from importlib import import_module;import_module(sys.argv.pop(1)).main()"
)


def command(module: str, *arguments: str) -> list[str]:
    """Return the command that runs ``main`` of a module of pneudrive in a child process.

    ``python -m`` would search the current folder first, and could run a file numpy.py there. Ctrl-C ends the child even
    if this process ignores Ctrl-C, for example a server started by a script.
    """
    return [sys.executable, "-I", "-c", _START, json.dumps([p for p in sys.path if p]), module, *arguments]
