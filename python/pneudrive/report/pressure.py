"""Friction against pressure: runs as separate markers, the line and its prediction band."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from pneudrive.characterise.closure import MINIMUM_RANGE_PA
from pneudrive.report import style
from pneudrive.report.page import Items, Picture, Section, Table, Text
from pneudrive.report.words import sentence, spread_evenly
from pneudrive.report.written import PICTURES, write_picture
from pneudrive.trajectory import check_target

if TYPE_CHECKING:
    from pathlib import Path

    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from pneudrive.characterise import Characterisation
    from pneudrive.characterise.pressure_line import FrictionPoint, PressureLine, RunSpread

COLUMNS = 3
MOST_PANELS = 9


def section(found: Characterisation) -> Section | None:
    """Friction over pressure for each seal; None where all recordings have one pressure."""
    if len(found.points) < 2 or np.ptp([p.pressure_pa for p in found.points]) < MINIMUM_RANGE_PA:
        return None
    blocks: list = [
        Text(
            "Each point is one recording with U (k = 2), which covers strokes and sensors but not a new assembly. "
            f"{_band_in_words(found)}"
        ),
        Picture("friction-pressure", _caption(found), draw(found), synthetic=found.synthetic),
    ]
    if found.run_spread is not None:
        blocks.append(_runs(found.run_spread))
    blocks.append(Items(tuple(sentence(line.statement) for line in found.pressure_lines)))
    return Section("pressure", "Friction against pressure", tuple(blocks), synthetic=found.synthetic)


def _caption(found: Characterisation) -> str:
    spread = found.run_spread
    known = f"standard deviation between runs {100 * spread.relative:.0f} %" if spread else "nothing was run twice"
    what = "Friction against gauge pressure, runs as separate markers; line and 95 % prediction band for "
    return f"{what}{BAND[spread is not None]} ({known})."


#: What the band holds, by whether anything was run twice.
BAND = {True: "a further run", False: "a further recording of the same run"}


def _band_in_words(found: Characterisation) -> str:
    if found.run_spread is None:
        return (
            "The band is where one further recording of the same run is expected with 95 %. Nothing was run twice: a "
            "further run may lie far outside."
        )
    return (
        "The band is where the friction of one further run is expected with 95 %; it includes the spread between runs."
    )


def panels_of(found: Characterisation) -> dict[str, tuple[list[FrictionPoint], PressureLine | None]]:
    """Points and line of each panel: one for each line, one for each seal without a line."""
    out: dict[str, tuple[list[FrictionPoint], PressureLine | None]] = {}
    for line in found.pressure_lines:
        out[line.seal] = (list(line.points), line)
    covered = {(p.recording, p.speed_m_s) for points, _ in out.values() for p in points}
    with_line = {p.seal for points, _ in out.values() for p in points}
    for point in found.points:
        if (point.recording, point.speed_m_s) not in covered and point.seal not in with_line:
            out.setdefault(point.seal, ([], None))[0].append(point)
    return out


def draw(found: Characterisation) -> Figure:
    """One panel for each seal on shared axes."""
    shown = spread_evenly(list(panels_of(found).items()), MOST_PANELS)
    rows = -(-len(shown) // COLUMNS)
    figure = style.new_figure(2.0 * rows + 0.8, style.WIDTH_IN if len(shown) > 1 else 4.5)
    axes = style.panels(figure, len(shown), COLUMNS, sharex=True, sharey=True)
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
        From ``characterise_recordings``, with recordings at two pressures or more.
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
    target = check_target(path, PICTURES)
    with style.applied():
        figure = draw(found)
        write_picture(figure, target)
    return figure


def draw_panel(axis: Axes, points: list[FrictionPoint], line: PressureLine | None) -> dict[str, Any]:
    """Draw the points of each run, and the line with its band; return what the legend needs."""
    handles: dict[str, Any] = {}
    if line is not None:
        bar = line.band_pressure_pa / 1e5
        band = axis.fill_between(bar, line.band_low_n, line.band_high_n, color=style.BAND, lw=0)
        handles["line"] = axis.plot(bar, line.band_mean_n, "-", color=style.BLACK, lw=0.9, label="line")[0]
        band.set_label(f"95 % for {BAND[line.basis != 'unknown']}")
        handles["band"] = band
    runs = sorted({p.run for p in points})  # one order in all panels: a run keeps its marker
    own = []
    for index, run in enumerate(runs):
        look = style.look(index)
        of_run = [p for p in points if p.run == run]
        drawn = axis.errorbar(
            [p.pressure_pa / 1e5 for p in of_run],
            [p.friction_n for p in of_run],
            yerr=[np.nan_to_num(p.expanded_n) for p in of_run],
            fmt=look.marker,
            color=look.color,
            mfc="white" if index else look.color,
            elinewidth=0.9,
            label=f"run {run}" if len(runs) > 1 else "recording with U (k = 2)",
        )
        own.append(drawn)
        if len(runs) == 1:
            handles["recording"] = drawn
    if len(runs) > 1:
        axis.legend(handles=own, loc="best", frameon=True, framealpha=1.0, edgecolor=style.GREY)
    return handles


def _runs(spread: RunSpread) -> Table:
    rows = tuple(
        (seal, f"{pressure / 1e5:.2f}", f"{low:.2f}", f"{high:.2f}", f"{100 * relative:.0f}")
        for seal, pressure, low, high, relative in spread.cells
    )
    head = ("seal", "pressure, bar", "lowest, N", "highest, N", "difference, %")
    return Table(head, rows, "Runs of one seal at one pressure: the spread that no single recording shows")
