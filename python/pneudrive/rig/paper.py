"""The source paper's figures from simulated data, each with the check of the paper's sentence."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pneudrive.rig.friction_curves import figure_5, figure_6, figure_8
from pneudrive.rig.stick_slip import figure_1, figure_2, figure_3

if TYPE_CHECKING:
    from pneudrive.rig.figure import PaperFigure
    from pneudrive.rig.simulated import SimulatedRig

__all__ = ["figure_1", "figure_2", "figure_3", "figure_5", "figure_6", "figure_8", "paper_figures"]


def paper_figures(rig: SimulatedRig | None = None, seed: int = 0) -> dict[int, PaperFigure]:
    """Make the figures 1, 2, 3, 5, 6 and 8; 4 and 7 are drawings of rigs, 9 needs a law of dwell.

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
