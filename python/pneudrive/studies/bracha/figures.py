"""The nine figures of the source paper."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from pneudrive.campaign.storage.folder import Campaign
from pneudrive.figures import THIN, Axis, Band, Figure, Line, Look, Markers, Panel, Rule, ramp
from pneudrive.report.layout_figure import rig_diagram
from pneudrive.studies.bracha.figure import PaperFigure
from pneudrive.studies.bracha.friction_curves import figure_5, figure_6, figure_8
from pneudrive.studies.bracha.stick_slip import figure_1, figure_2, figure_3, figure_4, figure_7, figure_9


def paper_figures(runs: Mapping[str, Campaign]) -> dict[int, PaperFigure]:
    """Return all figures of the paper.

    Parameters
    ----------
    runs : mapping of Campaign
        Result of `run_experiments`.

    Returns
    -------
    dict of PaperFigure
        Figures by their number in the paper.
    """
    figures = [
        figure_1(),
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


# --- Pictures of the source paper's figures 4 to 9.


#: Travel after a stop shown in figure 9, m.
SHOWN_M = 3e-3
DOTS, DASHED = Look("grey", "-", "."), Look("orange", "--")


def rig(data: PaperFigure) -> Figure:
    """Draw figures 4 and 7: the rig."""
    assert data.rig is not None
    return rig_diagram(*data.rig)


def cycle(data: PaperFigure) -> Figure:
    """Draw figure 5: friction after a turn, over the whole stroke and over its start."""
    c = data.columns
    marks = [
        Markers(c["time_s"], c["friction_n"], "every sample", DOTS, size=1.2),
        Line(c["time_s"], c["friction_smoothed_n"], "moving average of 5", width=0.8),
        Line(c["time_s"], c["friction_mean_n"], "mean of the rest of the stroke", DASHED),
    ]
    low = float(np.quantile(c["friction_n"][c["friction_n"].size // 10 :], 0.001))
    force = Axis("friction / N", low=low - 0.5, high=1.05 * data.quantities["peak_n"] + 0.6)
    start = Panel(marks, "the first 6 s", Axis("time after the turn / s", low=0.0, high=6.0))
    shared = {"columns": 2, "widths": (2, 1), "share_y": "all", "row_in": 2.7, "rest_in": 0.0}
    return Figure([Panel(marks), start], "time after the turn / s", force, **shared)


def over_speed(data: PaperFigure) -> Figure:
    """Draw figure 6: friction over speed, on linear and logarithmic axes; below, friction minus its true value."""
    c, settled = data.columns, Look("blue", "-", "x")
    speed, true = c["speed_m_s"], c["friction_true_n"]
    above = [
        Markers(speed, c["friction_n"], "force, as in the paper", size=3.5),
        Line(speed, c["air_n"], "part of the air", Look("orange", ":")),
        Markers(speed, c["friction_settled_n"], "seal, settled samples", settled, size=3.5),
        Line(speed, true, "seal, true in each cycle", THIN, 0.8),
    ]
    below = [
        Band(speed, c["low_n"] - true, c["high_n"] - true, "95 % band"),
        Rule(y=0.0),
        Markers(speed, c["friction_settled_n"] - true, look=settled, size=3.5),
    ]
    linear, logarithmic, label = "speed / (mm/s)", Axis("speed / (mm/s)", "log"), "seal − true / mN"
    panels = [
        Panel(above, "linear axis, as in the paper", linear, FROM_ZERO),
        Panel(above, "logarithmic axis", logarithmic, FROM_ZERO),
        Panel(below, "", linear, label),
        Panel(below, "", logarithmic, label),
    ]
    shared = {"share_x": "col", "share_y": "row", "heights": (2, 1), "row_in": 2.1, "rest_in": 0.2}
    return Figure(panels, columns=2, **shared)


FROM_ZERO = Axis("force / N", low=0.0)


def over_pressure(data: PaperFigure) -> Figure:
    """Draw figure 8: the sensor's force at each pressure, and its parts, seal and air."""
    c, panels = data.columns, []
    bar = c["gauge_pa"] / 1e5
    parts = (
        ("friction_n", "force sensor, as in the paper"),
        ("seal_n", "part of the seal"),
        ("air_n", "part of the air"),
    )
    for name, title in parts:
        curves = [
            Markers(c["speed_m_s"], values, f"{bar[i]:.1f} bar", ramp(i, bar.size), size=2.5, filled=True, joined=True)
            for i, values in enumerate(c[name])
        ]
        panels.append(Panel(curves, title))
    shared = {"columns": 3, "share_y": "all", "row_in": 3.1, "rest_in": 0.0, "entries": 8}
    return Figure(panels, Axis("speed / (mm/s)", "log"), FROM_ZERO, **shared)


def stop(data: PaperFigure) -> Figure:
    """Draw figure 9: friction through one stop over time, around the restart over travel, and peaks over speed."""
    c = data.columns
    around = c["friction_n"][(c["time_s"] > -1.0) & (c["time_s"] < c["time_s"][-1] - 1.0)]  # without the turns
    span = float(np.ptp(around))
    ends: dict[str, Any] = {"low": float(around.min()) - 0.35 * span, "high": float(around.max()) + 0.1 * span}
    top = int(np.argmax(c["friction_n"]))
    travel = np.abs(c["position_m"] - c["position_m"][int(np.searchsorted(c["time_s"], 1.0))])
    after, dots = slice(max(top - 40, 0), None), Look("black", "-", ".")

    def through(x: np.ndarray, part: slice, size: float) -> list[Any]:
        friction, running = c["friction_n"][part], c["running_n"][part]
        return [Markers(x, friction, "", dots, size=size, joined=True), Line(x, running, "uninterrupted", DASHED)]

    increment, width = c["increment_n"], c["increment_width_n"]
    peaks = Markers(c["speed_m_s"], increment, "", Look(), increment - width, increment + width, filled=True)
    near = Axis("travel from the stop / mm", low=-0.02 * SHOWN_M, high=SHOWN_M)
    panels = [
        Panel(
            through(c["time_s"], slice(None), 1.5),
            "",
            "time since the stop / s",
            Axis("force against motion / N", **ends),
        ),
        Panel(through(travel[after], after, 2.0), "", near, Axis("", **ends)),
        Panel([peaks], "", Axis("speed of the restart / (mm/s)", "log"), Axis("peak above uninterrupted / N", low=0.0)),
    ]
    return Figure(panels, columns=3, widths=(1.4, 1, 1), row_in=2.9, rest_in=0.0)


#: Number -> name of the file, and function that draws it.
DRAWINGS = {
    4: ("rig", rig),
    5: ("reversal", cycle),
    6: ("speed", over_speed),
    7: ("rig-under-pressure", rig),
    8: ("pressure", over_pressure),
    9: ("stop", stop),
}
