"""The report of a friction law against measured friction."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pneudrive.report import style
from pneudrive.report.axes import grid
from pneudrive.report.page import Paragraph, Report
from pneudrive.report.topics import Topic
from pneudrive.report.words import MOST_SHOWN, sentence

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from matplotlib.figure import Figure

    from pneudrive.validate.static import FrictionCurve, FrictionValidation

WORDS = {0: "both", 1: "+x", -1: "-x"}


@style.applied()
def write_friction_report(found: FrictionValidation, folder: str | Path) -> Path:
    """Write report.html with curves, bands and differences.

    Raises
    ------
    CommandError
        The folder cannot be written to.
    """
    lines = (sentence(line.strip(" +!")) for line in str(found).splitlines()[:2])
    law, table, model = (Topic("validation", key) for key in ("curves", "friction-conditions", "model"))
    parts = (
        law.section(law.text(), law.picture("friction", draw(list(found.curves)[:MOST_SHOWN]))),
        table.section(table.table(_rows(found))),
        model.section(Paragraph(found.drive.to_toml().strip(), "code")),
    )
    return Report(f"Friction of {found.drive.name} against {found.source.name}", lines, parts).write(folder)


def _rows(found: FrictionValidation) -> Iterator[tuple]:
    for c in found.curves:
        mean, largest = float(np.mean(c.model_n - c.friction_n)), float(c.metrics.largest)
        shares = (100 * c.metrics.nrmse, 100 * c.inside)
        yield c.condition, WORDS[c.direction], c.speed_m_s.size, mean, largest, *shares


def draw(curves: list[FrictionCurve]) -> Figure:
    """Draw one panel for each condition."""
    names = list(dict.fromkeys(c.condition for c in curves))
    figure, axes = grid(len(names), 2, 1.9, 0.6)
    for name, axis in zip(names, axes, strict=True):
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
