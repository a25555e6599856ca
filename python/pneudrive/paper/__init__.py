"""The source paper's figures from simulated data, each with the check of the paper's sentence."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pneudrive.paper.figure import PaperFigure
from pneudrive.paper.friction_curves import figure_5, figure_6, figure_8
from pneudrive.paper.stick_slip import figure_1, figure_2, figure_3

if TYPE_CHECKING:
    from pneudrive.rig.simulated import SimulatedRig

#: Figures of the paper that are not made here, and why.
NOT_REPRODUCED = {
    "4 and 7": "the rigs themselves: nothing to check",
    "9": "friction after stops of 15 s: needs a law of dwell, which the friction laws do not have yet",
}

__all__ = [
    "NOT_REPRODUCED",
    "PaperFigure",
    "figure_1",
    "figure_2",
    "figure_3",
    "figure_5",
    "figure_6",
    "figure_8",
    "paper_figures",
]


def paper_figures(rig: SimulatedRig | None = None, seed: int = 0) -> dict[int, PaperFigure]:
    """Make the figures 1, 2, 3, 5, 6 and 8; `NOT_REPRODUCED` says why the others are missing.

    Parameters
    ----------
    rig : SimulatedRig, optional
        The default rig where nothing is said.
    seed : int
        Of the noise of all sensors.

    Returns
    -------
    dict of PaperFigure
        By the figure's number in the paper.
    """
    figures = [figure_1(seed), figure_2(), figure_3(), figure_5(rig, seed), figure_6(rig, seed), figure_8(rig, seed)]
    return {figure.number: figure for figure in figures}
