"""The source paper's figures: its sentence, ours, and whether it holds."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pneudrive.paper import NOT_REPRODUCED
from pneudrive.paper.friction_curves import RAMP_M
from pneudrive.report import style
from pneudrive.report.page import Picture, Section, Table, Text
from pneudrive.report.words import plural, sentence

if TYPE_CHECKING:
    from collections.abc import Mapping

    from matplotlib.figure import Figure

    from pneudrive.paper import PaperFigure


def section(figures: Mapping[int, PaperFigure]) -> Section:
    """Table of sentences and checks, then figures 5, 6 and 8."""
    held = sum(f.holds for f in figures.values())
    rows = [
        (str(f.number), f.sentence, sentence(f.measured), "holds" if f.holds else "DOES NOT HOLD")
        for f in figures.values()
    ]
    rows += [(number, "–", why, "not checked") for number, why in NOT_REPRODUCED.items()]
    blocks: list = [
        Text(
            "The paper prints figures but no data, and does not name drive, seals or sensors. What can be checked "
            "is whether a simulated drive and rig with parameters of our own, all of them assumed, show what the "
            "paper says in words."
        ),
        Text(
            f"{held} of {plural(len(figures), 'sentence')} hold."
            if held == len(figures)
            else f"{held} of {plural(len(figures), 'sentence')} hold; those that do not: figure "
            f"{', '.join(str(f.number) for f in figures.values() if not f.holds)}.",
            "holds" if held == len(figures) else "fails",
        ),
        Table(("figure", "what the paper says", "what ours shows", "verdict"), tuple(rows), numbers_from=9),
        Text(
            "What is assumed: all values of rig and drive (listed under provenance); speeds spaced logarithmically, "
            f"as the paper does not say; in figure 5 a servo that turns over {1e3 * RAMP_M:g} mm, so that the peak "
            "lasts for some samples: with the rig's own limits it would lie between two of them. The stopping time, "
            "which the paper names as the other cause of that peak, is not in these friction laws."
        ),
        Text(
            "A sentence that holds here says that the laws and the measuring chain can show the effect, since the "
            "parameters were chosen so that it is there; it is no evidence that a given drive behaves so.",
            "note",
        ),
    ]
    drawers = {5: (cycle, "reversal"), 6: (over_speed, "speed"), 8: (over_pressure, "pressure")}
    for number, (drawer, name) in drawers.items():
        if number in figures:
            figure = figures[number]
            caption = f"As the paper's figure {number}. {figure.title}. {sentence(figure.measured)}"
            blocks.append(Picture(f"paper-{number}-{name}", caption, drawer(figure), synthetic=True))
    return Section("paper", "The source paper's figures from the simulated rig", tuple(blocks), synthetic=True)


def cycle(data: PaperFigure) -> Figure:
    """Figure 5: friction after a turn, all of it and its beginning."""
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
    right.set_xlim(0, 6.0)
    right.set_title("the first 6 s")
    left.set_ylabel("friction / N")
    left.legend(loc="upper right", markerscale=5)
    return figure


def over_speed(data: PaperFigure) -> Figure:
    """Figure 6: friction over speed, on the paper's linear axis and on a logarithmic one."""
    figure = style.new_figure(2.9)
    axes = figure.subplots(1, 2, sharey=True)
    c = data.columns
    speed = 1e3 * c["speed_m_s"]
    for axis in axes:
        axis.plot(speed, c["friction_true_n"], "-", color=style.GREY, lw=2.0, label="true")
        axis.plot(speed, c["friction_n"], "o", color=style.BLACK, mfc="white", ms=3.0, label="the paper's protocol")
        u = c["expanded_uncertainty_n"]
        settled = c["friction_settled_n"]
        axis.fill_between(speed, settled - u, settled + u, color=style.BAND, lw=0, label="U (k = 2) of the settled")
        axis.plot(speed, settled, "x", color=style.BLUE, ms=3.5, mew=0.8, label="settled samples")
        axis.set_xlabel("speed / (mm/s)")
    axes[0].set_title("linear axis, as in the paper")
    style.logarithmic(axes[1])
    axes[1].set_title("logarithmic axis")
    axes[0].set_ylabel("friction / N")
    axes[0].legend(loc="lower right")
    return figure


def over_pressure(data: PaperFigure) -> Figure:
    """Figure 8: a curve for each pressure, and how deep its dip is."""
    figure = style.new_figure(3.1)
    left, right = figure.subplots(1, 2, width_ratios=(2, 1))
    c = data.columns
    bar = c["gauge_pa"] / 1e5
    chosen = np.unique(np.linspace(0, bar.size - 1, 5).astype(int))
    for i, friction in enumerate(c["friction_n"]):
        if i in chosen:
            look = style.look(int(np.flatnonzero(chosen == i)[0]))
            left.plot(
                1e3 * c["speed_m_s"],
                friction,
                linestyle=look.linestyle,
                marker=look.marker,
                color=look.color,
                ms=2.5,
                lw=0.9,
                label=f"{bar[i]:.1f} bar",
            )
        else:
            left.plot(1e3 * c["speed_m_s"], friction, color=style.GREY, lw=0.4)
    style.logarithmic(left)
    left.set_xlabel("speed / (mm/s)")
    left.set_ylabel("friction / N")
    handles, labels = left.get_legend_handles_labels()
    left.legend(handles[::-1], labels[::-1], loc="upper right")
    right.plot(bar, 100 * c["dip"], "o-", color=style.BLACK, ms=3.5)
    right.set_ylim(bottom=0)
    right.set_xlabel("gauge pressure / bar")
    right.set_ylabel("fall to the minimum / %")
    return figure
