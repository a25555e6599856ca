"""Figure of a sizing: time against air of every choice that was simulated, with the limits."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pneudrive.constants import ANR_LITRES_PER_KG
from pneudrive.report import style
from pneudrive.report.axes import legend_of
from pneudrive.report.written import drawn

if TYPE_CHECKING:
    from pathlib import Path

    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from pneudrive.sizing.checks import SizedDrive
    from pneudrive.sizing.result import SizingResult


def plot_sizing(result: SizingResult, path: str | Path | None = None) -> Figure:
    """Draw the time that 1 % of the samples exceed over the air of a cycle: a point for each choice, and the limits.

    The lines of the best candidate cover 98 % of its samples.

    Parameters
    ----------
    result : SizingResult
        From `pneudrive.size`.
    path : path-like, optional
        Picture to write: .png, .svg or .pdf.

    Returns
    -------
    matplotlib.figure.Figure

    Raises
    ------
    CommandError
        If the suffix is unknown, or the file cannot be written.
    """
    return drawn(lambda: _finished(result), path)


def _finished(result: SizingResult) -> Figure:
    figure = draw(result)
    style.finish(figure, synthetic=True)
    return figure


def draw(result: SizingResult) -> Figure:
    """Draw a panel for each stroke, without the letters and the stamp that a page adds."""
    figure = style.new_figure(3.1)
    axes = figure.subplots(1, 2, sharex=True)
    task = result.task
    for axis, way, limit in zip(axes, ("out", "back"), (task.outward_s, task.back_s), strict=True):
        _points(axis, result, way)
        axis.axhline(limit * (1.0 - task.margin), color=style.BLACK, linestyle="--", label="longest time")
        axis.set(xlabel="air of a cycle / l ANR", ylabel=f"time {way}, worst 1 % / s", title=f"stroke {way}")
    legend_of(figure, axes[0])
    return figure


def _points(axis: Axes, result: SizingResult, way: str) -> None:
    names = {one.name for one in result.ranked}
    rest = [one for one in result.simulated if one.name not in names]
    for chosen, marker, color, label in (
        ([one for one in rest if not one.is_feasible], "x", style.GREY, "misses a limit"),
        ([one for one in rest if one.is_feasible], ".", style.GREY, "not simulated to the end"),
        (result.ranked, "o", style.BLUE, "meets the task"),
    ):
        shown = [one for one in chosen if _time(one, way) < float("inf")]
        if shown:
            air = [one.air_litres_anr for one in shown]
            axis.plot(air, [_time(one, way) for one in shown], marker, color=color, label=label, linestyle="")
    if result.best is not None:
        at = (result.best.air_litres_anr, _time(result.best, way))
        axis.plot(*at, "o", markersize=9.0, markerfacecolor="none", color=style.ORANGE, linestyle="", label="best")
        _spread(axis, result.best, way)


def _spread(axis: Axes, one: SizedDrive, way: str) -> None:
    """Draw the range of 98 % of the samples."""
    if not one.intervals:
        return
    air, time = one.air_litres_anr, _time(one, way)
    line = {"color": style.ORANGE, "linewidth": 1.2}
    axis.plot([ANR_LITRES_PER_KG * end for end in one.intervals["air"]], [time, time], **line)
    axis.plot([air, air], [one.intervals[f"time_{way}"][0], time], **line)


def _time(one: SizedDrive, way: str) -> float:
    return one.time_out if way == "out" else one.time_back
