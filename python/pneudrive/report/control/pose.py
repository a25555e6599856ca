"""Figure of a platform under control along a path of its pose."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pneudrive.report import style
from pneudrive.report.axes import legend_over, zero_line
from pneudrive.report.control.figures import MOST_DRAWN, panels
from pneudrive.report.written import drawn
from pneudrive.simulation.trajectory import check_si

if TYPE_CHECKING:
    from pathlib import Path

    import xarray as xr
    from matplotlib.figure import Figure

#: Unit of a coordinate -> factor and unit in which it is drawn, and its axis.
DRAWN = {"m": (1e3, "mm", "place"), "rad": (float(np.degrees(1.0)), "deg", "tilt")}


def plot_pose(run: xr.Dataset, path: str | Path | None = None) -> Figure:
    """Draw a platform under control over time: coordinates with references, errors, positions and forces of the legs.

    Parameters
    ----------
    run : xarray.Dataset
        From `pneudrive.control.run_pose`.
    path : path-like, optional
        Picture to write: .png, .svg or .pdf.

    Raises
    ------
    CommandError
        Unknown suffix, or the file cannot be written.
    """
    return drawn(lambda: _pose(run), path)


def _pose(run: xr.Dataset) -> Figure:
    check_si(run)
    part = style.thin(run.time, MOST_DRAWN)
    time = run.time.to_numpy()[part]
    score = run.attrs["score"]
    known = {str(name): run[name].to_numpy()[part] for name in run.data_vars}
    own = next(name.rpartition(".")[0] for name in known if name.endswith("_reference"))
    units = [unit for unit in DRAWN if any(one["unit"] == unit for one in score["coordinates"].values())]
    figure, axes = panels(len(units) + 3)
    error, position, force = axes[len(units) :]
    for number, (key, one) in enumerate(score["coordinates"].items()):
        factor, unit, what = DRAWN[one["unit"]]
        axis, look = axes[units.index(one["unit"])], style.look(number)
        wanted, actual = known[f"{own}.{key}_reference"], known[f"{own}.{key}"]
        axis.plot(time, factor * actual, color=look.color, label=key)
        axis.plot(time, factor * wanted, color=style.GREY, linestyle="--", lw=0.8)
        axis.set_ylabel(f"{what} / {unit}")
        axis.ticklabel_format(axis="y", useOffset=False)
        if one["amplitude"] > 0.0:
            off = 100.0 * (wanted - actual) / one["amplitude"]
            error.plot(time, off, color=look.color, lw=0.8, label=key)
    error.set_ylabel("error / % of\namplitude")
    zero_line(error)
    for number, leg in enumerate(score["legs"]):
        look = style.look(number)
        position.plot(time, 1e3 * known[f"{leg}.position"], color=look.color, label=leg)
        force.plot(time, known[f"{leg}.required_force"], color=look.color, label=leg)
    position.set_ylabel("leg / mm")
    force.set_ylabel("required\nforce / N")
    for axis in (*axes[: len(units)], position):
        legend_over(axis, 6)
    figure.align_ylabels()
    style.finish(figure, synthetic=True)
    axes[0].set_title(f"a   {run.attrs.get('law', '')} on {run.attrs.get('title', 'a platform')}", loc="left")
    return figure
