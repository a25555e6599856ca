"""Start of child processes with the import path of this one, without the current folder."""

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

    ``python -m`` would put the current folder first in the search path, and run a file numpy.py in it. Ctrl-C also ends
    the child if this process ignores Ctrl-C, for example a server that a script starts.
    """
    return [sys.executable, "-I", "-c", _START, json.dumps([p for p in sys.path if p]), module, *arguments]
