"""Asking whoever is at the rig, without losing sight of other processes."""

from __future__ import annotations

import select
import sys
from typing import NamedTuple, Protocol

from pneudrive.campaign.control import ABORT, CTRL_C, LOOK_S, RESUME, Requests

#: How an answer came.
AT_TERMINAL = "terminal"


class Prompt(Protocol):
    """Somebody who can be asked."""

    @property
    def there(self) -> bool:
        """Whether anybody would answer."""
        ...

    def show(self, text: str) -> None:
        """Show a text."""
        ...

    def line(self, seconds: float) -> str | None:
        """Wait for a line; None where none has come."""
        ...


class Terminal:
    """Whoever sits before the terminal that the process was started from; nobody where there is none."""

    def __init__(self) -> None:
        self._open = True

    @property
    def there(self) -> bool:
        """Whether standard input is a terminal."""
        try:
            return self._open and sys.stdin.isatty() and sys.stdout.isatty()
        except (AttributeError, ValueError):  # closed, or none
            return False

    def show(self, text: str) -> None:
        """Show a text."""
        try:
            sys.stdout.write(text)
            sys.stdout.flush()
        except (OSError, ValueError):
            self._open = False

    def line(self, seconds: float) -> str | None:
        """Wait for a line."""
        ready, _, _ = select.select([sys.stdin], [], [], seconds)
        if not ready:
            return None
        text = sys.stdin.readline()
        self._open = bool(text)
        return text.strip() if text else None


class Answer(NamedTuple):
    """What somebody said in a pause: whether it goes on, who said it, and how."""

    goes_on: bool
    name: str
    how: str

    def __str__(self) -> str:
        """Say it in words."""
        who = "at the keyboard" if self.how == AT_TERMINAL else f"by {self.name}"
        return f"{'resumed' if self.goes_on else 'ended'} {who}"


def wait_for_answer(requests: Requests, prompt: Prompt, operator: str) -> Answer:
    """Wait until somebody says whether a paused campaign goes on: at the terminal, or from another process.

    Parameters
    ----------
    requests : Requests
    prompt : Prompt
    operator : str
        Who answers with Enter alone.
    """
    while True:
        request = requests.take()
        if request is not None and (request.word in (ABORT, RESUME) or request.by == CTRL_C):
            return Answer(request.word == RESUME, request.by, "another process")
        if not prompt.there:
            requests.wait()
            continue
        line = prompt.line(LOOK_S)
        if line is not None:
            return Answer(line.lower() not in ("a", "abort", "end"), line or operator, AT_TERMINAL)
