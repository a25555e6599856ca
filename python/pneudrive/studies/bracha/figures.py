"""The nine figures of the source paper."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pneudrive.studies.bracha.friction_curves import figure_5, figure_6, figure_8
from pneudrive.studies.bracha.rigs import figure_4, figure_7
from pneudrive.studies.bracha.stick_slip import figure_1, figure_2, figure_3
from pneudrive.studies.bracha.stops import figure_9

if TYPE_CHECKING:
    from collections.abc import Mapping

    from pneudrive.studies.bracha.experiments import Experiment
    from pneudrive.studies.bracha.figure import PaperFigure


def paper_figures(runs: Mapping[str, Experiment], seed: int = 0) -> dict[int, PaperFigure]:
    """Return all figures of the paper.

    Parameters
    ----------
    runs : mapping of Experiment
        Result of `run_experiments`.
    seed : int
        Seed of the sensors on the drive of figure 1.

    Returns
    -------
    dict of PaperFigure
        Tables by the figure's number in the paper.
    """
    figures = [
        figure_1(seed),
        figure_2(),
        figure_3(),
        figure_4(runs["speed"]),
        figure_5(runs["cycle"]),
        figure_6(runs["speed"]),
        figure_7(runs["pressure"]),
        figure_8(runs["pressure"]),
        figure_9(runs["stops"]),
    ]
    return {figure.number: figure for figure in figures}
