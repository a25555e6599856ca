"""Friction against pressure: runs as separate markers, the line and its prediction band."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from pneudrive.friction.pressure import MINIMUM_RANGE_PA
from pneudrive.report import style
from pneudrive.report.axes import bars, grid, tinted
from pneudrive.report.page import Items
from pneudrive.report.topics import Topic
from pneudrive.report.words import sentence, spread_evenly
from pneudrive.report.written import drawn

if TYPE_CHECKING:
    from pathlib import Path

    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from pneudrive.friction.characterisation import Characterisation
    from pneudrive.friction.pressure import LevelPoint, PressureLine
    from pneudrive.report.page import Section

COLUMNS = 3
MOST_PANELS = 9


#: Meaning of the band, by whether a run was repeated.
BAND = {True: "a further run", False: "a further recording of the same run"}


def section(found: Characterisation) -> Section | None:
    """Return the section on friction over pressure for each seal; None at one pressure."""
    if len(found.points) < 2 or np.ptp([p.pressure_pa for p in found.points]) < MINIMUM_RANGE_PA:
        return None
    topic, spread = Topic("recordings", "pressure"), found.run_spread
    known = topic.say("between", percent=100 * spread.relative) if spread else "nothing was run twice"
    cells = () if spread is None else ((seal, p / 1e5, *n, 100 * share) for seal, p, *n, share in spread.cells)
    return topic.section(
        topic.text(band=topic.say("runs" if spread else "one_run")),
        topic.picture("friction-pressure", draw(found), further=BAND[spread is not None], known=known),
        topic.table(cells) if spread is not None else None,
        Items(tuple(sentence(line.statement) for line in found.pressure_lines)),
    )


def panels_of(found: Characterisation) -> dict[str, tuple[list[LevelPoint], PressureLine | None]]:
    """Return points and line of each panel. There is a panel for each line, and for each seal without a line."""
    out: dict[str, tuple[list[LevelPoint], PressureLine | None]] = {}
    for line in found.pressure_lines:
        out[line.seal] = (list(line.points), line)
    covered = {(p.recording, p.speed_m_s) for points, _ in out.values() for p in points}
    with_line = {p.seal for points, _ in out.values() for p in points}
    for point in found.points:
        if (point.recording, point.speed_m_s) not in covered and point.seal not in with_line:
            out.setdefault(point.seal, ([], None))[0].append(point)
    return out


def draw(found: Characterisation) -> Figure:
    """Draw one panel for each seal on shared axes."""
    shown = spread_evenly(list(panels_of(found).items()), MOST_PANELS)
    figure, axes = grid(len(shown), COLUMNS, 2.0, 0.8, alone_in=4.5, sharex=True, sharey=True)
    handles: dict[str, Any] = {}
    for axis, (title, (points, line)) in zip(axes, shown, strict=True):
        handles |= draw_panel(axis, points, line)
        axis.set_title(title)
    highest = max(p.friction_n + np.nan_to_num(p.expanded_n) for _, (points, _) in shown for p in points)
    bands = [float(line.band_high_n.max()) for _, (_, line) in shown if line is not None]
    axes[0].set_ylim(0, min(1.05 * max([highest, *bands]), 2 * highest))
    style.outer_labels(figure, "gauge pressure / bar", "friction / N")
    style.legend_above(figure, list(handles.values()))
    return figure


def plot_pressure(found: Characterisation, path: str | Path) -> Figure:
    """Draw friction against pressure with prediction bands, and write it.

    Parameters
    ----------
    found : Characterisation
        From ``characterise_recordings``, with recordings at two or more pressures.
    path : path-like
        Picture to write: .png, .svg or .pdf.

    Returns
    -------
    matplotlib.figure.Figure

    Raises
    ------
    CommandError
        Unknown suffix, or the file cannot be written.
    """
    return drawn(lambda: draw(found), path)


def draw_panel(axis: Axes, points: list[LevelPoint], line: PressureLine | None) -> dict[str, Any]:
    """Draw the points of each run, and the line with its band; return the legend's handles."""
    handles: dict[str, Any] = {}
    if line is not None:
        bar = line.band_pressure_pa / 1e5
        handles["line"] = axis.plot(bar, line.band_mean_n, "-", color=style.BLACK, lw=0.9, label="line")[0]
        said = f"95 % for {BAND[line.basis != 'unknown']}"
        handles["band"] = tinted(axis, bar, (line.band_low_n, line.band_high_n), said)
    runs = sorted({p.run for p in points})  # one order in all panels: a run keeps its marker
    own = []
    for index, run in enumerate(runs):
        look = style.look(index)
        of_run = [p for p in points if p.run == run]
        bar, friction, reach = np.array([(p.pressure_pa / 1e5, p.friction_n, p.expanded_n) for p in of_run]).T
        face, label = "white" if index else look.color, f"run {run}" if len(runs) > 1 else "recording with U (k = 2)"
        drawn = bars(axis, bar, friction, np.nan_to_num(reach), look, mfc=face, elinewidth=0.9, label=label)
        own.append(drawn)
        if len(runs) == 1:
            handles["recording"] = drawn
    if len(runs) > 1:
        axis.legend(handles=own, loc="best", frameon=True, framealpha=1.0, edgecolor=style.GREY)
    return handles
