"""The report of a friction law against measured friction."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from pneudrive.report import style
from pneudrive.report.page import Picture, Report, Section, Table, Text
from pneudrive.report.words import MOST_SHOWN, sentence

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from pneudrive.validate.static import FrictionCurve, FrictionValidation

WORDS = {0: "both", 1: "+x", -1: "-x"}


def write_friction_report(found: FrictionValidation, folder: str | Path) -> Path:
    """Write report.html with curves, bands and differences.

    Raises
    ------
    CommandError
        The folder cannot be written to.
    """
    with style.applied():
        lines = [sentence(line.strip(" +!")) for line in str(found).splitlines()[:2]]
        title = f"Friction of {found.drive.name} against {found.source.name}"
        return Report(title, lines, [_curves(found), _table(found), _model(found)]).write(Path(folder))


def _curves(found: FrictionValidation) -> Section:
    shown = list(found.curves)[:MOST_SHOWN]
    caption = "Measured friction with its 95 % band and the drive's law at the same pressures."
    text = Text("The law is that of steady sliding, evaluated by the core. Points that stick and slip are left out.")
    return Section("curves", "Law and measurement", (text, Picture("friction", caption, draw(shown))))


def draw(curves: list[FrictionCurve]) -> Figure:
    """One panel for each condition."""
    names = list(dict.fromkeys(c.condition for c in curves))
    figure = style.new_figure(0.6 + 1.9 * -(-len(names) // 2))
    for name, axis in zip(names, style.panels(figure, len(names), 2), strict=True):
        for index, curve in enumerate(c for c in curves if c.condition == name):
            look, v = style.look(index), 1e3 * curve.speed_m_s
            spread = np.abs(np.vstack([curve.friction_n - curve.low_n, curve.high_n - curve.friction_n]))
            axis.errorbar(v, curve.friction_n, spread, fmt=look.marker, color=look.color, label=WORDS[curve.direction])
            axis.plot(v, curve.model_n, look.linestyle, color=look.color)
        style.logarithmic(axis)
        axis.set_title(name)
        axis.legend(title="measured; lines: law")
    style.outer_labels(figure, "speed / (mm/s)", "friction / N")
    return figure


def _table(found: FrictionValidation) -> Section:
    rows = tuple(
        (
            c.condition,
            WORDS[c.direction],
            str(c.speed_m_s.size),
            f"{float(np.mean(c.model_n - c.friction_n)):+.2f}",
            f"{c.metrics.largest:.2f}",
            f"{100 * c.metrics.nrmse:.2g}",
            f"{100 * c.inside:.0f}",
        )
        for c in found.curves
    )
    head = (
        "condition",
        "direction",
        "points",
        "law less measured, mean N",
        "largest N",
        "NRMSE %",
        "inside the band %",
    )
    return Section("conditions", "By condition", (Table(head, rows, numbers_from=2),))


def _model(found: FrictionValidation) -> Section:
    return Section("model", "The drive", (Text(found.drive.to_toml().strip(), "code"),))
