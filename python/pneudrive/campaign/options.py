"""Options of a campaign run."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Options:
    """Options of a campaign run.

    Parameters
    ----------
    operator : str
        Name of the person at the rig.
    yes : bool
        Operator's steps count as done without an operator.
    patience_s : float
        Longest wait for good conditions before the campaign ends.
    steady_s : float
        Time of good conditions before the campaign continues.
    look_s : float
        Interval of the queries of the rig while waiting.
    attempts : int
        Number of attempts at a cycle before the campaign ends.
    bad_in_a_row : int
        Number of cycles in a row with serious flags after which the campaign ends: a sensor is broken.
    """

    operator: str = ""
    yes: bool = False
    patience_s: float = 600.0
    steady_s: float = 3.0
    look_s: float = 1.0
    attempts: int = 5
    bad_in_a_row: int = 3
