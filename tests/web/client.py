"""Requests to a served folder; and what the page gives to copy, run as a user runs it."""

from __future__ import annotations

import shlex
from typing import Any

from pneudrive.cli.main import run
from web.conftest import Served


def get(served: Served, address: str, status: int = 200, **given: object) -> dict:
    answered = served.client.get(address, params=given, headers=served.headers)
    assert answered.status_code == status, answered.text
    return answered.json()


def post(served: Served, address: str, body: object, status: int = 200) -> dict:
    answered = served.client.post(address, json=body, headers=served.headers)
    assert answered.status_code == status, answered.text
    return answered.json()


def run_line(command: str) -> int:
    """Run the last line of a command; return its status."""
    program, *words = shlex.split(command.splitlines()[-1])
    assert program == "pneudrive"
    return run(words)


def run_python(text: str) -> dict[str, Any]:
    """Run lines of Python; return their names."""
    names: dict[str, Any] = {}
    exec(text, names)
    return names
