"""The nine figures of the source paper."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pneudrive.report import axes as draw
from pneudrive.report import style
from pneudrive.report.campaign.rig_diagram import rig_diagram
from pneudrive.studies.bracha.friction_curves import figure_5, figure_6, figure_8
from pneudrive.studies.bracha.stick_slip import figure_1, figure_2, figure_3, figure_4, figure_7, figure_9

if TYPE_CHECKING:
    from collections.abc import Mapping

    from matplotlib.figure import Figure

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


# --- Pictures of the source paper's figures 4 to 9.

#: Travel after a stop that figure 9 shows, m.
SHOWN_M = 3e-3


def rig(data: PaperFigure) -> Figure:
    """Draw figures 4 and 7: the rig."""
    assert data.rig is not None
    return rig_diagram(*data.rig)


def cycle(data: PaperFigure) -> Figure:
    """Draw figure 5: friction after a turn, the stroke and its start."""
    figure = style.new_figure(2.7)
    left, right = figure.subplots(1, 2, sharey=True, width_ratios=(2, 1))
    c = data.columns
    for axis in (left, right):
        axis.plot(c["time_s"], c["friction_n"], ".", color=style.GREY, ms=1.2, label="every sample")
        axis.plot(c["time_s"], c["friction_smoothed_n"], color=style.BLACK, lw=0.8, label="moving average of 5")
        axis.plot(c["time_s"], c["friction_mean_n"], "--", color=style.ORANGE, label="mean of the rest of the stroke")
        axis.set_xlabel("time after the turn / s")
    low = float(np.quantile(c["friction_n"][c["friction_n"].size // 10 :], 0.001))
    left.set_ylim(low - 0.5, 1.05 * data.quantities["peak_n"] + 0.6)
    right.set(xlim=(0, 6.0), title="the first 6 s")
    left.set_ylabel("friction / N")
    left.legend(loc="upper right", markerscale=5)
    return figure


def over_speed(data: PaperFigure) -> Figure:
    """Draw figure 6: friction over speed, on linear and logarithmic axes; below it, friction minus the ground truth."""
    figure = style.new_figure(4.2)
    axes, below = figure.subplots(2, 2, sharex="col", sharey="row", height_ratios=(2, 1))
    c = data.columns
    speed = 1e3 * c["speed_m_s"]
    for axis in axes:
        axis.plot(speed, c["friction_n"], "o", color=style.BLACK, mfc="white", ms=3.5, label="force, as in the paper")
        axis.plot(speed, c["air_n"], ":", color=style.ORANGE, label="part of the air")
        axis.plot(speed, c["friction_settled_n"], "x", color=style.BLUE, ms=3.5, mew=0.8, label="seal, settled samples")
        axis.plot(speed, c["friction_true_n"], "-", color=style.GREY, lw=0.8, label="seal, true in each cycle")
        axis.set_ylim(bottom=0)
    for axis in below:
        low, high = (1e3 * (c[name] - c["friction_true_n"]) for name in ("low_n", "high_n"))
        draw.tinted(axis, speed, (low, high), "95 % band")
        axis.plot(speed, 1e3 * (c["friction_settled_n"] - c["friction_true_n"]), "x", color=style.BLUE, ms=3.5, mew=0.8)
        axis.axhline(0, color=style.GREY, lw=0.8)
        axis.set_xlabel("speed / (mm/s)")
    below[0].set_ylabel("seal − true / mN")
    style.headroom(below[0], below=0.35)
    below[0].legend(loc="lower right")
    axes[0].set_title("linear axis, as in the paper")
    style.logarithmic(axes[1])
    axes[1].set_title("logarithmic axis")
    axes[0].set_ylabel("force / N")
    axes[0].legend(loc="center right")
    return figure


def over_pressure(data: PaperFigure) -> Figure:
    """Draw figure 8: the sensor's force at each pressure, and its parts, seal and air."""
    figure = style.new_figure(3.1)
    left, middle, right = figure.subplots(1, 3, sharey=True)
    c = data.columns
    bar = c["gauge_pa"] / 1e5
    parts = ((left, "friction_n", "force sensor, as in the paper"), (middle, "seal_n", "part of the seal"))
    for axis, name, title in (*parts, (right, "air_n", "part of the air")):
        for i, values in enumerate(c[name]):
            look, label = style.ramp(i, bar.size), f"{bar[i]:.1f} bar"
            axis.plot(1e3 * c["speed_m_s"], values, **look._asdict(), ms=2.5, lw=0.9, label=label)
        style.logarithmic(axis)
        axis.set(title=title, xlabel="speed / (mm/s)")
    left.set_ylabel("force / N")
    left.set_ylim(bottom=0)
    handles, labels = left.get_legend_handles_labels()
    right.legend(handles[::-1], labels[::-1], loc="upper left")
    return figure


def stop(data: PaperFigure) -> Figure:
    """Draw figure 9: friction through one stop over time, around the restart over travel, and peaks over speed."""
    figure = style.new_figure(2.9)
    left, middle, right = figure.subplots(1, 3, width_ratios=(1.4, 1, 1))
    middle.sharey(left)
    c = data.columns
    left.plot(c["time_s"], c["friction_n"], ".-", color=style.BLACK, ms=1.5, lw=0.6)
    left.plot(c["time_s"], c["running_n"], "--", color=style.ORANGE, label="uninterrupted")
    left.set(xlabel="time since the stop / s", ylabel="force against motion / N")
    around = c["friction_n"][(c["time_s"] > -1.0) & (c["time_s"] < c["time_s"][-1] - 1.0)]  # without the turns
    span = float(np.ptp(around))
    left.set_ylim(float(around.min()) - 0.35 * span, float(around.max()) + 0.1 * span)
    left.legend(loc="lower center")
    top = int(np.argmax(c["friction_n"]))
    travel = 1e3 * np.abs(c["position_m"] - c["position_m"][int(np.searchsorted(c["time_s"], 1.0))])
    after = slice(max(top - 40, 0), None)
    middle.plot(travel[after], c["friction_n"][after], ".-", color=style.BLACK, ms=2.0, lw=0.6)
    middle.plot(travel[after], c["running_n"][after], "--", color=style.ORANGE)
    middle.set_xlim(-0.02 * 1e3 * SHOWN_M, 1e3 * SHOWN_M)
    middle.set_xlabel("travel from the stop / mm")
    right.errorbar(1e3 * c["speed_m_s"], c["increment_n"], c["increment_width_n"], fmt="o", color=style.BLACK)
    style.logarithmic(right)
    right.minorticks_off()
    right.set_xticks(1e3 * c["speed_m_s"])
    right.set_ylim(bottom=0)
    right.set(xlabel="speed of the restart / (mm/s)", ylabel="peak above uninterrupted / N")
    return figure


#: Number -> name of the file, and function that draws it.
DRAWINGS = {
    4: ("rig", rig),
    5: ("reversal", cycle),
    6: ("speed", over_speed),
    7: ("rig-under-pressure", rig),
    8: ("pressure", over_pressure),
    9: ("stop", stop),
}
