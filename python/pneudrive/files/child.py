"""How a process of our own is started: it imports what this one would, and nothing from the folder it runs in."""

from __future__ import annotations

import json
import sys

_START = (
    "import json,sys;sys.path[:]=json.loads(sys.argv.pop(1));"
    "from importlib import import_module;import_module(sys.argv.pop(1)).main()"
)


def command(module: str, *arguments: str) -> list[str]:
    """Give the command that runs ``main`` of a module of ours in a process of its own.

    ``python -m`` would put the current folder first in the search path: a file there that is called numpy.py would run.
    """
    return [sys.executable, "-I", "-c", _START, json.dumps([p for p in sys.path if p]), module, *arguments]
