"""Speed and stroke time of a drive against the length and the bore of its tubes."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pneudrive.report import style
from pneudrive.report.axes import legend_of
from pneudrive.report.written import drawn

if TYPE_CHECKING:
    from pathlib import Path

    import xarray as xr
    from matplotlib.figure import Figure

#: Panel: its label, factor from SI, and the variable in it.
_PANELS = (
    ("mean speed of the stroke / (m/s)", 1.0, "mean_speed"),
    ("stroke time / s", 1.0, "stroke_time_out"),
)


def plot_lines(study: xr.Dataset, path: str | Path | None = None) -> Figure:
    """Draw mean speed and stroke time over the length of the tubes, a curve for each bore.

    Parameters
    ----------
    study : xarray.Dataset
        From `pneudrive.lines`.
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
    return drawn(lambda: draw(study), path)


def draw(study: xr.Dataset) -> Figure:
    """Draw one panel for each variable, a curve for each bore."""
    figure = style.new_figure(2.9)
    axes = figure.subplots(1, len(_PANELS))
    for axis, (label, factor, name) in zip(axes, _PANELS, strict=True):
        for number, diameter in enumerate(study.diameter.to_numpy()):
            look = style.ramp(number, study.sizes["diameter"])
            axis.plot(study.length, factor * study[name][number], **look._asdict(), label=f"{1e3 * diameter:g} mm bore")
        without = factor * study.attrs["without_tubes"][name]
        axis.axhline(without, color=style.GREY, linestyle="--", label="without tubes")
        axis.set(xlabel="length of each tube / m", ylabel=label)
        axis.set_xlim(left=0.0)
        axis.set_ylim(bottom=0.0)
    legend_of(figure, axes[0])
    style.finish(figure, synthetic=True)
    return figure
