"""Asking whoever is at the rig, without losing sight of other processes."""

from __future__ import annotations

import select
import sys
from typing import TYPE_CHECKING, Protocol

from pneudrive.campaign.control import ABORT, CTRL_C, LOOK_S, RESUME, Requests
from pneudrive.campaign.lock import now, user

if TYPE_CHECKING:
    from pneudrive.campaign.session import Session


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


def go_on(session: Session, requests: Requests, prompt: Prompt) -> bool:
    """Wait, while a campaign is paused, until somebody says whether it goes on.

    Where the pause asks the operator for something, going on confirms it: the answer, with name and time, is left in
    the session.

    Returns
    -------
    bool
        False: end the campaign.
    """
    question = session.question
    name = session.options.operator or user()
    if question:
        text = f"Operator's step: {question}\nEnter: done (as {name}), another name: done by that one, a: end > "
        session.state("operator", question)
    else:
        text = (
            f"Paused after {session.now}; the axis is at rest, the pressure released.\n"
            "Enter: go on, a: end the campaign > "
        )
        session.state("paused", f"after {session.now}")
    session.journal.write(f"paused{': ' + question if question else ''}")
    session.display.suspend()
    if prompt.there:
        prompt.show(text)
    else:
        folder = session.campaign.path
        session.display.say(f"{text.splitlines()[0]} To go on: pneudrive campaign resume {folder}")
    if not _answered(session, requests, prompt, name):
        return False
    session.display.go_on()
    return True


def _answered(session: Session, requests: Requests, prompt: Prompt, name: str) -> bool:
    while True:
        request = requests.take()
        if request is not None and (request.word == ABORT or request.by == CTRL_C):
            session.tell(f"ended by {request.by}")
            return False
        if request is not None and request.word == RESUME:
            session.answer = {"name": request.by, "time": now(), "how": "another process"}
            session.journal.write(f"resumed by {request.by}")
            return True
        line = prompt.line(LOOK_S) if prompt.there else None
        if line is None:
            if not prompt.there:
                requests.wait()
            continue
        if line.lower() in ("a", "abort", "end"):
            session.tell("ended at the keyboard")
            return False
        session.answer = {"name": line or name, "time": now(), "how": "terminal"}
        session.journal.write("resumed at the keyboard")
        return True
