"""Prompts to the operator. While they wait, requests of other processes are served."""

from __future__ import annotations

import select
import sys
from typing import NamedTuple, Protocol

from pneudrive.campaign.storage.control import ABORT, CTRL_C, LOOK_S, RESUME, Requests

#: Ways of an answer.
AT_TERMINAL = "terminal"


class Prompt(Protocol):
    """Source of answers to prompts. This base class never answers."""

    @property
    def there(self) -> bool:
        """Whether answers are possible."""
        ...

    def show(self, text: str) -> None:
        """Show a text."""
        ...

    def line(self, seconds: float) -> str | None:
        """Wait for a line; return None if no line came."""
        ...


class Terminal:
    """The user at the terminal of this process, if there is a terminal."""

    def __init__(self) -> None:
        self._open = True

    @property
    def there(self) -> bool:
        """Whether standard input is a terminal."""
        try:
            return self._open and sys.stdin.isatty() and sys.stdout.isatty()
        except (AttributeError, ValueError):  # closed or missing
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
    """Answer in a pause: whether the campaign continues, who answered, and how."""

    goes_on: bool
    name: str
    how: str

    def __str__(self) -> str:
        """Return a description in words."""
        who = "at the keyboard" if self.how == AT_TERMINAL else f"by {self.name}"
        return f"{'resumed' if self.goes_on else 'ended'} {who}"


def wait_for_answer(requests: Requests, prompt: Prompt, operator: str) -> Answer:
    """Wait for an answer to a pause, at the terminal or from another process.

    Parameters
    ----------
    requests : Requests
    prompt : Prompt
    operator : str
        Name of a person who only presses Enter.
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
