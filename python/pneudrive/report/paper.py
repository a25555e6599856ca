"""The source paper's figures: its sentence, ours, and whether it holds; stick-slip in time and phase plane."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pneudrive.report import style
from pneudrive.report.page import Picture, Section, Table, Text
from pneudrive.report.words import plural, sentence

if TYPE_CHECKING:
    from collections.abc import Mapping

    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from pneudrive.rig import PaperFigure

#: Figures that the simulated rig does not show yet, and why.
NOT_YET = (
    ("4 and 7", "photographs of the rigs: nothing to check"),
    ("9", "friction after stops of 15 s: needs a law of dwell, which the friction laws do not have yet"),
)
STICK_SLIP = (1, 2, 3)
SHOWN_S = 10.0


def section(figures: Mapping[int, PaperFigure]) -> Section:
    """Table of sentences and checks, then figures 5, 6 and 8."""
    held = sum(f.holds for f in figures.values())
    rows = [
        (str(f.number), f.sentence, sentence(f.measured), "holds" if f.holds else "DOES NOT HOLD")
        for f in figures.values()
    ]
    rows += [(number, "–", why, "not checked") for number, why in NOT_YET]
    blocks: list = [
        Text(
            "The paper prints figures but no data, and does not name drive, seals or sensors. What can be checked is "
            "whether a simulated drive and rig with parameters of our own, all of them assumed, show what the paper says "
            "in words."
        ),
        Text(
            f"{held} of {plural(len(figures), 'sentence')} hold." if held == len(figures) else
            f"{held} of {plural(len(figures), 'sentence')} hold; those that do not: figure "
            f"{', '.join(str(f.number) for f in figures.values() if not f.holds)}.",
            "holds" if held == len(figures) else "fails",
        ),
        Table(("figure", "what the paper says", "what ours shows", "verdict"), tuple(rows), numbers_from=9),
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


def stick_slip_section(figures: Mapping[int, PaperFigure]) -> Section | None:
    """Figures 1 to 3: time and phase plane."""
    shown = [figures[n] for n in STICK_SLIP if n in figures]
    if not shown:
        return None
    rows = []
    for f in shown:
        q = f.quantities
        cells = (f"{1e3 * q['mean_speed_m_s']:.2f}", f"{q['periods']:.0f}", f"{q['period_s']:.3f}", f"{1e3 * q['step_m']:.2f}")
        rows.append((str(f.number), f.title, *cells, f"{q['peak_ratio']:.1f}", f"{100 * q['stuck_share']:.0f}"))
    head = ("figure", "drive", "mean, mm/s", "periods", "period, s", "step, mm", "peak over mean", "stuck, % of time")
    blocks = (
        Text(
            "A drive with a valve that is nearly closed: air is compressed while the piston sticks, and pushes it a step "
            "further when friction gives way. Stuck counts the time below a fifth of the mean speed."
        ),
        Table(head, tuple(rows), "Stick-slip, measured over whole periods", numbers_from=2),
        Picture(
            "stick-slip-time",
            "As the paper's figures 1 to 3: speed above, position below, in the order of the table.",
            in_time(shown),
            synthetic=True,
        ),
        Picture(
            "stick-slip-phase",
            "Phase plane: speed against the distance from the mean motion. Each loop is one period; the flat lower side "
            "is sticking, where the piston falls behind at the mean speed.",
            phase_plane(shown),
            synthetic=True,
        ),
    )
    return Section("stick-slip", "Stick-slip in time and in the phase plane", blocks, synthetic=True)


def in_time(figures: list[PaperFigure]) -> Figure:
    """Speed above position, a column for each figure."""
    figure = style.new_figure(3.4)
    grid = figure.subplots(2, len(figures), squeeze=False, sharex=True, sharey="row")
    for (above, below), data in zip(grid.T, figures, strict=True):
        c = data.columns
        part = c["time_s"] <= SHOWN_S
        time = c["time_s"][part]
        above.plot(time, 1e3 * c["velocity_m_s"][part], color=style.BLACK, lw=0.8)
        mean = 1e3 * data.quantities["mean_speed_m_s"]
        above.axhline(mean, color=style.ORANGE, linestyle="--", lw=1.0, label=f"mean {mean:.2f} mm/s")
        above.legend(loc="upper right", fontsize=6.8)
        below.plot(time, 1e3 * c["position_m"][part], color=style.BLACK, lw=1.0)
        above.set_title(f"figure {data.number}: {_law(data)}", fontsize=7.5)
        below.set_xlabel("time / s")
    grid[0, 0].set_ylim(top=1.25 * max(1e3 * float(f.columns["velocity_m_s"].max()) for f in figures))
    grid[0, 0].set_ylabel("speed / (mm/s)")
    grid[1, 0].set_ylabel("position / mm")
    figure.align_ylabels()
    return figure


def _law(data: PaperFigure) -> str:
    return {1: "LuGre, read by sensors", 2: "LuGre", 3: "Coulomb and Stribeck"}.get(data.number, data.title)


def phase_plane(figures: list[PaperFigure]) -> Figure:
    """Speed against position less mean motion."""
    figure = style.new_figure(2.6)
    axes = figure.subplots(1, len(figures), squeeze=False, sharey=True, sharex=True)[0]
    for axis, data in zip(axes, figures, strict=True):
        c = data.columns
        trend = np.polynomial.Polynomial.fit(c["time_s"], c["position_m"], 1)(c["time_s"])
        axis.plot(1e3 * (c["position_m"] - trend), 1e3 * c["velocity_m_s"], color=style.BLACK, lw=0.5)
        axis.axhline(1e3 * data.quantities["mean_speed_m_s"], color=style.ORANGE, linestyle="--", lw=1.0)
        axis.set_title(f"figure {data.number}: {_law(data)}", fontsize=7.5)
        axis.set_xlabel("position − mean motion / mm")
    axes[0].set_ylabel("speed / (mm/s)")
    return figure


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
    left.set_ylim(low - 0.5, 1.05 * data.quantities["peak_n"] + 0.3)
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
        axis.errorbar(
            speed, c["friction_settled_n"], yerr=c["expanded_uncertainty_n"], fmt="x", color=style.BLUE, ms=2.5,
            elinewidth=0.6, label="settled samples, U (k = 2)",
        )
        axis.set_xlabel("speed / (mm/s)")
    axes[0].set_title("linear axis, as in the paper")
    _log(axes[1])
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
                1e3 * c["speed_m_s"], friction, linestyle=look.linestyle, marker=look.marker, color=look.color, ms=2.5,
                lw=0.9, label=f"{bar[i]:.1f} bar",
            )
        else:
            left.plot(1e3 * c["speed_m_s"], friction, color=style.GREY, lw=0.4)
    _log(left)
    left.set_xlabel("speed / (mm/s)")
    left.set_ylabel("friction / N")
    handles, labels = left.get_legend_handles_labels()
    left.legend(handles[::-1], labels[::-1], loc="upper right")
    right.plot(bar, 100 * c["dip"], "o-", color=style.BLACK, ms=3.5)
    right.set_ylim(bottom=0)
    right.set_xlabel("gauge pressure / bar")
    right.set_ylabel("fall from lowest speed to minimum / %")
    return figure


def _log(axis: Axes) -> None:
    axis.set_xscale("log")
    axis.xaxis.set_major_formatter(lambda value, _: f"{value:g}")
