"""Measured values and those of a model, and their figure."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from pneudrive.figures import MODEL, RESIDUAL, SPEED, Figure, Line, Look, Markers, Panel, Rule, thin
from pneudrive.simulation.trajectory import meaning
from pneudrive.units import readable

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

    from pneudrive.figures import Axis, Mark

    Array = NDArray[np.float64]

#: Number of points from which values are a line; rows of a figure.
MANY, MOST_ROWS = 200, 12
#: Columns of the horizontal axis -> axis.
AXES: dict[str, Axis | str] = {"speed_m_s": SPEED, "time_s": "time / s"}


@dataclass(frozen=True)
class FittedData:
    """Measured values and those of the model, SI, shape (n,) each.

    ``x`` and ``y`` name the columns: ``time_s``, ``speed_m_s`` or ``reversal``, and ``position_m``, ``friction_n``, ...
    """

    x: str
    y: str
    at: Array
    measured: Array
    model: Array


def comparison_figure(every: Mapping[str, FittedData]) -> Figure:
    """Draw a row for each pair: measured values with those of the model, and their difference."""
    panels = []
    for name in list(every)[thin(every, MOST_ROWS)]:
        data, is_line = every[name], every[name].at.size > MANY
        part, x = thin(data.at), AXES.get(data.x, data.x)
        (column, si_unit, _), rest = meaning(data.y), data.measured - data.model
        unit = readable(si_unit)[1]
        unit = f" / ({unit})" if "/" in unit else f" / {unit}" if unit else ""
        model = Look("orange", "-", "x")
        marks: list[Mark] = [
            Markers(data.at, data.measured, "measured", size=3.0),
            Markers(data.at, data.model, "model", model),
        ]
        gap: Mark = Markers(data.at, rest, look=RESIDUAL, size=3.0)
        if is_line:
            marks = [
                Line(data.at[part], data.measured[part], "measured"),
                Line(data.at[part], data.model[part], "model", MODEL),
            ]
            gap = Line(data.at[part], rest[part], look=RESIDUAL, width=0.6)
        panels.append(Panel(marks, name, x, f"{column.replace('_', ' ')}{unit}"))
        panels.append(Panel([gap, Rule(y=0.0)], "measured - model", x, f"difference{unit}"))
    return Figure(panels, columns=2, row_in=1.7, rest_in=0.5)
