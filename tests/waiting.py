"""Waiting for a state of another thread or process."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING, TypeVar

if TYPE_CHECKING:
    from collections.abc import Callable

PATIENCE_S = 120.0  # on a busy machine

Answer = TypeVar("Answer")


def until(answer: Callable[[], Answer | None], pause: Callable[[float], None] = time.sleep) -> Answer:
    """Return the first answer that is true."""
    deadline = time.monotonic() + PATIENCE_S
    while not (found := answer()):
        assert time.monotonic() < deadline, "it never became true"
        pause(0.02)
    return found
