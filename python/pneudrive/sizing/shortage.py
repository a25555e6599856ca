"""Limits that a choice of parts misses, in numbers and in words."""

from __future__ import annotations

from typing import NamedTuple


class Shortage(NamedTuple):
    """Missed limit of a choice.

    Attributes
    ----------
    limit : str
        What it cannot do.
    share : float
        What it can do at most, over what is needed; below 1. 0 where no change of the task helps.
    said : str
        The same in words.
    """

    limit: str
    share: float
    said: str
