"""How a campaign is run."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Options:
    """How a campaign is run.

    Parameters
    ----------
    operator : str
        Who is at the rig.
    yes : bool
        Operator's steps are taken as done: nobody is there.
    patience_s : float
        How long to wait for conditions to come back before the campaign ends.
    steady_s : float
        How long they must have been back before it goes on.
    look_s : float
        How often the rig is asked meanwhile.
    attempts : int
        How often one cycle is begun before the campaign ends.
    bad_in_a_row : int
        So many cycles with serious flags one after the other end the campaign: a sensor is broken.
    """

    operator: str = ""
    yes: bool = False
    patience_s: float = 600.0
    steady_s: float = 3.0
    look_s: float = 1.0
    attempts: int = 5
    bad_in_a_row: int = 3
